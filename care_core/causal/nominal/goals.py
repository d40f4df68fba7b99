"""Robots on goals: driven from one to the next, turned at each."""

from __future__ import annotations

import numpy as np

from care_core.causal.nominal.formulas import Given, formula
from care_core.numbers import Floats

# What the goals of training took at the reference configuration of move_base (0.5 m/s, 1 rad/s): the way at full speed,
# the turns at full rate, and 4 s a goal to speed up, to find the way and to come to rest. The medians of five goals,
# 33 to 41 runs each, lie within 10% of it. What other speeds do is learned as a ratio: with the run's own speed in its
# place, times of runs left out were predicted to 21% instead of 20% (rms of the logarithm).
_GOAL_S, _METRE_S, _RADIAN_S = 4.0, 2.0, 1.0
_DRIVE_W = 80.0
"""Power of a robot of this size on its way; a mechanism learns the ratio to it."""
_GOALS = ("goals", "distance", "turn")


@formula(*_GOALS)
def goals_time(given: Given) -> Floats:
    """First goal sent to last answer, from the distance (m) and turning (rad) for each goal."""
    return np.asarray(given["goals"] * (_GOAL_S + _METRE_S * given["distance"] + _RADIAN_S * given["turn"]))


@formula(*_GOALS)
def goals_energy(given: Given) -> Floats:
    """Wh: the same power all the time."""
    return np.asarray(_DRIVE_W * goals_time(given) / 3600)
