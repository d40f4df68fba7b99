"""A look at a PX4 log: what the vehicle was, did and said, and what its own checks found.

Topics and fields are those of PX4's message definitions (msg/*.msg), old names beside new ones.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from care_core.ecosystems.base import RunModel
from care_core.ecosystems.findings import NOT_FLOWN, TOO_SHORT, Event, Finding, FindingKind, Health, Severity, Suspect
from care_core.ecosystems.ranking import Explains, rank_findings
from care_core.ecosystems.timeline import counted, damage_of, gaps, parameter_changes, repeats, timeline_of
from care_core.ecosystems.vehicles import mode_name, vehicle_of
from care_core.ecosystems.vehicles.arming import KILLED, KILLED_ALOFT_M
from care_core.logs.base import Table, Wanted
from care_core.records import Record

Floats = NDArray[np.float64]
Span = tuple[float, float]

MESSAGES = "logged_messages"
STATUS = "vehicle_status"

_ARMED = 2
"""arming_state: 2 has meant armed in every version (vehicle_status.msg)."""
_REJECTED = 1.0
"""A sensor whose innovation test ratio is above 1 is not used by EKF2 (estimator_status.msg)."""
_REJECTED_FOR_S = 1.0
_3D = 3
_FIXES = {0: "no fix", 1: "no fix", 2: "2D fix", 3: "3D fix", 4: "3D fix, DGPS", 5: "3D fix, RTK float",
          6: "3D fix, RTK fixed", 8: "extrapolated"}  # fmt: skip
_SAID_WITHIN_S = 1.0
_IN_AIR_M = 2.0
_SAGS = 0.9
_IDLE_S = 60.0
_TOO_SHORT_S = 2.0


class Flag(Record):
    """A flag of the vehicle, what it means while armed, and of what kind the finding is (None: told, no finding)."""

    topic: str
    field: str
    means: str
    kind: FindingKind | None = None
    severity: Severity = "warning"
    suspect: Suspect = "hardware"
    is_bad_at: int = 1


_FLAGS = (
    Flag(STATUS, "failsafe", "failsafe"),
    Flag(STATUS, "rc_signal_lost", "radio lost", "radio"),
    Flag(STATUS, "data_link_lost", "ground station lost", "radio", "info"),
    Flag(STATUS, "engine_failure", "engine failure", "motor", "critical"),
    Flag(STATUS, "mission_failure", "mission cannot be flown", "planner", "warning", "operation"),
    Flag("failsafe_flags", "manual_control_signal_lost", "radio lost", "radio"),
    Flag("failsafe_flags", "gcs_connection_lost", "ground station lost", "radio", "info"),
    Flag("failsafe_flags", "battery_unhealthy", "battery unhealthy", "battery", "critical"),
    Flag("failsafe_flags", "battery_low_remaining_time", "battery will not last to reach home", "battery"),
    Flag("failsafe_flags", "geofence_breached", "geofence breached", None),
    Flag("failsafe_flags", "local_position_invalid", "no valid local position", "estimator"),
    Flag("failsafe_flags", "global_position_invalid", "no valid global position", "gps"),
    Flag("failsafe_flags", "attitude_invalid", "no valid attitude", "estimator", "critical"),
    Flag("failsafe_flags", "angular_velocity_invalid", "no valid rotation rate", "imu", "critical"),
    Flag("failsafe_flags", "wind_limit_exceeded", "wind above its limit", None),
    Flag("failsafe_flags", "fd_critical_failure", "attitude beyond the failure detector's limits", "attitude",
         "critical"),
    Flag("failsafe_flags", "fd_motor_failure", "motor failure", "motor", "critical"),
    Flag("failsafe_flags", "fd_esc_arming_failure", "an ESC did not arm", "motor", "critical"),
    Flag("failsafe_flags", "fd_imbalanced_prop", "imbalanced propeller", "vibration"),
    Flag("vehicle_status_flags", "condition_battery_healthy", "battery unhealthy", "battery", "critical", is_bad_at=0),
    Flag("vehicle_status_flags", "vtol_transition_failure", "transition failed", "attitude"),
    Flag("estimator_status_flags", "cs_mag_field_disturbed", "magnetic field disturbed", "compass"),
    Flag("estimator_status_flags", "cs_mag_fault", "compass given up by the estimator", "compass"),
    Flag("estimator_status_flags", "cs_inertial_dead_reckoning", "estimator without position aid", "estimator"),
    Flag("estimator_status_flags", "fs_bad_acc_vertical", "vertical accelerations make no sense", "vibration"),
    Flag("estimator_status_flags", "fs_bad_acc_clipping", "accelerometers clip", "vibration"),
)  # fmt: skip
"""What the vehicle itself holds for wrong (vehicle_status, failsafe_flags, estimator_status_flags)."""

_RATIOS: Mapping[str, tuple[str, FindingKind]] = {
    "vel_test_ratio": ("velocity", "gps"), "pos_test_ratio": ("position", "gps"),
    "hgt_test_ratio": ("height", "barometer"), "mag_test_ratio": ("compass", "compass"),
}  # fmt: skip
_WARNINGS = {1: "low", 2: "critical", 3: "at its emergency level", 4: "failed"}
"""battery_status.warning."""

EXPLAINS: Explains = {
    "motor": frozenset(("attitude", "crash", "vibration")), "battery": frozenset(("motor", "crash")),
    "gps": frozenset(("estimator", "planner")), "compass": frozenset(("estimator", "attitude")),
    "vibration": frozenset(("estimator", "attitude")), "estimator": frozenset(("attitude", "crash")),
    "imu": frozenset(("estimator", "attitude")), "attitude": frozenset(("crash",)),
}  # fmt: skip

READS: Wanted = {
    MESSAGES: ("level", "message"),
    STATUS: ("arming_state", "nav_state", *(flag.field for flag in _FLAGS if flag.topic == STATUS)),
    **{topic: tuple(flag.field for flag in _FLAGS if flag.topic == topic)
       for topic in ("failsafe_flags", "vehicle_status_flags", "estimator_status_flags")},
    "vehicle_land_detected": ("landed",),
    "vehicle_local_position": ("z",),
    "battery_status": ("voltage_v", "current_a", "cell_count", "warning", "connected"),
    "vehicle_gps_position": ("fix_type", "satellites_used", "hdop"),
    "sensor_gps": ("fix_type", "satellites_used", "hdop"),
    "estimator_status": tuple(_RATIOS),
    "sensor_combined": ("gyro_rad[0]",),
}  # fmt: skip

_MARKS = re.compile(r"\x1b?\[\d+m")
_ROUTINE = re.compile(
    r"\[(logger|mavlink|px4|tone_alarm|init|uavcan|dataman|load_mon|gps)\]|Ready for takeoff|Using default takeoff"
    r"|home set|mavlink: |ROMFS|Takeoff detected|Landing detected|arming warning|notify"
)
_PREFLIGHT = re.compile(r"Preflight|Not ready|PREFLIGHT|NOT READY|arming denied|Arming denied|ARMING DENIED", re.I)
_ARMED_BY = re.compile(r"\[commander\] (?:Armed|Disarmed) (by .+)")
_NOT_READY = re.compile(r"^(?:Not ready to fly|Preflight(?: Fail)?): ?", re.IGNORECASE)
_FALLING: frozenset[FindingKind] = frozenset(("attitude", "motor", "vibration", "estimator", "crash", "imu"))
_SPEAKER = re.compile(r"^\[\w+\]\s*")
_SPOKEN_LEVELS = frozenset(("EMERGENCY", "ALERT", "CRITICAL", "ERROR", "WARNING"))
_SPOKEN_BY = re.compile(r"\[(commander|navigator|failsafe|flight_mode_manager|vtol_att_control|land_detector)\]")


class Px4Flight(Record, dict=True):
    """One log of a PX4 vehicle."""

    tables: Mapping[str, Table]
    end_s: float

    def one(self, topic: str, *fields: str) -> Table | None:
        """A topic with rows and all of these fields, None where the log lacks one."""
        table = self.tables.get(topic)
        return table if table is not None and len(table) and set(fields) <= table.columns.keys() else None

    @cached_property
    def arming(self) -> tuple[tuple[float, bool], ...]:
        """Whether it was armed at first, and when that changed."""
        table = self.one(STATUS, "arming_state")
        return tuple((t, state == _ARMED) for t, state in _changes(table, "arming_state")) if table else ()

    @cached_property
    def armed(self) -> tuple[Span, ...]:
        spans: list[Span] = []
        start: float | None = None
        for t, is_armed in self.arming:
            if is_armed:
                start = t if start is None else start
            elif start is not None:
                spans.append((start, t))
                start = None
        return (*spans, (start, self.end_s)) if start is not None else tuple(spans)

    @cached_property
    def words(self) -> tuple[tuple[float, str, str], ...]:
        """Time, level and text of what the firmware said."""
        table = self.one(MESSAGES, "level", "message")
        if table is None:
            return ()
        rows = zip(table.t.tolist(), table["level"].tolist(), table["message"].tolist(), strict=True)
        return tuple((t, str(level), _MARKS.sub("", str(text)).strip()) for t, level, text in rows)

    def how(self, t: float) -> str:
        """What the commander says of an arming or disarming at a time: "by landing"."""
        said = [_ARMED_BY.match(text) for at, _, text in self.words if abs(at - t) < _SAID_WITHIN_S]
        return next((match[1] for match in said if match), "")

    @cached_property
    def killed_s(self) -> float | None:
        """When the kill switch cut its motors while it was armed, as the commander says."""
        return next((t for t, _, text in self.words if KILLED.search(text) and _within(self.armed, t)), None)

    @cached_property
    def killed_m(self) -> float | None:
        """How high it was above where the log began when the kill switch cut its motors; None where it did not, or no
        height is told. The land detector is no witness: many a pilot kills what it does not let disarm."""
        position = self.one("vehicle_local_position", "z")
        if self.killed_s is None or position is None:
            return None
        return float(position["z"][0] - np.interp(self.killed_s, position.t, position["z"]))

    @cached_property
    def complaints(self) -> tuple[tuple[float, str], ...]:
        """What kept it from arming, by its own words."""
        return tuple((t, _SPEAKER.sub("", text)) for t, _, text in self.words if _PREFLIGHT.search(text))


def examine(model: RunModel) -> Health:
    """What happened in a ULog."""
    log, tables = model.log, model.tables({name: fields for name, fields in READS.items() if fields})
    flight = Px4Flight(tables, _end(tables, log.duration_s))
    vehicle = vehicle_of(log.facts, log.settings())
    hardware = log.facts.get("hardware", "")
    introduction = Event(0.0, "vehicle", ", ".join(filter(None, (vehicle.title, hardware))), STATUS)
    states = tuple(_states(flight))
    moments = [
        *_arming(flight),
        *_modes(flight),
        *_landings(flight),
        *(moment for moment, _ in states),
        *_spoken(flight),
        *_battery(flight),
        *_gps(flight),
        *parameter_changes(log.settings(), flight.armed, "parameters"),
        *gaps(tables.values(), flight.armed),
        *damage_of(log.damage),
        *_cut(flight, log.duration_s),
    ]
    found = [finding for _, finding in states if finding and not _after_kill(flight, finding)]
    findings = rank_findings((*found, *_killed(flight), *_refused(flight)), EXPLAINS)
    too_little = TOO_SHORT if STATUS not in tables or flight.end_s < _TOO_SHORT_S else "" if flight.armed else NOT_FLOWN
    return Health(vehicle.title, timeline_of(moments, introduction), findings, too_little)


def _killed(flight: Px4Flight) -> Iterator[Finding]:
    """Motors that somebody cut in the air. What its attitude does from then on says nothing."""
    if flight.killed_s is not None and flight.killed_m is not None and flight.killed_m > KILLED_ALOFT_M:
        yield Finding(
            "crash", "the kill switch cut the motors in the air", flight.killed_s, flight.end_s, "critical",
            f"the commander says so, {flight.killed_m:.1f} m above where the log begins",
            f"{MESSAGES}; vehicle_local_position.z", "operation", probability=0.9,
        )  # fmt: skip


def _after_kill(flight: Px4Flight, finding: Finding) -> bool:
    """Whether a finding tells only of a vehicle that falls, or lies, with its motors cut."""
    return flight.killed_s is not None and finding.onset_s >= flight.killed_s and finding.kind in _FALLING


def _within(spans: Iterable[Span], t: float) -> bool:
    return any(start <= t <= end for start, end in spans)


def _end(tables: Mapping[str, Table], duration_s: float) -> float:
    """When the recording really ended: a last message long after everything else is a wrong stamp."""
    t = np.unique(np.concatenate([*(table.t for table in tables.values()), [duration_s]]))
    late = np.flatnonzero(np.diff(t) > _IDLE_S)
    return float(t[late[0]]) if len(late) and len(t) - late[0] < len(t) / 10 else duration_s


def _changes(table: Table, field: str) -> Iterator[tuple[float, float]]:
    """The first value of a field and every change of it."""
    values = table[field]
    known = np.flatnonzero(np.isfinite(values))
    if len(known):
        for row in known[np.append(True, np.diff(values[known]) != 0)].tolist():
            yield float(table.t[row]), float(values[row])


def _arming(flight: Px4Flight) -> Iterator[Event]:
    since: float | None = None
    for at, (t, is_armed) in enumerate(flight.arming):
        how = f" {flight.how(t)}" if flight.how(t) else ""
        if is_armed:
            since = t
            yield Event(t, "arming", "armed when the log begins" if at == 0 else f"armed{how}", STATUS)
        elif at:
            lasted = f", armed for {t - since:.0f} s" if since is not None else ""
            yield Event(t, "arming", f"disarmed{how}{lasted}", STATUS)
    if flight.complaints and not flight.armed:
        last = flight.complaints[-1][0]
        standing = dict.fromkeys(text for t, text in flight.complaints if t >= last - _SAID_WITHIN_S)
        yield Event(
            last, "arming", f"it never armed: {'; '.join(_NOT_READY.sub('', one) for one in standing)}", MESSAGES
        )
    else:
        yield from repeats([Event(t, "arming", text, MESSAGES) for t, text in flight.complaints])


def _modes(flight: Px4Flight) -> Iterator[Event]:
    table = flight.one(STATUS, "nav_state")
    for t, mode in _changes(table, "nav_state") if table else ():
        yield Event(t, "mode", f"mode {mode_name('px4', int(mode))}", STATUS)


def _landings(flight: Px4Flight) -> Iterator[Event]:
    """Taking off and landing by the land detector, and the highest point between."""
    table = flight.one("vehicle_land_detected", "landed")
    for at, (t, landed) in enumerate(_changes(table, "landed") if table else ()):
        if at or not landed:
            yield Event(t, "flight", "landed" if landed else "took off", "vehicle_land_detected")
    position = flight.one("vehicle_local_position", "z")
    for start, end in flight.armed if position else ():
        part = position.between(start, end) if position else None
        height = part["z"][0] - part["z"] if part is not None and len(part) else np.empty(0)
        if part is not None and len(height) and np.nanmax(height) > _IN_AIR_M:
            top = int(np.nanargmax(height))
            yield Event(float(part.t[top]), "flight", f"highest point, {height[top]:.1f} m",
                         "vehicle_local_position")  # fmt: skip


def _states(flight: Px4Flight) -> Iterator[tuple[Event, Finding | None]]:
    """What the vehicle's own checks held for wrong while it was armed, each with its finding where it is one."""
    for flag in _FLAGS:
        table = flight.one(flag.topic, flag.field)
        if table is not None:
            bad = table[flag.field] == flag.is_bad_at
            yield from _state(flight, table.t, bad, flag, f"{flag.topic}.{flag.field}")
    ratios = flight.one("estimator_status")
    for field, (what, kind) in _RATIOS.items() if ratios else ():
        if ratios is not None and field in ratios.columns:
            flag = Flag("estimator_status", field, f"estimator rejects {what}", kind)
            yield from _state(flight, ratios.t, ratios[field] > _REJECTED, flag, f"estimator_status.{field} above 1",
                              _REJECTED_FOR_S)  # fmt: skip


