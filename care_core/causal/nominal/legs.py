"""Legs that begin and end at rest, with limits of speed, acceleration and jerk."""

from __future__ import annotations

import numpy as np

from care_core.causal.nominal.formulas import TINY, Given
from care_core.geodesy import GRAVITY
from care_core.numbers import Floats

LEGS = (
    "path_length", "legs", "leg_variation", "climb", "climbing_legs", "descent", "descending_legs", "flown_corners",
    "corner_turn", "commanded_speed",
)  # fmt: skip
END = ("returns", "end_height", "return_distance", "return_height")
"""Arguments of the formulas of legs, and of the way home."""
_RISE_ACCELERATION, _RISE_JERK = 1.0, 5.0
"""Vertical acceleration and jerk of the way (ArduCopter 4.5: WPNAV_ACCEL_Z, PSC_JERK_Z)."""


def two_lengths(mean: Floats, variation: Floats) -> tuple[Floats, Floats]:
    """Two lengths that stand for all legs: they have their mean and their variation."""
    return np.maximum(mean * (1 - variation), 1.0), np.maximum(mean * (1 + variation), 1.0)


def rise_time(height: Floats, speed: Floats) -> Floats:
    """Time up or down a height from rest to rest; 0 where there is none."""
    way = np.maximum(height, TINY)
    peak, ramp = ramps_of(way, speed, np.full_like(way, _RISE_ACCELERATION), np.full_like(way, _RISE_JERK), 0.0)
    return np.where(height > 0, way / peak + ramp, 0.0)


def ramps_of(
    way: Floats, speed: Floats, acceleration: Floats, jerk: Floats, lag: Floats | float
) -> tuple[Floats, Floats]:
    """Top speed on a way from rest to rest, and the time that speeding up and slowing down add to `way / speed`."""
    bend = acceleration**2 / jerk  # below this speed the largest acceleration is never reached
    with_plateau = (-bend + np.sqrt(bend**2 + 4 * acceleration * way)) / 2
    without = (way * np.sqrt(jerk) / 2) ** (2 / 3)
    peak = np.maximum(np.minimum(np.where(with_plateau >= bend, with_plateau, without), speed), TINY)
    ramp = np.where(peak >= bend, peak / acceleration + acceleration / jerk, 2 * np.sqrt(peak / jerk))
    return peak, np.asarray(ramp + lag)


def blend(
    radius: Floats, turn_deg: Floats, top: Floats, acceleration: Floats, jerk: Floats,
    corner: Floats,
) -> Floats:  # fmt: skip
    """How long before a corner the next leg may begin, halved: the corner stays within the radius, the vehicle within
    its speed and the acceleration that it may have in a corner."""
    aside = np.maximum(2 * np.sin(np.radians(turn_deg) / 2), 0.05)
    along = np.maximum(2 * np.cos(np.radians(turn_deg) / 2), 0.05)
    bend = acceleration / jerk  # seconds from rest until the acceleration is at its largest
    off = radius / aside
    beyond = off - acceleration**3 / (6 * jerk**2)
    later = bend + (-bend / 2 + np.sqrt(np.maximum(bend**2 / 4 + 2 * beyond / acceleration, 0.0)))
    by_radius = np.where(beyond <= 0, np.cbrt(6 * off / jerk), later)
    by_turn = np.where(acceleration * aside < corner, np.inf, corner / (jerk * aside))
    slowest = top / along
    knee = acceleration * bend / 2
    by_speed = np.where(slowest >= knee, bend + (slowest - knee) / acceleration, np.sqrt(2 * slowest / jerk))
    return np.asarray(np.minimum(np.minimum(by_radius, by_turn), by_speed))


def within_lean(given: Given) -> Floats:
    """The wanted acceleration, but no more than two thirds of what the largest lean gives: the rest holds the wind."""
    lean = np.radians(np.clip(given["lean_limit"], 5.0, 60.0))
    return np.minimum(given["acceleration"], GRAVITY * np.tan(lean) * 2 / 3)
