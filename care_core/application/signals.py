"""Signals of a log to be drawn: what was wanted over what came of it. Runs in worker threads; touches no widget."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING

from care_core.application.open_run import OpenRun, log_of
from care_core.errors import CareError
from care_core.records import Record, replace

if TYPE_CHECKING:
    from care_core.diagnose.records import Diagnosis
    from care_core.logs.base import Channel, Log, Table
    from care_core.numbers import Floats

Source = tuple[str, str]
"""Channel and field."""

SELECTORS = ("I", "Inst", "Instance", "C")
"""Fields that say which of several sensors a value is from: no signals. The first sensor is drawn."""

CLOCKS = ("GMS", "GWk", "TimeUS", "time_usec", "time_boot_ms", "timestamp", "stamp", "secs", "sec", "nsecs", "nanosec")
"""Last parts of fields that say when a message was made: no signals, and they tell the day."""

NO_SIGNALS = {
    "ARM",
    "CMD",
    "ERR",
    "EV",
    "MODE",
    "MSG",
    "ORGN",
    "PARM",
    "VER",
    "logged_messages",
    "/rosout",
    "/rosout_agg",
}
"""Records of what was done and said: there is nothing to draw."""

KNOWN: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "ATT": {"Roll": ("DesRoll", "RollIn"), "Pitch": ("DesPitch", "PitchIn"), "Yaw": ("DesYaw", "YawIn")},
    "CTUN": {"Alt": ("DAlt",), "BarAlt": ("WPAlt",), "CRt": ("DCRt",), "ThO": (), "ThrOut": ()},
    "RATE": {"R": ("RDes",), "P": ("PDes",), "Y": ("YDes",)},
    "PSCN": {"PN": ("TPN",), "VN": ("TVN",)},
    "PSCE": {"PE": ("TPE",), "VE": ("TVE",)},
    "PSCD": {"PD": ("TPD",), "VD": ("TVD",)},
    "STER": {"TurnRate": ("DesTurnRate",)},
    "THR": {"Speed": ("DesSpeed",)},
    "BAT": {"Volt": (), "Curr": ()},
    "CURR": {"Volt": (), "Curr": ()},
    "VIBE": {"VibeX": (), "VibeY": (), "VibeZ": ()},
    "GPS": {"NSats": (), "HDop": (), "Spd": ()},
    "RCOU": {f"C{number}": () for number in range(1, 9)},
    "XKF4": {"SV": (), "SP": (), "SH": (), "SM": ()},
    "NKF4": {"SV": (), "SP": (), "SH": (), "SM": ()},
    "ATTITUDE": {"roll": (), "pitch": (), "yaw": ()},
    "VFR_HUD": {"alt": (), "groundspeed": (), "throttle": (), "climb": ()},
    "SYS_STATUS": {"voltage_battery": (), "current_battery": ()},
    "GPS_RAW_INT": {"satellites_visible": (), "eph": ()},
    "VIBRATION": {"vibration_x": (), "vibration_y": (), "vibration_z": ()},
    "SERVO_OUTPUT_RAW": {f"servo{number}_raw": () for number in range(1, 9)},
    "vehicle_local_position": {"x": ("x",), "y": ("y",), "z": ("z",), "vx": ("vx",), "vy": ("vy",), "vz": ("vz",)},
    "battery_status": {"voltage_v": (), "current_a": (), "remaining": ()},
    "cpuload": {"load": ()},
    "sensor_gps": {"satellites_used": (), "eph": ()},
}
"""Per record the numbers that tell most, each with what was wanted of it, by its names in newer and older logs.

