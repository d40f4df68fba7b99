"""The run model of a mission's log, and the modes that were in force during the mission."""

from __future__ import annotations

from care_core.ecosystems.ardupilot.flight import Flight, as_flight
from care_core.ecosystems.ardupilot.recorded import Mode
from care_core.ecosystems.measures import Mission


def flight_of(mission: Mission) -> Flight:
    """The run model of the whole log that a mission is cut from."""
    return as_flight(mission.model)


def modes_in_force(mission: Mission) -> tuple[Mode, ...]:
    """Every known mode in force at any time of the mission, in order; empty where the log does not say."""
    modes = flight_of(mission).modes_between(mission.start_s, mission.end_s)
    return tuple(mode for mode in modes if mode.number is not None)


def is_armed(mission: Mission) -> bool:
    """Whether the vehicle was armed before the mission's end, by its records or by what else shows it."""
    flight = flight_of(mission)
    is_recorded = any(change.is_armed and change.time_s <= mission.end_s for change in flight.arm_changes)
    return is_recorded or any(start <= mission.start_s < end for start, end in flight.armed)


def mode_names(mission: Mission) -> tuple[str, ...]:
    """The names of the modes in force during the mission, each once."""
    return tuple(dict.fromkeys(mode.name for mode in modes_in_force(mission)))


def flew_automatically(mission: Mission) -> bool:
    """Whether a mode that flies missions was in force; a log that does not say is given the benefit."""
    modes = modes_in_force(mission)
    return not modes or any(mode.way == "mission" for mode in modes)
