"""Signals of a log to be drawn: what was wanted over what came of it. Runs in worker threads; touches no widget."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from care_core.application.case import Case
from care_core.application.viewing import TEXTS, log_of
from care_core.errors import CareError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from care_core.logs.base import Log, Table

Source = tuple[str, str]
"""Channel and field."""

SELECTORS = ("I", "Inst", "Instance", "C")
"""Fields that say which of several sensors a value is from: no signals. The first sensor is drawn."""

KNOWN: Mapping[str, Mapping[str, str | None]] = {
    "ATT": {"Roll": "DesRoll", "Pitch": "DesPitch", "Yaw": "DesYaw"},
    "CTUN": {"Alt": "DAlt", "BarAlt": "WPAlt", "CRt": "DCRt", "ThO": None, "ThrOut": None},
    "RATE": {"R": "RDes", "P": "PDes", "Y": "YDes"},
    "PSCN": {"PN": "TPN", "VN": "TVN"},
    "PSCE": {"PE": "TPE", "VE": "TVE"},
    "PSCD": {"PD": "TPD", "VD": "TVD"},
    "STER": {"TurnRate": "DesTurnRate"},
    "THR": {"Speed": "DesSpeed"},
    "BAT": {"Volt": None, "Curr": None},
    "CURR": {"Volt": None, "Curr": None},
    "VIBE": {"VibeX": None, "VibeY": None, "VibeZ": None},
    "GPS": {"NSats": None, "HDop": None, "Spd": None},
    "RCOU": {f"C{number}": None for number in range(1, 9)},
    "XKF4": {"SV": None, "SP": None, "SH": None, "SM": None},
    "NKF4": {"SV": None, "SP": None, "SH": None, "SM": None},
    "ATTITUDE": {"roll": None, "pitch": None, "yaw": None},
    "VFR_HUD": {"alt": None, "groundspeed": None, "throttle": None, "climb": None},
    "SYS_STATUS": {"voltage_battery": None, "current_battery": None},
    "GPS_RAW_INT": {"satellites_visible": None, "eph": None},
    "VIBRATION": {"vibration_x": None, "vibration_y": None, "vibration_z": None},
    "SERVO_OUTPUT_RAW": {f"servo{number}_raw": None for number in range(1, 9)},
    "vehicle_local_position": {"x": "x", "y": "y", "z": "z", "vx": "vx", "vy": "vy", "vz": "vz"},
    "battery_status": {"voltage_v": None, "current_a": None, "remaining": None},
    "cpuload": {"load": None},
    "sensor_gps": {"satellites_used": None, "eph": None},
}
"""Per record the numbers that tell most, each with the one of the same record that was wanted of it.

ArduPilot: docs "Log messages"; MAVLink common.xml; PX4 msg/ (`VehicleLocalPositionSetpoint` beside the position).
"""
DEMANDS = {"vehicle_local_position": "vehicle_local_position_setpoint"}
"""Records whose demand is in a record of its own."""

KNOWN_TYPES: Mapping[str, Mapping[str, str | None]] = {
    "Odometry": {
        "twist.twist.linear.x": "linear.x",
        "twist.twist.angular.z": "angular.z",
        "pose.pose.position.x": None,
        "pose.pose.position.y": None,
    },
    "Twist": {"linear.x": None, "angular.z": None},
    "BatteryState": {"voltage": None, "percentage": None},
    "Imu": {"linear_acceleration.z": None, "angular_velocity.z": None},
    "PoseWithCovarianceStamped": {"pose.pose.position.x": None, "pose.pose.position.y": None},
}
"""The same by the type of a ROS message; what odometry was to follow is a velocity command."""


@dataclass(frozen=True, slots=True)
class Signal:
    """A number over time in a log, what it was to follow, and the variables of the profile that are read from it."""

    channel: str
    field: str
    wanted: Source | None = None
    used_by: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        return f"{self.channel} {self.field}"

    @property
    def wanted_name(self) -> str:
        """What it was to follow, without what both names share; empty where there is no such thing."""
        if self.wanted is None:
            return ""
        return self.wanted[1] if self.wanted[0] == self.channel else " ".join(self.wanted)


Columns = tuple[tuple[float, float] | None, ...]
"""A line squeezed into columns: per column its least and its greatest value, None where there is none."""


@dataclass(frozen=True, slots=True)
class Trace:
    """A signal, and what was wanted of it, squeezed into columns from `start_s` to `end_s` of the log."""

    start_s: float
    end_s: float
    columns: Columns
    wanted: Columns
    """Empty where nothing was wanted."""
    low: float
    high: float
    count: int


def signals_of(case: Case) -> list[Signal]:
    """The signals of a log: those that were to follow something first; of these and of the others first what the
    profile reads for objectives and causal paths, then what it reads else, then what tells most of a log of its kind.

    What another signal was to follow is no signal of its own: it is drawn with that.
    """
    log = log_of(case)
    known = {(one.channel, one.field): one for one in _known(log)}
    found = {}
    for source, used_by in _read_by_profile(case, log).items():
        follows = known[source].wanted if source in known else None
        found[source] = Signal(*source, follows, used_by)
    every = [*found.values(), *(one for source, one in known.items() if source not in found)]
    demands = {one.wanted for one in every}
    left = [one for one in every if (one.channel, one.field) not in demands]
    return sorted(left, key=lambda one: one.wanted is None)


def _read_by_profile(case: Case, log: Log) -> dict[Source, tuple[str, ...]]:
    """What the profile's extractors read, with the variables it is read for, those that matter most first."""
    from care_core.extract.registry import find_extractor

    present = {channel.name for channel in log.channels()}
    users: dict[Source, list[str]] = {}
    for variable in case.schema.variables.values() if case.schema else ():
        if variable.extract is None:
            continue
        needs = find_extractor(variable.extract.kind).needs(variable.extract.args)
        for channel, fields in needs.items():
            for field in fields:
                if channel in present and channel not in TEXTS and field not in SELECTORS:
                    users.setdefault((channel, field), []).append(variable.name)
    matters = {result.variable.name for result in case.diagnosis.objectives}
    matters |= {node.name for fault in case.diagnosis.faults for cause in fault.causes for node in cause.path}
    # What every variable needs, such as to find the mission, tells least about any of them.
    ranked = sorted(users, key=lambda source: -len(matters & set(users[source])) / len(users[source]))
    return {source: tuple(sorted(users[source], key=lambda name: name not in matters)) for source in ranked}


