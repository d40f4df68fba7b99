"""The hall, and what differs from run to run and is in no log: clutter, slip, battery. Lengths in m."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from dataclasses import dataclass

LENGTH, WIDTH = 12.0, 5.0
RADIUS = 0.22
"""Of the robot."""
START = (0.8, 1.0, 0.0)
GOALS = ((4.2, 3.9), (6.8, 1.0), (10.9, 3.8), (7.2, 3.0), (2.6, 1.6))

_PASSAGE = 1.1
_SHELVES = ((3.2, 1.5), (5.6, 3.3), (8.6, 1.9))
"""Shelves across the hall: where along it, and where the middle of its passage is."""

Rect = tuple[float, float, float, float]
Disc = tuple[float, float, float]


def shelves() -> tuple[Rect, ...]:
    """Each as (x0, y0, x1, y1)."""
    made = []
    for x, middle in _SHELVES:
        made += [(x, 0.0, x + 0.3, middle - _PASSAGE / 2), (x, middle + _PASSAGE / 2, x + 0.3, WIDTH)]
    return tuple(made)


@dataclass(frozen=True)
class Conditions:
    """What one run meets."""

    clutter: Sequence[Disc]
    """Boxes and bins as (x, y, radius), which the map does not know."""
    slip: float
    """Share of the way that the floor eats."""
    bias: float
    """How much the robot pulls aside, rad/s at 1 m/s."""
    volts: float
    """Of the battery at rest when the mission begins."""
    ohms: float
    seed: int

    @classmethod
    def of(cls, seed: int) -> Conditions:
        rng = random.Random(f"hall {seed}")
        clutter: list[Disc] = []
        wanted = rng.choice((0, 1, 1, 2, 2, 3, 4))
        while len(clutter) < wanted:
            disc = (rng.uniform(1.6, LENGTH - 1.0), rng.uniform(0.5, WIDTH - 0.5), rng.uniform(0.12, 0.25))
            if _is_passable(disc, clutter):
                clutter.append(disc)
        return cls(
            tuple(clutter),
            slip=rng.uniform(0.0, 0.05),
            bias=rng.gauss(0.0, 0.02),
            volts=rng.gauss(12.5, 0.08),
            ohms=rng.uniform(0.06, 0.1),
            seed=seed,
        )


def _is_passable(disc: Disc, others: Sequence[Disc]) -> bool:
    """Whether a careful robot still gets everywhere."""
    x, y, radius = disc
    free = [math.dist((x, y), goal) - radius for goal in (*GOALS, START[:2])]
    apart = [math.dist((x, y), other[:2]) - radius - other[2] for other in others]
    walls = [_to_rect(x, y, shelf) - radius for shelf in shelves()]
    return min(free) > 0.8 and min(apart, default=9.0) > 0.9 and min(walls) > 0.9


def clearance(x: float, y: float, discs: Sequence[Disc], rects: Sequence[Rect]) -> float:
    """Distance from a point to the nearest wall, shelf or disc."""
    nearest = min(x, LENGTH - x, y, WIDTH - y)
    for rect in rects:
        nearest = min(nearest, _to_rect(x, y, rect))
    for cx, cy, radius in discs:
        nearest = min(nearest, math.hypot(x - cx, y - cy) - radius)
    return nearest


def _to_rect(x: float, y: float, rect: Rect) -> float:
    x0, y0, x1, y1 = rect
    dx, dy = max(x0 - x, 0.0, x - x1), max(y0 - y, 0.0, y - y1)
    if dx or dy:
        return math.hypot(dx, dy)
    return -min(x - x0, x1 - x, y - y0, y1 - y)
