"""Telemetry seen as a DataFlash log, so that every ArduPilot extractor reads both.

A ground station hears less, later and more coarsely than the vehicle writes down: what it never heard stays absent
and its extractors answer `Unavailable`. Arming is known to half the time between two heartbeats (0.5 s).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cached_property
from typing import Any

import numpy as np

from care_core.logs import formats
from care_core.logs.base import Channel, Log, Table, Wanted
from care_core.records import Record

Sample = tuple[float, tuple[Any, ...]]

_ARMED_FLAG = 128
_ARM_DISARM, _FORCE = 400, 21196
_FORCED_WITHIN_S = 3.0
_SAME_EVENT_S = 3.0
_UNKNOWN_U16 = 65535
_COPTERS = frozenset((2, 3, 4, 13, 14, 15, 29, 35))

_Scaled = Mapping[str, tuple[str, float]]
_AS_SENT: Mapping[str, tuple[str, _Scaled]] = {
    "POS": ("GLOBAL_POSITION_INT", {"Lat": ("lat", 1e-7), "Lng": ("lon", 1e-7), "Alt": ("alt", 1e-3),
                                    "RelHomeAlt": ("relative_alt", 1e-3)}),
    "PSCN": ("GLOBAL_POSITION_INT", {"VN": ("vx", 0.01)}),
    "PSCE": ("GLOBAL_POSITION_INT", {"VE": ("vy", 0.01)}),
    "PSCD": ("GLOBAL_POSITION_INT", {"VD": ("vz", 0.01)}),
    "GPS": ("GPS_RAW_INT", {"Status": ("fix_type", 1), "NSats": ("satellites_visible", 1), "HDop": ("eph", 0.01),
                            "Lat": ("lat", 1e-7), "Lng": ("lon", 1e-7), "Alt": ("alt", 1e-3), "Spd": ("vel", 0.01),
                            "GCrs": ("cog", 0.01), "GMS": ("time_usec", 1e-3)}),
    "CTUN": ("VFR_HUD", {"ThO": ("throttle", 0.01), "Alt": ("alt", 1), "As": ("airspeed", 1)}),
    "RCOU": ("SERVO_OUTPUT_RAW", {f"C{n}": (f"servo{n}_raw", 1) for n in range(1, 17)}),
    "VIBE": ("VIBRATION", {"Clip": ("clipping_0", 1)} | {f"Vibe{axis}": (f"vibration_{axis.lower()}", 1)
                                                         for axis in "XYZ"}),
    "RCIN": ("RC_CHANNELS", {f"C{n}": (f"chan{n}_raw", 1) for n in range(1, 15)}),
    "POWR": ("POWER_STATUS", {"Vcc": ("Vcc", 1e-3)}),
    "XKF4": ("EKF_STATUS_REPORT", {"SV": ("velocity_variance", 1), "SP": ("pos_horiz_variance", 1),
                                   "SH": ("pos_vert_variance", 1), "SM": ("compass_variance", 1)}),
    "THR": ("VFR_HUD", {"ThrOut": ("throttle", 1), "Speed": ("groundspeed", 1)}),
    "STER": ("ATTITUDE", {"TurnRate": ("yawspeed", 180 / np.pi)}),
    "RATE": ("ATTITUDE", {"R": ("rollspeed", 180 / np.pi), "P": ("pitchspeed", 180 / np.pi),
                          "Y": ("yawspeed", 180 / np.pi)}),
}  # fmt: skip
"""DataFlash message -> the MAVLink message that carries it, and per field the sent one and its scale."""

_UNKNOWN: Mapping[str, float] = {
    "eph": _UNKNOWN_U16, "vel": _UNKNOWN_U16, "cog": _UNKNOWN_U16, "voltage_battery": _UNKNOWN_U16,
    "current_battery": -1, "energy_consumed": -1,
}  # fmt: skip
"""Values by which a sender says that it does not know."""


_TEXTS = frozenset(("Message", "Name"))
"""What is text among the fields that are read of DataFlash messages. A mode is either, by firmware."""


def as_dataflash(log: Log) -> Log:
    """The log as whoever reads DataFlash messages expects it: of telemetry the log that it can stand for, of a
    DataFlash log the fields that its declarations give the kind that the firmware does."""
    if log.format is formats.MAVLINK_TLOG:
        return _Telemetry(log)
    return _Declared(log) if log.format in (formats.DATAFLASH_BIN, formats.DATAFLASH_TEXT) else log


class _Declared(Record, eq=False):
    """A DataFlash log whose declarations may be broken: a field that holds text for numbers, or numbers for text, is as
    good as absent."""

    log: Log

    def __getattr__(self, name: str) -> Any:
        return getattr(self.log, name)

    def read(self, wanted: Wanted) -> Mapping[str, Table]:
        return {name: _as_expected(table) for name, table in self.log.read(wanted).items()}


def _as_expected(table: Table) -> Table:
    names = [
        name for name in table.columns if name == "Mode" or table.kind(name) == ("text" if name in _TEXTS else "number")
    ]
    return table if len(names) == len(table.columns) else Table(table.t, {name: table[name] for name in names})


class _Telemetry(Record, eq=False, dict=True):
    """A telemetry log with the messages of a DataFlash log beside its own. Everything else is the log's."""

    log: Log

    def __getattr__(self, name: str) -> Any:
        return getattr(self.log, name)

    def channels(self) -> tuple[Channel, ...]:
        own = self.log.channels()
        heard = {channel.name.partition("@")[0]: channel for channel in reversed(own)}
        shown = []
        for name, sources in _SOURCES.items():
            source = next((heard[source] for source in sources if source in heard), None)
            if source is not None:
                shown.append(Channel(name, source.name, source.count, source.rate_hz))
        return (*own, *shown)

    def read(self, wanted: Wanted) -> Mapping[str, Table]:
        own = {name: fields for name, fields in wanted.items() if name not in _SOURCES}
        tables = dict(self.log.read(own))
        for name, fields in wanted.items():
            table = self._table(name) if name in _SOURCES else None
            if table is not None and len(table):
                present = {field: table[field] for field in fields if field in table.columns}
                tables[name] = Table(table.t, present)
        return tables

    def _table(self, name: str) -> Table | None:
        return _MADE[name](self) if name in _MADE else self._as_sent(name)

    def heard(self, message: str, *fields: str) -> Table | None:
        """A message of the vehicle, None when it was never heard. Values that mean "unknown" are NaN."""
        table = self.log.read({message: fields}).get(message)
        if table is None or not set(fields) <= table.columns.keys():
            return None
        for field in fields:
            if field in _UNKNOWN:
                table[field][table[field] == _UNKNOWN[field]] = np.nan
        return table

    def exchanged(self, message: str, *fields: str) -> dict[str, Table]:
        """A message that the vehicle sent, or that was sent to it: one table a sender, of the vehicle under ""."""
        names = [channel.name for channel in self.log.channels() if channel.name.partition("@")[0] == message]
        tables = self.log.read(dict.fromkeys(names, (*fields, "target_system")))
        return {
            name.partition("@")[2]: table if name == message else table.where(table["target_system"] == self.system)
            for name, table in tables.items()
        }

    @cached_property
    def system(self) -> int:
        """The vehicle's number."""
        return int(self.log.facts["system"].partition(".")[0])

    @cached_property
    def heartbeats(self) -> Table | None:
        return self.heard("HEARTBEAT", "base_mode", "custom_mode", "type", "system_status")

    def _as_sent(self, name: str) -> Table | None:
        message, fields = _AS_SENT[name]
        table = self.heard(message, *(sent for sent, _ in fields.values()))
        if table is None:
            return None
        if name == "POS":
            table = table.where((table["lat"] != 0) | (table["lon"] != 0))
        return Table(table.t, {field: table[sent] * scale for field, (sent, scale) in fields.items()})


