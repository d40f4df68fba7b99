"""Which vehicle flew, and in which modes: ArduPilot's and PX4's numbers mean what that vehicle means by them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from care_core.ecosystems.measures import Mission, has
from care_core.ecosystems.vehicles import Kind, Vehicle, Way, mode_name, mode_number, vehicle_of, way_of
from care_core.ecosystems.vehicles.modes import px4_mode
from care_core.logs.base import Wanted

MODES: Wanted = {"MODE": ("ModeNum", "Mode")}
"""What modes are read from: firmware before 3.3 names them only."""


class Entered(NamedTuple):
    """A mode in force: when it was entered, perhaps before the mission, its number and what the vehicle does in it."""

    t: float
    number: int
    way: Way


def vehicle_flown(mission: Mission) -> Vehicle:
    """The vehicle of a mission's log; use through `mission.shared`."""
    return vehicle_of(mission.facts, mission.settings)


def kind_flown(mission: Mission) -> Kind:
    """Whose mode numbers count; a log that does not say is taken for a copter's, whose profile reads it."""
    kind = mission.shared(vehicle_flown).kind
    return "copter" if kind == "unknown" else kind


def modes_in_force(mission: Mission) -> tuple[Entered, ...]:
    """Every mode in force at any time of the mission, in order; empty where the log does not say."""
    table = mission.tables.get("MODE")
    field = next((field for field in MODES["MODE"] if has(table, field)), None)
    if table is None or field is None:
        return ()
    kind = kind_flown(mission)
    until = np.append(table.t[1:], np.inf)
    rows = np.flatnonzero((table.t <= mission.end_s) & (until > mission.start_s))
    entered = [(float(table.t[row]), _number(table[field][row], kind)) for row in rows.tolist()]
    return tuple(Entered(t, number, way_of(kind, number)) for t, number in entered if number is not None)


def mode_names(mission: Mission) -> tuple[str, ...]:
    """The names of the modes in force during the mission, each once."""
    kind = kind_flown(mission)
    return tuple(dict.fromkeys(mode_name(kind, mode.number) for mode in mission.shared(modes_in_force)))


def flew_automatically(mission: Mission) -> bool:
    """Whether a mode that flies missions was in force; a log that does not say is given the benefit."""
    modes = mission.shared(modes_in_force)
    return not modes or any(mode.way == "mission" for mode in modes)


def _number(mode: float | str, kind: Kind) -> int | None:
    if isinstance(mode, str):
        return mode_number(kind, mode)
    if not np.isfinite(mode):
        return None
    return px4_mode(int(mode)) if kind == "px4" else int(mode)
