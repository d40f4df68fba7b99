"""Rovers: the same legs on the ground, corners driven through or turned on the spot."""

from __future__ import annotations

import numpy as np

from care_core.causal.nominal.formulas import TINY, Given, formula
from care_core.causal.nominal.legs import blend, ramps_of, two_lengths
from care_core.numbers import Floats

_DRIVE = (
    "path_length", "legs", "leg_variation", "flown_corners", "corner_turn", "sharp_corners", "sharp_turns",
    "commanded_speed", "speed", "acceleration", "deceleration", "radius", "turn_limit", "turn_rate", "throttle_limit",
    "full_throttle_speed", "steering_kind",
)  # fmt: skip
# ArduRover 4.5: acceleration where none is given (AR_WPNav.cpp: AR_WPNAV_ACCEL_MAX), percent below which the largest
# throttle is not taken (AP_MotorsUGV.cpp: sanity_check_parameters), turn rate on the spot (AR_PivotTurn.cpp:
# WP_PIVOT_RATE).
_NO_LIMIT, _LEAST_THROTTLE, _PIVOT_RATE = 20.0, 30.0, 60.0
# Fitted to the training drives: path error of a rover that stands nearly still, seconds in which its steering responds,
# those more of a skid-steered one, and the part of a turn that leads it off.
_POSITION_M, _RESPONSE_S, _SKID_S, _TURN_RAD = 0.55, 0.27, 0.18, 0.18


@formula(*_DRIVE)
def drive_cruise_time(given: Given) -> Floats:
    """All legs of a rover without the waits at their ends.

    Speeding up and slowing down share the smaller of both limits, and the jerk is as large as it (AR_WPNav::init). A
    skid-steered one stops at sharp corners and turns on the spot; others begin the next leg early.
    """
    speed, limit, count = _drive_speed(given), _drive_acceleration(given), np.maximum(given["legs"], 1)
    time, ramps, top = np.zeros_like(speed), np.zeros_like(speed), np.zeros_like(speed)
    for way in two_lengths(given["path_length"] / count, given["leg_variation"]):
        peak, ramp = ramps_of(way, speed, limit, limit, 0.0)
        time += count / 2 * (way / peak + ramp)
        ramps += count / 2 * ramp
        top += count / 2 * peak
    overlap = 2 * blend(given["radius"], given["corner_turn"], top / count, limit, limit, given["turn_limit"])
    through = given["flown_corners"] - given["steering_kind"] * given["sharp_corners"]
    pivots = (
        given["steering_kind"] * given["sharp_turns"] / np.minimum(_PIVOT_RATE, np.maximum(given["turn_rate"], 1.0))
    )
    return np.asarray(time + pivots - through * np.minimum(overlap, ramps / count))


def _drive_speed(given: Given) -> Floats:
    """The speed that is asked for, as far as the throttle gives it."""
    wanted = np.where(given["commanded_speed"] > 0, given["commanded_speed"], given["speed"])
    throttle = np.clip(given["throttle_limit"], _LEAST_THROTTLE, 100.0) / 100.0
    most = np.where(given["full_throttle_speed"] > 0, given["full_throttle_speed"] * throttle, wanted)
    return np.asarray(np.minimum(wanted, most))


def _drive_acceleration(given: Given) -> Floats:
    """The smaller of both limits, each of which may be none."""
    faster = np.where(given["acceleration"] > 0, given["acceleration"], _NO_LIMIT)
    return np.asarray(np.where(given["deceleration"] > 0, np.minimum(faster, given["deceleration"]), faster))


@formula(*_DRIVE)
def drive_cruise_speed(given: Given) -> Floats:
    """Length of the legs over the time for them."""
    return np.asarray(given["path_length"] / np.maximum(drive_cruise_time(given), TINY))


@formula(*_DRIVE, "hold_time")
def drive_mission_time(given: Given) -> Floats:
    """The legs and the waits at their ends."""
    return np.asarray(given["hold_time"] + drive_cruise_time(given))


@formula(*_DRIVE)
def drive_path_error(given: Given) -> Floats:
    """Largest distance from the legs: how far a rover gets while its steering responds and turns as fast as it may."""
    leg = given["path_length"] / np.maximum(given["legs"], 1)
    fastest = np.minimum(_drive_speed(given), np.sqrt(_drive_acceleration(given) * leg))
    turn_s = _TURN_RAD / np.radians(np.maximum(given["turn_rate"], 1.0))
    return np.asarray(_POSITION_M + fastest * (_RESPONSE_S + given["steering_kind"] * _SKID_S + turn_s))


@formula("path_length", "energy_per_metre")
def drive_energy(given: Given) -> Floats:
    """Wh: what each metre takes, all the way."""
    return np.asarray(given["energy_per_metre"] * given["path_length"] / 3600)


@formula("steering_kind")
def drive_energy_per_metre(given: Given) -> Floats:
    """J/m: what the rovers of the training took, with steered wheels and with sides that are driven apart (218 drives,
    99 of 100 of them 0.97 to 1.4 times this)."""
    return np.where(given["steering_kind"] > 0, 150.0, 31.3)


@formula("steering_kind")
def drive_full_throttle_speed(given: Given) -> Floats:
    """m/s: how fast the rovers of the training were for their throttle (95 of 100 at least 0.97 times this)."""
    return np.where(given["steering_kind"] > 0, 4.0, 19.6)
