"""A laser scanner at the front of the robot."""

from __future__ import annotations

import math

import numpy as np

from nav2_robot.world import Floats, Pose, World

AHEAD_M = 0.2
"""In front of the middle of the body."""
RAYS = 181
ANGLE_MIN, ANGLE_MAX = -math.radians(135), math.radians(135)
RANGE_MIN, RANGE_MAX = 0.05, 12.0
PERIOD_S = 0.1

_ANGLES = np.linspace(ANGLE_MIN, ANGLE_MAX, RAYS)


def scan(world: World, pose: Pose, noise: float, rng: np.random.Generator) -> Floats:
    """Ranges in m, shape (RAYS,), from right to left; inf beyond the longest."""
    x, y, yaw = pose
    ranges = world.cast(x + AHEAD_M * math.cos(yaw), y + AHEAD_M * math.sin(yaw), yaw + _ANGLES)
    return limited(ranges + noise * rng.standard_normal(RAYS))


def limited(ranges: Floats) -> Floats:
    """Ranges as the device gives them: none nearer than its shortest, nothing beyond its longest."""
    return np.asarray(np.where(ranges > RANGE_MAX, np.inf, np.maximum(ranges, RANGE_MIN)), np.float64)
