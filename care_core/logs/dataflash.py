"""ArduPilot DataFlash logs (.BIN): a stream of records whose types the log itself declares (FMT).

A record is the two bytes A3 95, a type byte and a body of the fixed length that the type's FMT gives. There is no
checksum, so a record is believed when another one begins where it ends; where that breaks the reader goes on at
the next record that is confirmed that way and reports the gap. Records are found and decoded with whole-array
operations: nothing here loops over messages.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta, timezone
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from care_core.errors import LogError
from care_core.logs.base import Channel, LogFormat, Table, Wanted
from care_core.run import Damage, Setting

Bytes = NDArray[np.uint8]
Offsets = NDArray[np.int64]

_FMT, _FMT_LENGTH = 0x80, 89
_MAX_TYPES = 256
_CHUNK = 1 << 22
_MAX_DAMAGE = 100

# Format character of a field -> numpy type of its bytes, divisor of the stored integer.
_FIELD_TYPES: dict[str, tuple[str, float]] = {
    "a": ("(32,)<i2", 1), "b": ("i1", 1), "B": ("u1", 1), "h": ("<i2", 1), "H": ("<u2", 1), "i": ("<i4", 1),
    "I": ("<u4", 1), "q": ("<i8", 1), "Q": ("<u8", 1), "g": ("<f2", 1), "f": ("<f4", 1), "d": ("<f8", 1),
    "n": ("S4", 1), "N": ("S16", 1), "Z": ("S64", 1), "M": ("i1", 1),
    "c": ("<i2", 100), "C": ("<u2", 100), "e": ("<i4", 100), "E": ("<u4", 100), "L": ("<i4", 1e7),
}  # fmt: skip

# GPS time runs ahead of UTC by the leap seconds since 1980: 18 since 2017, and none is announced.
_GPS_EPOCH = datetime(1980, 1, 6, tzinfo=timezone.utc) - timedelta(seconds=18)
# A week that no receiver has reached yet is a flipped bit.
_LAST_WEEK, _WEEK_MS = 5200, 7 * 24 * 3600 * 1000
_FIRMWARE = re.compile(r"(Ardu\w+|APM:\w+|AntennaTracker|Blimp|Rover) V\d")


class Field(NamedTuple):
    """Where a field lies in a record (bytes from its first byte) and how it is stored."""

    offset: int
    dtype: np.dtype[Any]
    divisor: float


@dataclass(frozen=True, slots=True)
class Format:
    """One message type as declared by an FMT record at byte `byte`."""

    type: int
    name: str
    length: int
    code: str
    fields: Mapping[str, Field]
    byte: int

    @property
    def time_field(self) -> tuple[str, float] | None:
        """The name of the timestamp and its ticks per second."""
        if "TimeUS" in self.fields:
            return "TimeUS", 1e6
        return ("TimeMS", 1e3) if "TimeMS" in self.fields else None


class DataFlashLog:
    """A DataFlash log. Channels are message types, fields the columns of FMT.

    Rows of a message with instances (BAT `Inst`, VIBE `IMU`, XKF4 `C`, ...) stay as recorded, beside the column
    that names the instance. Times are seconds from the first timestamp of the log.

    Raises:
        LogError: the file cannot be read, or holds no message at all.
    """

    format = LogFormat.DATAFLASH_BIN

    def __init__(self, path: Path) -> None:
        self.path = path
        data = self._bytes()
        self._size = len(data)
        starts = _find_headers(data)
        formats, redefined = _read_formats(data, starts)
        starts, gaps = _follow_records(data, starts, formats)
        types = data[starts + 2]
        self._formats = {found[-1].name: found for found in _by_name(formats)}
        self._offsets = {
            declared.type: starts[types == declared.type] for found in self._formats.values() for declared in found
        }
        if not np.any(types != _FMT):
            raise LogError("The log holds no message.", hint="It may have been cut off.", where=str(path))
        self._first_s, self.duration_s = self._span(data, starts, types)
        self.damage = self._describe(data, starts, gaps, redefined)

    def channels(self) -> tuple[Channel, ...]:
        data = self._bytes()
        found = []
        for name in sorted(self._formats):
            t = self._times(data, name)
            count = len(t)
            if count:
                span = float(t[-1] - t[0])
                rate = (count - 1) / span if count > 1 and span > 0 else None
                found.append(Channel(name, self._formats[name][-1].code, count, rate))
        return tuple(found)

    def read(self, wanted: Wanted) -> Mapping[str, Table]:
        data = self._bytes()
        tables = {}
        for name, fields in wanted.items():
            if name in self._formats and self._count(name):
                columns = {field: self._column(data, name, field) for field in fields}
                present = {field: column for field, column in columns.items() if column is not None}
                tables[name] = Table(self._times(data, name), present)
        return tables

    def settings(self) -> Mapping[str, tuple[Setting, ...]]:
        return self._settings

    @cached_property
    def _settings(self) -> Mapping[str, tuple[Setting, ...]]:
        table = self.read({"PARM": ("Name", "Value", "Default")}).get("PARM")
        if table is None or not {"Name", "Value"} <= table.columns.keys():
            return {}
        values, defaults = table["Value"], table.columns.get("Default", np.full(len(table), np.nan))
        history: dict[str, list[Setting]] = {}
        for t, name, value, default in zip(table.t, table["Name"], values, defaults, strict=True):
            known = history.setdefault(name, [])
            number = _shortest(value)
            if not known or known[-1].value != number:
                reference = _shortest(default) if np.isfinite(default) else None
                changed_at = float(t) if known else None
                known.append(Setting(name, number, "PARM", default=reference, changed_at_s=changed_at))
        return {name: tuple(known) for name, known in history.items()}

    @cached_property
    def facts(self) -> Mapping[str, str]:
        """`firmware` ("ArduCopter V4.5.4 (fd1bcc61)") and `frame` ("QUAD/PLUS") where the log names them."""
        tables = self.read({"MSG": ("Message",), "VER": ("FWS",)})
        texts = [str(text) for name, field in (("VER", "FWS"), ("MSG", "Message")) if name in tables
                 for text in tables[name].columns.get(field, ())]  # fmt: skip
        facts = {}
        firmware = next((text for text in texts if _FIRMWARE.match(text)), None)
        frame = next((text for text in texts if text.startswith("Frame: ")), None)
        if firmware:
            facts["firmware"] = firmware
        if frame:
            facts["frame"] = frame.removeprefix("Frame: ")
        return facts

    @cached_property
    def start(self) -> str | None:
        """Wall clock of the first timestamp (UTC), from the first GPS record that knows its week."""
        gps = self.read({"GPS": ("GWk", "GMS")}).get("GPS")
        if gps is None or not {"GWk", "GMS"} <= gps.columns.keys():
            return None
        known = gps.where((gps["GWk"] > 0) & (gps["GWk"] <= _LAST_WEEK) & (gps["GMS"] < _WEEK_MS))
        if not len(known):
            return None
        fix = _GPS_EPOCH + timedelta(weeks=float(known["GWk"][0]), milliseconds=float(known["GMS"][0]))
        return (fix - timedelta(seconds=float(known.t[0]))).isoformat(timespec="seconds")

    def _bytes(self) -> Bytes:
        """The file as an array of bytes, mapped and not copied."""
        try:
            data = np.asarray(np.memmap(self.path, dtype=np.uint8, mode="r"))
        except (OSError, ValueError) as err:
            raise LogError(f"Cannot read the file: {err}.", where=str(self.path)) from err
        if len(data) < getattr(self, "_size", 0):
            raise LogError("The file was cut while it was read.", hint="Try again.", where=str(self.path))
        return data

    def _count(self, name: str) -> int:
        return sum(len(self._offsets[number]) for number in self._types(name))

    def _types(self, name: str) -> tuple[int, ...]:
        return tuple(dict.fromkeys(declared.type for declared in self._formats[name]))

    def _parts(self, name: str) -> list[tuple[Format, Offsets]]:
        """The records of a message by the declaration that was in force, in file order."""
        parts = []
        for number in self._types(name):
            declared = [form for form in self._formats[name] if form.type == number]
            cuts = np.searchsorted(self._offsets[number], [form.byte for form in declared[1:]])
            parts += list(zip(declared, np.split(self._offsets[number], cuts), strict=True))
        return [(form, offsets) for form, offsets in parts if len(offsets)]

    def _column(self, data: Bytes, name: str, field: str) -> NDArray[Any] | None:
        parts = self._parts(name)
        if not any(field in form.fields for form, _ in parts):
            return None
        pieces = [
            _decode(data, offsets, form.fields[field]) if field in form.fields else np.full(len(offsets), np.nan)
            for form, offsets in parts
        ]
        return pieces[0] if len(pieces) == 1 else np.concatenate(pieces)

    def _times(self, data: Bytes, name: str) -> NDArray[np.float64]:
        pieces = [_clock(data, offsets, form) - self._first_s for form, offsets in self._parts(name)]
        return np.concatenate(pieces) if pieces else np.empty(0)

    def _span(self, data: Bytes, starts: Offsets, types: Bytes) -> tuple[float, float]:
        """The first timestamp of the log and the seconds to its last, in file order."""
        timed = np.zeros(_MAX_TYPES, dtype=bool)
        form_of = {form.type: form for found in self._formats.values() for form in found}
        timed[[number for number, form in form_of.items() if form.time_field]] = True
        stamped = starts[timed[types]]
        if not len(stamped):
            return 0.0, 0.0
        first, last = (
            float(_clock(data, stamped[[at]], form_of[int(data[stamped[at] + 2])])[0]) for at in (0, len(stamped) - 1)
        )
        return first, max(last - first, 0.0)

    def _describe(
        self, data: Bytes, starts: Offsets, gaps: list[tuple[int, int]], redefined: list[Damage]
    ) -> tuple[Damage, ...]:
        form_of = {form.type: form for found in self._formats.values() for form in found}

        def time_at(byte: int) -> float | None:
            before = starts[max(0, int(np.searchsorted(starts, byte)) - 20) : np.searchsorted(starts, byte)]
            for offset in before[::-1]:
                form = form_of[int(data[offset + 2])]
                if form.time_field:
                    return float(_clock(data, np.array([offset]), form)[0] - self._first_s)
            return None

        found = [Damage(_gap_text(low, high, self._size), low, time_at(low)) for low, high in gaps[:_MAX_DAMAGE]]
        if len(gaps) > _MAX_DAMAGE:
            found.append(Damage(f"{len(gaps) - _MAX_DAMAGE} more damaged places", gaps[_MAX_DAMAGE][0]))
        return (*redefined, *found)


def _find_headers(data: Bytes) -> Offsets:
    """Every place where the two header bytes stand with a type byte after them, true records or not."""
    found = []
    for low in range(0, len(data) - 2, _CHUNK):
        piece = data[low : low + _CHUNK + 2]
        found.append(np.flatnonzero((piece[:-2] == 0xA3) & (piece[1:-1] == 0x95)) + low)
    return np.concatenate(found) if found else np.empty(0, dtype=np.int64)


def _read_formats(data: Bytes, starts: Offsets) -> tuple[list[Format], list[Damage]]:
    """Every distinct declaration in file order, and what is wrong with those that contradict an earlier one."""
    places = starts[(data[starts + 2] == _FMT) & (starts + _FMT_LENGTH <= len(data))]
    own = _to_format(_FMT, "FMT", _FMT_LENGTH, "BBnNZ", "Type,Length,Name,Format,Columns", 0)
    formats: dict[int, Format] = {_FMT: own}
    found, redefined = [own], []
    for byte in places.tolist():
        body = data[byte + 3 : byte + _FMT_LENGTH].tobytes()
        name, code, columns = (_text(part) for part in (body[2:6], body[6:22], body[22:86]))
        if not name.isidentifier() or body[1] < 3 or not set(code) <= _FIELD_TYPES.keys():
            continue
        form = _to_format(body[0], name, body[1], code, columns, byte)
        known = formats.get(form.type)
        if known is not None and (known.name, known.length, known.fields) == (form.name, form.length, form.fields):
            continue
        if known is not None:
            redefined.append(Damage(f"message type {form.type} ({known.name}) is declared again as {name}", byte))
        formats[form.type] = form
        found.append(form)
    return found, redefined


def _to_format(number: int, name: str, length: int, code: str, columns: str, byte: int) -> Format:
    fields, offset = {}, 3
    for column, letter in zip(columns.split(","), code, strict=False):
        kind, divisor = _FIELD_TYPES[letter]
        dtype = np.dtype(kind)
        if offset + dtype.itemsize <= length:
            fields[column] = Field(offset, dtype, divisor)
        offset += dtype.itemsize
    return Format(number, name, length, code, fields, byte)


def _by_name(formats: list[Format]) -> list[list[Format]]:
    names: dict[str, list[Format]] = {}
    for form in formats:
        names.setdefault(form.name, []).append(form)
    return list(names.values())


def _follow_records(data: Bytes, starts: Offsets, formats: list[Format]) -> tuple[Offsets, list[tuple[int, int]]]:
    """The true records among the header places, and the gaps (first byte, byte after) between them.

    Records follow each other without space, so only the places where they do not are walked one by one.
    """
    types = data[starts + 2]
    lengths = np.zeros(_MAX_TYPES, dtype=np.int64)
    for form in reversed(formats):
        lengths[form.type] = form.length
    size = lengths[types]
    declared: set[int] = set()
    for form in formats:
        # A first declaration holds from the start of the file, a later one from where it stands.
        if form.type in declared:
            size[(types == form.type) & (starts >= form.byte)] = form.length
        declared.add(form.type)
    whole = (size > 0) & (starts + size <= len(data))
    starts, ends = starts[whole], (starts + size)[whole]
    if not len(starts):
        return starts, [(0, len(data))]
    at_end = np.searchsorted(starts, ends)
    meets = (ends == len(data)) | (starts[np.minimum(at_end, len(starts) - 1)] == ends)
    keep = np.ones(len(starts), dtype=bool)
    confirmed = np.flatnonzero(meets)
    gaps = [(0, int(starts[0]))] if starts[0] else []
    position = 0
    for place in np.flatnonzero(~meets | (at_end != np.arange(1, len(starts) + 1))).tolist():
        if place < position:
            continue
        position = int(at_end[place])
        if not meets[place]:
            later = int(np.searchsorted(confirmed, place + 1))
            position = int(confirmed[later]) if later < len(confirmed) else len(starts)
            resumed = int(starts[position]) if position < len(starts) else len(data)
            was_cut = resumed < ends[place]
            keep[place] = not was_cut
            gaps.append((int(starts[place] if was_cut else ends[place]), resumed))
        keep[place + 1 : position] = False
    return starts[keep], gaps


def _gap_text(low: int, high: int, size: int) -> str:
    where = "at the end " if high == size else ""
    return f"{high - low} bytes {where}are not readable records"


def _decode(data: Bytes, offsets: Offsets, field: Field) -> NDArray[Any]:
    """One field of the records at `offsets`: float64, or object for text and arrays."""
    count = len(data) - field.offset - field.dtype.itemsize + 1
    # A view of the field at every byte of the file, from which indexing copies only the records' own.
    everywhere: NDArray[Any] = np.ndarray(
        (count, *field.dtype.shape), field.dtype.base, data.data, field.offset, (1, *_inner_strides(field.dtype))
    )
    values = everywhere[offsets]
    if field.dtype.kind == "S":
        return np.array([_text(value) for value in values.tolist()], dtype=object)
    if field.dtype.shape:
        rows = np.empty(len(values), dtype=object)
        rows[:] = [tuple(row) for row in values.tolist()]
        return rows
    with np.errstate(invalid="ignore"):  # flipped bits make signalling NaNs of floats
        return np.asarray(values.astype(np.float64) / field.divisor)


def _inner_strides(dtype: np.dtype[Any]) -> tuple[int, ...]:
    return (dtype.base.itemsize,) if dtype.shape else ()


def _clock(data: Bytes, offsets: Offsets, form: Format) -> NDArray[np.float64]:
    """Timestamps in seconds since boot, NaN for a message without any."""
    if form.time_field is None:
        return np.full(len(offsets), np.nan)
    name, ticks = form.time_field
    return np.asarray(_decode(data, offsets, form.fields[name]) / ticks, dtype=np.float64)


def _text(raw: bytes) -> str:
    """Text up to the first zero byte; bytes that are not UTF-8 are read as Latin-1, so nothing is lost."""
    raw = raw.split(b"\0", 1)[0]
    try:
        return raw.decode("utf-8")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def _shortest(value: float) -> float:
    """A single-precision number as it was typed: 0.135, not 0.13500000536441803."""
    return float(str(np.float32(value)))
