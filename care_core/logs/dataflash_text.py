"""DataFlash logs as text (.log): the same messages as the .BIN, one a line, with values already scaled.

Lines before the first FMT are a greeting. A line that is not what its FMT says is damage.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from functools import cached_property
from math import isfinite
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from care_core import limits
from care_core.errors import LogError
from care_core.logs import formats
from care_core.logs.ardupilot import FACTS, GPS_TIME, PARM_FIELDS, dataflash_facts, parameters_of, wall_clock
from care_core.logs.base import Channel, Table, Wanted
from care_core.logs.clock import find_clock
from care_core.logs.damage import summarised
from care_core.logs.dataflash import time_field
from care_core.logs.file_windows import FileArray
from care_core.numbers import Bools, Floats
from care_core.run import Damage, Setting

Offsets = NDArray[np.int64]

_TEXT_CODES = frozenset("nNZ")
_MAYBE_TEXT_CODES = frozenset("aM")
_FRACTION_CODES = frozenset("fdgcCeEL")
"""What may be no number (nan): a whole one cannot."""
_NAME_BYTES = 5  # four of a message's name and the comma
_PIECE = 2048  # lines parsed in one go
_HEADS = 1 << 18
_CHUNK = 1 << 22
_MOST_BROKEN = 100_000
"""Broken lines of a message that are told one by one before they are summed up."""
_STEADY, _STEADY_HZ = ("CTUN", "ATT"), 10.0
"""Messages that firmware without time stamps wrote from its loop of 10 Hz (ArduCopter 3.0, `ten_hz_logging_loop`)."""


class Columns(NamedTuple):
    """The columns of a message and the format characters of their values."""

    names: tuple[str, ...]
    codes: str


class DataFlashTextLog:
    """A DataFlash log as text. Channels and fields are those of the .BIN; old firmwares name and stamp fewer.

    Raises:
        LogError: the file cannot be read, or holds no message at all.
    """

    format = formats.DATAFLASH_TEXT

    def __init__(self, path: Path) -> None:
        self.path = path
        self._data = FileArray.open(path)
        self._formats: dict[str, Columns] = {}
        self._counted_from = ""
        self._lines = self._index()
        self._read_formats()
        broken = self._drop_broken()
        if not any(len(places) for name, places in self._lines.items() if name != "FMT"):
            raise LogError("The log holds no message.", hint="It may have been cut off.", where=str(path))
        late = self._keep_time()
        where = np.searchsorted(self._places, [byte for byte, _ in broken]) - 1
        times = [float(self._seconds[at]) if at >= 0 else None for at in where.tolist()]
        found = [Damage(text, byte, t) for (byte, text), t in zip(broken, times, strict=True)]
        self.damage = (*late, *summarised(found, "damaged lines"))

    def channels(self) -> tuple[Channel, ...]:
        found = []
        for name in sorted(name for name, places in self._lines.items() if len(places)):
            t = self._times(name)
            found.append(Channel.over(name, self._formats[name].codes, len(t), float(t[-1] - t[0])))
        return tuple(found)

    def read(self, wanted: Wanted) -> Mapping[str, Table]:
        tables = {}
        for name, fields in wanted.items():
            if name in self._formats and len(self._lines.get(name, ())):
                tables[name] = Table(self._times(name), self._columns(name, fields))
        return tables

    def settings(self) -> Mapping[str, tuple[Setting, ...]]:
        return self._settings

    @cached_property
    def _settings(self) -> Mapping[str, tuple[Setting, ...]]:
        return parameters_of(self.read({"PARM": PARM_FIELDS}).get("PARM"), float)

    @cached_property
    def facts(self) -> Mapping[str, str]:
        """`firmware`, `vehicle`, `frame` as a message or the greeting names them; `clock` where times are counted."""
        first = int(min(places[0] for places in self._lines.values() if len(places)))
        greeting = _text(self._data.between(0, first)).splitlines()
        facts = dataflash_facts(self.read(FACTS), *(line.strip() for line in greeting))
        if self._counted_from:
            facts["clock"] = f"counted from {self._counted_from}, {_STEADY_HZ:.0f} a second"
        return facts

    @cached_property
    def start(self) -> str | None:
        """Wall clock of the first timestamp (UTC), from the first GPS line that knows its week."""
        return wall_clock(self.read({"GPS": GPS_TIME}))

    def _index(self) -> dict[str, Offsets]:
        """Message name -> the first bytes of its lines. What does not begin like a message is under ''."""
        size = len(self._data)
        breaks = [
            np.flatnonzero(self._data.between(low, low + _CHUNK) == ord("\n")) + low for low in range(0, size, _CHUNK)
        ]
        self._ends = np.concatenate([*breaks, [size]]).astype(np.int64)
        starts = np.append(0, self._ends[:-1] + 1)
        starts = starts[starts < size]
        starts = starts[~np.isin(self._data.at(starts), (ord("\r"), ord("\n")))]  # a file can be all line ends
        names = np.concatenate([self._heads(part) for part in np.array_split(starts, len(starts) // _HEADS + 1)])
        order = np.argsort(names, kind="stable")
        firsts = np.flatnonzero(np.append(True, names[order][1:] != names[order][:-1]))
        lines: dict[str, Offsets] = {}
        others = [np.empty(0, dtype=np.int64)]
        for low, own in zip(firsts.tolist(), np.split(starts[order], firsts[1:]), strict=True):
            name = names[order[low]].decode("latin-1")
            if len(name) < _NAME_BYTES and name.isidentifier() and len(lines) < limits.TEXT_MESSAGE_TYPES:
                lines[name] = own
            else:
                others.append(own)
        lines[""] = np.sort(np.concatenate(others))
        return lines

    def _heads(self, starts: Offsets) -> NDArray[np.bytes_]:
        """What stands before the comma in the first bytes of lines."""
        heads = self._data.at(starts, (np.uint8, _NAME_BYTES))
        heads[np.cumsum(heads == ord(","), axis=1) > 0] = 0
        return np.asarray(heads.view(f"S{_NAME_BYTES}")[:, 0], dtype=np.bytes_)

    def _line(self, place: int) -> str:
        """The line that begins at a byte, without its end."""
        size = 256
        while True:
            piece = self._data.between(place, place + size).tobytes()
            end = piece.find(b"\n")
            if end >= 0 or place + size >= len(self._data):
                return _text(piece[: end if end >= 0 else None]).rstrip("\r")
            size *= 4

    def _read_formats(self) -> None:
        for place in self._lines.get("FMT", np.empty(0, dtype=np.int64)).tolist():
            parts = [part.strip() for part in self._line(place).split(",")]
            if len(parts) > 5 and parts[3].isidentifier():
                # The first logs forgot the column of the columns in the declaration of FMT itself.
                names = tuple(parts[5:]) if parts[3] != "FMT" else ("Type", "Length", "Name", "Format", "Columns")
                self._formats[parts[3]] = Columns(names, parts[4])

    def _drop_broken(self) -> list[tuple[int, str]]:
        """Leave only the lines that their FMT describes; answers where the others were and what they are."""
        first = min((int(places[0]) for name, places in self._lines.items() if name == "FMT"), default=0)
        broken = []
        for name in list(self._lines):
            places = self._lines[name]
            if name not in self._formats:
                del self._lines[name]
                for place in places[places >= first].tolist():
                    if self._line(place).strip():
                        broken.append((place, "a line is no message that the log declares"))
                    if len(broken) > _MOST_BROKEN:
                        break
                continue
            if name == "FMT":
                continue
            sound = self._sound(name, places)
            broken += [(place, f"a line is no whole {name}") for place in places[~sound][:_MOST_BROKEN].tolist()]
            self._lines[name] = places[sound]
        return sorted(broken)

    def _sound(self, name: str, places: Offsets) -> Bools:
        """Which of the lines are what their FMT says."""
        sound = np.ones(len(places), dtype=bool)
        for at in range(0, len(places), _PIECE):
            piece = places[at : at + _PIECE]
            if self._numbers(name, piece, len(self._formats[name].codes)) is None:
                sound[at : at + _PIECE] = [self._values(name, place) is not None for place in piece.tolist()]
        return sound

    def _numbers(self, name: str, places: Offsets, count: int) -> Floats | None:
        """The first `count` values of lines, shape (lines, count), parsed together: line by line takes ten times as
        long. None where they are not all plain numbers, or a line has more or fewer values than declared."""
        codes = self._formats[name].codes
        if not count or set(codes) & (_TEXT_CODES | _MAYBE_TEXT_CODES):
            return None
        ends = self._ends[np.searchsorted(self._ends, places)]
        lines = self._data.parts(places + len(name) + 1, ends)
        if any(line.count(b",") != len(codes) - 1 for line in lines):
            return None
        if count < len(codes):
            lines = [b",".join(line.split(b",", count)[:count]) for line in lines]
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error", DeprecationWarning)  # how numpy 1 says that it met no number
                values = np.fromstring(b",".join(lines), sep=",")
        except (ValueError, DeprecationWarning):
            return None
        if values.size != len(lines) * count:
            return None
        table = values.reshape(len(lines), count)
        whole = [at for at, code in enumerate(codes[:count]) if code not in _FRACTION_CODES]
        return table if np.isfinite(table[:, whole]).all() else None

    def _values(self, name: str, place: int) -> list[str] | None:
        """The values of a line, None when they are not as many as declared or a number is none."""
        columns, line = self._formats[name], self._line(place)
        values = line.split(",")[1:]
        count = len(columns.codes)
        if count and len(values) > count and columns.codes[-1] in _TEXT_CODES:
            values[count - 1 :] = [",".join(values[count - 1 :])]
        if len(values) < count:
            return None
        values = [value.strip() for value in values[:count]]
        return values if all(map(_is_value, values, columns.codes)) else None

    def _columns(self, name: str, fields: Sequence[str]) -> dict[str, NDArray[Any]]:
        columns = self._formats[name]
        if name == "FMT" or not len(self._lines[name]):
            return {}
        known = {field: at for at, field in enumerate(columns.names[: len(columns.codes)])}
        wanted = {field: known[field] for field in fields if field in known}
        places, parts = self._lines[name], []
        for first in range(0, len(places), _PIECE):
            numbers = self._numbers(name, places[first : first + _PIECE], max(wanted.values(), default=-1) + 1)
            if numbers is None:
                return self._texts(name, wanted)
            parts.append(numbers[:, list(wanted.values())])
        return dict(zip(wanted, np.concatenate(parts).T, strict=True))

    def _texts(self, name: str, wanted: Mapping[str, int]) -> dict[str, NDArray[Any]]:
        """Columns of a message whose lines have to be looked at one by one."""
        codes = self._formats[name].codes
        rows = [self._values(name, place) or [] for place in self._lines[name].tolist()]
        return {field: _column([row[at] for row in rows], codes[at]) for field, at in wanted.items()}

    def _keep_time(self) -> tuple[Damage, ...]:
        """Set `_places` and `_seconds`, the stamped lines and their time; drop lines with an impossible stamp."""
        places, stamps = [np.empty(0, dtype=np.int64)], [np.empty(0)]
        for name, own in self._lines.items():
            stamp = time_field(name, self._formats[name].names)
            column = self._columns(name, (stamp[0],)).get(stamp[0]) if stamp is not None else None
            # A broken declaration has fewer values than names, or calls the time a text.
            if stamp is not None and column is not None and column.dtype.kind == "f":
                places.append(own)
                stamps.append(column / stamp[1])
        if len(places) == 1:
            self._keep_count()
            return ()
        order = np.argsort(np.concatenate(places), kind="stable")
        place, second = np.concatenate(places)[order], np.concatenate(stamps)[order]
        clock, impossible, jumps = find_clock(second, place)
        lost = [Damage("a line's time is impossible", byte) for byte in place[impossible].tolist()]
        self._places, self._seconds = place[~impossible], clock.seconds(second, place)[~impossible]
        if lost:
            self._lines = {name: own[~np.isin(own, place[impossible])] for name, own in self._lines.items()}
        self.duration_s = clock.duration_s
        return (*summarised(jumps, "clock jumps"), *summarised(lost, "lines with an impossible time"))

    def _keep_count(self) -> None:
        """Count time by a message that comes steadily, where none has a stamp (APM boards before firmware 3.1)."""
        name = next((name for name in _STEADY if len(self._lines.get(name, ())) > 1), None)
        self._places = self._lines[name] if name else np.empty(0, dtype=np.int64)
        self._seconds = np.arange(len(self._places)) / _STEADY_HZ
        self.duration_s = float(self._seconds[-1]) if name else 0.0
        self._counted_from = name or ""

    def _times(self, name: str) -> Floats:
        """Seconds of the lines of a message; one without a stamp has that of the last one before it."""
        own = self._lines[name]
        if name == "FMT" or not len(self._places):
            return np.full(len(own), np.nan)
        at = np.searchsorted(self._places, own, side="right") - 1
        return np.where(at >= 0, self._seconds[at], 0.0)


def _is_value(value: str, code: str) -> bool:
    if code in _TEXT_CODES or code == "M":
        return True
    try:
        number = float(value)
    except ValueError:
        return code == "a"
    return code in _FRACTION_CODES or isfinite(number)


def _column(values: list[str], code: str) -> NDArray[Any]:
    """The values as numbers, or as text where they are (a mode is either, by firmware)."""
    if code in _TEXT_CODES or code == "a":
        return np.array(values, dtype=object)
    try:
        return np.array([float(value) for value in values])
    except ValueError:
        return np.array(values, dtype=object)


def _text(raw: bytes | NDArray[np.uint8]) -> str:
    raw = bytes(raw)
    try:
        return raw.decode("utf-8")
    except UnicodeDecodeError:
        return raw.decode("latin-1")
