"""How missions are found in a DataFlash log, and what is said of one that no threshold belongs to.

A mission is one arming to the next disarm; what was armed when its log began has no beginning to measure from. A log
without any arming in which arming was refused is one mission too: the vehicle never left the ground, and its last
refusals say why.
"""

from __future__ import annotations

from collections.abc import Mapping

from care_core.ecosystems.ardupilot.flight import Flight, as_flight
from care_core.ecosystems.ardupilot.measures.events import (
    errors,
    failed,
    forced,
    is_over,
    last_refusals,
    never_asked,
    telling,
    was_asked,
)
from care_core.ecosystems.ardupilot.measures.flown_mission import NEEDS, analyse, waypoint_offsets
from care_core.ecosystems.ardupilot.measures.modes import flew_automatically, flight_of, is_armed, mode_names
from care_core.ecosystems.ardupilot.measures.outcome import HEIGHTS, plain_checks
from care_core.ecosystems.ardupilot.measures.phases import span_of_phase
from care_core.ecosystems.ardupilot.measures.requested import mission_held
from care_core.ecosystems.ardupilot.measures.shortfall import shortfall, tolerance_m
from care_core.ecosystems.base import RunModel
from care_core.ecosystems.measures import MISSION_KINDS, Args, Mission, MissionKind, numeric, points
from care_core.ecosystems.spans import Span
from care_core.ecosystems.vehicles import error_kind, error_words
from care_core.logs.base import Table, Wanted, merge_needs
from care_core.run import Evidence, OutcomeCheck, Unavailable

_STANDS_S = 1.0
"""So long it stands at the start of a log that holds its take-off."""


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
        flight = as_flight(model)
        armed, disarmed = (
            {one.time_s for one in flight.arm_changes if one.is_armed is state} for state in (True, False)
        )
        whole = [
            span
            for span in flight.recorded_armed
            if span[0] in armed or _begins_standing(flight, span) or _is_logged_once_armed(flight, span)
        ]
        spans = [(start, end, end in disarmed) for start, end in whole]
        if not flight.arm_changes and flight.refusals:
            spans = [(0.0, flight.end_s, True)]
        kept = _sound(flight, tables)
        return tuple(
            Mission(flight.run_at(start_s), kept, start_s, end_s, has_ended, spec)
            for start_s, end_s, has_ended in spans
        )

    def mismatch(self, mission: Mission) -> str:
        expected = mission.spec.get("waypoints", ())
        flown = mission.shared(analyse).waypoints
        if not expected:
            return ""
        held = mission.shared(mission_held)
        if isinstance(held, Unavailable) and not flown and flight_of(mission).held_missions:
            return held.reason
        if len(flown) != len(expected):
            return f"the mission has {len(flown)} waypoints, the profile's has {len(expected)}"
        for number, off_m in enumerate(waypoint_offsets(flown, expected), start=1):
            if off_m > tolerance_m(mission):
                return f"waypoint {number} is {off_m:.0f} m from where the profile's mission has it"
        return ""

    def evidence(self, mission: Mission) -> tuple[Evidence, ...]:
        if not is_armed(mission):
            return tuple(Evidence(one.time_s, one.text, "refusal") for one in last_refusals(mission))
        found = [Evidence(t, text, kind) for t, text, kind in telling(mission)]
        spoken = {one.kind for one in found}
        for t, subsystem, code in errors(mission):
            kind = error_kind(subsystem)
            if kind and code and kind not in spoken:
                found.append(Evidence(t, f"ERR: {error_words(subsystem, code, flight_of(mission).mode_kind)}", kind))
        if forced(mission):
            found.append(Evidence(mission.end_s, "Disarmed by force in flight", "forced", is_concluded=True))
        return tuple(sorted(found, key=lambda one: one.time_s))

    def shortfall(self, mission: Mission) -> tuple[str, ...]:
        return shortfall(mission)

    def is_decided(self, mission: Mission) -> bool:
        # Power is pulled of a vehicle that would not arm, which cuts the log's last record: the refusal stands.
        return is_over(mission) or (failed(mission) if is_armed(mission) else was_asked(mission))

    def checks(self, mission: Mission) -> tuple[OutcomeCheck, ...]:
        return () if not is_armed(mission) or flew_automatically(mission) else tuple(plain_checks(mission))

    def outcome(self, mission: Mission) -> tuple[OutcomeCheck, ...]:
        if is_armed(mission):
            return tuple(plain_checks(mission, and_mission=True))
        never = 0.0 if was_asked(mission) else never_asked(mission)
        return (OutcomeCheck("armed", never, "the vehicle armed", "arming was refused"),)

    def span(self, mission: Mission, phase: str) -> tuple[float, float] | None:
        span = span_of_phase(mission, {"phase": phase})
        return None if isinstance(span, Unavailable) else span

    def modes(self, mission: Mission) -> tuple[str, ...]:
        return mode_names(mission)


class UnrecordedArming(ArduPilotFlight):
    """A flight whose arming no record tells of: a log that begins or is written while armed, or of old firmware. It is
    armed as its status or its throttle says, and over where a disarming is recorded or where it stands at the end."""

    name = "ardupilot_unrecorded_arming"

    def missions(self, model: RunModel, tables: Mapping[str, Table], spec: Args) -> tuple[Mission, ...]:
        flight = as_flight(model)
        disarmed = {one.time_s for one in flight.arm_changes if not one.is_armed}
        kept = _sound(flight, tables)
        return tuple(
            Mission(model, kept, start_s, end_s, end_s in disarmed or flight.stands_at_end, spec)
            for start_s, end_s in flight.armed
        )


def _is_logged_once_armed(flight: Flight, span: Span) -> bool:
    """Whether a log that begins armed holds the whole of a dive: submarines that log nothing while disarmed open it
    after the arming, so no record of that is in it."""
    begins = flight.kind == "sub" and flight.is_written_armed and span[0] <= flight.armed[0][0]
    return begins and any(span[0] < mode.start_s < span[1] and mode.way == "mission" for mode in flight.modes)


def _begins_standing(flight: Flight, span: Span) -> bool:
    """Whether a log that begins armed holds the whole of a flight: it stood then, and took off later."""
    took_off_s = next((start for start, _ in flight.airborne), None)
    return took_off_s is not None and span[0] + _STANDS_S < took_off_s < span[1]


def _sound(flight: Flight, tables: Mapping[str, Table]) -> dict[str, Table]:
    sound = {name: flight.sound_table(name, table) for name, table in tables.items()}
    return {name: table for name, table in sound.items() if table is not None}


MISSION_KINDS[ArduPilotFlight.name] = ArduPilotFlight()
MISSION_KINDS[UnrecordedArming.name] = UnrecordedArming()
