"""PX4 flights: from arming to disarming, by `vehicle_status`, and what each is judged by.

Topics and fields are those of PX4's message definitions (msg/*.msg).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from care_core.ecosystems.ardupilot.measures.flight import AIRBORNE_M
from care_core.ecosystems.base import RunModel
from care_core.ecosystems.measures import MISSION_KINDS, Args, Mission, MissionKind, has
from care_core.ecosystems.vehicles import mode_name, way_of
from care_core.ecosystems.vehicles.arming import KILLED, KILLED_ALOFT_M
from care_core.ecosystems.vehicles.modes import Way
from care_core.logs.base import Table, Wanted
from care_core.records import replace
from care_core.run import Check, Evidence, Unavailable, Value

_BARELY_M = 0.5
"""Rise below which a vehicle never left the ground."""

STATUS, LANDED, RESULT, FLAGS = "vehicle_status", "vehicle_land_detected", "mission_result", "failsafe_flags"
POSITION, MESSAGES = "vehicle_local_position", "logged_messages"
_ARMED = 2
"""arming_state: 2 has meant armed in every version (vehicle_status.msg)."""
_GAVE_UP = 0b10001111
"""failure_detector_status: roll, pitch, height, external and motor (failure_detector_status.msg)."""
_TERMINATION = 13
_ROVER = 3
"""vehicle_type of a rover (vehicle_status.msg: VEHICLE_TYPE_ROVER)."""
_SAID_WITHIN_S = 1.0
"""Topics are published at their own times: what belongs to the end may come so much after it."""
_CUT = Unavailable("the log ends before the vehicle disarmed", "record until it has disarmed")


class Px4Flight(MissionKind):
    """From arming to disarming."""

    name = "px4_flight"
    args: Mapping[str, str] = {}

    def needs(self, spec: Args) -> Wanted:
        return {
            STATUS: ("arming_state", "nav_state", "failsafe", "failure_detector_status", "vehicle_type"),
            LANDED: ("landed",),
            POSITION: ("z",),
            RESULT: ("finished", "failure"),
            FLAGS: ("fd_critical_failure", "fd_motor_failure"),
            MESSAGES: ("message",),
        }

    def missions(self, model: RunModel, tables: Mapping[str, Table], spec: Args) -> tuple[Mission, ...]:
        status = tables.get(STATUS)
        if not has(status, "arming_state"):
            return ()
        armed = status["arming_state"] == _ARMED
        edges = np.flatnonzero(np.diff(np.concatenate(([False], armed)).astype(np.int8)))
        times = [float(status.t[row]) for row in edges.tolist()]
        ends = [*times[1::2], model.log.duration_s][: len(times[::2])]
        closed = len(times) // 2
        return tuple(
            Mission(model, tables, start_s, end_s, number < closed, spec)
            for number, (start_s, end_s) in enumerate(zip(times[::2], ends, strict=True))
        )

    def mismatch(self, mission: Mission) -> str:
        return ""

    def evidence(self, mission: Mission) -> tuple[Evidence, ...]:
        return ()

    def outcome(self, mission: Mission) -> tuple[Check, ...]:
        return tuple(_checks(mission))

    def modes(self, mission: Mission) -> tuple[str, ...]:
        return tuple(dict.fromkeys(mode_name("px4", mode) for mode in _modes(mission)))


MISSION_KINDS[Px4Flight.name] = Px4Flight()


def _checks(mission: Mission) -> Iterator[Check]:
    yield Check("armed", 1.0, "the vehicle armed")
    flies = _last(mission, STATUS, "vehicle_type") != _ROVER
    if flies:
        yield Check("took_off", _took_off(mission), "it left the ground")
    if any(_way(mode) == "mission" for mode in _modes(mission)):
        yield Check("mission_success", _mission(mission), "the mission was flown to its end", "the mission failed")
    killed_s = _killed_s(mission)
    driven = replace(mission, end_s=min(killed_s, mission.end_s))  # what falls with its motors cut is no new failure
    broke = _ever(driven, FLAGS, "fd_critical_failure") or _ever(driven, FLAGS, "fd_motor_failure")
    broke = broke or _TERMINATION in _modes(driven) or _detected(driven)
    cut = not broke and killed_s < math.inf and _height_at(mission, killed_s) > KILLED_ALOFT_M
    how = "the kill switch cut its motors in the air" if cut else "the failure detector acted"
    yield Check("no_crash", 0.0 if broke or cut else 1.0, "the failure detector stayed silent", how)
    yield Check("no_failsafe", 1.0 - _ever(mission, STATUS, "failsafe"), "no failsafe acted", "a failsafe acted")
    if flies:
        yield Check("landed", _on_ground(mission), "it was on the ground at the end", "it was disarmed in the air")
    yield Check("disarmed", 1.0 if mission.ended else _CUT, "it was disarmed at the end")


def _took_off(mission: Mission) -> Value:
    """1 where it rose, or, where no height is told, the land detector said so: that also speaks up on a bench."""
    position = mission.table(POSITION)
    heights = position["z"][np.isfinite(position["z"])] if has(position, "z") else np.empty(0)
    if len(heights):
        rose = float(heights[0] - heights.min())
        barely = f"it rose no higher than {rose:.1f} m" if rose > _BARELY_M else "it never left the ground"
        return 1.0 if rose > AIRBORNE_M else Unavailable(barely)
    if not has(mission.table(LANDED), "landed"):
        return Unavailable("the log does not say when it was on the ground", f"record {LANDED}", LANDED)
    flew = _ever(mission, LANDED, "landed", 0)
    return 1.0 if flew else Unavailable("it never left the ground")


def _on_ground(mission: Mission) -> Value:
    if not has(mission.table(LANDED), "landed"):
        return Unavailable("the log does not say when it was on the ground", f"record {LANDED}", LANDED)
    return float(_last(mission, LANDED, "landed") == 1) if mission.ended else _CUT


def _mission(mission: Mission) -> Value:
    """1 where the navigator called the mission finished, 0 where it failed or was still under way at the end."""
    if not has(mission.table(RESULT), "finished"):
        return Unavailable("the log does not say how the mission ended", f"record {RESULT}", RESULT)
    if _ever(mission, RESULT, "finished"):
        return 1.0
    if _ever(mission, RESULT, "failure"):
        return 0.0
    left = mode_name("px4", _modes(mission)[-1])
    return Unavailable(f"the mission was not flown to its end, the last mode was {left}")


def _modes(mission: Mission) -> list[int]:
    """Numbers of the modes during the mission, in order."""
    table = mission.table(STATUS)
    if not has(table, "nav_state"):
        return []
    states = table["nav_state"][np.isfinite(table["nav_state"])].astype(int)
    return [int(state) for row, state in enumerate(states) if row == 0 or state != states[row - 1]]


def _way(mode: int) -> Way:
    return way_of("px4", mode)


def _killed_s(mission: Mission) -> float:
    """When the kill switch cut its motors, infinity where it did not."""
    table = mission.table(MESSAGES)
    if not has(table, "message"):
        return math.inf
    said = zip(table.t.tolist(), table["message"].tolist(), strict=True)
    return next((t for t, text in said if KILLED.search(str(text))), math.inf)


def _height_at(mission: Mission, t: float) -> float:
    """Metres above where the mission began; 0 where no height is told."""
    position = mission.table(POSITION)
    known = position.where(np.isfinite(position["z"])) if has(position, "z") else None
    return float(known["z"][0] - np.interp(t, known.t, known["z"])) if known is not None and len(known) else 0.0


def _detected(mission: Mission) -> bool:
    table = mission.table(STATUS)
    if not has(table, "failure_detector_status"):
        return False
    bits = np.nan_to_num(table["failure_detector_status"]).astype(np.int64)
    return bool(np.any(bits & _GAVE_UP))


def _ever(mission: Mission, topic: str, field: str, value: float = 1) -> bool:
    table = mission.table(topic)
    return has(table, field) and bool(np.any(table[field] == value))


def _last(mission: Mission, topic: str, field: str) -> float | None:
    """The value in force at the end of the mission, which may have been told before it began."""
    table = mission.tables.get(topic)
    if not has(table, field):
        return None
    before = table.where(table.t <= mission.end_s + _SAID_WITHIN_S)
    return float(before[field][-1]) if len(before) else None
