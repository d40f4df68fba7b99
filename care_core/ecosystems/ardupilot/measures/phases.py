"""The parts of an ArduPilot run, as the arguments of an extractor name them."""

from __future__ import annotations

from care_core.ecosystems.ardupilot.measures.flown_mission import FlownMission, analyse
from care_core.ecosystems.ardupilot.measures.modes import is_armed
from care_core.ecosystems.measures import Args, Mission, numeric, one_of
from care_core.ecosystems.vehicles.arming import NEVER_ARMED
from care_core.ecosystems.vehicles.way import span_in
from care_core.run import Unavailable

PHASE_ARGS = {
    "phase": one_of(
        "only this part of the flight: takeoff, leg, return, return_climb, return_cruise, descent, touchdown; of a "
        "drive: mission (from its start to where it is complete, or ends), leg, hold",
        *("takeoff", "leg", "return", "return_climb", "return_cruise", "descent", "touchdown", "mission", "hold"),
    ),
    "index": numeric("number of the leg or wait, from 1"),
}


def flown_mission(mission: Mission) -> FlownMission | Unavailable:
    """What was flown of a mission; why nothing was."""
    return mission.shared(analyse) if is_armed(mission) else NEVER_ARMED


def span_of_phase(mission: Mission, args: Args) -> tuple[float, float] | Unavailable:
    """Start and end in the log of the part of the flight that `args` name."""
    flown = flown_mission(mission)
    return flown if isinstance(flown, Unavailable) else span_in(flown.phases, args)
