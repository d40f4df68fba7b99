"""Where the robot drives: a corridor with passages, a hall, an open yard; clutter that the map lacks. Lengths in m."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

CELL_M = 0.05
"""Of the map that Nav2 is given."""

_WALL_M = 0.2
_LEG_M = 3.0
"""In the yard goals lie so far apart at least."""
_FREE_M = 0.95
"""Clutter leaves a gap of so much on one of its sides at least: a careful robot gets everywhere."""

Rect = tuple[float, float, float, float]
"""x0, y0, x1, y1."""
Pose = tuple[float, float, float]
"""x, y, yaw (rad)."""
Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Passage:
    """An opening in a wall across the way; the wall stands at `x`."""

    x: float
    y: float
    width: float


@dataclass(frozen=True)
class World:
    """Walls, clutter and the mission in them. Walls are on the map; clutter only the laser sees."""

    walls: tuple[Rect, ...]
    clutter: tuple[Rect, ...]
    passages: tuple[Passage, ...]
    start: Pose
    goals: tuple[Pose, ...]

    @cached_property
    def segments(self) -> Floats:
        """Sides of everything that stands, shape (sides, 4): x1, y1, x2, y2."""
        sides = [
            side
            for x0, y0, x1, y1 in (*self.walls, *self.clutter)
            for side in ((x0, y0, x1, y0), (x1, y0, x1, y1), (x1, y1, x0, y1), (x0, y1, x0, y0))
        ]
        return np.array(sides, np.float64).reshape(-1, 4)

    def blocked(self, passage: Passage) -> World:
        """The world with something standing in a passage."""
        half = passage.width / 2 + 0.05
        box = (passage.x - 0.1, passage.y - half, passage.x + 0.1, passage.y + half)
        return World(self.walls, (*self.clutter, box), self.passages, self.start, self.goals)

    def cast(self, x: float, y: float, angles: Floats) -> Floats:
        """Distance from a point to what is nearest in each direction (rad), shape (rays,); inf where nothing stands."""
        ends = self.segments
        edge_x, edge_y = ends[:, 2] - ends[:, 0], ends[:, 3] - ends[:, 1]
        to_x, to_y = ends[:, 0] - x, ends[:, 1] - y
        ray_x, ray_y = np.cos(angles)[:, None], np.sin(angles)[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            cross = ray_x * edge_y - ray_y * edge_x
            along = (to_x * edge_y - to_y * edge_x) / cross
            share = (to_x * ray_y - to_y * ray_x) / cross
        hit = (along > 0) & (share >= 0) & (share <= 1)
        return np.asarray(np.where(hit, along, np.inf).min(axis=1, initial=np.inf), np.float64)

    @cached_property
    def boxes(self) -> Floats:
        """Everything that stands, shape (boxes, 4): x0, y0, x1, y1."""
        return np.array((*self.walls, *self.clutter), np.float64).reshape(-1, 4)

    def touches(self, x: float, y: float, radius: float) -> bool:
        """Whether a round body with its middle there touches anything."""
        low, high = self.boxes[:, :2], self.boxes[:, 2:]
        apart = np.maximum(np.maximum(low - (x, y), (x, y) - high), 0.0)
        return bool(((apart**2).sum(axis=1) < radius**2).any())

    def map(self) -> tuple[NDArray[np.int8], tuple[float, float]]:
        """The walls as an occupancy grid (rows along y; 100 wall, 0 free) and the place of its first cell's corner."""
        walls = np.array(self.walls)
        x0, y0 = float(walls[:, 0].min()), float(walls[:, 1].min())
        columns, rows = (math.ceil((float(walls[:, i].max()) - low) / CELL_M) for i, low in ((2, x0), (3, y0)))
        grid = np.zeros((rows, columns), np.int8)
        for left, below, right, above in self.walls:
            i0, j0 = math.floor((left - x0) / CELL_M + 1e-6), math.floor((below - y0) / CELL_M + 1e-6)
            i1, j1 = math.ceil((right - x0) / CELL_M - 1e-6), math.ceil((above - y0) / CELL_M - 1e-6)
            grid[j0:j1, i0:i1] = 100
        return grid, (x0, y0)


def corridor(rng: random.Random) -> World:
    """A corridor of 17 m with four walls across, each with one passage, and goals in some of its bays."""
    length, below, above = 17.0, -2.2, 2.2
    places = (2.8, 6.2, 9.6, 13.0)
    passages = tuple(Passage(x, rng.uniform(-0.9, 0.9), rng.uniform(0.95, 1.35)) for x in places)
    walls = list(_room(-1.5, below, length - 1.5, above))
    for gap in passages:
        left, right = gap.x - _WALL_M / 2, gap.x + _WALL_M / 2
        walls += [(left, below, right, gap.y - gap.width / 2), (left, gap.y + gap.width / 2, right, above)]
    bays = [(low + high) / 2 for low, high in zip(places, (*places[1:], length - 1.5), strict=True)]
    goals = tuple(
        (x, rng.uniform(-0.8, 0.8), rng.uniform(-1.2, 1.2))
        for x in sorted(rng.sample(bays, rng.choice((2, 2, 3, 3, 4))))
    )
    area = (0.8, below, length - 2.0, above)
    clutter = _clutter(rng, rng.choice((0, 1, 2, 2, 3, 4)), area, walls, goals, passages)
    return World(tuple(walls), clutter, passages, _start(rng), goals)


