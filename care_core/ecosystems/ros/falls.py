"""A robot on wheels or legs that tips over: what it stands on no longer carries it as it should."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from care_core.numbers import Floats
from care_core.records import Record

TIPPED_DEG, LIES_S = 45.0, 1.0
"""Beyond this tilt for so long it has tipped over: no slope that wheels climb is steeper (Husky A200: 45 deg)."""
LEVEL_DEG, LEVEL_S, MOSTLY = 20.0, 3.0, 0.9
"""Before it, it stood within so many degrees, for so long and this share of the time: else it is built so, or flies."""
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


def fall_of(topic: str, t: Floats, tilt: Floats, z: Floats, path_m: Callable[[float, float], float]) -> Fall | None:
    """The first fall that a source tells; None where there is none.

    Args:
        t, tilt, z: of its samples, s, deg, m, each of shape (n,).
        path_m: how far the robot came between two times.
    """
    over = tilt > TIPPED_DEG
    edges = np.flatnonzero(np.diff(np.concatenate(([False], over, [False])).astype(np.int8)))
    for first, last in zip(edges[::2].tolist(), (edges[1::2] - 1).tolist(), strict=True):
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