def _known(log: Log) -> Iterable[Signal]:
    """The signals that every log of its kind has, as far as this one has them."""
    channels = {channel.name: channel for channel in log.channels() if channel.count}
    commands = sorted((name for name, one in channels.items() if _of_type(one.type) == "Twist"), key=len)
    for name, channel in channels.items():
        if name.startswith("/"):
            for field, wanted in KNOWN_TYPES.get(_of_type(channel.type), {}).items():
                command = next((one for one in commands if one.endswith("cmd_vel")), None)
                yield Signal(name, field, (command, wanted) if command and wanted else None)
    recorded = {name: fields for name, fields in KNOWN.items() if name in channels}
    asked = {name: {*fields, *filter(None, fields.values())} for name, fields in recorded.items()}
    asked |= {DEMANDS[name]: asked[name] for name in recorded if DEMANDS.get(name) in channels}
    held = {name: set(table.columns) for name, table in log.read({k: sorted(v) for k, v in asked.items()}).items()}
    for name, fields in recorded.items():
        source = DEMANDS.get(name, name)
        for field, wanted in fields.items():
            if field in held.get(name, ()):
                yield Signal(name, field, (source, wanted) if wanted and wanted in held.get(source, ()) else None)


def _of_type(type: str) -> str:
    """The bare name of a ROS type: geometry_msgs/Twist, geometry_msgs/msg/TwistStamped."""
    return type.rsplit("/", 1)[-1]


def whole_of(case: Case) -> tuple[float, float]:
    """The span of the log that is drawn at first: the mission, or all of the log where it has none."""
    mission = case.diagnosis.run.mission
    if mission.end_s > mission.start_s:
        return mission.start_s, mission.end_s
    return 0.0, max(log_of(case).duration_s, 1e-9)


def trace_of(case: Case, signal: Signal, span: tuple[float, float], columns: int) -> Trace:
    """The signal, and what was wanted of it, over a span of the log in so many columns.

    Raises:
        CareError: the log holds no number there.
    """
    sources = [(signal.channel, signal.field), *([signal.wanted] if signal.wanted else [])]
    asked: dict[str, list[str]] = {}
    for channel, field in sources:
        asked.setdefault(channel, [] if channel.startswith("/") else list(SELECTORS)).append(field)
    tables = log_of(case).read(asked)
    lines = [_line(tables.get(channel), field, span) for channel, field in sources]
    if lines[0] is None:
        raise CareError(f"The log holds no numbers in {signal.name}.", hint="Choose another signal.")
    count = len(lines[0][1])
    if not count:
        where = f"from {span[0]:.1f} to {span[1]:.1f} s"
        raise CareError(f"{signal.name} has no value {where}.", hint="Choose another signal, or - for more of the log.")
    drawn = [line for line in lines if line is not None and len(line[1])]
    squeezed = [_squeezed(t, values, span, columns) for t, values in drawn]
    low, high = min(float(v.min()) for _, v in drawn), max(float(v.max()) for _, v in drawn)
    return Trace(*span, squeezed[0], squeezed[1] if len(squeezed) > 1 else (), low, high, count)


Line = tuple["NDArray[np.float64]", "NDArray[np.float64]"]


def _line(table: Table | None, field: str, span: tuple[float, float]) -> Line | None:
    """Times and values of a field within a span, of the first sensor where there are several; None: no numbers."""
    import numpy as np

    if table is None or field not in table.columns or table[field].dtype.kind not in "fiub":
        return None
    table = table.between(*span)
    for selector in SELECTORS:
        if selector in table.columns and selector != field and len(table):
            table = table.where(table[selector] == table[selector].min())
            break
    values = table[field].astype(float)
    good = np.isfinite(values)
    return table.t[good], values[good]


def _squeezed(t: NDArray[np.float64], values: NDArray[np.float64], span: tuple[float, float], columns: int) -> Columns:
    import numpy as np

    place = np.clip(((t - span[0]) / max(span[1] - span[0], 1e-9) * columns).astype(int), 0, columns - 1)
    low, high = np.full(columns, np.inf), np.full(columns, -np.inf)
    np.minimum.at(low, place, values)
    np.maximum.at(high, place, values)
    return tuple((float(least), float(most)) if least <= most else None for least, most in zip(low, high, strict=True))