def _attitude(log: _Telemetry) -> Table | None:
    """ATT. A copter's NAV_CONTROLLER_OUTPUT says which attitude it wants; it comes at times of its own."""
    table = log.heard("ATTITUDE", "roll", "pitch", "yaw")
    if table is None:
        return None
    columns = {name: np.degrees(table[name.lower()]) for name in ("Roll", "Pitch", "Yaw")}
    columns["Yaw"] = columns["Yaw"] % 360
    wanted = log.heard("NAV_CONTROLLER_OUTPUT", "nav_roll", "nav_pitch", "nav_bearing")
    beats = log.heartbeats
    if wanted is not None and beats is not None and int(beats["type"][0]) in _COPTERS:
        columns["DesRoll"] = np.interp(table.t, wanted.t, wanted["nav_roll"])
        columns["DesPitch"] = np.interp(table.t, wanted.t, wanted["nav_pitch"])
        turned = np.degrees(np.unwrap(np.radians(wanted["nav_bearing"])))
        columns["DesYaw"] = np.interp(table.t, wanted.t, turned) % 360
    return Table(table.t, columns)


def _batteries(log: _Telemetry) -> Table | None:
    """BAT, from BATTERY_STATUS where it is sent, else from SYS_STATUS."""
    table = log.heard("BATTERY_STATUS", "id", "voltages", "current_battery", "energy_consumed")
    if table is not None:
        cells = np.array(table["voltages"].tolist(), dtype=np.float64)
        volts = np.where(cells == _UNKNOWN_U16, 0.0, cells).sum(axis=1) / 1000
        return Table(table.t, {
            "Inst": table["id"],
            "Volt": np.where(volts > 0, volts, np.nan),
            "Curr": table["current_battery"] / 100,
            "EnrgTot": table["energy_consumed"] / 36,
        })  # fmt: skip
    table = log.heard("SYS_STATUS", "voltage_battery", "current_battery")
    if table is None:
        return None
    return Table(table.t, {"Volt": table["voltage_battery"] / 1000, "Curr": table["current_battery"] / 100})


