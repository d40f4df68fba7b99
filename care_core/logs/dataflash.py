"""ArduPilot DataFlash logs (.BIN): a stream of records whose types the log itself declares (FMT).

A record is the two bytes A3 95, a type byte and a body of the fixed length that the type's FMT gives. There is no
checksum, so a record is believed when another one begins where it ends; where that breaks the reader goes on at
the next record that is confirmed that way and reports the gap. Records are found and decoded with whole-array
operations: nothing here loops over messages.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from functools import cached_property, partial
from pathlib import Path
from threading import Lock
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from care_core import limits
from care_core.errors import LogError
from care_core.logs import formats
from care_core.logs.ardupilot import (
    FACTS,
    GPS_TIME,
    PARM_FIELDS,
    dataflash_facts,
    parameters_of,
    shortest,
    text_of,
    wall_clock,
)
from care_core.logs.base import Channel, Kind, LazyColumns, Table, Wanted
from care_core.logs.clock import Clock, clock_of
from care_core.logs.damage import summarised
from care_core.logs.file_windows import Bytes, FileArray, Offsets, give_back, stored_in
from care_core.numbers import Bools, Floats
from care_core.records import Record
from care_core.run import Damage, Setting

_HEADER = b"\xa3\x95"
_FMT, _FMT_LENGTH = 0x80, 89
_MAX_TYPES = 256
_PIECE = 1 << 18
"""Records that are looked at together: what is made of them stays in the processor's cache."""
_LONGEST_RECORD = 256
"""Bytes; the length of a record is one byte of its format."""
_NEAR = 20
"""Records before a gap among which one is looked for that says the time."""

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


class Format(Record):
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


Part: TypeAlias = "tuple[Format, Offsets]"
"""A declaration and the places of its records."""


class _Held:
    """Arrays that were asked for last, each with the first of the rows that it holds, of at most so many bytes
    together; a larger one is held alone."""

    def __init__(self, most: int) -> None:
        self.most = most
        self.lock = Lock()  # the app's threads share a log
        self._arrays: dict[tuple[int, ...], tuple[int, NDArray[Any]]] = {}
        self._bytes = 0

    def find(self, key: tuple[int, ...], rows: range) -> NDArray[Any] | None:
        """The rows of what is held, None where not all of them are."""
        if key not in self._arrays:
            return None
        first, array = self._arrays[key] = self._arrays.pop(key)  # what was asked for last goes last
        if not rows:
            return array[:0]
        if not first <= rows[0] <= rows[-1] < first + len(array):
            return None
        return array[rows.start - first : rows.stop - first : rows.step]

    def make_room(self, size: int) -> None:
        """Let go of the oldest for so many bytes."""
        while self._arrays and self._bytes + size > self.most:
            self.drop(next(iter(self._arrays)))
        give_back(size)

    def drop(self, key: tuple[int, ...]) -> None:
        if key in self._arrays:
            self._bytes -= self._arrays.pop(key)[1].nbytes

    def keep(self, key: tuple[int, ...], first: int, array: NDArray[Any]) -> None:
        self._arrays[key] = (first, array)
        self._bytes += array.nbytes


class _Values:
    """Fields of the records of a declaration as they are stored. Those that were asked for last are held: every check
    reads what it looks at, and a walk through a large log is long."""

    def __init__(self, data: FileArray) -> None:
        self._data = data
        self._held = _Held(limits.values_bytes(len(data)))

    def of(self, form: Format, offsets: Offsets, rows: range, name: str, among: Sequence[str]) -> NDArray[Any]:
        """The field in some of the records at `offsets`, shape (n,); of those `among` which it is as many as may be
        held come by the same walk, the next first. Of all records, where all that may be held, else of these alone."""
        at = among.index(name)
        wanted = {
            (form.type, form.byte, form.fields[one].offset): form.fields[one] for one in (*among[at:], *among[:at])
        }
        asked = next(iter(wanted))
        with self._held.lock:
            found = self._held.find(asked, rows)
            if found is None:
                whole = sum(field.dtype.itemsize for field in wanted.values()) * len(offsets) <= self._held.most
                stretch = range(len(offsets)) if whole or not rows else range(rows[0], rows[-1] + 1)
                missing = [key for key in wanted if self._held.find(key, rows) is None]
                self._read(offsets, stretch, {key: wanted[key] for key in missing})
                found = self._held.find(asked, rows)
        assert found is not None
        return found

    def _read(self, offsets: Offsets, rows: range, missing: Mapping[tuple[int, int, int], RecordField]) -> None:
        """Read the first of the fields, and those behind it that may be held together, in place of the oldest."""
        chosen: dict[tuple[int, int, int], RecordField] = {}
        size = 0
        for key, field in missing.items():
            own = len(rows) * field.dtype.itemsize
            if chosen and size + own > self._held.most:
                break
            chosen[key] = field
            size += own
            self._held.drop(key)
        self._held.make_room(size)
        stored = [(field.offset, field.dtype) for field in chosen.values()]
        (read,) = self._data.fields([(offsets[rows.start : rows.stop], stored)])
        for key, values in zip(chosen, read, strict=True):
            self._held.keep(key, rows.start, values)


