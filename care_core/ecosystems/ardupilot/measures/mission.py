"""How missions are found in a DataFlash log, and what is said of one that no threshold belongs to.

A mission is one arming to the next disarm. A log without any arming in which arming was refused is one mission
too: the vehicle never left the ground, and its last refusals say why.
"""

from __future__ import annotations

from collections.abc import Mapping

from care_core.ecosystems.ardupilot.measures.events import (
    arm_events,
    armed_spans,
    errors,
    failed,
    forced,
    is_armed,
    is_over,
    last_refusals,
    refusals,
    telling,
)
from care_core.ecosystems.ardupilot.measures.flight import NEEDS, analyse, waypoint_offsets
from care_core.ecosystems.ardupilot.measures.modes import flew_automatically, kind_flown, mode_names
from care_core.ecosystems.ardupilot.measures.outcome import HEIGHTS, WAYPOINT_TOLERANCE_M, plain_checks
from care_core.ecosystems.base import RunModel
from care_core.ecosystems.measures import MISSION_KINDS, Args, Mission, MissionKind, numeric, points
from care_core.ecosystems.vehicles import error_kind, error_words
from care_core.logs.base import Table, Wanted, merge_needs
from care_core.logs.plausible import plausible
from care_core.run import Check, Evidence, Unavailable


class ArduPilotFlight(MissionKind):
    """From arming to disarming."""

    name = "ardupilot_flight"
    args: Mapping[str, str] = {
        "waypoints": points("list of [latitude, longitude, height above home in m] that the thresholds belong to", 3),
        "tolerance_m": numeric("how far from home a landing may end, and a waypoint may be off"),
    }

    def needs(self, spec: Args) -> Wanted:
        return merge_needs((NEEDS, HEIGHTS))

    def missions(self, model: RunModel, tables: Mapping[str, Table], spec: Args) -> tuple[Mission, ...]:
        spans = armed_spans(tables, model.log.duration_s)
        if not spans and not arm_events(tables) and refusals(tables.get("MSG")):
            spans = [(0.0, model.log.duration_s, True)]
        sound = plausible(tables)
        return tuple(Mission(model, sound, start_s, end_s, ended, spec) for start_s, end_s, ended in spans)

    def mismatch(self, mission: Mission) -> str:
        expected = mission.spec.get("waypoints", ())
        flown = mission.shared(analyse).waypoints
        if not expected:
            return ""
        if len(flown) != len(expected):
            return f"the mission has {len(flown)} waypoints, the profile's has {len(expected)}"
        tolerance_m = float(mission.spec.get("tolerance_m", WAYPOINT_TOLERANCE_M))
        for number, off_m in enumerate(waypoint_offsets(flown, expected), start=1):
            if off_m > tolerance_m:
                return f"waypoint {number} is {off_m:.0f} m from where the profile's mission has it"
        return ""

    def evidence(self, mission: Mission) -> tuple[Evidence, ...]:
        if not is_armed(mission):
            return tuple(Evidence(t, text, "refusal") for t, text in last_refusals(mission))
        found = [Evidence(t, text, kind) for t, text, kind in telling(mission)]
        spoken = {one.kind for one in found}
        for t, subsystem, code in errors(mission):
            kind = error_kind(subsystem)
            if kind and code and kind not in spoken:
                found.append(Evidence(t, f"ERR: {error_words(subsystem, code, kind_flown(mission))}", kind))
        if forced(mission):
            found.append(Evidence(mission.end_s, "Disarmed by force in flight", "forced"))
        return tuple(sorted(found, key=lambda one: one.time_s))

    def is_decided(self, mission: Mission) -> bool:
        return is_over(mission) or (is_armed(mission) and failed(mission))

    def checks(self, mission: Mission) -> tuple[Check, ...]:
        return () if not is_armed(mission) or flew_automatically(mission) else tuple(plain_checks(mission))

    def outcome(self, mission: Mission) -> tuple[Check, ...]:
        if is_armed(mission):
            return tuple(plain_checks(mission, and_mission=True))
        asked_for = any(text.startswith("Arm:") for _, text in refusals(mission.tables.get("MSG")))
        never = 0.0 if asked_for else Unavailable("the vehicle never armed, and nobody asked it to")
        return (Check("armed", never, "the vehicle armed", "arming was refused"),)

    def modes(self, mission: Mission) -> tuple[str, ...]:
        return mode_names(mission)


MISSION_KINDS[ArduPilotFlight.name] = ArduPilotFlight()
