"""PX4 logs (.ulg), decoded by pyulog (extra `px4`).

Topics are channels; further instances of one are `TOPIC#1`, `TOPIC#2`. What the firmware said in words is the channel
`logged_messages`. pyulog reads on after damage but does not say where it was, so the chain of records is walked here.
"""

from __future__ import annotations

import contextlib
import io
import math
from collections.abc import Iterable, Mapping, Sequence
from datetime import datetime, timezone
from functools import cached_property
from pathlib import Path
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import NDArray

from care_core.errors import LogError
from care_core.extras import install_hint
from care_core.files import open_regular
from care_core.logs import formats
from care_core.logs.base import Channel, Table, Wanted
from care_core.logs.clock import PAUSE_S, find_clock
from care_core.logs.damage import summarised
from care_core.numbers import median
from care_core.run import Damage, Setting

MESSAGES = "logged_messages"
_HEADER_BYTES = 16
_RECORD_TYPES = frozenset(b"BFIMPQARDLCSO")
_SYSTEM_DEFAULT, _SETUP_DEFAULT = 0, 1
_VEHICLE_TYPES = {1: "multicopter", 2: "fixed wing", 3: "rover", 4: "airship"}
_GPS_TOPICS = ("vehicle_gps_position", "sensor_gps")
_EARLIEST_S = datetime(2005, 1, 1, tzinfo=timezone.utc).timestamp()


class Px4Log:
    """A PX4 log. Fields are pyulog's (`q[0]`); times are seconds from the first record of the log.

    Raises:
        LogError: pyulog is not installed, or the file cannot be read.
    """

    format = formats.PX4_ULG

    def __init__(self, path: Path) -> None:
        self.path = path
        ulog = _parse(path, None)
        tables = {_channel(data): data.data["timestamp"] for data in _stamped(ulog)}
        if not tables:
            raise LogError("The log holds no message.", hint="It may have been cut off.", where=str(path))
        self._first_us = _first_us(ulog, tables.values())
        seconds = {name: self._seconds(stamps) for name, stamps in tables.items()}
        kept = {name: t[_believable(t)] for name, t in seconds.items()}
        self._channels = {name: t for name, t in kept.items() if len(t)}
        self.duration_s = max((float(t[-1]) for t in self._channels.values()), default=0.0)
        self._info = dict(ulog.msg_info_dict)
        self._version = _version(ulog)
        self._settings = self._history(ulog)
        self._words = self._spoken(ulog)
        lost = sum(len(t) for t in seconds.values()) - sum(len(t) for t in kept.values())
        self.damage = (*self._damage(ulog), *([Damage(f"{lost} messages with an impossible time")] if lost else ()))

    def channels(self) -> tuple[Channel, ...]:
        found = []
        for name, t in (*self._channels.items(), (MESSAGES, self._words.t)):
            if len(t):
                found.append(Channel.over(name, name.partition("#")[0], len(t), float(t[-1] - t[0])))
        return tuple(sorted(found, key=lambda channel: channel.name))

    def read(self, wanted: Wanted) -> Mapping[str, Table]:
        topics = {name.partition("#")[0] for name in wanted if name in self._channels}
        tables = {}
        if topics:
            for data in _stamped(_parse(self.path, sorted(topics))):
                name = _channel(data)
                if name in wanted and name in self._channels:
                    t = self._seconds(data.data["timestamp"])
                    with np.errstate(invalid="ignore"):  # flipped bits make signalling NaNs of floats
                        columns = {field: data.data[field].astype(np.float64)
                                   for field in wanted[name] if field in data.data}  # fmt: skip
                    tables[name] = Table(t, columns).where(_believable(t))
        if MESSAGES in wanted and len(self._words):
            columns = {field: self._words[field] for field in wanted[MESSAGES] if field in self._words.columns}
            tables[MESSAGES] = Table(self._words.t, columns)
        return tables

    def settings(self) -> Mapping[str, tuple[Setting, ...]]:
        return self._settings

    @cached_property
    def facts(self) -> Mapping[str, str]:
        """`stack`, `firmware` ("PX4 v1.15.0 (cb09dde6)"), `uuid` of the board, `hardware` and `vehicle`, where told."""
        facts = {"stack": "PX4", "firmware": f"PX4 {self._version}".strip()}
        if isinstance(self._info.get("sys_uuid"), str):
            facts["uuid"] = str(self._info["sys_uuid"])
        if isinstance(self._info.get("ver_hw"), str):
            facts["hardware"] = str(self._info["ver_hw"])
        status = self.read({"vehicle_status": ("vehicle_type",)}).get("vehicle_status")
        if status is not None and "vehicle_type" in status.columns and len(status):
            kind = float(status["vehicle_type"][-1])
            facts["vehicle"] = _VEHICLE_TYPES.get(int(kind), "") if math.isfinite(kind) else ""
        return {key: text for key, text in facts.items() if text}

    @cached_property
    def start(self) -> str | None:
        """Wall clock of the first record (UTC), from the first GPS message that knows it."""
        for table in self.read(dict.fromkeys(_GPS_TOPICS, ("time_utc_usec",))).values():
            if "time_utc_usec" in table.columns:
                utc_s = table["time_utc_usec"] / 1e6 - table.t
                known = utc_s[(utc_s > _EARLIEST_S) & (utc_s < 1e10)]
                if len(known):
                    return datetime.fromtimestamp(float(known[0]), timezone.utc).isoformat(timespec="seconds")
        return None

    def _seconds(self, stamps_us: NDArray[Any]) -> NDArray[np.float64]:
        """Times in the log. What was said before it began and still held is stamped earlier, or 0: it gets time 0."""
        with np.errstate(invalid="ignore"):
            return np.asarray(np.maximum(stamps_us.astype(np.float64) - self._first_us, 0.0) / 1e6)

    def _history(self, ulog: Any) -> dict[str, tuple[Setting, ...]]:
        """Every parameter with its default (the log names those that differ from the value) and its changes."""
        defaults = {**ulog.get_default_parameters(_SYSTEM_DEFAULT), **ulog.get_default_parameters(_SETUP_DEFAULT)}
        source = "PX4 parameters"
        known: dict[str, list[Setting]] = {}
        for name, value in ulog.initial_parameters.items():
            if _is_number(value):
                default = defaults.get(name, value) if ulog.has_default_parameters else None
                known[name] = [Setting(name, _number(value), source, _number(default) if _is_number(default) else None)]
        for stamp_us, name, value in ulog.changed_parameters:
            values = known.setdefault(name, [])
            if _is_number(value) and (not values or values[-1].value != _number(value)):
                changed_s = (stamp_us - self._first_us) / 1e6 if values else None
                values.append(Setting(name, _number(value), source, changed_at_s=changed_s))
        return {name: tuple(values) for name, values in known.items() if values}

    def _spoken(self, ulog: Any) -> Table:
        tagged = [one for several in ulog.logged_messages_tagged.values() for one in several]
        said = sorted([*ulog.logged_messages, *tagged], key=lambda one: int(one.timestamp))
        t = self._seconds(np.array([one.timestamp for one in said], dtype=np.float64))
        levels = [one.log_level_str() for one in said]
        columns = {"level": levels, "message": [str(one.message) for one in said]}
        words = Table(t, {name: np.array(texts, dtype=object) for name, texts in columns.items()})
        return words.where(t <= self.duration_s + 1.0)

    def _damage(self, ulog: Any) -> tuple[Damage, ...]:
        times = self._seconds(np.array([one.timestamp for one in ulog.dropouts]))
        dropouts = [Damage(f"{one.duration} ms were not recorded (dropout)", None, t)
                    for one, t in zip(ulog.dropouts, times.tolist(), strict=True) if one.duration > 0]  # fmt: skip
        broken = _first_break(self.path, self.duration_s)
        if broken is None and ulog.file_corruption:
            broken = Damage("records that fit no declaration")
        return (*summarised(dropouts, "dropouts"), *([broken] if broken else ()))


