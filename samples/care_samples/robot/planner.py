"""Ways through the hall: A* over a grid whose cells cost more near obstacles."""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence

from care_samples.robot.world import LENGTH, RADIUS, WIDTH, Disc, clearance, shelves

CELL = 0.2
COLUMNS, ROWS = round(LENGTH / CELL), round(WIDTH / CELL)

Point = tuple[float, float]
_STEPS = tuple((i, j, math.hypot(i, j) * CELL) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j)


class Map:
    """What the robot knows of the hall: the shelves from the start, clutter once it has seen it."""

    def __init__(self, padding: float, inflation: float, weight: float) -> None:
        self._padding, self._inflation, self._weight = padding, inflation, weight
        self.discs: list[Disc] = []
        rects = shelves()
        self._free = [
            [clearance((i + 0.5) * CELL, (j + 0.5) * CELL, (), rects) for j in range(ROWS)] for i in range(COLUMNS)
        ]
        self._costs = self._priced()

    def see(self, disc: Disc) -> None:
        """Put a newly seen obstacle into the map."""
        self.discs.append(disc)
        x, y, radius = disc
        for i, column in enumerate(self._free):
            for j, free in enumerate(column):
                distance = math.hypot((i + 0.5) * CELL - x, (j + 0.5) * CELL - y) - radius
                column[j] = min(free, distance)
        self._costs = self._priced()

    def _priced(self) -> list[list[float]]:
        """Per cell the cost of a metre through it; infinite where the padded robot does not fit."""
        margin, reach = RADIUS + self._padding, max(self._inflation, 1e-6)
        return [
            [
                math.inf if free < margin else 1.0 + self._weight * max(0.0, 1.0 - (free - margin) / reach) ** 2
                for free in column
            ]
            for column in self._free
        ]

    def way(self, start: Point, goal: Point) -> list[Point]:
        """The cheapest way between two places, empty where there is none."""
        first, last = self._cell(start), self._cell(goal)
        costs = self._costs
        best = {first: 0.0}
        came: dict[tuple[int, int], tuple[int, int]] = {}
        queue = [(0.0, first)]
        while queue:
            _, cell = heapq.heappop(queue)
            if cell == last:
                return self._traced(came, cell, goal)
            i, j = cell
            for di, dj, length in _STEPS:
                a, b = i + di, j + dj
                if not (0 <= a < COLUMNS and 0 <= b < ROWS) or (costs[a][b] == math.inf and (a, b) != last):
                    continue
                price = costs[a][b] if costs[a][b] < math.inf else 20.0
                cost = best[cell] + length * price
                if cost < best.get((a, b), math.inf):
                    best[a, b] = cost
                    came[a, b] = cell
                    heapq.heappush(queue, (cost + CELL * math.hypot(a - last[0], b - last[1]), (a, b)))
        return []

    @staticmethod
    def _cell(point: Point) -> tuple[int, int]:
        return min(max(int(point[0] / CELL), 0), COLUMNS - 1), min(max(int(point[1] / CELL), 0), ROWS - 1)

    @staticmethod
    def _traced(came: dict[tuple[int, int], tuple[int, int]], cell: tuple[int, int], goal: Point) -> list[Point]:
        cells = [cell]
        while cells[-1] in came:
            cells.append(came[cells[-1]])
        points = [((i + 0.5) * CELL, (j + 0.5) * CELL) for i, j in reversed(cells)]
        return [*_smoothed(points[:-1]), goal]


def _smoothed(points: Sequence[Point]) -> list[Point]:
    """Each point the mean of itself and its neighbours: a grid's corners are none of the hall's."""
    middle = [
        ((a[0] + b[0] + c[0]) / 3, (a[1] + b[1] + c[1]) / 3)
        for a, b, c in zip(points, points[1:], points[2:], strict=False)
    ]
    return [*points[:1], *middle, *points[-1:]]