class _Times:
    """Seconds of all records of the declarations of one reading: all come by one walk where all may be held, else one
    by one, and those that were asked for last are held."""

    def __init__(self, parts: Sequence[Part], read: Callable[[Sequence[Part]], list[Floats]], most: int) -> None:
        self._read, self._held = read, _Held(most)
        self._together = parts if sum(map(_seconds_bytes, parts)) <= most else ()

    def of(self, part: Part) -> Floats:
        """Those of one of the declarations, shape (n,)."""
        rows = range(len(part[1]))
        with self._held.lock:
            found = self._held.find(_key(part), rows)
            if found is None:
                self._hold(self._together or [part])
                found = self._held.find(_key(part), rows)
        assert found is not None
        return found

    def _hold(self, parts: Sequence[Part]) -> None:
        self._held.make_room(sum(map(_seconds_bytes, parts)))
        for part, t in zip(parts, self._read(parts), strict=True):
            self._held.keep(_key(part), 0, t)


class _RecordColumns(LazyColumns):
    """Columns of records of one layout, whose times `seconds` answers. Numbers are made of what is stored each time
    they are asked for. Text is slow to decode and rare, so it is kept."""

    def __init__(
        self,
        values: _Values,
        seconds: Callable[[], Floats],
        form: Format,
        offsets: Offsets,
        names: Sequence[str],
        rows: range | Offsets | None = None,
    ) -> None:
        super().__init__(names)
        self._values, self._seconds, self._form, self._offsets = values, seconds, form, offsets
        self._rows = range(len(offsets)) if rows is None else rows
        self._texts: dict[str, NDArray[Any]] = {}

    def __getitem__(self, name: str) -> NDArray[Any]:
        if name in self._texts:
            return self._texts[name]
        if name not in self:
            raise KeyError(name)
        field = self._form.fields[name]
        stretch, left = self._stretch
        column = _decoded(self._values.of(self._form, self._offsets, stretch, name, self._names)[left], field)
        if field.dtype.kind == "S":
            self._texts[name] = column
        return column

    @property
    def _stretch(self) -> tuple[range, slice | Offsets]:
        """A stretch of the records with all rows, and which of its records those are."""
        rows = self._rows
        if isinstance(rows, range):
            return rows, slice(None)
        first = int(rows[0]) if len(rows) else 0
        return range(first, int(rows[-1]) + 1 if len(rows) else 0), rows - rows.dtype.type(first)

    @property
    def count(self) -> int:
        return len(self._rows)

    @property
    def t(self) -> Floats:
        stretch, left = self._stretch
        return self._seconds()[stretch.start : stretch.stop : stretch.step][left]

    def kind(self, name: str) -> Kind:
        return self._form.fields[name].kind

    def where(self, mask: Bools | slice) -> _RecordColumns:
        rows: range | Offsets
        if isinstance(mask, slice):
            rows = self._rows[mask]
        elif isinstance(self._rows, range):
            rows = np.arange(self._rows.start, self._rows.stop, self._rows.step, dtype=self._offsets.dtype)[mask]
        else:
            rows = self._rows[mask]
        part = _RecordColumns(self._values, self._seconds, self._form, self._offsets, self._names, rows)
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

    format = formats.DATAFLASH_BIN

    def __init__(self, path: Path) -> None:
        self.path = path
        self._data = data = FileArray.open(path)
        starts, types = _find_headers(data)
        formats, redefined = _read_formats(data, starts, types)
        starts, types, gaps = _follow_records(len(data), starts, types, formats)
        self._formats = {found[-1].name: found for found in _by_name(formats)}
        self._values = _Values(data)
        self._clock, lost, untimely = self._keep_time(data, starts, types)
        if len(lost):
            kept = ~np.isin(starts, lost)
            starts, types = starts[kept], types[kept]
        of_type = _of_each_type(starts, types)
        none = np.empty(0, dtype=starts.dtype)
        self._offsets = {
            declared.type: of_type.get(declared.type, none) for found in self._formats.values() for declared in found
        }
        if not of_type.keys() - {_FMT}:
            raise LogError("The log holds no message.", hint="It may have been cut off.", where=str(path))
        self.duration_s = self._clock.duration_s
        self.damage = (*redefined, *untimely, *self._describe(data, starts, types, gaps))

    def channels(self) -> tuple[Channel, ...]:
        return self._channels

    @cached_property
    def _channels(self) -> tuple[Channel, ...]:
        names = [name for name in sorted(self._formats) if self._count(name)]
        ends = {name: [(form, offsets[[0, -1]]) for form, offsets in self._parts(name)] for name in names}
        times = iter(self._read_seconds([part for parts in ends.values() for part in parts]))
        found = []
        for name, parts in ends.items():
            own = [next(times) for _ in parts]
            span_s = float(own[-1][-1] - own[0][0])
            found.append(Channel.over(name, self._formats[name][-1].code, self._count(name), span_s))
        return tuple(found)

    def read(self, wanted: Wanted) -> Mapping[str, Table]:
        parts = {name: self._parts(name) for name in wanted if name in self._formats and self._count(name)}
        steady = [own[0] for own in parts.values() if len(own) == 1]
        times = _Times(steady, self._read_seconds, limits.values_bytes(len(self._data)))
        return {name: self._table(own, wanted[name], times) for name, own in parts.items()}

    def settings(self) -> Mapping[str, tuple[Setting, ...]]:
        return self._settings

    @cached_property
    def _settings(self) -> Mapping[str, tuple[Setting, ...]]:
        return parameters_of(self.read({"PARM": PARM_FIELDS}).get("PARM"), shortest)

    @cached_property
    def facts(self) -> Mapping[str, str]:
        """`firmware`, `vehicle` and `frame`, where the log names them."""
        return dataflash_facts(self.read(FACTS))

    @cached_property
    def start(self) -> str | None:
        """Wall clock of the first timestamp (UTC), from the first GPS record that knows its week."""
        return wall_clock(self.read({"GPS": GPS_TIME}))

    def _count(self, name: str) -> int:
        return sum(len(self._offsets[number]) for number in self._types(name))

    def _types(self, name: str) -> tuple[int, ...]:
        return tuple(dict.fromkeys(declared.type for declared in self._formats[name]))

    def _parts(self, name: str) -> list[Part]:
        """The records of a message by the declaration that was in force, in file order."""
        parts = []
        for number in self._types(name):
            declared = [form for form in self._formats[name] if form.type == number]
            offsets = self._offsets[number]
            cuts = np.searchsorted(offsets, np.array([form.byte for form in declared[1:]], dtype=offsets.dtype))
            parts += list(zip(declared, np.split(offsets, cuts), strict=True))
        return [(form, offsets) for form, offsets in parts if len(offsets)]

    def _table(self, parts: Sequence[Part], fields: Sequence[str], times: _Times) -> Table:
        known = [field for field in fields if any(field in form.fields for form, _ in parts)]
        if len(parts) == 1:
            return Table(None, _RecordColumns(self._values, partial(times.of, parts[0]), *parts[0], known))
        data = self._data
        columns = {
            field: np.concatenate([
                _decode(data, offsets, form.fields[field]) if field in form.fields else np.full(len(offsets), np.nan)
                for form, offsets in parts
            ])
            for field in known
        }  # fmt: skip
        return Table(np.concatenate(self._read_seconds(parts)), columns)

    def _read_seconds(self, parts: Sequence[Part]) -> list[Floats]:
        """Seconds of records of several declarations."""
        found, timed = [], []
        for form, offsets in parts:
            if form.time_field is not None:
                t = np.empty(len(offsets))
                timed.append((form, offsets, t))
            else:
                t = np.full(len(offsets), np.nan) if form.type == _FMT else self._last_known_time(offsets)
            found.append(t)
        for near, piece in self._data.windows([offsets for _, offsets, _ in timed], _LONGEST_RECORD):
            for (form, offsets, t), (rows, inner) in zip(timed, near, strict=True):
                if len(inner):
                    t[rows] = self._clock.seconds(_stamps(piece, inner, form), offsets[rows])
        return found

    def _last_known_time(self, offsets: Offsets) -> Floats:
        """Time of the last stamped record before each of these bytes: old firmwares stamped few of their messages."""
        places, seconds = self._timeline
        before = np.searchsorted(places, offsets) - 1
        return np.where(before >= 0, seconds[before], 0.0) if len(places) else np.full(len(offsets), np.nan)

    @cached_property
    def _timeline(self) -> tuple[Offsets, Floats]:
        starts = np.concatenate(list(self._offsets.values()))
        types = np.repeat(
            np.array(list(self._offsets), dtype=np.uint8), [len(offsets) for offsets in self._offsets.values()]
        )
        order = np.argsort(starts, kind="stable")
        pieces = list(self._stamped(self._data, starts[order], types[order]))
        if not pieces:
            return np.empty(0, dtype=starts.dtype), np.empty(0)
        places = np.concatenate([places for _, places in pieces])
        return places, self._clock.seconds(np.concatenate([stamps for stamps, _ in pieces]), places)

    def _stamped(self, data: FileArray, starts: Offsets, types: Bytes) -> Iterator[tuple[Floats, Offsets]]:
        """Of the records that carry a stamp, window by window: their stamps in seconds, and their places."""
        groups = _alike(form for found in self._formats.values() for form in found)
        for ((rows, near),), piece in data.windows([starts], _LONGEST_RECORD):
            own = types[rows]
            stamps, timed = np.empty(len(own)), np.zeros(len(own), dtype=bool)
            for form, is_alike in groups:  # nearly always one
                alike = is_alike[own]
                stamps[alike] = _stamps(piece, near[alike], form)
                timed |= alike
            yield stamps[timed], starts[rows][timed]

    def _keep_time(self, data: FileArray, starts: Offsets, types: Bytes) -> tuple[Clock, Offsets, tuple[Damage, ...]]:
        """The clock of the log, the places of the records whose stamp is impossible, and what is wrong with time."""
        clock, spans, jumps = clock_of(self._stamped(data, starts, types))
        is_timed = np.zeros(_MAX_TYPES, dtype=bool)
        is_timed[[form.type for found in self._formats.values() for form in found if form.time_field]] = True
        first, last = np.array(spans, dtype=starts.dtype).reshape(-1, 2).T
        lows, highs = np.searchsorted(starts, first).tolist(), np.searchsorted(starts, last, "right").tolist()
        lost = [starts[low:high][is_timed[types[low:high]]] for low, high in zip(lows, highs, strict=True)]
        places = np.concatenate([np.empty(0, dtype=starts.dtype), *lost])
        damage = [Damage("a record's time is impossible", byte) for byte in places.tolist()]
        return (
            clock,
            places,
            (*summarised(jumps, "clock jumps"), *summarised(damage, "records with an impossible time")),
        )

    def _describe(
        self, data: FileArray, starts: Offsets, types: Bytes, gaps: list[tuple[int, int]]
    ) -> tuple[Damage, ...]:
        form_of = {form.type: form for found in self._formats.values() for form in found}

        def time_at(byte: int) -> float | None:
            end = int(np.searchsorted(starts, np.array(byte, dtype=starts.dtype)))
            for row in range(end - 1, max(end - _NEAR, 0) - 1, -1):
                form = form_of[int(types[row])]
                if form.time_field:
                    place = starts[row : row + 1]
                    record = data.between(int(place[0]), int(place[0]) + form.length)
                    return float(self._clock.seconds(_stamps(record, place - place, form), place)[0])
            return None

        found = [Damage(_gap_text(low, high, len(data)), low, time_at(low)) for low, high in gaps]
        return summarised(found, "damaged places")


