"""Multicopters: waypoints flown with speed, acceleration and jerk limits."""

from __future__ import annotations

import numpy as np

from care_core.causal.nominal.formulas import TINY, Given, formula
from care_core.causal.nominal.legs import END, LEGS, blend, ramps_of, rise_time, two_lengths, within_lean
from care_core.numbers import Floats

# ArduCopter 4.5: seconds between arming and lifting off (ARMING_DELAY_SEC), loiter above home (RTL_LOIT_TIME), height
# of the last part of a landing (LAND_ALT_LOW), slope of the cone in which a return stays low (RTL_CONE_SLOPE), the
# landing detector with its disarming, and a moment before the way down begins.
_ARMING_S, _LOITER_S, _LAND_LOW_M, _CONE, _LANDED_S, _STILL_S = 2.0, 5.0, 10.0, 3.0, 2.0, 1.0

_TAKEOFF = ("takeoff_height", "climb_speed")
_LIMITS = ("speed", "acceleration", "jerk", "lean_limit", "response")
_CRUISE = (*LEGS, *_LIMITS, "radius", "climb_speed", "descent_speed")
_MISSION = tuple(dict.fromkeys((*_CRUISE, "hold_time", *_TAKEOFF, *END, *_LIMITS, "landing_speed")))


@formula(*_TAKEOFF)
def multicopter_takeoff_time(given: Given) -> Floats:
    """Arming to the first leg."""
    return _ARMING_S + rise_time(given["takeoff_height"], given["climb_speed"])


@formula(*_CRUISE)
def multicopter_cruise_time(given: Given) -> Floats:
    """All legs without the waits at their ends.

    Each leg starts and ends at rest. Where nobody waits, the next leg begins before the last one ends: as early as the
    corner between them stays within the radius (ArduCopter 4.5, SCurve::advance_target_along_track).
    """
    speed = np.where(given["commanded_speed"] > 0, given["commanded_speed"], given["speed"])
    acceleration, jerk = within_lean(given), given["jerk"]
    count = np.maximum(given["legs"], 1)
    length = given["path_length"] / count
    climbing, descending = given["climbing_legs"], given["descending_legs"]
    # Level, climbing and descending legs, (3, 1, n), of two lengths, (2, n).
    legs = np.array([count - climbing - descending, climbing, descending])[:, None] / 2
    rise = np.array(
        [np.zeros_like(length), given["climb"] / np.maximum(climbing, 1), given["descent"] / np.maximum(descending, 1)]
    )[:, None]
    limit = np.array([np.full_like(length, np.inf), given["climb_speed"], given["descent_speed"]])[:, None]
    flat = np.array(two_lengths(length, given["leg_variation"]))
    way = np.hypot(flat, rise)
    fastest = np.minimum(speed * way / flat, limit * way / np.maximum(rise, TINY))
    peak, ramp = ramps_of(way, fastest, acceleration, jerk, _lag(given))
    time, ramps, top = ((legs * part).sum(axis=(0, 1)) for part in (way / peak + ramp, ramp, peak))
    overlap = 2 * blend(given["radius"], given["corner_turn"], top / count, acceleration, jerk, 2 * acceleration)
    return np.asarray(time - given["flown_corners"] * np.minimum(overlap, ramps / count))


@formula(*_CRUISE)
def multicopter_cruise_speed(given: Given) -> Floats:
    """Length of the legs over the time for them."""
    return np.asarray(given["path_length"] / np.maximum(multicopter_cruise_time(given), TINY))


@formula(*END, *_LIMITS, "climb_speed")
def multicopter_return_time(given: Given) -> Floats:
    """From the last waypoint to above home: up, over, and the wait there. Nothing where the mission ends elsewhere."""
    way = np.maximum(given["return_distance"], 1.0)
    peak, ramp = ramps_of(way, given["speed"], within_lean(given), given["jerk"], _lag(given))
    over = np.where(given["return_distance"] > 1.0, way / peak + ramp, 0.0)
    up = rise_time(_return_height(given) - given["end_height"], given["climb_speed"])
    return np.asarray(given["returns"] * (up + over + _LOITER_S))


@formula(*END, "descent_speed")
def multicopter_descent_time(given: Given) -> Floats:
    """From the height of the return, or of the last waypoint, to where a landing slows down."""
    return _STILL_S + rise_time(_return_height(given) - _LAND_LOW_M, given["descent_speed"])


@formula(*END, "landing_speed")
def multicopter_landing_time(given: Given) -> Floats:
    """The slow last metres, to disarming."""
    slow = np.minimum(_return_height(given), _LAND_LOW_M)
    return np.asarray(slow / np.maximum(given["landing_speed"], TINY) + _LANDED_S)


@formula(*_MISSION)
def multicopter_mission_time(given: Given) -> Floats:
    """Arming to disarming: the phases one after the other."""
    phases = (
        multicopter_takeoff_time, multicopter_cruise_time, multicopter_return_time, multicopter_descent_time,
        multicopter_landing_time,
    )  # fmt: skip
    return np.asarray(given["hold_time"] + sum(phase(given) for phase in phases))


@formula(*_MISSION, "hover_power")
def multicopter_energy(given: Given) -> Floats:
    """Wh: the power that keeps the vehicle in the air, all the time."""
    return np.asarray(given["hover_power"] * multicopter_mission_time(given) / 3600)


@formula("motor_output")
def multicopter_hover_power(given: Given) -> Floats:
    """W: what the multicopters of the training took to stay up, by the mean output of their motors (342 flights of
    seven vehicles, 0.73 to 1.36 times this)."""
    return np.asarray(570.0 * np.maximum(given["motor_output"], TINY) ** 1.16)


def _lag(given: Given) -> Floats:
    """What the limit of the jerk's change adds to speeding up and slowing down (WPNav: snap by the response time)."""
    return np.asarray(2 * np.maximum(given["response"], 0.1))


def _return_height(given: Given) -> Floats:
    """Height of the way home: no higher than needed near home, never lower than the last waypoint."""
    last = given["end_height"]
    high = np.maximum(last, np.minimum(given["return_height"], _CONE * given["return_distance"]))
    return np.where(given["returns"] > 0, high, last)
