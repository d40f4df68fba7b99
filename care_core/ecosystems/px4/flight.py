"""The model of a PX4 log: when it was armed, in which modes, how high, and what its firmware said.

Topics and fields are those of PX4's message definitions (msg/*.msg). Times are seconds from the start of the log.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_core.ecosystems.base import RunModel
from care_core.ecosystems.findings import Event, FindingKind
from care_core.ecosystems.liveness import Frozen, Unconnected
from care_core.ecosystems.px4 import sources
from care_core.ecosystems.px4.attitude import ATTITUDE, WANTED, Lean, lean_of
from care_core.ecosystems.px4.attitude import READS as ATTITUDE_READS
from care_core.ecosystems.px4.calibration import is_calibration, usual
from care_core.ecosystems.px4.preflight import read_by
from care_core.ecosystems.spans import Span, within
from care_core.ecosystems.vehicles import is_simulated
from care_core.ecosystems.vehicles.way import AIRBORNE_M
from care_core.logs.base import Log, Table, Wanted
from care_core.numbers import Bools
from care_core.records import replace
from care_core.run import Setting

STATUS, MESSAGES, LANDED = "vehicle_status", "logged_messages", "vehicle_land_detected"
POSITION, RESULT, FLAGS = "vehicle_local_position", "mission_result", "failsafe_flags"
RESULT_FIELDS = ("finished", "failure", "mission_id", "instance_count", "seq_reached", "seq_total")

READS: Wanted = {
    STATUS: ("arming_state", "nav_state", "failsafe", "failure_detector_status", "vehicle_type"),
    MESSAGES: ("level", "message"),
    LANDED: ("landed",),
    POSITION: ("z",),
    RESULT: RESULT_FIELDS,
    FLAGS: ("fd_critical_failure", "fd_motor_failure"),
    "sensor_combined": ("gyro_rad[0]",),
}

ROTARY, ROVER = 1, 3
"""vehicle_type of what hovers and of a rover (vehicle_status.msg: VEHICLE_TYPE_ROTARY_WING, VEHICLE_TYPE_ROVER)."""
TERMINATION = 13
"""nav_state in which the firmware has ended the flight (vehicle_status.msg)."""
BARELY_M = 0.5
"""Rise below which a vehicle never left the ground."""
SAID_WITHIN_S = 1.0
"""Topics are published at their own times: what belongs to an event may come so much after it."""

_ARMED = 2
"""arming_state: 2 has meant armed in every version (vehicle_status.msg)."""
_GAVE_UP = 0b00001111
"""failure_detector_status: roll, pitch, height and external, which end a flight (vehicle_status.msg). 128 is a motor
since 1.14, as failsafe_flags says too, and a propeller out of balance before, of which the firmware only advises."""
BY_STICK = frozenset((0, 1, 2, 6, 8, 10, 15, 16))
"""Modes that a pilot flies with sticks: manual, altitude, position and their kin (nav_state of vehicle_status.msg)."""
_IDLE_S = 60.0
_MARKS = re.compile(r"\x1b?\[\d+m")
_SPEAKER = re.compile(r"^\[\w+\]\s*")
_ARMED_BY = re.compile(r"(?:\[commander\] )?(Armed|Disarmed) (by .+)")
_PREFLIGHT = re.compile(
    r"Preflight|Arming check|health_and_arming_checks|Not ready|arming denied|Mission rejected"
    r"|Geofence violation for waypoint",
    re.IGNORECASE,
)
_DENIED = re.compile(r"Arming denied", re.IGNORECASE)
_NOT_READY = re.compile(r"^(?:Not ready to fly|Arming check|Preflight(?: Fail)?): ?", re.IGNORECASE)
_KILLED = re.compile(r"\bKill(?:[- ]?switch)? engaged", re.IGNORECASE)
"""What the commander says of the kill switch, then and now (Commander.cpp)."""


class Px4Flight(RunModel):
    """A PX4 log as a flight: everything that checks, mission kind and timeline know of it."""

    def __init__(self, log: Log) -> None:
        super().__init__(log)
        self.expect(READS)

    def table(self, topic: str, *fields: str) -> Table | None:
        """A topic with rows and all of these fields, None where the log lacks one."""
        table = self.tables({topic: fields}).get(topic)
        return table if table is not None and len(table) and set(fields) <= table.columns.keys() else None

    @cached_property
    def end_s(self) -> float:
        """When the recording really ended: a last message long after everything else has a wrong stamp."""
        duration_s = self.log.duration_s
        t = np.unique(np.concatenate([*(table.t for table in self.tables(READS).values()), [duration_s]]))
        late = np.flatnonzero(np.diff(t) > _IDLE_S)
        return float(t[late[0]]) if len(late) and len(t) - late[0] < len(t) / 10 else duration_s

    @cached_property
    def arming(self) -> tuple[tuple[float, bool], ...]:
        """Whether it was armed at first, and when that changed; by the commander's words where no state is recorded."""
        told = tuple((t, state == _ARMED) for t, state in self.changes(STATUS, "arming_state"))
        said = ((t, _ARMED_BY.match(text)) for t, _, text in self.messages)
        return told or tuple((t, match[1] == "Armed") for t, match in said if match)

    @cached_property
    def armed(self) -> tuple[Span, ...]:
        """From each arming to its disarming, or to the end of the recording."""
        spans: list[Span] = []
        start: float | None = None
        for t, is_armed in self.arming:
            if is_armed:
                start = t if start is None else start
            elif start is not None:
                spans.append((start, t))
                start = None
        return (*spans, (start, self.end_s)) if start is not None else tuple(spans)

    @property
    def ends_armed(self) -> bool:
        """Whether the log breaks off before the vehicle disarmed."""
        return bool(self.arming) and self.arming[-1][1]

    def began_armed(self, t: float) -> bool:
        """Whether what begins at a time began while it was armed. What is there as it arms was there before."""
        return any(start < t <= end for start, end in self.armed)

    @cached_property
    def messages(self) -> tuple[tuple[float, str, str], ...]:
        """Time, level and text of what the firmware said."""
        table = self.table(MESSAGES, "message")
        if table is None:
            return ()
        levels = table["level"].tolist() if "level" in table.columns else [""] * len(table)
        rows = zip(table.t.tolist(), levels, table["message"].tolist(), strict=True)
        return tuple((t, str(level), _MARKS.sub("", str(text)).strip()) for t, level, text in rows)

    def armed_by(self, t: float, *, is_armed: bool) -> str:
        """What the commander says of an arming or disarming at a time: "by landing"; "" where it says nothing."""
        matches = (_ARMED_BY.match(text) for at, _, text in self.messages if abs(at - t) < SAID_WITHIN_S)
        return next((match[2] for match in matches if match and (match[1] == "Armed") == is_armed), "")

    @cached_property
    def complaints(self) -> tuple[tuple[float, str], ...]:
        """What keeps it from arming, by its own words."""
        return tuple((t, without_speaker(text)) for t, _, text in self.messages if is_complaint(text))

    @property
    def was_denied(self) -> bool:
        """Whether somebody asked it to arm, and it would not. That it is not ready is said unasked, too."""
        return any(is_bare_denial(text) for _, text in self.complaints)

    @property
    def refusals(self) -> tuple[tuple[float, str], ...]:
        """The different reasons for which it would not arm, as of when each was given last, and those last that read a
        parameter which is off its default; that it will not, only where it gives none."""
        last = {text: t for t, text in self.complaints}
        reasons = {text: t for text, t in last.items() if not is_bare_denial(text)} or last
        return tuple(sorted(((t, text) for text, t in reasons.items()), key=lambda one: (self._is_set_so(one[1]), one)))

    def _is_set_so(self, complaint: str) -> bool:
        return any(self.off_default(name) is not None for name in read_by(reason_of(complaint)))

    @cached_property
    def kills(self) -> tuple[float, ...]:
        """When the kill switch cut its motors while it was armed, as the commander says."""
        said = (t for t, _, text in self.messages if _KILLED.search(text) and not is_complaint(text))
        return tuple(t for t in said if within(self.armed, t))

    def parameter(self, name: str) -> float | None:
        """The value of a parameter as first driven, None where the log does not hold it."""
        value = next((one.value for one in self.log.settings().get(name, ())), None)
        return float(value) if isinstance(value, (int, float)) else None

    def off_default(self, name: str) -> Setting | None:
        """A parameter that was first driven off its airframe's default, or a calibration that no sensor needs; None
        where it is at it, or the log lacks either."""
        setting = next(iter(self.log.settings().get(name, ())), None)
        if setting is None:
            return None
        if isinstance(setting.value, (int, float)) and is_calibration(name):
            sound = usual(name, float(setting.value), is_simulated=is_simulated(self.log.facts, {}))
            return None if sound is None else replace(setting, default=sound)
        return None if setting.default in (None, setting.value) else setting

    def killed_s(self, span: Span = (-math.inf, math.inf)) -> float | None:
        """When the kill switch first cut its motors in a span, None where it did not."""
        return next((t for t in self.kills if span[0] <= t <= span[1]), None)

    def heights(self, span: Span) -> Table | None:
        """`height` in metres above where a span begins, None where the log tells no height in it."""
        position = self.table(POSITION, "z")
        part = None if position is None else position.between(*span)
        known = None if part is None else part.where(np.isfinite(part["z"]))
        if known is None or not len(known):
            return None
        return Table(known.t, {"height": known["z"][0] - known["z"]})

    def height_m(self, t: float) -> float | None:
        """How high it was above where it was armed last. The land detector is no witness: many a pilot kills what it
        does not let disarm."""
        armed_s = max((start for start, _ in self.armed if start <= t), default=0.0)
        heights = self.heights((armed_s, math.inf))
        return None if heights is None else float(np.interp(t, heights.t, heights["height"]))

    @cached_property
    def lean(self) -> Lean | None:
        """How it leaned and was to lean, None where the log lacks its attitude."""
        tables = self.tables(ATTITUDE_READS)
        return lean_of(tables.get(ATTITUDE), tables.get(WANTED))

    @property
    def hovers(self) -> bool:
        """Whether it never flew as a wing or drove."""
        table = self.table(STATUS, "vehicle_type")
        return table is None or bool(np.all(np.isin(table["vehicle_type"], (0, ROTARY))))

    @cached_property
    def aloft(self) -> tuple[Span, ...]:
        """From where it rose to where it came down for the last time, of each span armed; of what drives, all of it."""
        found = []
        for span in self.armed:
            heights = self.heights(span)
            up = heights.t[heights["height"] > AIRBORNE_M] if heights is not None else np.empty(0)
            if len(up):
                found.append((float(up[0]), float(up[-1])))
            elif self.last(STATUS, "vehicle_type", span[1]) == ROVER:
                found.append(span)
        return tuple(found)

    @cached_property
    def frozen(self) -> tuple[Frozen, ...]:
        """Stretches in which a source only repeats itself while the vehicle moves."""
        return tuple(sources.frozen(self, self.aloft))

    @cached_property
    def unconnected(self) -> tuple[Unconnected, ...]:
        """Sources that say nothing from first to last; none of a vehicle that never armed."""
        return tuple(sources.unconnected(self, self.aloft if self.hovers else ())) if self.armed else ()

    def has_no(self, kind: FindingKind | None) -> bool:
        """Whether nothing is connected that the firmware could find failed."""
        return any(one.kind == kind for one in self.unconnected)

    def repeats(self, channel: str) -> tuple[Span, ...]:
        return tuple(one.span for one in self.frozen if one.channel == channel)

    @cached_property
    def modes(self) -> tuple[tuple[float, int], ...]:
        """`nav_state` at first, and when it changed."""
        return tuple((t, int(mode)) for t, mode in self.changes(STATUS, "nav_state"))

    def modes_during(self, span: Span) -> list[int]:
        """The modes in force during a span, in order."""
        before = [mode for t, mode in self.modes if t <= span[0]][-1:]
        return [*before, *(mode for t, mode in self.modes if span[0] < t <= span[1])]

    def detected_s(self, span: Span) -> float | None:
        """When the failure detector first acted in a span; None where it did not."""
        times = [self.first_s(FLAGS, name, 1, span) for name in ("fd_critical_failure", "fd_motor_failure")]
        status = self.during(STATUS, "failure_detector_status", span)
        if status is not None:
            bits = np.nan_to_num(status["failure_detector_status"]).astype(np.int64) & _GAVE_UP
            times.append(_first_s(status.t, bits != 0))
        return min((one for one in times if one is not None), default=None)

    def terminated_s(self, span: Span) -> float | None:
        """When the firmware first ended the flight in a span, its motors cut; None where it did not."""
        if TERMINATION in self.modes_during((span[0], span[0])):
            return span[0]
        return self.first_s(STATUS, "nav_state", TERMINATION, span)

    def changes(self, topic: str, field: str) -> Iterator[tuple[float, float]]:
        """The first value of a field and every change of it; nothing where the log lacks it."""
        table = self.table(topic, field)
        return iter(()) if table is None else changes(table, field)

    def during(self, topic: str, field: str, span: Span) -> Table | None:
        """A topic's rows in a span, None where the log lacks the field."""
        table = self.table(topic, field)
        return None if table is None else table.between(*span)

    def first_s(self, topic: str, field: str, value: float, span: Span) -> float | None:
        """When a field first had a value in a span; None where it never had."""
        table = self.during(topic, field, span)
        return None if table is None else _first_s(table.t, table[field] == value)

    def ever(self, topic: str, field: str, value: float, span: Span) -> bool:
        """Whether a field had a value in a span."""
        return self.first_s(topic, field, value, span) is not None

    def at_least(self, topic: str, field: str, value: float, span: Span) -> bool:
        """Whether a field reached a value in a span."""
        table = self.during(topic, field, span)
        return table is not None and bool(np.any(table[field] >= value))

    def last(self, topic: str, field: str, t: float) -> float | None:
        """The value in force at a time, which may have been published before or just after it."""
        table = self.during(topic, field, (-math.inf, t + SAID_WITHIN_S))
        return float(table[field][-1]) if table is not None and len(table) else None