def _key(part: Part) -> tuple[int, int]:
    return part[0].type, part[0].byte


def _seconds_bytes(part: Part) -> int:
    return len(part[1]) * np.dtype(np.float64).itemsize


def _find_headers(data: FileArray) -> tuple[Offsets, Bytes]:
    """Every place where the two header bytes stand with a type byte after them, true records or not; and that byte."""
    # A log can hold millions of records: four bytes a place do for all but the largest.
    kind = np.int32 if len(data) < 1 << 31 else np.int64
    places, types = bytearray(), bytearray()  # they grow where they lie
    for low, piece in data.pieces(2):
        first = np.flatnonzero(piece[:-2] == _HEADER[0])
        first = first[piece[first + 1] == _HEADER[1]]
        places += (first + low).astype(kind).tobytes()
        types += piece[first + 2].tobytes()
    return np.frombuffer(places, dtype=kind), np.frombuffer(types, dtype=np.uint8)


def _of_each_type(starts: Offsets, types: Bytes) -> dict[int, Offsets]:
    """The records of each type."""
    pieces = [slice(low, low + _PIECE) for low in range(0, len(starts), _PIECE)]
    counts = np.array([np.bincount(types[rows], minlength=_MAX_TYPES) for rows in pieces]).reshape(-1, _MAX_TYPES)
    total = counts.sum(axis=0)
    found = {number: np.empty(total[number], dtype=starts.dtype) for number in np.flatnonzero(total).tolist()}
    for rows, end, count in zip(pieces, np.cumsum(counts, axis=0), counts, strict=True):
        order = np.argsort(types[rows], kind="stable")
        there = np.flatnonzero(count).tolist()
        for number, own in zip(there, np.split(starts[rows][order], np.cumsum(count[there])[:-1]), strict=True):
            found[number][end[number] - count[number] : end[number]] = own
    return found