def _state(
    flight: Px4Flight, t: Floats, bad: NDArray[np.bool_], flag: Flag, source: str, at_least_s: float = 0.0
) -> Iterator[tuple[Event, Finding | None]]:
    """A state that began while the vehicle was armed; one that held before, or from its first record on, it was armed
    with: flown by a ground station alone it never had a radio to lose."""
    spans = [
        span for span in _runs(t, bad) if span[1] - span[0] >= at_least_s and span[0] > t[0] and _began(flight, span[0])
    ]
    if not spans:
        return
    start, end = spans[0]
    lasting = f" ({len(spans)} times until {spans[-1][0]:.0f} s)" if len(spans) > 1 else f" for {end - start:.1f} s"
    kind = "failsafe" if flag.field == "failsafe" else "error"
    moment = Event(start, kind, flag.means + lasting, flag.topic)
    if flag.kind is None:
        yield moment, None
        return
    yield moment, Finding(
        flag.kind, flag.means, start, spans[-1][1], flag.severity, f"{flag.means}{lasting}, by the vehicle's own check",
        source, flag.suspect,
    )  # fmt: skip


def _began(flight: Px4Flight, t: float) -> bool:
    return any(start < t <= end for start, end in flight.armed)


def _runs(t: Floats, mask: NDArray[np.bool_]) -> list[Span]:
    """Spans in which a mask holds, each until the next row in which it does not."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(np.int8)))
    ends = np.minimum(edges[1::2], len(t) - 1)
    return list(zip(t[edges[::2]].tolist(), t[ends].tolist(), strict=True))


def _spoken(flight: Px4Flight) -> Iterator[Event]:
    """Warnings of anybody, and what the parts that fly it say."""
    spoken = []
    for t, level, text in flight.words:
        is_loud = level in _SPOKEN_LEVELS or (_SPOKEN_BY.match(text) is not None and not _ROUTINE.search(text))
        if not is_loud or _PREFLIGHT.search(text) or _ARMED_BY.match(text):
            continue
        kind = "failsafe" if "failsafe" in text.casefold() else "crash" if "crash" in text.casefold() else "message"
        spoken.append(Event(t, kind, _SPEAKER.sub("", text), MESSAGES))
    yield from repeats(spoken)


def _battery(flight: Px4Flight) -> Iterator[Event]:
    table = flight.one("battery_status", "voltage_v")
    if table is None:
        return
    sane = table.where((table["voltage_v"] > 1.0) & (table.columns.get("connected", np.ones(len(table))) == 1))
    if not len(sane):
        return
    at = flight.armed[0][0] if flight.armed else float(sane.t[0])
    before = sane.between(-math.inf, at)
    row = len(before) - 1 if len(before) else 0
    volts, count = float(sane["voltage_v"][row]), int(sane.columns.get("cell_count", np.zeros(len(sane)))[row])
    pack = f" ({count} cells)" if count > 1 else ""
    yield Event(max(at, float(sane.t[row])), "battery", f"battery at {volts:.1f} V{pack}", "battery_status")
    yield from _battery_worst(flight, sane, volts)


def _battery_worst(flight: Px4Flight, table: Table, volts: float) -> Iterator[Event]:
    parts = [part for span in flight.armed if len(part := table.between(*span))]
    for part in parts:
        low = int(np.argmin(part["voltage_v"]))
        if part["voltage_v"][low] < _SAGS * volts:
            amps = float(part["current_a"][low]) if "current_a" in part.columns else -1.0
            drawn = f" at {amps:.0f} A" if amps > 0.5 else ""
            text = f"battery at its lowest while armed: {part['voltage_v'][low]:.1f} V{drawn}"
            yield Event(float(part.t[low]), "battery", text, "battery_status")
        if "warning" in part.columns:
            for t, level in _changes(part, "warning"):
                if int(level) in _WARNINGS:
                    yield Event(t, "battery", f"battery {_WARNINGS[int(level)]}", "battery_status")


def _gps(flight: Px4Flight) -> Iterator[Event]:
    topic = next((name for name in ("vehicle_gps_position", "sensor_gps") if flight.one(name, "fix_type")), "")
    table = flight.one(topic, "fix_type")
    if table is None:
        return
    at = flight.armed[0][0] if flight.armed else float(table.t[-1])
    before = table.between(-math.inf, at)
    row = len(before) - 1 if len(before) else 0
    parts = [f"GPS: {_FIXES.get(int(table['fix_type'][row]), '3D fix')}"]
    if "satellites_used" in table.columns:
        parts.append(f"{table['satellites_used'][row]:.0f} satellites")
    if "hdop" in table.columns and table["hdop"][row] > 0:
        parts.append(f"HDop {table['hdop'][row]:.1f}")
    yield Event(max(at, float(table.t[row])), "gps", ", ".join(parts), topic)
    if table["fix_type"][row] >= _3D:
        lost = [t for t, fix in _changes(table, "fix_type") if fix < _3D and _began(flight, t)]
        if lost:
            yield Event(lost[0], "gps", "GPS lost its 3D fix while armed", topic)


def _cut(flight: Px4Flight, duration_s: float) -> Iterator[Event]:
    if flight.end_s < duration_s:
        text = f"the recording ends, but for a message stamped {duration_s - flight.end_s:.0f} s later"
        yield Event(flight.end_s, "log", text, "the log")
    if flight.arming and flight.arming[-1][1]:
        text = "the log ends with the vehicle armed: power lost, or the recording stopped"
        yield Event(flight.end_s, "log", text, "the log")


def _refused(flight: Px4Flight) -> Iterable[Finding]:
    """A vehicle that was not ready to fly and never armed."""
    if not flight.complaints or flight.armed:
        return ()
    standing = list(dict.fromkeys(_NOT_READY.sub("", text) for _, text in flight.complaints))
    first, last = flight.complaints[0][0], flight.complaints[-1][0]
    others = "".join(f"{text}; " for text in standing[-3:-1])
    evidence = f"{others}{counted(len(flight.complaints), 'complaint')}, and it never armed"
    title = f"not ready to fly: {standing[-1]}"
    source = f"{MESSAGES} of the preflight checks"
    return (Finding("prearm", title, first, max(last, first), "warning", evidence, source, "parameter"),)