def _home(log: _Telemetry) -> Table | None:
    table = log.heard("HOME_POSITION", "latitude", "longitude", "altitude")
    if table is None:
        return None
    here = {
        "Type": np.ones(len(table)),
        "Lat": table["latitude"] * 1e-7,
        "Lng": table["longitude"] * 1e-7,
        "Alt": table["altitude"] * 1e-3,
    }
    return Table(table.t, here)


def _status(log: _Telemetry) -> Table | None:
    """STAT: whether it was armed, and its state (MAV_STATE), by each heartbeat."""
    beats = log.heartbeats
    if beats is None:
        return None
    armed = ((beats["base_mode"].astype(np.int64) & _ARMED_FLAG) > 0).astype(np.float64)
    return Table(beats.t, {"Armed": armed, "State": beats["system_status"].astype(np.float64)})


def _armings(log: _Telemetry) -> Table | None:
    """ARM: every change of the armed flag, halfway between the two heartbeats. One already set at the first is no
    arming, since when that was is not in the log."""
    beats = log.heartbeats
    if beats is None:
        return None
    armed = (beats["base_mode"].astype(np.int64) & _ARMED_FLAG) > 0
    changed = np.flatnonzero(armed[1:] != armed[:-1]) + 1
    t = (beats.t[changed] + beats.t[changed - 1]) / 2
    commands = log.exchanged("COMMAND_LONG", "command", "param1", "param2").values()
    orders = [c.t[(c["command"] == _ARM_DISARM) & (c["param1"] == 0) & (c["param2"] == _FORCE)] for c in commands]
    forced = np.concatenate([np.empty(0), *orders])
    columns = {"ArmState": armed[changed].astype(np.float64)}
    if commands:  # a recording without any order would not show one by force either
        by_force = [float(np.any((forced >= at - _FORCED_WITHIN_S) & (forced <= at + 1))) for at in t.tolist()]
        columns["Forced"] = np.array(by_force)
    return Table(t, columns)


def _modes(log: _Telemetry) -> Table | None:
    beats = log.heartbeats
    if beats is None:
        return None
    is_new = np.append(True, np.diff(beats["custom_mode"]) != 0)
    return Table(beats.t[is_new], {"ModeNum": beats["custom_mode"][is_new]})


def _messages(log: _Telemetry) -> Table | None:
    """MSG: the vehicle's texts, and in its words what it said of its mission by number only."""
    rows = list(_texts(log))
    for message, words in (("MISSION_ITEM_REACHED", "Reached command #{}"), ("MISSION_CURRENT", "Mission: {} ")):
        table = log.heard(message, "seq")
        if table is None:
            continue
        said = [(t, text) for t, (text,) in rows]
        is_new = np.append(message == "MISSION_ITEM_REACHED", np.diff(table["seq"]) != 0)
        for t, number in zip(table.t[is_new].tolist(), table["seq"][is_new].tolist(), strict=True):
            text = words.format(int(number))
            if not any(abs(t - at) <= _SAME_EVENT_S and known.startswith(text) for at, known in said):
                rows.append((t, (text,)))
    return _to_table(rows, ("Message",))


def _texts(log: _Telemetry) -> Iterator[Sample]:
    """The texts of STATUSTEXT, without the tab at the end by which PX4 marks those that it sends as events, too; a long
    one comes in pieces of the same number."""
    table = log.heard("STATUSTEXT", "text", "id", "chunk_seq")
    if table is None:
        return
    began: tuple[float, int, str] | None = None
    for t, text, number, piece in zip(table.t, table["text"], table["id"], table["chunk_seq"], strict=True):
        if began is not None and (number == 0 or piece == 0 or number != began[1]):
            yield began[0], (began[2].strip(),)
            began = None
        if number == 0:
            yield float(t), (str(text).strip(),)
        elif began is None:
            began = (float(t), int(number), str(text))
        else:
            began = (*began[:2], began[2] + str(text))
    if began is not None:
        yield began[0], (began[2].strip(),)


