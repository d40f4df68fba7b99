"""A copter that is disarmed in the air, and falls."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.base import Limits

LIMITS = Limits()
_ALOFT_M = LIMITS.add("height at which it is disarmed", 2.0, "m", "a choice: what came down on a slope stands lower")
_FALLS_M = LIMITS.add("fall after it", 2.0, "m", "a choice: a height that is estimated drifts by less")
_FALLS_S = LIMITS.add("time of that fall", 1.5, "s", "from 2 m it takes 0.6 s; who carries it down takes longer")
_WITHIN_S = LIMITS.add("time within which it begins", 10.0, "s", "a choice: telemetry of a busy link is late")
_SILENT_S = LIMITS.add("age of the last height before it", 5.0, "s", "a choice: the same, and it hovers on meanwhile")
_STEP = LIMITS.add("share of the fall in one record", 0.7, "", "a choice: a height that is set anew is one step")
_CALM_MS = LIMITS.add("descent before it", 2.0, "m/s", "LAND_SPEED_HIGH as shipped: what falls already is no drop")


class Drop(NamedTuple):
    """When it was disarmed, how high it was then, and how far it fell at once."""

    time_s: float
    height_m: float
    fell_m: float


def dropped(flight: Flight) -> Drop | None:
    """The first such fall; None where there was none, or no height tells."""
    if not (flight.is_copter or flight.kind == "quadplane") or flight.height is None:
        return None
    t, height = flight.height
    for at in (one.time_s for one in flight.arm_changes if not one.is_armed):
        last = int(np.searchsorted(t, at, side="right")) - 1
        after = (t > at) & (t <= at + _WITHIN_S)
        if last < 0 or at - t[last] > _SILENT_S or np.count_nonzero(after) < 3:
            continue
        high_m, before_m = float(height[last]), float(np.interp(t[last] - _FALLS_S, t, height))
        if high_m < _ALOFT_M or before_m - high_m > _CALM_MS * _FALLS_S:
            continue
        fell_m = _falls(np.append(at, t[after]), np.append(high_m, height[after]))
        if fell_m > _FALLS_M:
            return Drop(at, high_m, fell_m)
    return None


def _falls(t: np.ndarray, height: np.ndarray) -> float:
    """The largest loss of height within the time of a fall that is no single step, m."""
    most = 0.0
    for n in range(len(t)):
        inside = height[n : int(np.searchsorted(t, t[n] + _FALLS_S, side="right"))]
        lost = float(inside[0] - inside.min())
        step = float(np.max(inside[:-1] - inside[1:])) if len(inside) > 1 else 0.0
        if step < _STEP * lost:
            most = max(most, lost)
    return most