def _read_formats(data: FileArray, starts: Offsets, types: Bytes) -> tuple[list[Format], list[Damage]]:
    """Every distinct declaration in file order, and what is wrong with those that contradict an earlier one."""
    places = starts[types == _FMT]
    places = places[places <= len(data) - _FMT_LENGTH]
    own = _to_format(_FMT, "FMT", _FMT_LENGTH, "BBnNZ", "Type,Length,Name,Format,Columns", 0)
    formats: dict[int, Format] = {_FMT: own}
    found, redefined = [own], []
    for byte in places.tolist():
        body = data.between(byte + 3, byte + _FMT_LENGTH).tobytes()
        name, code, columns = (text_of(part) for part in (body[2:6], body[6:22], body[22:86]))
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


def _follow_records(
    end: int, starts: Offsets, types: Bytes, formats: list[Format]
) -> tuple[Offsets, Bytes, list[tuple[int, int]]]:
    """The true records among the header places of a file that ends at a byte, with their types, and the gaps (first
    byte, byte after) between them.

    Records follow each other without space, so only the places where they do not are walked one by one.
    """
    lengths = np.zeros(_MAX_TYPES, dtype=np.uint8)
    for form in reversed(formats):
        lengths[form.type] = form.length
    size = np.frombuffer(bytearray(types).translate(lengths.tobytes()), dtype=np.uint8)
    declared: set[int] = set()
    for form in formats:
        # A first declaration holds from the start of the file, a later one from where it stands.
        if form.type in declared:
            later = int(np.searchsorted(starts, np.array(form.byte, dtype=starts.dtype)))
            size[later:][types[later:] == form.type] = form.length
        declared.add(form.type)
    whole = size > 0
    last = int(np.searchsorted(starts, np.array(max(end - _LONGEST_RECORD, 0), dtype=starts.dtype)))
    whole[last:] &= starts[last:] <= end - size[last:].astype(np.int64)
    if not whole.all():
        starts, types, size = _moved(starts, whole), _moved(types, whole), _moved(size, whole)
    if not len(starts):
        return starts, types, [(0, end)]
    breaks = np.append(_breaks(starts, size), len(starts) - 1)
    ends = starts[breaks] + size[breaks].astype(starts.dtype)
    after = np.searchsorted(starts, ends)
    meets = (ends == end) | (starts[np.minimum(after, len(starts) - 1)] == ends)
    confirmed = np.ones(len(starts), dtype=bool)
    confirmed[breaks[~meets]] = False
    keep = np.ones(len(starts), dtype=bool)
    gaps = [(0, int(starts[0]))] if starts[0] else []
    position = 0
    for place, over, met, next_place in zip(breaks.tolist(), ends.tolist(), meets, after.tolist(), strict=True):
        if place < position:
            continue
        position = next_place
        if not met:
            later = int(np.argmax(confirmed[place + 1 :])) + place + 1 if place + 1 < len(starts) else place
            position = later if confirmed[later] else len(starts)
            resumed = int(starts[position]) if position < len(starts) else end
            was_cut = resumed < over
            keep[place] = not was_cut
            gaps.append((int(starts[place]) if was_cut else over, resumed))
        keep[place + 1 : position] = False
    return _moved(starts, keep), _moved(types, keep), gaps


