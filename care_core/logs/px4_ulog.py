"""PX4 logs (.ulg): a header, declarations of topics, and a chain of records without checksums.

Topics are channels; further instances of one are `TOPIC#1`, `TOPIC#2`. What the firmware said, in words or as an event
with its text in the log, is the channel `logged_messages`. Only what is asked for is decoded. Source: the ULog file
format, docs.px4.io/main/en/dev_log/ulog_file_format.html.
"""

from __future__ import annotations

import math
import re
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import datetime, timezone
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from care_core.errors import LogError
from care_core.logs import formats, px4_events
from care_core.logs.base import Channel, Table, Wanted
from care_core.logs.clock import BACK_S, PAUSE_S, STEP_S, find_clock
from care_core.logs.damage import summarised
from care_core.logs.file_windows import FileArray, Offsets, keep_freed
from care_core.logs.ulog_formats import RecordField, Value, read_value
from care_core.logs.ulog_records import (
    DEFAULT,
    DROPOUT,
    INFO,
    INFO_MULTIPLE,
    MESSAGE_HEADER,
    PARAMETER,
    TAGGED_TEXT,
    TEXT,
    Other,
    Topic,
    UlogContents,
    each_of,
    read_contents,
)
from care_core.numbers import Bools, Floats, median
from care_core.run import Damage, Setting, is_said_again

MESSAGES = "logged_messages"
SOURCE = "PX4 parameters"
LEVELS = ("EMERGENCY", "ALERT", "CRITICAL", "ERROR", "WARNING", "NOTICE", "INFO", "DEBUG")
"""Of logged strings, by the digit that they begin with, as the Linux kernel numbers them."""
_SETUP_DEFAULT = 2
"""Bit of a default's record that is the airframe's. One of the firmware alone (bit 1) is written where the airframe has
a default of its own that the value does not differ from (`Logger::write_parameter_defaults`)."""
_VTOL = "VTOL"
_VEHICLE_TYPES = {1: "multicopter", 2: "fixed wing", 3: "rover", 4: "airship"}
_GPS_TOPICS = ("vehicle_gps_position", "sensor_gps")
_EARLIEST_S = datetime(2005, 1, 1, tzinfo=timezone.utc).timestamp()
_LATEST_S = 1e10
_SAMPLES = 64
"""Rows of a GPS topic that are looked at first for one that knows the time."""
_MOST_STAMPS = 1000
"""Times of a topic that tell about where the log lies."""
_ATTENTION = LEVELS.index("WARNING")
"""Events of lesser levels say what else is logged: that it climbs, that it armed."""
_TOGETHER_S = 1.0
"""Within it an event and a logged string are the same."""
_NO_WORD = re.compile(r"\W+|preflight fail|arming check")
_NEAR = 100
"""Messages ahead of a place among which the latest tells its time (several tasks write into one log), and strings that
an event is held against."""


class _Messages(NamedTuple):
    """The messages of a channel whose time can be: where each begins, and seconds of the log, both of shape (n,)."""

    topic: Topic
    places: Offsets
    t: Floats