ArduPilot: docs "Log messages"; MAVLink common.xml; PX4 msg/ (`VehicleLocalPositionSetpoint` beside the position).
"""
DEMANDS = {"vehicle_local_position": "vehicle_local_position_setpoint"}
"""Records whose demand is in a record of its own."""

KNOWN_TYPES: Mapping[str, Mapping[str, tuple[str, ...]]] = {
    "Odometry": {
        "twist.twist.linear.x": ("linear.x",),
        "twist.twist.angular.z": ("angular.z",),
        "pose.pose.position.x": (),
        "pose.pose.position.y": (),
    },
    "NavigateToPose_FeedbackMessage": {"feedback.distance_remaining": ()},
    "Twist": {"linear.x": (), "angular.z": ()},
    "BatteryState": {"voltage": (), "percentage": ()},
    "Imu": {"linear_acceleration.z": (), "angular_velocity.z": ()},
    "PoseWithCovarianceStamped": {"pose.pose.position.x": (), "pose.pose.position.y": ()},
}
"""The same by the type of a ROS message; what odometry was to follow is a velocity command."""


LONGEST_GAP = 5.0
"""A line is broken where it has no value for so many of its usual intervals."""


class Signal(Record):
    """A number over time in a log, what it was to follow, and the variables of the profile that are read from it."""

    channel: str
    field: str
    wanted: Source | None = None
    used_by: tuple[str, ...] = ()
    is_beside: bool = False
    """Whether what is drawn with it was no demand, but is another of its kind to compare it with."""

    @property
    def name(self) -> str:
        return f"{self.channel} {self.field}"

    @property
    def wanted_name(self) -> str:
        """What is drawn with it, without what both names share; empty where there is no such thing."""
        if self.wanted is None:
            return ""
        return self.wanted[1] if self.wanted[0] == self.channel else " ".join(self.wanted)


Columns = tuple[tuple[float, float] | None, ...]
"""A line squeezed into columns: per column its least and its greatest value, None where it is broken."""


class Trace(Record):
    """A signal, and what was wanted of it, squeezed into columns from `start_s` to `end_s` of the log."""

    start_s: float
    end_s: float
    columns: Columns
    wanted: Columns
    """Empty where nothing was wanted."""
    low: float
    high: float
    """Between them lies what was measured until the robot was down; what is thrown about later runs along the edge."""
    count: int


def signals_of(case: OpenRun) -> list[Signal]:
    """The signals of a log: those that were to follow something first; of these and of the others first what the
    profile reads for objectives and causal paths, then what it reads else, then what tells most of a log of its kind.

    What another signal was to follow is no signal of its own: it is drawn with that.
    """
    log = log_of(case)
    present = {channel.name: channel for channel in log.channels() if channel.count}
    users = _read_by_profile(case, present)
    held = _recorded_fields(log, present, users)
    known = {(one.channel, one.field): one for one in _known(present, held)}
    found = [replace(known.get(source, Signal(*source)), used_by=names) for source, names in users.items()]
    every = [
        *(one for one in found if (one.channel, one.field) in held),
        *(known[key] for key in known if key not in users),
    ]
    demands = {one.wanted for one in every}
    left = [one for one in every if (one.channel, one.field) not in demands]
    return sorted(left, key=lambda one: one.wanted is None)


def _read_by_profile(case: OpenRun, present: Collection[str]) -> dict[Source, tuple[str, ...]]:
    """What the profile's extractors read, with the variables it is read for, those that matter most first."""
    from care_core.ecosystems.measures import find_extractor

    users: dict[Source, list[str]] = {}
    for variable in case.schema.variables.values() if case.schema else ():
        if variable.extract is None:
            continue
        needs = find_extractor(variable.extract.kind).needs(variable.extract.args)
        for channel, fields in needs.items():
            for field in fields:
                is_signal = field not in SELECTORS and field.rsplit(".", 1)[-1] not in CLOCKS
                if is_signal and channel in present and channel not in NO_SIGNALS:
                    users.setdefault((channel, field), []).append(variable.name)
    matters = {result.variable.name for result in case.diagnosis.objectives}
    matters |= {node.name for fault in case.diagnosis.faults for cause in fault.causes for node in cause.path}
    # What every variable needs, such as to find the mission, tells least about any of them.
    ranked = sorted(users, key=lambda source: -len(matters & set(users[source])) / len(users[source]))
    return {source: tuple(sorted(users[source], key=lambda name: name not in matters)) for source in ranked}


def _recorded_fields(log: Log, present: Mapping[str, Channel], read: Iterable[Source]) -> set[Source]:
    """Which of the fields that are known or read the log really has. A ROS message has the fields of its type."""
    asked: dict[str, set[str]] = {}
    for name in present:
        for record in (name, DEMANDS.get(name, name)):
            for field, wanted in KNOWN.get(name, {}).items():
                asked.setdefault(record, set()).update((field, *wanted))
    for channel, field in read:
        asked.setdefault(channel, set()).add(field)
    topics = {(channel, field) for channel in asked if channel.startswith("/") for field in asked[channel]}
    records = {name: sorted(fields) for name, fields in asked.items() if name in present and not name.startswith("/")}
    return topics | {(name, field) for name, table in log.read(records).items() for field in table.columns}


def _known(present: Mapping[str, Channel], held: Collection[Source]) -> Iterator[Signal]:
    """The signals that every log of its kind has, as far as this one has them."""
    commands = sorted((name for name, one in present.items() if type_name(one.type) == "Twist"), key=len)
    command = next((name for name in commands if name.endswith("cmd_vel")), "")
    for name, channel in present.items():
        if name.startswith("/"):
            for field, wanted in KNOWN_TYPES.get(type_name(channel.type), {}).items():
                yield Signal(name, field, (command, wanted[0]) if command and wanted else None)
            continue
        for field, wanted in KNOWN.get(name, {}).items():
            demands = ((DEMANDS.get(name, name), one) for one in wanted)
            if (name, field) in held:
                yield Signal(name, field, next((demand for demand in demands if demand in held), None))


def type_name(type: str) -> str:
    """The bare name of a ROS type: geometry_msgs/Twist, geometry_msgs/msg/TwistStamped."""
    return type.rsplit("/", 1)[-1]


def whole_of(case: OpenRun) -> tuple[float, float]:
    """The span of the log that is drawn at first: the mission, or all of the log where it has none."""
    mission = case.diagnosis.run.mission
    if mission.end_s > mission.start_s:
        return mission.start_s, mission.end_s
    return 0.0, max(log_of(case).duration_s, 1e-9)


