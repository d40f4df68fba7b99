"""Planes and QuadPlanes: legs at an airspeed, circles, a landing."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from care_core.causal.nominal.formulas import Given, formula
from care_core.numbers import Floats

_SPEED = ("speed", "least_speed", "most_speed", "commanded_speed")
_CIRCLES = ("loiter_turns", "loiter_radius", "hold_time", "loiters")
_MISSION = (*_SPEED, *_CIRCLES, "way_out", "way_back", "home_height")
_HEIGHT = (*_SPEED, "rises", "first_rise", "first_length", "legs_length", "climb_rate", "home_height")
_PATH = (*_SPEED, "period", "loiter_radius", "leg_after_loiter", "home_height")
_DAMPING = 0.75
"""NAVL1_DAMPING as shipped."""
_POWER_AT_MS, _POWER_GROWS = 22.0, 3.7
"""Airspeed for which `level_power` is given, and the power of the airspeed with which it grows, of planes that were
flown at several: drag takes the cube, and what a motor wastes grows, too."""
_THINS_PER_M, _THINS = 2.25577e-5, 2.12794
"""The standard atmosphere (ISO 2533): the root of the density falls by this power of 1 - height x this."""
_SHORT_S, _TAKES_OFF_S, _CLIMBS_S_PER_M = 18.4, 17.6, 0.107
"""Energy: how much shorter the way out is for the take-off and the landing; what these take, and what a metre of climb
takes, in seconds of level flight."""


class _Fitted(NamedTuple):
    """Constants of one kind, fitted to its training flights of the reference configuration."""

    ends_s: float
    """Take-off, landing and disarming beside the way."""
    turn: float
    """How many of its circles a turn takes."""
    joins: float
    """The part of a circle that joining a wait, and leaving it on course, takes."""
    level_error_m: float
    """Height error on level legs."""
    lags: float
    """What a leg lags behind its climb."""
    first_lags_s: float
    """What is left of the first climb as its leg ends, in seconds."""
    first_lags: float
    """The same as of the other legs."""
    begins_s: float
    """How long after the run that climb begins, which the take-off takes."""
    corner: float
    """How far a corner leads off, in lengths of the guidance (AP_L1_Control.cpp: L1)."""
    off_a_circle: float
    """How far a circle does, in its radius."""


_PLANE = _Fitted(19.5, 1.78, 0.52, 0.87, 0.64, 4.0, 0.38, 11.5, 0.38, 1.14)
_QUADPLANE = _Fitted(33.7, 1.5, 0.36, 1.68, 0.52, 0.0, 1.14, 16.8, 0.24, 1.19)


@formula(*_SPEED)
def plane_airspeed(given: Given) -> Floats:
    """The airspeed that is asked for, by the mission or else the parameter: no less than the least, no more than the
    largest."""
    wanted = np.where(given["commanded_speed"] > 0, given["commanded_speed"], given["speed"])
    return np.asarray(np.maximum(np.minimum(wanted, given["most_speed"]), given["least_speed"]))


@formula(*_SPEED, "home_height")
def plane_leg_speed(given: Given) -> Floats:
    """What that airspeed is over ground without wind: more in thin air."""
    return np.asarray(plane_airspeed(given) * _true_per_indicated(given))


@formula(*_MISSION)
def plane_mission_time(given: Given) -> Floats:
    """Arming to disarming, without wind: the way out with its circles at the wanted airspeed, and the way back at that
    of the parameter."""
    return _mission_time(given, _PLANE)


@formula(*_MISSION, "climb_speed", "descent_speed", "takeoff_height", "end_height", "return_height")
def quadplane_mission_time(given: Given) -> Floats:
    """The same of a QuadPlane, which climbs upright first, and comes down upright from its last waypoint or from the
    height of its return."""
    from_height = np.where(given["way_back"] > 0, given["return_height"], given["end_height"])
    climb_s = given["takeoff_height"] / np.maximum(given["climb_speed"], 0.1)
    descent_s = np.maximum(from_height, 0.0) / np.maximum(given["descent_speed"], 0.1)
    return _mission_time(given, _QUADPLANE) + climb_s + descent_s


@formula(*_MISSION, "level_power", "climbs")
def plane_energy(given: Given) -> Floats:
    """Wh: the power of level flight, as the airspeed asks for it, on the way, and what the take-off, the climbs and the
    landing take beside it."""
    out, back = (
        (airspeed / _POWER_AT_MS) ** _POWER_GROWS for airspeed in (plane_airspeed(given), _own_airspeed(given))
    )
    level_s = out * np.maximum(_out_s(given, _PLANE) - _SHORT_S, 0.0) + back * _back_s(given)
    return np.asarray(given["level_power"] * (level_s + _TAKES_OFF_S + _CLIMBS_S_PER_M * given["climbs"]) / 3600)


@formula(*_HEIGHT)
def plane_height_error(given: Given) -> Floats:
    """Mean height error on the legs: one that leads up is flown below it until the climb is done, and the first of them
    until the climb of the way to it is."""
    return _height_error(given, _PLANE)


@formula(*_HEIGHT)
def quadplane_height_error(given: Given) -> Floats:
    """The same of a QuadPlane."""
    return _height_error(given, _QUADPLANE)


@formula(*_PATH)
def plane_path_error(given: Given) -> Floats:
    """Largest distance from the legs: corners lead off by a share of the length of the guidance, and a leg that follows
    a circle begins as far off as the circle is wide."""
    return _path_error(given, _PLANE)


@formula(*_PATH)
def quadplane_path_error(given: Given) -> Floats:
    """The same of a QuadPlane."""
    return _path_error(given, _QUADPLANE)


def _true_per_indicated(given: Given) -> Floats:
    return np.asarray((1.0 - _THINS_PER_M * given["home_height"]) ** -_THINS)


def _own_airspeed(given: Given) -> Floats:
    """The airspeed of a plane that no mission commands one."""
    return plane_airspeed({**given, "commanded_speed": np.zeros_like(given["speed"])})


def _mission_time(given: Given, kind: _Fitted) -> Floats:
    return np.asarray(kind.ends_s + _out_s(given, kind) + _back_s(given))


def _out_s(given: Given, kind: _Fitted) -> Floats:
    turns = kind.turn * given["loiter_turns"] + kind.joins * given["loiters"]
    way = given["way_out"] + turns * 2 * np.pi * np.abs(given["loiter_radius"])
    return np.asarray(given["hold_time"] + way / np.maximum(plane_leg_speed(given), 1.0))


def _back_s(given: Given) -> Floats:
    return np.asarray(given["way_back"] / np.maximum(_true_per_indicated(given) * _own_airspeed(given), 1.0))


def _height_error(given: Given, kind: _Fitted) -> Floats:
    rate, speed = np.maximum(given["climb_rate"], 0.1), np.maximum(plane_leg_speed(given), 1.0)
    climbed = rate * np.maximum(given["first_length"] / speed - kind.begins_s, 0.0)
    left = np.maximum(given["first_rise"] - climbed, 0.0)
    behind_ms = (kind.lags * given["rises"] + kind.first_lags * left**2) / rate + kind.first_lags_s * left
    return np.asarray(kind.level_error_m + behind_ms / np.maximum(given["legs_length"] / speed, 1.0))


def _path_error(given: Given, kind: _Fitted) -> Floats:
    guidance = given["period"] * _DAMPING * plane_leg_speed(given) / np.pi
    circle = given["leg_after_loiter"] * kind.off_a_circle * np.abs(given["loiter_radius"])
    return np.asarray(np.maximum(kind.corner * guidance, circle))