class Px4Log:
    """A PX4 log. Fields are dotted paths with numbers (`q[0]`); times are seconds from the first record of the log.

    Raises:
        LogError: the file cannot be read, or holds no message.
    """

    format = formats.PX4_ULG

    def __init__(self, path: Path) -> None:
        self.path = path
        keep_freed()
        self._data = FileArray.open(path)
        contents = read_contents(self._data)
        topics = [(topic, places, stamps.astype(np.float64)) for topic, places, stamps in each_of(contents)]
        if not topics:
            raise LogError("The log holds no message.", hint="It may have been cut off.", where=str(path))
        self._first_us = _first_us(contents.start_us, (stamps for _, _, stamps in topics))
        self._channels: dict[str, _Messages] = {}
        lost = 0
        for topic, places, stamps in topics:
            t = self._seconds(stamps)
            kept = _believable(t)
            lost += len(t) - int(np.count_nonzero(kept))
            if kept.any():
                own = _Messages(topic, places, t)
                self._channels[topic.channel] = own if kept.all() else _rows(own, kept)
        self.duration_s = max((float(one.t[-1]) for one in self._channels.values()), default=0.0)
        self._read_others(contents, lost)

    def _read_others(self, contents: UlogContents, lost: int) -> None:
        """What the records say that are no messages of topics, and what is broken."""
        times = _Times(contents, self._seconds, self.duration_s)
        unread: list[Damage] = []
        self._info = _keyed(contents.others, INFO, unread)
        self._settings = self._history(contents, times, unread)
        self._multiple = [one for one in contents.others if one.kind == INFO_MULTIPLE]
        self._words = self._spoken(contents.others)
        misfits = [Damage("a message fits no declaration", byte) for byte in contents.misfits]
        broken = (
            *summarised(contents.damage, "damaged places"),
            *summarised(unread, "records that cannot be read"),
            *summarised(misfits, "messages that fit no declaration"),
        )
        self.damage = (
            *summarised(_dropouts(contents.others, times), "dropouts"),
            *(_timed(one, times) for one in sorted(broken, key=lambda one: one.byte or 0)),
            *([Damage(f"{lost} messages with an impossible time")] if lost else ()),
        )

    def channels(self) -> tuple[Channel, ...]:
        found = []
        for name, t in (*((name, one.t) for name, one in self._channels.items()), (MESSAGES, self._words.t)):
            if len(t):
                found.append(Channel.over(name, name.partition("#")[0], len(t), float(t[-1] - t[0])))
        return tuple(sorted(found, key=lambda channel: channel.name))

    def read(self, wanted: Wanted) -> Mapping[str, Table]:
        tables = self._tables({name: (self._channels[name], fields) for name, fields in wanted.items()
                               if name in self._channels})  # fmt: skip
        if MESSAGES in wanted and len(self._words):
            columns = {field: self._words[field] for field in wanted[MESSAGES] if field in self._words.columns}
            tables[MESSAGES] = Table(self._words.t, columns)
        return tables

    def _tables(self, wanted: Mapping[str, tuple[_Messages, Sequence[str]]]) -> dict[str, Table]:
        """Fields of messages, all by one walk through the file."""
        layouts = {name: _fields(own.topic, fields) for name, (own, fields) in wanted.items()}
        with_fields = [name for name in wanted if layouts[name]]
        stored = self._data.fields(
            [(wanted[name][0].places, [(one.offset, one.dtype) for one in layouts[name].values()])
             for name in with_fields]
        )  # fmt: skip
        columns = dict(zip(with_fields, stored, strict=True))
        tables = {}
        with np.errstate(invalid="ignore"):  # flipped bits make signalling NaNs of floats
            for name, (own, _) in wanted.items():
                values = (column.astype(np.float64) for column in columns.pop(name, ()))
                tables[name] = Table(own.t, dict(zip(layouts[name], values, strict=True)))
        return tables

    def settings(self) -> Mapping[str, tuple[Setting, ...]]:
        return self._settings

    @cached_property
    def facts(self) -> Mapping[str, str]:
        """`stack`, `firmware` ("PX4 v1.15.0 (cb09dde6)"), `uuid` of the board, `hardware` and `vehicle`, where told."""
        facts = {"stack": "PX4", "firmware": f"PX4 {_version(self._info)}".strip()}
        for fact, key in (("uuid", "sys_uuid"), ("hardware", "ver_hw")):
            if isinstance(value := self._info.get(key), str):
                facts[fact] = value
        if (own := self._channels.get("vehicle_status")) is not None:
            last = self._tables({"": (_rows(own, slice(-1, None)), ("vehicle_type", "is_vtol"))})[""]
            if "vehicle_type" in last.columns:
                facts["vehicle"] = _VEHICLE_TYPES.get(int(last["vehicle_type"][-1]), "")
            if "is_vtol" in last.columns and last["is_vtol"][-1]:  # its type is that of how it flies just now
                facts["vehicle"] = _VTOL
        return {key: text for key, text in facts.items() if text}

    @cached_property
    def start(self) -> str | None:
        """Wall clock of the first record (UTC), from the first GPS message that knows it."""
        for own in (self._channels[name] for name in _GPS_TOPICS if name in self._channels):
            last = len(own.t) - 1
            rows = np.unique(np.linspace(0, last, min(_SAMPLES, last + 1)).astype(np.int64))  # few bytes of a large log
            if len(known := np.flatnonzero(np.isfinite(self._utc_s(own, rows)))):
                first = int(known[0])
                near = np.arange(rows[max(first - 1, 0)], rows[first] + 1)
                utc_s = self._utc_s(own, near)
                start_s = float(utc_s[np.isfinite(utc_s)][0])
                return datetime.fromtimestamp(start_s, timezone.utc).isoformat(timespec="seconds")
        return None

    def _utc_s(self, own: _Messages, rows: NDArray[np.int64]) -> Floats:
        """Wall clock of the first record by rows of a GPS topic, seconds since 1970; NaN of those that do not know."""
        table = self._tables({"": (_rows(own, rows), ("time_utc_usec",))})[""]
        if "time_utc_usec" not in table.columns:
            return np.full(len(rows), np.nan)
        utc_s = table["time_utc_usec"] / 1e6 - table.t
        return np.where((utc_s > _EARLIEST_S) & (utc_s < _LATEST_S), utc_s, np.nan)

    @property
    def multiple(self) -> Mapping[str, tuple[tuple[Value, ...], ...]]:
        """Information that comes in parts (`perf_counter_preflight`, `boot_console_output`): by key its lists."""
        lists: dict[str, list[list[Value]]] = {}
        for one in self._multiple:
            if (keyed := read_value(one.body[1:])) is not None:
                own = lists.setdefault(keyed[0], [])
                if not own or not one.body[0]:
                    own.append([])
                own[-1].append(keyed[1])
        return {key: tuple(tuple(parts) for parts in own) for key, own in lists.items()}

    def _seconds(self, stamps_us: Floats) -> Floats:
        """Times in the log. What was said before it began and still held is stamped earlier, or 0: it gets time 0."""
        return np.maximum(stamps_us - self._first_us, 0.0) / 1e6

    def _history(self, contents: UlogContents, times: _Times, unread: list[Damage]) -> dict[str, tuple[Setting, ...]]:
        """Every parameter with the airframe's default (the log names those that differ from the value) and its
        changes."""
        initial = [one for one in contents.others if one.byte < contents.logging_byte]
        later = [one for one in contents.others if one.byte >= contents.logging_byte and one.kind == PARAMETER]
        defaults = _defaults(contents.others, unread)
        known: dict[str, list[Setting]] = {}
        for name, value in _keyed(initial, PARAMETER, unread).items():
            if isinstance(value, (int, float)):
                default = defaults.get(name, value) if contents.has_defaults else None
                known[name] = [Setting(name, _number(value), SOURCE, _number(default) if _is_number(default) else None)]
        for one in later:
            for name, value in _keyed([one], PARAMETER, unread).items():
                values = known.setdefault(name, [])
                if isinstance(value, (int, float)) and not (values and is_said_again(values[-1].value, _number(value))):
                    values.append(Setting(name, _number(value), SOURCE,
                                          changed_at_s=times.at(one.byte) if values else None))  # fmt: skip
        return {name: tuple(values) for name, values in known.items() if values}

    def _spoken(self, others: Iterable[Other]) -> Table:
        """What was said in words, and the events that say what no words did."""
        said = list(self._logged_strings(others))
        times, words = [one.t for one in said], [_bare(one.text) for one in said]
        said += (one for one in self._events() if not _is_told(one, times, words))
        said.sort(key=lambda one: one.t)
        t = np.array([one.t for one in said], dtype=np.float64)
        columns = {"level": [one.level for one in said], "message": [one.text for one in said]}
        spoken = Table(t, {name: np.array(texts, dtype=object) for name, texts in columns.items()})
        return spoken.where(t <= self.duration_s + 1.0)

    def _logged_strings(self, others: Iterable[Other]) -> Iterator[_Said]:
        strings = []
        for one in others:
            at = {TEXT: 1, TAGGED_TEXT: 3}.get(one.kind, 0)
            if at:
                stamp_us = int.from_bytes(one.body[at : at + 8], "little")
                text = one.body[at + 8 :].decode("utf-8", "replace").rstrip("\0")
                strings.append((stamp_us, one.kind, one.body[0] - ord("0"), text))
        strings.sort(key=lambda one: one[:2])
        t = self._seconds(np.array([one[0] for one in strings], dtype=np.float64))
        for at_s, (_, _, level, text) in zip(t.tolist(), strings, strict=True):
            yield _Said(at_s, LEVELS[level] if 0 <= level < len(LEVELS) else "UNKNOWN", text)

    def _events(self) -> Iterator[_Said]:
        """What was said as events, where the log has their texts."""
        own, texts = self._channels.get(px4_events.TOPIC), self._event_texts()
        if own is None or texts is None:
            return
        table = self._tables({"": (own, px4_events.FIELDS)})[""]
        if set(px4_events.FIELDS) - table.columns.keys():
            return
        numbers = np.column_stack([table[name] for name in px4_events.FIELDS]).astype(np.int64).tolist()
        for t, (number, levels, *arguments) in zip(table.t.tolist(), numbers, strict=True):
            level = levels & 15  # for whoever is not on board; the other half is for the vehicle's own log
            text = texts.text(number, bytes(arguments)) if level <= _ATTENTION else ""
            if text:
                yield _Said(t, LEVELS[level], text)

    def _event_texts(self) -> px4_events.EventTexts | None:
        parts = self.multiple.get("metadata_events", ((self._info.get("metadata_events", b""),),))[0]
        return px4_events.EventTexts.parse(b"".join(part for part in parts if isinstance(part, bytes)))


