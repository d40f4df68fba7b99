"""Multicopters under PX4: a trajectory with limited jerk, corners as fast as their radius lets."""

from __future__ import annotations

import numpy as np

from care_core.causal.nominal.formulas import TINY, Given, formula
from care_core.causal.nominal.legs import END, LEGS, ramps_of, rise_time, two_lengths, within_lean
from care_core.numbers import Floats

# PX4 1.15: seconds between arming and lifting off (COM_SPOOLUP_TIME, MPC_TKO_RAMP_T), share of the acceleration that
# is there in a corner, height below which a landing is slow (MPC_LAND_ALT2) and from which it slows down
# (MPC_LAND_ALT1), the way within which a return flies home as high as it is (RTL_MIN_DIST).
_SPOOL_S, _SLOW_BELOW_M, _SLOWS_FROM_M, _NEAR_HOME_M = 4.0, 5.0, 10.0, 10.0
_PX4_LIMITS = ("speed", "fastest", "acceleration", "jerk", "lean_limit")
_PX4_CRUISE = (*LEGS, *_PX4_LIMITS, "radius", "climb_speed", "descent_speed")
_PX4_TAKEOFF = ("takeoff_height", "takeoff_speed", "climb_speed")
_PX4_RETURN = (*END, *_PX4_LIMITS, "climb_speed")
_PX4_DESCENT = (*END, "descent_speed", "descend_height", "landing_delay", "landing_speed")
_PX4_LANDING = ("landing_speed", "detection_time", "disarm_time")
_PX4_MISSION = tuple(
    dict.fromkeys((*_PX4_CRUISE, "hold_time", *_PX4_TAKEOFF, *_PX4_RETURN, *_PX4_DESCENT, *_PX4_LANDING))
)


@formula(*_PX4_TAKEOFF)
def px4_takeoff_time(given: Given) -> Floats:
    """Arming to the first leg."""
    return _SPOOL_S + rise_time(given["takeoff_height"], np.minimum(given["takeoff_speed"], given["climb_speed"]))


@formula(*_PX4_CRUISE)
def px4_cruise_time(given: Given) -> Floats:
    """All legs without the waits at their ends. A corner without a wait is flown through at the speed that keeps the
    acceleration within a circle of the acceptance radius (PX4: PositionSmoothing, computeMaxSpeedInWaypoint)."""
    wanted = np.where(given["commanded_speed"] > 0, given["commanded_speed"], given["speed"])
    speed = np.minimum(wanted, given["fastest"])
    acceleration, jerk = within_lean(given), given["jerk"]
    count = np.maximum(given["legs"], 1)
    climbing, descending = given["climbing_legs"], given["descending_legs"]
    legs = np.array([count - climbing - descending, climbing, descending])[:, None] / 2
    length = given["path_length"] / count
    rise = np.array(
        [np.zeros_like(length), given["climb"] / np.maximum(climbing, 1), given["descent"] / np.maximum(descending, 1)]
    )[:, None]
    limit = np.array([np.full_like(length, np.inf), given["climb_speed"], given["descent_speed"]])[:, None]
    flat = np.array(two_lengths(length, given["leg_variation"]))
    fastest = np.minimum(speed, limit * flat / np.maximum(rise, TINY))
    peak, ramp = ramps_of(flat, fastest, acceleration, jerk, 0.0)
    time, top = ((legs * part).sum(axis=(0, 1)) for part in (flat / peak + ramp, peak))
    inside = np.radians(180.0 - np.clip(given["corner_turn"], 1.0, 179.0)) / 2
    through = np.minimum(np.sqrt(acceleration * given["radius"] * np.tan(inside)), top / count)
    gained = through * (2 * top / count - through) / (acceleration * np.maximum(top / count, TINY))
    return np.asarray(np.maximum(time - given["flown_corners"] * gained, given["path_length"] / speed))


@formula(*_PX4_CRUISE)
def px4_cruise_speed(given: Given) -> Floats:
    """Length of the legs over the time for them."""
    return np.asarray(given["path_length"] / np.maximum(px4_cruise_time(given), TINY))


@formula(*_PX4_RETURN)
def px4_return_time(given: Given) -> Floats:
    """From the last waypoint to above home: up and over. Nothing where the mission ends elsewhere."""
    way = np.maximum(given["return_distance"], 1.0)
    peak, ramp = ramps_of(way, np.minimum(given["speed"], given["fastest"]), within_lean(given), given["jerk"], 0.0)
    over = np.where(given["return_distance"] > 1.0, way / peak + ramp, 0.0)
    up = rise_time(_px4_return_height(given) - given["end_height"], given["climb_speed"])
    return np.asarray(given["returns"] * (up + over))


@formula(*_PX4_DESCENT)
def px4_descent_time(given: Given) -> Floats:
    """From the height of the return, or of the last waypoint, to where a landing is slow, with the wait on the way."""
    high = _px4_return_height(given)
    slows = np.minimum(high, _SLOWS_FROM_M)
    fast = rise_time(high - slows, given["descent_speed"])
    middle = np.maximum((given["descent_speed"] + given["landing_speed"]) / 2, TINY)
    wait = given["returns"] * given["landing_delay"]
    return np.asarray(fast + np.maximum(slows - _SLOW_BELOW_M, 0.0) / middle + wait)


@formula(*_PX4_LANDING)
def px4_landing_time(given: Given) -> Floats:
    """The slow last metres, to disarming."""
    down = _SLOW_BELOW_M / np.maximum(given["landing_speed"], TINY)
    return np.asarray(down + given["detection_time"] + given["disarm_time"])


@formula(*_PX4_MISSION)
def px4_mission_time(given: Given) -> Floats:
    """Arming to disarming: the phases one after the other."""
    phases = (px4_takeoff_time, px4_cruise_time, px4_return_time, px4_descent_time, px4_landing_time)
    return np.asarray(given["hold_time"] + sum(phase(given) for phase in phases))


@formula(*_PX4_MISSION, "hover_power")
def px4_energy(given: Given) -> Floats:
    """Wh: the power that keeps the vehicle in the air, all the time."""
    return np.asarray(given["hover_power"] * px4_mission_time(given) / 3600)


def _px4_return_height(given: Given) -> Floats:
    """Height of the way home; near home a vehicle climbs no higher than its descent begins."""
    last = given["end_height"]
    near = given["return_distance"] < _NEAR_HOME_M
    high = np.where(near, np.maximum(last, np.minimum(given["return_height"], _SLOWS_FROM_M)),
                    np.maximum(last, given["return_height"]))  # fmt: skip
    return np.where(given["returns"] > 0, high, last)
