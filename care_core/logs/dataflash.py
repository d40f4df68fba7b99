"""ArduPilot DataFlash logs (.BIN): a stream of records whose types the log itself declares (FMT).

A record is the two bytes A3 95, a type byte and a body of the fixed length that the type's FMT gives. There is no
checksum, so a record is believed when another one begins where it ends; where that breaks the reader goes on at
the next record that is confirmed that way and reports the gap. Records are found and decoded with whole-array
operations: nothing here loops over messages.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from threading import Lock
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from care_core import limits
from care_core.errors import LogError
from care_core.frozen import dataclass
from care_core.logs.ardupilot import GPS_TIME, PARM_FIELDS, facts_of, parameters_of, shortest, wall_clock
from care_core.logs.base import Channel, Kind, LazyColumns, LogFormat, Table, Wanted
from care_core.logs.clock import Clock, find_clock
from care_core.logs.damage import summarised
from care_core.logs.mapped import FileArray, Offsets
from care_core.run import Damage, Setting

_FMT, _FMT_LENGTH = 0x80, 89
_MAX_TYPES = 256
_CHUNK = 1 << 22
_LONGEST_RECORD = 256
"""Bytes; the length of a record is one byte of its format."""

# Format character of a field -> numpy type of its bytes, divisor of the stored integer.
_FIELD_TYPES: dict[str, tuple[str, float]] = {
    "a": ("(32,)<i2", 1), "b": ("i1", 1), "B": ("u1", 1), "h": ("<i2", 1), "H": ("<u2", 1), "i": ("<i4", 1),
    "I": ("<u4", 1), "q": ("<i8", 1), "Q": ("<u8", 1), "g": ("<f2", 1), "f": ("<f4", 1), "d": ("<f8", 1),
    "n": ("S4", 1), "N": ("S16", 1), "Z": ("S64", 1), "M": ("i1", 1),
    "c": ("<i2", 100), "C": ("<u2", 100), "e": ("<i4", 100), "E": ("<u4", 100), "L": ("<i4", 1e7),
}  # fmt: skip


class RecordField(NamedTuple):
    """Where a field lies in a record (bytes from its first byte) and how it is stored."""

    offset: int
    dtype: np.dtype[Any]
    divisor: float

    @property
    def kind(self) -> Kind:
        return "text" if self.dtype.kind == "S" else "other" if self.dtype.shape else "number"


@dataclass(frozen=True, slots=True)
class Format:
    """One message type as declared by an FMT record at byte `byte`."""

    type: int
    name: str
    length: int
    code: str
    fields: Mapping[str, RecordField]
    byte: int

    @property
    def time_field(self) -> tuple[str, float] | None:
        """The name of the timestamp and its ticks per second; None where it is declared as text."""
        found = time_field(self.name, self.fields)
        return found if found is not None and self.fields[found[0]].kind == "number" else None


class _Values:
    """Fields of all records of a declaration as they are stored. Those that were asked for last are held, up to
    `limits.VALUES_BYTES`: every check reads what it looks at, and a walk through a large log is long."""

    def __init__(self, data: FileArray) -> None:
        self._data = data
        self._held: dict[tuple[int, int, int], NDArray[Any]] = {}
        self._bytes = 0
        self._lock = Lock()  # the app's threads share a log

    def of(self, form: Format, offsets: Offsets, name: str, among: Iterable[str] = ()) -> NDArray[Any]:
        """The field of the records at `offsets`, shape (n,); those `among` which it is come by the same walk."""
        wanted = {(form.type, form.byte, form.fields[one].offset): form.fields[one] for one in (name, *among)}
        asked = next(iter(wanted))
        with self._lock:
            if asked not in self._held:
                missing = {key: field for key, field in wanted.items() if key not in self._held}
                if len(offsets) * sum(field.dtype.itemsize for field in missing.values()) > limits.VALUES_BYTES:
                    missing = {asked: wanted[asked]}
                read = self._data.fields(offsets, [(field.offset, field.dtype) for field in missing.values()])
                self._held |= zip(missing, read, strict=True)
                self._bytes += sum(column.nbytes for column in read)
            found = self._held[asked] = self._held.pop(asked)  # what was asked for last goes last
            while len(self._held) > 1 and self._bytes > limits.VALUES_BYTES:
                self._bytes -= self._held.pop(next(iter(self._held))).nbytes
        return found


class _RecordColumns(LazyColumns):
    """Columns of records of one layout. Numbers are made of what is stored each time they are asked for. Text is slow
    to decode and rare, so it is kept."""

    def __init__(
        self,
        values: _Values,
        form: Format,
        offsets: Offsets,
        names: Sequence[str],
        rows: slice | NDArray[np.intp] = slice(None),
    ) -> None:
        self._values, self._form, self._offsets, self._names, self._rows = values, form, offsets, names, rows
        self._texts: dict[str, NDArray[Any]] = {}

    def __getitem__(self, name: str) -> NDArray[Any]:
        if name in self._texts:
            return self._texts[name]
        if name not in self:
            raise KeyError(name)
        field = self._form.fields[name]
        column = _decoded(self._values.of(self._form, self._offsets, name, self._names)[self._rows], field)
        if field.dtype.kind == "S":
            self._texts[name] = column
        return column

    def __contains__(self, name: object) -> bool:
        return name in self._names  # the inherited way would decode the column

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def kind(self, name: str) -> Kind:
        return self._form.fields[name].kind

    def where(self, mask: NDArray[np.bool_] | slice) -> _RecordColumns:
        rows: slice | NDArray[np.intp]
        if isinstance(self._rows, slice) and isinstance(mask, slice):
            left = range(len(self._offsets))[self._rows][mask]
            rows = slice(left.start, left.stop, left.step)
        else:
            rows = np.arange(len(self._offsets))[self._rows][mask]
        part = _RecordColumns(self._values, self._form, self._offsets, self._names, rows)
        part._texts = {name: column[mask] for name, column in self._texts.items()}
        return part


def time_field(message: str, fields: Collection[str]) -> tuple[str, float] | None:
    """The field that says when a message was written, and its ticks per second; None when it does not say."""
    if "TimeUS" in fields:
        return "TimeUS", 1e6
    if message.startswith("GPS"):  # before firmware 3.2 its TimeMS was the satellites' time
        return ("T", 1e3) if "T" in fields else None
    return ("TimeMS", 1e3) if "TimeMS" in fields else None


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
        self._data = data = FileArray.open(path)
        starts = _find_headers(data)
        formats, redefined = _read_formats(data, starts)
        starts, gaps = _follow_records(data, starts, formats)
        self._formats = {found[-1].name: found for found in _by_name(formats)}
        self._values = _Values(data)
        self._clock, starts, untimely = self._keep_time(data, starts)
        types = data.at(starts + 2)
        self._offsets = {
            declared.type: starts[types == declared.type] for found in self._formats.values() for declared in found
        }
        if not np.any(types != _FMT):
            raise LogError("The log holds no message.", hint="It may have been cut off.", where=str(path))
        self.duration_s = self._clock.duration_s
        self.damage = (*redefined, *untimely, *self._describe(data, starts, gaps))

    def channels(self) -> tuple[Channel, ...]:
        return self._channels

    @cached_property
    def _channels(self) -> tuple[Channel, ...]:
        data = self._data
        found = []
        for name in sorted(self._formats):
            count = self._count(name)
            if count:
                t = self._times(data, name, ends_only=True)
                found.append(Channel.over(name, self._formats[name][-1].code, count, float(t[-1] - t[0])))
        return tuple(found)

    def read(self, wanted: Wanted) -> Mapping[str, Table]:
        data = self._data
        return {
            name: Table(self._times(data, name), self._columns(data, name, fields))
            for name, fields in wanted.items()
            if name in self._formats and self._count(name)
        }

    def settings(self) -> Mapping[str, tuple[Setting, ...]]:
        return self._settings

    @cached_property
    def _settings(self) -> Mapping[str, tuple[Setting, ...]]:
        return parameters_of(self.read({"PARM": PARM_FIELDS}).get("PARM"), shortest)

    @cached_property
    def facts(self) -> Mapping[str, str]:
        """`firmware`, `vehicle` and `frame`, where the log names them."""
        tables = self.read({"VER": ("FWS",), "MSG": ("Message",)})
        return facts_of(str(text) for table in tables.values() for column in table.columns.values() for text in column)

    @cached_property
    def start(self) -> str | None:
        """Wall clock of the first timestamp (UTC), from the first GPS record that knows its week."""
        return wall_clock(self.read({"GPS": GPS_TIME}))

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

    def _columns(self, data: FileArray, name: str, fields: Sequence[str]) -> Mapping[str, NDArray[Any]]:
        parts = self._parts(name)
        known = [field for field in fields if any(field in form.fields for form, _ in parts)]
        if len(parts) == 1:
            form, offsets = parts[0]
            return _RecordColumns(self._values, form, offsets, known)
        return {
            field: np.concatenate([
                _decode(data, offsets, form.fields[field]) if field in form.fields else np.full(len(offsets), np.nan)
                for form, offsets in parts
            ])
            for field in known
        }  # fmt: skip

    def _times(self, data: FileArray, name: str, *, ends_only: bool = False) -> NDArray[np.float64]:
        """Seconds of the records of a message, or of the first and last of those of each declaration."""
        pieces = []
        for form, all_offsets in self._parts(name):
            offsets = all_offsets[[0, -1]] if ends_only else all_offsets
            if form.time_field is not None and not ends_only:
                name_of_time, ticks = form.time_field
                stored = self._values.of(form, offsets, name_of_time)
                stamps = _decoded(stored, form.fields[name_of_time]) / ticks
                pieces.append(self._clock.seconds(stamps, offsets))
            elif form.time_field is not None:
                pieces.append(self._clock.seconds(_stamps(data, offsets, form), offsets))
            elif form.type == _FMT:
                pieces.append(np.full(len(offsets), np.nan))
            else:
                pieces.append(self._last_known_time(offsets))
        return np.concatenate(pieces) if pieces else np.empty(0)

    def _last_known_time(self, offsets: Offsets) -> NDArray[np.float64]:
        """Time of the last stamped record before each of these bytes: old firmwares stamped few of their messages."""
        places, seconds = self._timeline
        before = np.searchsorted(places, offsets) - 1
        return np.where(before >= 0, seconds[before], 0.0) if len(places) else np.full(len(offsets), np.nan)

    @cached_property
    def _timeline(self) -> tuple[Offsets, NDArray[np.float64]]:
        data = self._data
        starts = np.sort(np.concatenate(list(self._offsets.values())))
        places, stamps = self._stamped(data, starts)
        return places, self._clock.seconds(stamps, places)

    def _stamped(self, data: FileArray, starts: Offsets) -> tuple[Offsets, NDArray[np.float64]]:
        """Those of the records that carry a stamp, and their stamps in seconds."""
        form_of = {form.type: form for found in self._formats.values() for form in found if form.time_field}
        types = data.at(starts + 2)
        timed = np.zeros(_MAX_TYPES, dtype=bool)
        timed[list(form_of)] = True
        places, types = starts[timed[types]], types[timed[types]]
        stamps = np.empty(len(places))
        for alike in _alike(form_of.values()):  # nearly always one group: a walk through a large log is long
            own = np.isin(types, [form.type for form in alike])
            stamps[own] = _stamps(data, places[own], alike[0])
        return places, stamps

    def _keep_time(self, data: FileArray, starts: Offsets) -> tuple[Clock, Offsets, tuple[Damage, ...]]:
        """The clock of the log, the records without those whose stamp is impossible, and what is wrong with time."""
        places, stamps = self._stamped(data, starts)
        clock, impossible, jumps = find_clock(stamps, places)
        lost = [Damage("a record's time is impossible", byte) for byte in places[impossible].tolist()]
        kept = starts[~np.isin(starts, places[impossible])] if lost else starts
        return clock, kept, (*summarised(jumps, "clock jumps"), *summarised(lost, "records with an impossible time"))

    def _describe(self, data: FileArray, starts: Offsets, gaps: list[tuple[int, int]]) -> tuple[Damage, ...]:
        form_of = {form.type: form for found in self._formats.values() for form in found}

        def time_at(byte: int) -> float | None:
            before = starts[max(0, int(np.searchsorted(starts, byte)) - 20) : np.searchsorted(starts, byte)]
            for offset in before[::-1]:
                form = form_of[data.byte(int(offset) + 2)]
                if form.time_field:
                    place = np.array([offset])
                    return float(self._clock.seconds(_stamps(data, place, form), place)[0])
            return None

        found = [Damage(_gap_text(low, high, len(data)), low, time_at(low)) for low, high in gaps]
        return summarised(found, "damaged places")


def _find_headers(data: FileArray) -> Offsets:
    """Every place where the two header bytes stand with a type byte after them, true records or not."""
    # A log can hold millions of records: four bytes a place do for all but the largest.
    kind = np.int32 if len(data) < 1 << 31 else np.int64
    found: list[Offsets] = [np.empty(0, dtype=kind)]
    for low in range(0, len(data) - 2, _CHUNK):
        piece = data.between(low, low + _CHUNK + 2)
        found.append((np.flatnonzero((piece[:-2] == 0xA3) & (piece[1:-1] == 0x95)) + low).astype(kind))
    return np.concatenate(found)


def _read_formats(data: FileArray, starts: Offsets) -> tuple[list[Format], list[Damage]]:
    """Every distinct declaration in file order, and what is wrong with those that contradict an earlier one."""
    places = starts[(data.at(starts + 2) == _FMT) & (starts + _FMT_LENGTH <= len(data))]
    own = _to_format(_FMT, "FMT", _FMT_LENGTH, "BBnNZ", "Type,Length,Name,Format,Columns", 0)
    formats: dict[int, Format] = {_FMT: own}
    found, redefined = [own], []
    for byte in places.tolist():
        body = data.between(byte + 3, byte + _FMT_LENGTH).tobytes()
        name, code, columns = (_text(part) for part in (body[2:6], body[6:22], body[22:86]))
        if not name.isidentifier() or body[1] < 3 or not set(code) <= _FIELD_TYPES.keys():
            continue
        form = _to_format(body[0], name, body[1], code, columns, byte)
        known = formats.get(form.type)
        if known is not None and (known.name, known.length, known.fields) == (form.name, form.length, form.fields):
            continue
        if known is not None and form.type == _FMT and form.length == _FMT_LENGTH:
            continue  # firmware before 3.2 names one column fewer of its own declarations: the same bytes
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
            fields[column] = RecordField(offset, dtype, divisor)
        offset += dtype.itemsize
    return Format(number, name, length, code, fields, byte)


def _by_name(formats: list[Format]) -> list[list[Format]]:
    names: dict[str, list[Format]] = {}
    for form in formats:
        names.setdefault(form.name, []).append(form)
    return list(names.values())


def _follow_records(data: FileArray, starts: Offsets, formats: list[Format]) -> tuple[Offsets, list[tuple[int, int]]]:
    """The true records among the header places, and the gaps (first byte, byte after) between them.

    Records follow each other without space, so only the places where they do not are walked one by one.
    """
    types = data.at(starts + 2)
    lengths = np.zeros(_MAX_TYPES, dtype=np.uint8)
    for form in reversed(formats):
        lengths[form.type] = form.length
    size = lengths[types]
    declared: set[int] = set()
    for form in formats:
        # A first declaration holds from the start of the file, a later one from where it stands.
        if form.type in declared:
            size[(types == form.type) & (starts >= form.byte)] = form.length
        declared.add(form.type)
    whole = (size > 0) & (starts <= len(data) - size.astype(starts.dtype))
    starts, size = starts[whole], size[whole]
    if not len(starts):
        return starts, [(0, len(data))]
    breaks = np.append(np.flatnonzero(np.diff(starts) != size[:-1]), len(starts) - 1)
    ends = starts[breaks].astype(np.int64) + size[breaks]
    after = np.searchsorted(starts, ends)
    meets = (ends == len(data)) | (starts[np.minimum(after, len(starts) - 1)] == ends)
    confirmed = np.ones(len(starts), dtype=bool)
    confirmed[breaks[~meets]] = False
    keep = np.ones(len(starts), dtype=bool)
    gaps = [(0, int(starts[0]))] if starts[0] else []
    position = 0
    for place, end, met, next_place in zip(breaks.tolist(), ends.tolist(), meets, after.tolist(), strict=True):
        if place < position:
            continue
        position = next_place
        if not met:
            later = int(np.argmax(confirmed[place + 1 :])) + place + 1 if place + 1 < len(starts) else place
            position = later if confirmed[later] else len(starts)
            resumed = int(starts[position]) if position < len(starts) else len(data)
            was_cut = resumed < end
            keep[place] = not was_cut
            gaps.append((int(starts[place]) if was_cut else end, resumed))
        keep[place + 1 : position] = False
    return starts[keep], gaps


def _gap_text(low: int, high: int, size: int) -> str:
    if high == size and high - low < _LONGEST_RECORD:
        return f"the log breaks off inside a record, its last {high - low} bytes"
    where = "at the end " if high == size else ""
    return f"{high - low} bytes {where}are not readable records"


def _decode(data: FileArray, offsets: Offsets, field: RecordField) -> NDArray[Any]:
    """One field of the records at `offsets`: float64, or object for text and arrays."""
    return _decoded(data.at(offsets + field.offset, field.dtype), field)


def _decoded(values: NDArray[Any], field: RecordField) -> NDArray[Any]:
    """What is stored as float64, or as objects for text and arrays."""
    if field.dtype.kind == "S":
        return np.array([_text(value) for value in values.tolist()], dtype=object)
    if field.dtype.shape:
        rows = np.empty(len(values), dtype=object)
        rows[:] = [tuple(row) for row in values.tolist()]
        return rows
    with np.errstate(invalid="ignore"):  # flipped bits make signalling NaNs of floats
        return np.asarray(values.astype(np.float64) / field.divisor)


def _stamps(data: FileArray, offsets: Offsets, form: Format) -> NDArray[np.float64]:
    """Timestamps in seconds of records that have one."""
    assert form.time_field is not None
    name, ticks = form.time_field
    return np.asarray(_decode(data, offsets, form.fields[name]) / ticks, dtype=np.float64)


def _alike(forms: Iterable[Format]) -> list[list[Format]]:
    """Declarations with a timestamp, those together that keep it at the same place in the same way."""
    found: dict[tuple[RecordField, float], list[Format]] = {}
    for form in forms:
        if form.time_field is not None:
            name, ticks = form.time_field
            found.setdefault((form.fields[name], ticks), []).append(form)
    return list(found.values())


def _text(raw: bytes) -> str:
    """Text up to the first zero byte; bytes that are not UTF-8 are read as Latin-1, so nothing is lost."""
    raw = raw.split(b"\0", 1)[0]
    try:
        return raw.decode("utf-8")
    except UnicodeDecodeError:
        return raw.decode("latin-1")