class _Said(NamedTuple):
    """What the firmware said: seconds of the log, one of `LEVELS`, and the text."""

    t: float
    level: str
    text: str


def _bare(text: str) -> str:
    """The letters and digits of a text that say something, to hold two wordings against each other."""
    return _NO_WORD.sub("", text.casefold())


def _is_told(event: _Said, times: Sequence[float], words: Sequence[str]) -> bool:
    """Whether a logged string says the same at that time, of strings in the order of their times."""
    first, last = bisect_right(times, event.t - _TOGETHER_S), bisect_left(times, event.t + _TOGETHER_S)
    own = _bare(event.text)
    return any(own in text for text in words[first : min(last, first + _NEAR)])


class _Times:
    """When records lie that have no stamp: the latest time of the messages just ahead of them."""

    def __init__(self, contents: UlogContents, seconds: Any, duration_s: float) -> None:
        self._places, self._stamps_us = contents.places, contents.stamps_us
        self._seconds, self._end_s = seconds, duration_s

    def at(self, byte: int) -> float:
        """Seconds of the log at a byte; 0 ahead of all messages."""
        row = int(np.searchsorted(self._places, self._places.dtype.type(byte)))
        t = self._seconds(self._stamps_us[max(row - _NEAR, 0) : row].astype(np.float64))
        return float(max(t[t <= self._end_s], default=0.0))


