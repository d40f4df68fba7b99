"""Planes: legs at an airspeed, circles, a landing."""

from __future__ import annotations

import numpy as np

from care_core.causal.nominal.formulas import Given, formula
from care_core.numbers import Floats

_PLANE = ("speed", "least_speed", "most_speed", "commanded_speed")
_PLANE_MISSION = (*_PLANE, "path_length", "loiter_turns", "loiter_radius", "hold_time", "returns", "return_distance")
_PLANE_ENDS_S = 30.0
"""Take-off run, flare, roll-out and disarming."""


@formula(*_PLANE)
def plane_airspeed(given: Given) -> Floats:
    """The airspeed that is asked for, by the mission or else the parameter: no less than the least, no more than the
    largest."""
    wanted = np.where(given["commanded_speed"] > 0, given["commanded_speed"], given["speed"])
    return np.asarray(np.maximum(np.minimum(wanted, given["most_speed"]), given["least_speed"]))


@formula(*_PLANE_MISSION)
def plane_mission_time(given: Given) -> Floats:
    """Arming to disarming: the legs, the way home and the circles at the wanted airspeed, without wind."""
    circles = given["loiter_turns"] * 2 * np.pi * np.abs(given["loiter_radius"])
    way = given["path_length"] + circles + given["returns"] * given["return_distance"]
    return np.asarray(_PLANE_ENDS_S + given["hold_time"] + way / np.maximum(plane_airspeed(given), 1.0))


@formula(*_PLANE_MISSION, "level_power")
def plane_energy(given: Given) -> Floats:
    """Wh: the power of level flight, which grows with the cube of the airspeed, all the time."""
    power = given["level_power"] * (plane_airspeed(given) / _POWER_AT_MS) ** 3
    return np.asarray(power * plane_mission_time(given) / 3600)


_POWER_AT_MS = 22.0
"""Airspeed for which `level_power` is given."""
# Fitted to 69 training flights of the reference configuration: height error on legs that are level, the part of a climb
# that a leg lags behind, and how far a corner leads off, in lengths of the guidance (AP_L1_Control.cpp: L1).
_LEVEL_ERROR_M, _LAGS, _CORNER, _DAMPING, _OFF_A_CIRCLE = 1.6, 0.25, 0.38, 0.75, 1.25


@formula(*_PLANE, "rises", "legs_length", "climb_rate")
def plane_height_error(given: Given) -> Floats:
    """Mean height error on the legs: a leg that leads up is flown below it until the climb is done."""
    flown_s = given["legs_length"] / np.maximum(plane_airspeed(given), 1.0)
    behind = _LAGS * given["rises"] / np.maximum(given["climb_rate"], 0.1)
    return np.asarray(_LEVEL_ERROR_M + behind / np.maximum(flown_s, 1.0))


@formula(*_PLANE, "period", "loiter_radius", "leg_after_loiter")
def plane_path_error(given: Given) -> Floats:
    """Largest distance from the legs: corners lead off by a share of the length of the guidance, and a leg that follows
    a circle begins as far off as the circle is wide."""
    guidance = given["period"] * _DAMPING * plane_airspeed(given) / np.pi
    circle = given["leg_after_loiter"] * _OFF_A_CIRCLE * np.abs(given["loiter_radius"])
    return np.asarray(np.maximum(_CORNER * guidance, circle))
