"""How a robot leans by its transforms, where neither odometry nor an IMU tells: a filter or a simulator shows it."""

from __future__ import annotations

from collections.abc import Iterator, Sized
from typing import Any

import numpy as np

from care_core.ecosystems.ros.messages import MESSAGES, TF, lean
from care_core.logs.base import Table
from care_core.numbers import Floats

_BASES = ("base_link", "base_footprint", "base_stabilized")
"""Frames of the robot (REP 105 and 120): what of them leans, leans with it."""
_WORLDS = ("odom", "map", "world", "base_footprint", "base_stabilized")
"""Frames that stand upright."""
_FEWEST = 50
"""Transforms that tell how it usually stands."""
_ROTATION = len(MESSAGES[TF[0]].reads) - 4
"""Where the parts of the rotation begin in what is read of transforms."""


def shown_tilts(table: Table) -> Iterator[tuple[Floats, Floats]]:
    """Time, s, and angle to how it stood at first, deg, of each transform of the robot's frame; each of shape (n,)."""
    columns = [table[name] for name in MESSAGES[TF[0]].reads]
    found: dict[tuple[str, str], list[tuple[float, ...]]] = {}
    for time_s, *fields in zip(table.t.tolist(), *(column.tolist() for column in columns), strict=True):
        if not all(isinstance(field, Sized) for field in fields):
            continue
        for parent, child, *numbers in zip(*fields, strict=False):
            pair = _last(parent), _last(child)
            if pair[0] in _WORLDS and pair[1] in _BASES:
                found.setdefault(pair, []).append((time_s, *numbers[_ROTATION - 2 :]))
    for rows in found.values():
        if len(rows) >= _FEWEST and (tilt := _tilt(rows)) is not None:
            yield np.array([row[0] for row in rows]), tilt


def _last(frame: object) -> str:
    """A frame's name without the name space of its robot."""
    return str(frame).rstrip("/").rpartition("/")[2]


def _tilt(rows: list[tuple[Any, ...]]) -> Floats | None:
    """None where a rotation is none."""
    try:
        parts = np.array([row[1:] for row in rows], np.float64).T
    except (TypeError, ValueError):
        return None
    return lean(*parts)