def _moved(column: NDArray[Any], keep: Bools) -> NDArray[Any]:
    """The entries of a mask, moved to the front of the array: a large log's index is not held twice."""
    at = 0
    for low in range(0, len(column), _PIECE):
        part = column[low : low + _PIECE][keep[low : low + _PIECE]]
        column[at : at + len(part)] = part
        at += len(part)
    return column[:at]


def _breaks(starts: Offsets, size: Bytes) -> NDArray[np.intp]:
    """The records behind which, by their size, the next does not begin."""
    found = []
    for low in range(0, len(starts) - 1, _PIECE):
        piece = starts[low : low + _PIECE + 1]
        found.append(np.flatnonzero(np.diff(piece) != size[low : low + len(piece) - 1]) + low)
    return np.concatenate([np.empty(0, dtype=np.intp), *found])


def _gap_text(low: int, high: int, size: int) -> str:
    if high == size and high - low < _LONGEST_RECORD:
        last = f"{high - low} bytes" if high - low > 1 else "byte"
        return f"the log breaks off inside a record, its last {last}"
    where = "at the end " if high == size else ""
    return f"{high - low} bytes {where}are not readable records"


def _decode(data: FileArray, offsets: Offsets, field: RecordField) -> NDArray[Any]:
    """One field of the records at `offsets`: float64, or object for text and arrays."""
    return _decoded(data.fields([(offsets, [(field.offset, field.dtype)])])[0][0], field)