def settled_s(diagnosis: Diagnosis) -> float:
    """When the run was over, crashed or back on the ground: what is measured later tells nothing of it."""
    from care_core.ecosystems.findings import every_finding

    health = diagnosis.health
    down = [one.onset_s for one in every_finding(health.findings) if one.kind == "crash"]
    down += [one.time_s for one in health.timeline if one.kind == "crash" or one.text == "landed"]
    return max(down) if down else math.inf


def trace_of(case: OpenRun, signal: Signal, span: tuple[float, float], columns: int) -> Trace:
    """The signal, and what was wanted of it, over a span of the log in so many columns.

    Raises:
        CareError: the log holds no number there.
    """
    sources = [(signal.channel, signal.field), *([signal.wanted] if signal.wanted else [])]
    found = shown_lines(case, sources, span)
    lines = [found[source] for source in sources]
    if lines[0] is None:
        raise CareError(f"The log holds no numbers in {signal.name}.", hint="Choose another signal.")
    count = len(lines[0][1])
    if not count:
        where = f"from {span[0]:.1f} to {span[1]:.1f} s"
        raise CareError(f"{signal.name} has no value {where}.", hint="Choose another signal, or - for more of the log.")
    drawn = [line for line in lines if line is not None and len(line[1])]
    squeezed = [_squeezed(t, values, span, columns) for t, values in drawn]
    end_s = settled_s(case.diagnosis)
    until = [values[t <= end_s] for t, values in drawn]
    scale = [values for values in until if len(values)] or [values for _, values in drawn]
    low, high = min(float(v.min()) for v in scale), max(float(v.max()) for v in scale)
    return Trace(*span, squeezed[0], squeezed[1] if len(squeezed) > 1 else (), low, high, count)


Line = tuple["Floats", "Floats"]
"""Times in seconds of the log and values, both of shape (n,)."""


def lines_of(case: OpenRun, sources: Iterable[Source], span: tuple[float, float]) -> dict[Source, Line | None]:
    """Signals over a span of the log, read in one pass, of the first sensor where there are several; None where the
    log holds no numbers of that name."""
    asked: dict[str, list[str]] = {}
    wanted = list(dict.fromkeys(sources))
    for channel, field in wanted:
        asked.setdefault(channel, [] if channel.startswith("/") else list(SELECTORS)).append(field)
    tables = log_of(case).read(asked)
    return {(channel, field): _line(tables.get(channel), field, span) for channel, field in wanted}


_AS_READ: Mapping[str, tuple[str, float]] = {
    "rad": ("deg", math.degrees(1.0)),
    "rad/s": ("deg/s", math.degrees(1.0)),
    "mV": ("V", 1e-3),
    "cA": ("A", 1e-2),
}
"""Units of the wire, those that people read instead, and what makes these of them."""


def as_read(log: Log, unit: str) -> tuple[str, float]:
    """The unit in which people read a signal, and the factor to it. Parameters of ROS robots are in radians."""
    return (unit, 1.0) if log.format.ecosystem == "ros" else _AS_READ.get(unit, (unit, 1.0))


def shown_lines(case: OpenRun, sources: Iterable[Source], span: tuple[float, float]) -> dict[Source, Line | None]:
    """The same as `lines_of` in the units in which they are shown."""
    from care_core.ecosystems.registry import ecosystem_of

    log, found = log_of(case), lines_of(case, sources, span)
    ecosystem, channels = ecosystem_of(log.format), {channel.name: channel for channel in log.channels()}
    for (channel, field), line in found.items():
        known = ecosystem.field(channels[channel], field) if channel in channels else None
        factor = 1.0 if known is None else as_read(log, known.unit)[1]
        if line is not None and factor != 1.0:
            found[channel, field] = line[0], line[1] * factor
    return found


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


def _squeezed(t: Floats, values: Floats, span: tuple[float, float], columns: int) -> Columns:
    import numpy as np

    from care_core.numbers import median

    place = np.clip(((t - span[0]) / max(span[1] - span[0], 1e-9) * columns).astype(int), 0, columns - 1)
    low, high = np.full(columns, np.inf), np.full(columns, -np.inf)
    np.minimum.at(low, place, values)
    np.maximum.at(high, place, values)
    known = np.flatnonzero(low <= high)
    if len(known) > 1:  # where samples are rarer than columns, a line joins them
        every = np.arange(columns)
        after = np.clip(np.searchsorted(known, every), 1, len(known) - 1)
        width_s = (span[1] - span[0]) / columns
        is_joined = (known[after] - known[after - 1]) * width_s <= LONGEST_GAP * float(median(np.diff(t))) + width_s
        joined = is_joined & (low > high) & (every > known[0]) & (every < known[-1])
        low[joined] = high[joined] = np.interp(every[joined], known, (low[known] + high[known]) / 2)
    return tuple((float(least), float(most)) if least <= most else None for least, most in zip(low, high, strict=True))
