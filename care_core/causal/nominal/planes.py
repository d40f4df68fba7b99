"""Planes: legs at an airspeed, circles, a landing."""

from __future__ import annotations

import numpy as np

from care_core.causal.nominal.formulas import Given, formula
from care_core.numbers import Floats

_PLANE = ("speed", "least_speed", "most_speed", "commanded_speed")
_WAY = ("loiter_radius", "hold_time", "returns", "return_distance")
_MISSION = (*_PLANE, "path_length", "loiter_turns", "loiters", *_WAY)
_DAMPING = 0.75
"""NAVL1_DAMPING as shipped."""
# Fitted to the training flights of the reference configuration, those of QuadPlanes (_QUAD) apart.
_PLANE_ENDS_S, _TURN, _JOINS = 39.5, 1.55, 0.65
"""Take-off run, flare, roll-out and disarming; how many of its circles a turn takes; and the part of a circle that
joining a wait, and leaving it on course, takes."""
_QUAD_ENDS_S = 30.0
_LEVEL_ERROR_M, _LAGS, _FIRST_LAGS_S, _FIRST_LAGS, _BEGINS_S = 1.45, 0.75, 9.0, 0.7, 4.0
"""Height error on level legs (m); what a leg lags behind its climb; what is left of the first climb as its leg ends,
(s, and as of the other legs); and how long after the leg that climb begins (s)."""
_QUAD_LEVEL_ERROR_M, _QUAD_LAGS = 1.6, 0.25
_CORNER, _OFF_A_CIRCLE = 0.45, 1.2
"""How far a corner leads off, in lengths of the guidance (AP_L1_Control.cpp: L1), and a circle, in its radius."""
_QUAD_CORNER, _QUAD_OFF_A_CIRCLE = 0.38, 1.25


@formula(*_PLANE)
def plane_airspeed(given: Given) -> Floats:
    """The airspeed that is asked for, by the mission or else the parameter: no less than the least, no more than the
    largest."""
    wanted = np.where(given["commanded_speed"] > 0, given["commanded_speed"], given["speed"])
    return np.asarray(np.maximum(np.minimum(wanted, given["most_speed"]), given["least_speed"]))


@formula(*_MISSION)
def plane_mission_time(given: Given) -> Floats:
    """Arming to disarming: the legs, the way home and the circles at the wanted airspeed, without wind."""
    return _PLANE_ENDS_S + _flown_s(given, _TURN * given["loiter_turns"] + _JOINS * given["loiters"])


@formula(*_PLANE, "path_length", "loiter_turns", *_WAY)
def quadplane_mission_time(given: Given) -> Floats:
    """The same of a QuadPlane; what its lift motors take is left to the mechanism."""
    return _QUAD_ENDS_S + _flown_s(given, given["loiter_turns"])


def _flown_s(given: Given, turns: Floats) -> Floats:
    circles = turns * 2 * np.pi * np.abs(given["loiter_radius"])
    way = given["path_length"] + circles + given["returns"] * given["return_distance"]
    return np.asarray(given["hold_time"] + way / np.maximum(plane_airspeed(given), 1.0))


@formula(*_MISSION, "level_power")
def plane_energy(given: Given) -> Floats:
    """Wh: the power of level flight, which grows with the cube of the airspeed, all the time."""
    power = given["level_power"] * (plane_airspeed(given) / _POWER_AT_MS) ** 3
    return np.asarray(power * plane_mission_time(given) / 3600)


_POWER_AT_MS = 22.0
"""Airspeed for which `level_power` is given."""


@formula(*_PLANE, "rises", "first_rise", "first_length", "legs_length", "climb_rate")
def plane_height_error(given: Given) -> Floats:
    """Mean height error on the legs: one that leads up is flown below it until the climb is done, and the first of them
    until the climb of the way to it is."""
    rate = np.maximum(given["climb_rate"], 0.1)
    climbed = rate * np.maximum(given["first_length"] / np.maximum(plane_airspeed(given), 1.0) - _BEGINS_S, 0.0)
    left = np.maximum(given["first_rise"] - climbed, 0.0)
    behind = (_LAGS * given["rises"] + _FIRST_LAGS * left**2) / rate + _FIRST_LAGS_S * left
    return _LEVEL_ERROR_M + _mean_of_legs(given, behind)


@formula(*_PLANE, "rises", "legs_length", "climb_rate")
def quadplane_height_error(given: Given) -> Floats:
    """The same of a QuadPlane, whose `rises` count a part of the first climb."""
    behind = _QUAD_LAGS * given["rises"] / np.maximum(given["climb_rate"], 0.1)
    return _QUAD_LEVEL_ERROR_M + _mean_of_legs(given, behind)


def _mean_of_legs(given: Given, error_ms: Floats) -> Floats:
    """The mean of an error of height that is given times its seconds."""
    flown_s = given["legs_length"] / np.maximum(plane_airspeed(given), 1.0)
    return np.asarray(error_ms / np.maximum(flown_s, 1.0))


@formula(*_PLANE, "period", "loiter_radius", "leg_after_loiter")
def plane_path_error(given: Given) -> Floats:
    """Largest distance from the legs: corners lead off by a share of the length of the guidance, and a leg that follows
    a circle begins as far off as the circle is wide."""
    return _off_the_legs(given, _CORNER, _OFF_A_CIRCLE)


@formula(*_PLANE, "period", "loiter_radius", "leg_after_loiter")
def quadplane_path_error(given: Given) -> Floats:
    """The same of a QuadPlane."""
    return _off_the_legs(given, _QUAD_CORNER, _QUAD_OFF_A_CIRCLE)


def _off_the_legs(given: Given, corner: float, off_a_circle: float) -> Floats:
    guidance = given["period"] * _DAMPING * plane_airspeed(given) / np.pi
    circle = given["leg_after_loiter"] * off_a_circle * np.abs(given["loiter_radius"])
    return np.asarray(np.maximum(corner * guidance, circle))