def _decoded(values: NDArray[Any], field: RecordField) -> NDArray[Any]:
    """What is stored as float64, or as objects for text and arrays."""
    if field.dtype.kind == "S":
        return np.array([text_of(value) for value in values.tolist()], dtype=object)
    if field.dtype.shape:
        rows = np.empty(len(values), dtype=object)
        rows[:] = [tuple(row) for row in values.tolist()]
        return rows
    with np.errstate(invalid="ignore"):  # flipped bits make signalling NaNs of floats
        found = values.astype(np.float64)
        found /= field.divisor
    return found


def _stamps(piece: Bytes, places: Offsets, form: Format) -> Floats:
    """Timestamps in seconds of the records at places of a window, of a declaration that has one."""
    assert form.time_field is not None
    name, ticks = form.time_field
    field = form.fields[name]
    return np.asarray(_decoded(stored_in(piece, places, (field.offset, field.dtype)), field) / ticks, dtype=np.float64)


def _alike(forms: Iterable[Format]) -> list[tuple[Format, Bools]]:
    """Of the types with a timestamp, by their last declaration, those together that keep it at the same place in the
    same way: one of them, and which they are."""
    found: dict[tuple[RecordField, float], tuple[Format, Bools]] = {}
    for form in {form.type: form for form in forms if form.time_field is not None}.values():
        assert form.time_field is not None
        name, ticks = form.time_field
        key = (form.fields[name], ticks)
        found.setdefault(key, (form, np.zeros(_MAX_TYPES, dtype=bool)))[1][form.type] = True
    return list(found.values())
