"""A robot on wheels or legs that tips over: what it stands on no longer carries it as it should."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from care_core.ecosystems.spans import unbroken
from care_core.numbers import Floats
from care_core.records import Record

TIPPED_DEG, LIES_S = 45.0, 1.0
"""Beyond this tilt for so long it has tipped over: no slope that wheels climb is steeper (Husky A200: 45 deg)."""
LEVEL_DEG, LEVEL_S, MOSTLY = 20.0, 3.0, 0.9
"""Before it, it stood within so many degrees, for so long and this share of the time: else it is built so, or flies."""
LEAP_M, LEAP_S, PLANAR_M = 0.3, 1.0, 0.1
"""It falls or is thrown up where its height, the same within the last of these before, changes by so much so fast: no
kerb that a robot climbs is as high."""
RISES, RISES_M = 0.3, 0.5
"""What rises by more than this share of its way, beyond half a metre, is in the air or the water."""


class Fall(Record):
    """When a robot tipped over, and how far."""

    topic: str
    start_s: float
    end_s: float
    """The last moment at which it lay."""
    most_deg: float
    rose_m: float
    """How far its height changed meanwhile."""
    stays: bool
    """Whether it still lay when the recording ended."""

    @property
    def lies(self) -> bool:
        """Whether it tipped over; else it fell, or was thrown up, and stands."""
        return self.most_deg > TIPPED_DEG


def fall_of(topic: str, t: Floats, tilt: Floats, z: Floats, path_m: Callable[[float, float], float]) -> Fall | None:
    """The first fall that a source tells, a change of its height alone where it does not lie; None where there is none.

    Args:
        t, tilt, z: of its samples, s, deg, m, each of shape (n,).
        path_m: how far the robot came between two times.
    """
    return _tipped(topic, t, tilt, z, path_m) or _leaped(topic, t, tilt, z)


def _tipped(topic: str, t: Floats, tilt: Floats, z: Floats, path_m: Callable[[float, float], float]) -> Fall | None:
    over = tilt > TIPPED_DEG
    for first, last in unbroken(over):
        if t[last] - t[first] < LIES_S:
            continue
        level = np.flatnonzero(tilt[:first] < LEVEL_DEG)
        start = int(level[-1]) + 1 if len(level) else 0
        before = slice(0, start)
        if not start or t[start] - t[0] < LEVEL_S or np.mean(tilt[before] < LEVEL_DEG) < MOSTLY:
            return None
        if np.ptp(z[before]) > RISES_M + RISES * path_m(float(t[0]), float(t[start])):
            return None
        rows = slice(start - 1, last + 1)
        rose_m = float(np.ptp(z[rows]))
        end = int(np.flatnonzero(over)[-1])
        stays = end == len(t) - 1
        return Fall(topic, float(t[start]), float(t[end]), float(tilt[start:].max()), rose_m, stays)
    return None


def _leaped(topic: str, t: Floats, tilt: Floats, z: Floats) -> Fall | None:
    """It keeps its height until that changes within a second by more than any kerb, and it tilts meanwhile."""
    later = np.minimum(np.searchsorted(t, t + LEAP_S), len(t) - 1)
    rows = np.flatnonzero(np.abs(z[later] - z) > LEAP_M)
    if not len(rows):
        return None
    first, last = int(rows[0]), int(later[rows[0]])
    if t[first] - t[0] < LEVEL_S or np.ptp(z[:first]) > PLANAR_M or tilt[first : last + 1].max() < LEVEL_DEG:
        return None
    return Fall(
        topic, float(t[first]), float(t[last]), float(tilt[first:].max()), float(abs(z[last] - z[first])), False
    )