def changes(table: Table, field: str) -> Iterator[tuple[float, float]]:
    """The first value of a field and every change of it."""
    values = table[field]
    known = np.flatnonzero(np.isfinite(values))
    if len(known):
        for row in known[np.append(True, np.diff(values[known]) != 0)].tolist():
            yield float(table.t[row]), float(values[row])


def is_complaint(text: str) -> bool:
    """Whether the firmware says that it does not let itself be armed."""
    return _PREFLIGHT.search(text) is not None


def is_bare_denial(text: str) -> bool:
    """Whether the firmware says that it does not arm, and not why."""
    return _DENIED.match(text) is not None


def is_arming(text: str) -> bool:
    """Whether the commander says that it armed or disarmed."""
    return _ARMED_BY.match(text) is not None


def without_speaker(text: str) -> str:
    """A message without the name of the module that says it."""
    return _SPEAKER.sub("", text)


def reason_of(complaint: str) -> str:
    """What a complaint says is wrong."""
    return _NOT_READY.sub("", complaint)


_LEVELS = {"emergency": "FATAL", "alert": "FATAL", "critical": "FATAL", "error": "ERROR", "warning": "WARN"}
"""Levels of logged messages that ask for attention."""


def log_messages(flight: RunModel) -> Iterator[Event]:
    """What the firmware said, with its level where that asks for attention."""
    assert isinstance(flight, Px4Flight)
    for t, level, text in flight.messages:
        yield Event(t, _LEVELS.get(level.casefold(), "message"), text, MESSAGES)


def _first_s(t: NDArray[Any], holds: Bools) -> float | None:
    """The first time at which something holds; None where it never does."""
    return float(t[int(np.argmax(holds))]) if holds.any() else None
