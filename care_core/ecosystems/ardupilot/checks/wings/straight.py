"""Where a plane flies straight: what its surfaces are held at there is what it needs, whatever their trims say."""

from __future__ import annotations

import numpy as np

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.statistics import smooth
from care_core.ecosystems.base import Limits
from care_core.ecosystems.spans import during
from care_core.logs.base import Table, Wanted
from care_core.numbers import Bools, Floats, median

READS: Wanted = {"ATT": ("Roll", "Yaw"), "GPS": ("Spd",)}
LIMITS = Limits()
_FLIES_MS = LIMITS.add("speed at which it flies on its wings", 12.0, "m/s", "a choice: a QuadPlane hovers slower")
_STRAIGHT_DPS = LIMITS.add("turn of what flies straight", 2.0, "deg/s", "a choice: a full turn takes three minutes")
_OVER_S = LIMITS.add("time over which the turn is taken", 2.0, "s", "a choice: gusts swing it faster")
_RECORDS = LIMITS.add("fewest records of straight flight", 20.0, "", "a choice: some seconds of it")
_NO_RATE_DPS = 1000.0
"""Where two records have one time: no straight flight."""


def straight(flight: Flight) -> Floats:
    """The times of the attitudes (s) at which it flies on its wings and does not turn; none where they are too few."""
    leans, moved = flight.one("ATT", "Roll", "Yaw"), flight.one("GPS", "Spd")
    if leans is None or moved is None or len(leans) < _RECORDS:
        return np.empty(0)
    flies = (np.interp(leans.t, moved.t, moved["Spd"]) > _FLIES_MS) & during(flight.flown, leans.t)
    found = leans.t[flies & _goes_straight(leans)]
    return found if len(found) >= _RECORDS else np.empty(0)


def held_at(t: Floats, table: Table, field: str) -> float:
    """What a field mostly is at these times."""
    return float(median(np.interp(t, table.t, table[field])))


def _goes_straight(leans: Table) -> Bools:
    with np.errstate(divide="ignore", invalid="ignore"):  # damage gives records one time
        rate = np.degrees(np.gradient(np.unwrap(np.radians(leans["Yaw"])), leans.t))
    return np.asarray(np.abs(smooth(leans.t, np.where(np.isfinite(rate), rate, _NO_RATE_DPS), _OVER_S)) < _STRAIGHT_DPS)