def hall(rng: random.Random) -> World:
    """An open hall of 13 by 9 m with pillars, one wall with a door across it, goals in its corners."""
    left, below, right, above = -1.5, -1.5, 11.5, 7.5
    door = Passage(5.0 + rng.uniform(-0.6, 0.6), rng.uniform(2.0, 5.5), rng.uniform(0.95, 1.5))
    walls = list(_room(left, below, right, above))
    near, far = door.x - _WALL_M / 2, door.x + _WALL_M / 2
    walls += [(near, below, far, door.y - door.width / 2), (near, door.y + door.width / 2, far, above)]
    for x, y in ((2.0, 3.8), (8.2, 1.6), (8.2, 4.6)):
        walls.append((x - 0.2, y - 0.2, x + 0.2, y + 0.2))
    corners = [(9.8, 0.2), (9.8, 6.0), (6.9, 3.0), (3.2, 6.0), (1.0, 5.6), (3.2, 0.6)]
    rng.shuffle(corners)
    goals = tuple((x, y, rng.uniform(-math.pi, math.pi)) for x, y in corners[: rng.choice((2, 3, 3, 4))])
    clutter = _clutter(rng, rng.choice((0, 2, 3, 4, 6)), (left + 0.8, below + 0.8, right - 0.8, above - 0.8), walls,
                       goals, (door,))  # fmt: skip
    return World(tuple(walls), clutter, (door,), _start(rng), goals)


def yard(rng: random.Random) -> World:
    """An open yard of 11 by 11 m: nothing on the map but its walls, boxes that only the laser sees, goals anywhere."""
    low, high = -1.5, 9.5
    walls = list(_room(low, low, high, high))
    goals: list[Pose] = []
    wanted = rng.choice((2, 3, 3, 4))
    while len(goals) < wanted:
        x, y = rng.uniform(low + 1.0, high - 1.0), rng.uniform(low + 1.0, high - 1.0)
        last = goals[-1] if goals else (0.0, 0.0, 0.0)
        if math.hypot(x - last[0], y - last[1]) > _LEG_M:
            goals.append((x, y, rng.uniform(-math.pi, math.pi)))
    area = (low + 0.6, low + 0.6, high - 0.6, high - 0.6)
    clutter = _clutter(rng, rng.choice((2, 4, 6, 8)), area, walls, goals, ())
    return World(tuple(walls), clutter, (), _start(rng), tuple(goals))


WORLDS: Mapping[str, Callable[[random.Random], World]] = {"corridor": corridor, "hall": hall, "yard": yard}


@dataclass(frozen=True)
class Conditions:
    """What one run meets and nobody set."""

    world: World
    slip: float
    """How strongly the wheels slip: standard deviation of the share of the way that is lost or gained."""
    range_noise: float
    """Of the laser, m."""
    charge: float
    """Of the battery when the mission begins, share."""
    seed: int

    @classmethod
    def of(cls, seed: int, kind: str = "") -> Conditions:
        """The same seed, the same conditions; the seed chooses the world too unless it is named."""
        rng = random.Random(f"nav2 robot {seed}")
        drawn = rng.choice(sorted(WORLDS))
        world = WORLDS[kind or drawn](rng)
        return cls(world, rng.uniform(0.005, 0.04), rng.uniform(0.005, 0.015), rng.uniform(0.75, 1.0), seed)


def _room(x0: float, y0: float, x1: float, y1: float) -> tuple[Rect, ...]:
    w = _WALL_M
    return (
        (x0 - w, y0 - w, x1 + w, y0),
        (x0 - w, y1, x1 + w, y1 + w),
        (x0 - w, y0, x0, y1),
        (x1, y0, x1 + w, y1),
    )


def _start(rng: random.Random) -> Pose:
    return 0.0, rng.uniform(-0.15, 0.15), rng.uniform(-0.2, 0.2)


def _clutter(
    rng: random.Random,
    wanted: int,
    area: Rect,
    walls: Sequence[Rect],
    goals: Sequence[Pose],
    passages: Sequence[Passage],
) -> tuple[Rect, ...]:
    """Boxes away from goals and passages, each with a free way beside it; fewer than wanted where there is no room."""
    placed: list[Rect] = []
    for _ in range(60 * wanted):
        if len(placed) == wanted:
            break
        half = rng.uniform(0.12, 0.25)
        x, y = rng.uniform(area[0], area[2]), rng.uniform(area[1], area[3])
        box = (x - half, y - half, x + half, y + half)
        keep_free = [(0.0, 0.0), *(goal[:2] for goal in goals), *((gap.x, gap.y) for gap in passages)]
        if min(_apart(box, (gx, gy, gx, gy)) for gx, gy in keep_free) < 0.85:
            continue
        if min(_apart(box, other) for other in (*walls, *placed)) < _FREE_M and not _hugs(box, walls, placed):
            continue
        placed.append(box)
    return tuple(placed)


def _hugs(box: Rect, walls: Sequence[Rect], placed: Sequence[Rect]) -> bool:
    """Whether a box stands close to one wall only, so that no gap is left to try, and free of all else."""
    near = [other for other in (*walls, *placed) if _apart(box, other) < _FREE_M]
    return len(near) == 1 and near[0] in walls and _apart(box, near[0]) < 0.25


def _apart(a: Rect, b: Rect) -> float:
    """Distance between two rectangles."""
    return math.hypot(max(b[0] - a[2], a[0] - b[2], 0.0), max(b[1] - a[3], a[1] - b[3], 0.0))


def described(world: World) -> dict[str, Any]:
    """The world as plain data, for what the simulator knows of a run."""
    return {
        "goals": [list(goal) for goal in world.goals],
        "clutter": [list(box) for box in world.clutter],
        "passages": [[gap.x, gap.y, gap.width] for gap in world.passages],
    }