def _rows(own: _Messages, rows: slice | NDArray[Any]) -> _Messages:
    return _Messages(own.topic, own.places[rows], own.t[rows])


def _fields(topic: Topic, names: Iterable[str]) -> dict[str, RecordField]:
    """Where the fields that a topic has lie behind the first byte of a record."""
    found = ((name, topic.layout.find(name)) for name in names)
    return {name: RecordField(one.offset + MESSAGE_HEADER, one.dtype) for name, one in found if one is not None}


def _keyed(others: Iterable[Other], kind: int, unread: list[Damage]) -> dict[str, Value]:
    """Keys and their last values of the records of a kind."""
    found = {}
    for one in others:
        if one.kind == kind:
            keyed = read_value(one.body)
            if keyed is None:
                unread.append(Damage("a record cannot be read", one.byte))
            else:
                found[keyed[0]] = keyed[1]
    return found


def _defaults(others: Sequence[Other], unread: list[Damage]) -> dict[str, Value]:
    """The airframe's defaults of the parameters that differ from them."""
    own = [one for one in others if one.kind == DEFAULT and one.body[0] & _SETUP_DEFAULT]
    return _keyed([Other(one.byte, DEFAULT, one.body[1:]) for one in own], DEFAULT, unread)


def _dropouts(others: Iterable[Other], times: _Times) -> list[Damage]:
    found = ((int.from_bytes(one.body, "little"), one.byte) for one in others if one.kind == DROPOUT)
    return [Damage(f"{ms} ms were not recorded (dropout)", None, times.at(byte)) for ms, byte in found if ms]


def _timed(one: Damage, times: _Times) -> Damage:
    """The damage with its time in the log."""
    return one if one.byte is None else Damage(one.what, one.byte, times.at(one.byte))


def _is_number(value: Value | None) -> bool:
    """Whether a parameter is one: a log may declare it as text, or as what no number is."""
    return isinstance(value, (int, float)) and math.isfinite(value)


def _number(value: Value | None) -> float:
    """A parameter as it was typed: a float is single precision."""
    assert isinstance(value, (int, float))
    return float(value) if isinstance(value, int) else float(str(np.float32(value)))


def _first_us(start_us: int, stamps: Iterable[Floats]) -> float:
    """Second 0 of the log: its header's stamp, unless the records lie elsewhere."""
    middle = float(median([float(median(part[:: 1 + len(part) // _MOST_STAMPS])) for part in stamps]))
    first = float(start_us)
    return first if 0 <= middle - first <= PAUSE_S * 1e6 else middle


def _believable(t: Floats) -> Bools:
    """Which times of a topic can be: within a day of the log's start, and in step with their neighbours."""
    steps = np.diff(t)
    if t[-1] <= PAUSE_S and (not len(steps) or (steps.min() >= -BACK_S and steps.max() <= STEP_S)):
        return np.ones(len(t), bool)
    near = t <= PAUSE_S
    _, impossible, _ = find_clock(t[near], np.flatnonzero(near))
    near[np.flatnonzero(near)[impossible]] = False
    return np.asarray(near)


def _version(info: Mapping[str, Value]) -> str:
    """ "v1.15.0 (cb09dde6)": one byte each of `ver_sw_release`, and the first digits of the commit."""
    release, commit = info.get("ver_sw_release"), info.get("ver_sw")
    if not isinstance(release, int) or not isinstance(commit, str):
        return ""
    return f"v{release >> 24 & 255}.{release >> 16 & 255}.{release >> 8 & 255} ({commit[:8]})"