def _items(log: _Telemetry) -> Table | None:
    """CMD: the mission as the vehicle or, to the vehicle, a ground station sent it. Item 0 is home, no item; here its
    number says how many items there are, as the message before each transfer does."""
    rows: list[Sample] = []
    for message, scale in (("MISSION_ITEM_INT", 1e-7), ("MISSION_ITEM", 1.0)):
        for table in log.exchanged(
            message, "seq", "command", "param1", "param2", "param3", "x", "y", "z", "frame", "mission_type"
        ).values():
            own = table.where((table["mission_type"] == 0) & (table["seq"] > 0))
            columns = (
                own["seq"], own["command"], own["param1"], own["param2"], own["param3"], own["x"] * scale,
                own["y"] * scale, own["z"], own["frame"], np.full(len(own), np.nan),
            )  # fmt: skip
            rows += zip(own.t.tolist(), zip(*(column.tolist() for column in columns), strict=True), strict=True)
    blank = (0.0,) * 9
    announced = sorted(_counts(log))
    if announced and announced[0][-1] and announced[0][0] <= min((t for t, _ in rows), default=np.inf):
        rows.append((0.0, (*blank, 0.0)))  # what was held before the first upload is not known
    rows += [(t, (*blank, count)) for t, count, _ in announced]
    return _to_table(rows, ("CNum", "CId", "Prm1", "Prm2", "Prm3", "Lat", "Lng", "Alt", "Frame", "CTot"))


def _counts(log: _Telemetry) -> Iterator[tuple[float, float, bool]]:
    """When and how many items were announced, and whether to the vehicle; a mission that is cleared has none, and an
    upload that the vehicle declined at once is none."""
    for sender, table in log.exchanged("MISSION_COUNT", "count", "mission_type").items():
        own = table.where(table["mission_type"] == 0)
        for t, count in zip(own.t.tolist(), own["count"].tolist(), strict=True):
            if not sender or not _was_declined(log, t):
                yield t, count, bool(sender)
    for table in log.exchanged("MISSION_CLEAR_ALL", "mission_type").values():
        yield from ((t, 0.0, True) for t in table.t[table["mission_type"] == 0].tolist())


def _was_declined(log: _Telemetry, announced_s: float) -> bool:
    """Whether the vehicle's answer to an upload is that it takes none: it asked for no item before."""
    answers = log.heard("MISSION_ACK", "type", "mission_type")
    if answers is None:
        return False
    own = answers.where((answers["mission_type"] == 0) & (answers.t >= announced_s))
    asked = (log.heard(message, "seq") for message in ("MISSION_REQUEST", "MISSION_REQUEST_INT"))
    later = (float(t) for table in asked if table is not None for t in table.t[table.t >= announced_s][:1])
    return len(own) > 0 and own["type"][0] != 0 and bool(own.t[0] <= min(later, default=np.inf))


def _to_table(rows: Iterable[Sample], fields: tuple[str, ...]) -> Table | None:
    ordered = sorted(rows, key=lambda row: row[0])
    if not ordered:
        return None
    kind = object if isinstance(ordered[0][1][0], str) else np.float64
    columns = {field: np.array([row[at] for _, row in ordered], dtype=kind) for at, field in enumerate(fields)}
    return Table(np.array([t for t, _ in ordered]), columns)


_MADE: Mapping[str, Callable[[_Telemetry], Table | None]] = {
    "ATT": _attitude, "BAT": _batteries, "ORGN": _home, "ARM": _armings, "STAT": _status, "MODE": _modes,
    "MSG": _messages, "CMD": _items,
}  # fmt: skip
_SOURCES: Mapping[str, tuple[str, ...]] = {
    **{name: (message,) for name, (message, _) in _AS_SENT.items()},
    "ATT": ("ATTITUDE",),
    "BAT": ("BATTERY_STATUS", "SYS_STATUS"),
    "ORGN": ("HOME_POSITION",),
    "ARM": ("HEARTBEAT",),
    "STAT": ("HEARTBEAT",),
    "MODE": ("HEARTBEAT",),
    "MSG": ("STATUSTEXT", "MISSION_ITEM_REACHED", "MISSION_CURRENT"),
    "CMD": ("MISSION_ITEM_INT", "MISSION_ITEM"),
}
"""DataFlash message -> the MAVLink messages that it is made of."""
