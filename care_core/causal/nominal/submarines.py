"""Submarines: legs at a speed, up and down at others."""

from __future__ import annotations

import numpy as np

from care_core.causal.nominal.formulas import TINY, Given, formula
from care_core.numbers import Floats

_DIVE = ("path_length", "legs", "climb", "descent", "hold_time", "speed", "climb_speed", "descent_speed")
_LEG_S = 3.0
"""What speeding up and slowing down add to each leg."""


@formula(*_DIVE)
def dive_mission_time(given: Given) -> Floats:
    """The legs of a submarine, each as long as its way or its change of depth takes, and the waits at their ends."""
    over = given["path_length"] / np.maximum(given["speed"], TINY)
    up = given["climb"] / np.maximum(given["climb_speed"], TINY)
    down = given["descent"] / np.maximum(given["descent_speed"], TINY)
    return np.asarray(given["hold_time"] + given["legs"] * _LEG_S + np.maximum(over, up + down))