def _parse(path: Path, topics: Sequence[str] | None) -> Any:
    try:
        from pyulog import ULog
    except ImportError as err:
        raise LogError(
            "PX4 logs need pyulog, which is not installed.",
            hint=f"{install_hint('px4')}.",
            where=str(path),
        ) from err
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            return ULog(str(path), topics)
    except (FileNotFoundError, PermissionError) as err:
        raise LogError(f"Cannot read the file: {err.strerror}.", hint="Check the path.", where=str(path)) from err
    except Exception as err:  # pyulog says not which errors a damaged file can raise
        raise LogError(
            "The log is too damaged for pyulog.", hint="Copy it from the vehicle again.", where=str(path)
        ) from err


def _stamped(ulog: Any) -> list[Any]:
    """The topics that say when; a flipped bit can rename the field."""
    return [data for data in ulog.data_list if "timestamp" in data.data]


def _channel(data: Any) -> str:
    return f"{data.name}#{data.multi_id}" if data.multi_id else str(data.name)


def _is_number(value: Any) -> TypeGuard[int | float]:
    """Whether a parameter is one: a log may declare it as text, or as what no number is."""
    return isinstance(value, (int, float)) and math.isfinite(value)


def _number(value: float) -> float:
    """A parameter as it was typed: a float is single precision."""
    return float(value) if isinstance(value, int) else float(str(np.float32(value)))


def _first_us(ulog: Any, stamps: Iterable[NDArray[Any]]) -> float:
    """Second 0 of the log: its header's stamp, unless the records lie elsewhere."""
    middle = float(median([float(median(part)) for part in stamps]))
    first = float(ulog.start_timestamp)
    return first if 0 <= middle - first <= PAUSE_S * 1e6 else middle


def _believable(t: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which times of a topic can be: within a day of the log's start, and in step with their neighbours."""
    near = t <= PAUSE_S
    _, impossible, _ = find_clock(t[near], np.flatnonzero(near))
    near[np.flatnonzero(near)[impossible]] = False
    return np.asarray(near)


def _first_break(path: Path, end_s: float) -> Damage | None:
    """Where the chain of records breaks for the first time; a cut ends the log at `end_s`."""
    with open_regular(path) as stream:
        data = stream.read()
    place, size = _HEADER_BYTES, len(data)
    while place + 3 <= size:
        length = data[place] | data[place + 1] << 8
        if data[place + 2] not in _RECORD_TYPES or not length:
            return Damage("what follows is no record", place)
        if place + 3 + length > size:
            break
        place += 3 + length
    return Damage(f"cut in a record, {size - place} bytes of it are there", place, end_s) if place < size else None


def _version(ulog: Any) -> str:
    try:
        major, minor, patch, _ = ulog.get_version_info()
        return f"v{major}.{minor}.{patch} ({str(ulog.msg_info_dict['ver_sw'])[:8]})"
    except Exception:  # a flipped bit makes another type of it
        return ""
