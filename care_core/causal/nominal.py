"""What physics says a mission takes: formulas that a profile names for a variable, and a mechanism corrects.

A few hundred missions cannot teach how far it is to every waypoint, but nobody has to learn that: the autopilot's
speed profile is known. A mechanism then learns what is left, the ratio of the value to its nominal, which is much the
same on every mission. Arguments are arrays of one value a run, in m, s, m/s, W, degrees and their like.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from care_core.numbers import Floats
from care_core.records import Record

Given = Mapping[str, Floats]
"""Arguments of a formula by their names, each of shape (n,)."""

GRAVITY = 9.81
SCALES = {"cm": 0.01, "cm/s": 0.01, "cm/s/s": 0.01, "cdeg": 0.01, "ms": 0.001, "gravities": GRAVITY}
"""From a variable's unit to that of a formula's argument."""
_TINY = 1e-6

# ArduCopter 4.5: seconds between arming and lifting off (ARMING_DELAY_SEC), loiter above home (RTL_LOIT_TIME), height
# of the last part of a landing (LAND_ALT_LOW), slope of the cone in which a return stays low (RTL_CONE_SLOPE), vertical
# acceleration and jerk of the way (WPNAV_ACCEL_Z, PSC_JERK_Z), the landing detector with its disarming, and a
# moment before the way down begins.
_ARMING_S, _LOITER_S, _LAND_LOW_M, _CONE = 2.0, 5.0, 10.0, 3.0
_RISE_ACCELERATION, _RISE_JERK, _LANDED_S, _STILL_S = 1.0, 5.0, 2.0, 1.0


class Formula(Record):
    """A formula and the names of its arguments."""

    arguments: tuple[str, ...]
    compute: Callable[[Given], Floats]


FORMULAS: dict[str, Formula] = {}


class Nominal(Record):
    """A formula with the variables that are its arguments. `inputs` and `scales` follow the formula's arguments."""

    kind: str
    inputs: tuple[str, ...]
    scales: tuple[float, ...]

    def of(self, columns: Floats) -> Floats:
        """The nominal value of each run, above 0. columns: shape (n, len(inputs)) in the variables' own units."""
        formula = FORMULAS[self.kind]
        scaled = columns * np.array(self.scales)
        given = dict(zip(formula.arguments, scaled.T, strict=True))
        with np.errstate(all="ignore"):  # a value out of range gives a nominal that nobody believes, not a warning
            value = formula.compute(given)
        return np.asarray(np.maximum(value, _TINY))


def nominal(kind: str, given: Mapping[str, str], units: Mapping[str, str]) -> Nominal:
    """The formula with its arguments found: the variable that is given for it, else the one of its own name.

    Args:
        given: argument -> variable. units: unit of each variable of the profile.

    Raises:
        ValueError: no such formula, an argument that it lacks, or a variable that is not there.
    """
    if kind not in FORMULAS:
        raise ValueError(f"there is no formula '{kind}'; known are {', '.join(FORMULAS)}")
    names = FORMULAS[kind].arguments
    for name in given:
        if name not in names:
            raise ValueError(f"'{kind}' has no argument '{name}'; it has {', '.join(names)}")
    inputs = tuple(given.get(name, name) for name in names)
    for name in inputs:
        if name not in units:
            raise ValueError(f"'{kind}' needs '{name}', which the profile does not declare")
    return Nominal(kind, inputs, tuple(SCALES.get(units[name], 1.0) for name in inputs))


def formula(*arguments: str) -> Callable[[Callable[[Given], Floats]], Callable[[Given], Floats]]:
    """Register a function under its own name."""

    def register(compute: Callable[[Given], Floats]) -> Callable[[Given], Floats]:
        FORMULAS[compute.__name__] = Formula(arguments, compute)
        return compute

    return register


# --- multicopters: waypoints flown with speed, acceleration and jerk limits ---------------------------------------

_TAKEOFF = ("takeoff_height", "climb_speed")
_LEGS = (
    "path_length", "legs", "leg_variation", "climb", "climbing_legs", "descent", "descending_legs", "flown_corners",
    "corner_turn", "commanded_speed",
)  # fmt: skip
_LIMITS = ("speed", "acceleration", "jerk", "lean_limit", "response")
_CRUISE = (*_LEGS, *_LIMITS, "radius", "climb_speed", "descent_speed")
_END = ("returns", "end_height", "return_distance", "return_height")
_MISSION = tuple(dict.fromkeys((*_CRUISE, "hold_time", *_TAKEOFF, *_END, *_LIMITS, "landing_speed")))


@formula(*_TAKEOFF)
def multicopter_takeoff_time(given: Given) -> Floats:
    """Arming to the first leg."""
    return _ARMING_S + _rise_time(given["takeoff_height"], given["climb_speed"])


@formula(*_CRUISE)
def multicopter_cruise_time(given: Given) -> Floats:
    """All legs without the waits at their ends.

    Each leg starts and ends at rest. Where nobody waits, the next leg begins before the last one ends: as early as the
    corner between them stays within the radius (ArduCopter 4.5, SCurve::advance_target_along_track).
    """
    speed = np.where(given["commanded_speed"] > 0, given["commanded_speed"], given["speed"])
    acceleration, jerk = _within_lean(given), given["jerk"]
    count = np.maximum(given["legs"], 1)
    length = given["path_length"] / count
    climbing, descending = given["climbing_legs"], given["descending_legs"]
    # Level, climbing and descending legs, (3, 1, n), of two lengths, (2, n).
    legs = np.array([count - climbing - descending, climbing, descending])[:, None] / 2
    rise = np.array(
        [np.zeros_like(length), given["climb"] / np.maximum(climbing, 1), given["descent"] / np.maximum(descending, 1)]
    )[:, None]
    limit = np.array([np.full_like(length, np.inf), given["climb_speed"], given["descent_speed"]])[:, None]
    flat = np.array(_two_lengths(length, given["leg_variation"]))
    way = np.hypot(flat, rise)
    fastest = np.minimum(speed * way / flat, limit * way / np.maximum(rise, _TINY))
    peak, ramp = _ramps(way, fastest, acceleration, jerk, _lag(given))
    time, ramps, top = ((legs * part).sum(axis=(0, 1)) for part in (way / peak + ramp, ramp, peak))
    overlap = 2 * _blend(given["radius"], given["corner_turn"], top / count, acceleration, jerk, 2 * acceleration)
    return np.asarray(time - given["flown_corners"] * np.minimum(overlap, ramps / count))


def _two_lengths(mean: Floats, variation: Floats) -> tuple[Floats, Floats]:
    """Two lengths that stand for all legs: they have their mean and their variation."""
    return np.maximum(mean * (1 - variation), 1.0), np.maximum(mean * (1 + variation), 1.0)


@formula(*_CRUISE)
def multicopter_cruise_speed(given: Given) -> Floats:
    """Length of the legs over the time for them."""
    return np.asarray(given["path_length"] / np.maximum(multicopter_cruise_time(given), _TINY))


@formula(*_END, *_LIMITS, "climb_speed")
def multicopter_return_time(given: Given) -> Floats:
    """From the last waypoint to above home: up, over, and the wait there. Nothing where the mission ends elsewhere."""
    way = np.maximum(given["return_distance"], 1.0)
    peak, ramp = _ramps(way, given["speed"], _within_lean(given), given["jerk"], _lag(given))
    over = np.where(given["return_distance"] > 1.0, way / peak + ramp, 0.0)
    up = _rise_time(_return_height(given) - given["end_height"], given["climb_speed"])
    return np.asarray(given["returns"] * (up + over + _LOITER_S))


@formula(*_END, "descent_speed")
def multicopter_descent_time(given: Given) -> Floats:
    """From the height of the return, or of the last waypoint, to where a landing slows down."""
    return _STILL_S + _rise_time(_return_height(given) - _LAND_LOW_M, given["descent_speed"])


@formula(*_END, "landing_speed")
def multicopter_landing_time(given: Given) -> Floats:
    """The slow last metres, to disarming."""
    slow = np.minimum(_return_height(given), _LAND_LOW_M)
    return np.asarray(slow / np.maximum(given["landing_speed"], _TINY) + _LANDED_S)


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
    return np.asarray(570.0 * np.maximum(given["motor_output"], _TINY) ** 1.16)


def _lag(given: Given) -> Floats:
    """What the limit of the jerk's change adds to speeding up and slowing down (WPNav: snap by the response time)."""
    return np.asarray(2 * np.maximum(given["response"], 0.1))


def _within_lean(given: Given) -> Floats:
    """The wanted acceleration, but no more than two thirds of what the largest lean gives: the rest holds the wind."""
    lean = np.radians(np.clip(given["lean_limit"], 5.0, 60.0))
    return np.minimum(given["acceleration"], GRAVITY * np.tan(lean) * 2 / 3)


def _return_height(given: Given) -> Floats:
    """Height of the way home: no higher than needed near home, never lower than the last waypoint."""
    last = given["end_height"]
    high = np.maximum(last, np.minimum(given["return_height"], _CONE * given["return_distance"]))
    return np.where(given["returns"] > 0, high, last)


def _rise_time(height: Floats, speed: Floats) -> Floats:
    """Time up or down a height from rest to rest; 0 where there is none."""
    way = np.maximum(height, _TINY)
    peak, ramp = _ramps(way, speed, np.full_like(way, _RISE_ACCELERATION), np.full_like(way, _RISE_JERK), 0.0)
    return np.where(height > 0, way / peak + ramp, 0.0)


def _ramps(
    way: Floats, speed: Floats, acceleration: Floats, jerk: Floats, lag: Floats | float
) -> tuple[Floats, Floats]:
    """Top speed on a way from rest to rest, and the time that speeding up and slowing down add to `way / speed`."""
    bend = acceleration**2 / jerk  # below this speed the largest acceleration is never reached
    with_plateau = (-bend + np.sqrt(bend**2 + 4 * acceleration * way)) / 2
    without = (way * np.sqrt(jerk) / 2) ** (2 / 3)
    peak = np.maximum(np.minimum(np.where(with_plateau >= bend, with_plateau, without), speed), _TINY)
    ramp = np.where(peak >= bend, peak / acceleration + acceleration / jerk, 2 * np.sqrt(peak / jerk))
    return peak, np.asarray(ramp + lag)


def _blend(
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


# --- rovers: the same legs on the ground, corners driven through or turned on the spot --------------------------

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
    for way in _two_lengths(given["path_length"] / count, given["leg_variation"]):
        peak, ramp = _ramps(way, speed, limit, limit, 0.0)
        time += count / 2 * (way / peak + ramp)
        ramps += count / 2 * ramp
        top += count / 2 * peak
    overlap = 2 * _blend(given["radius"], given["corner_turn"], top / count, limit, limit, given["turn_limit"])
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
    return np.asarray(given["path_length"] / np.maximum(drive_cruise_time(given), _TINY))


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


# --- planes: legs at an airspeed, circles, a landing ------------------------------------------------------------

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


# --- submarines: legs at a speed, up and down at others ---------------------------------------------------------

_DIVE = ("path_length", "legs", "climb", "descent", "hold_time", "speed", "climb_speed", "descent_speed")
_LEG_S = 3.0
"""What speeding up and slowing down add to each leg."""


@formula(*_DIVE)
def dive_mission_time(given: Given) -> Floats:
    """The legs of a submarine, each as long as its way or its change of depth takes, and the waits at their ends."""
    over = given["path_length"] / np.maximum(given["speed"], _TINY)
    up = given["climb"] / np.maximum(given["climb_speed"], _TINY)
    down = given["descent"] / np.maximum(given["descent_speed"], _TINY)
    return np.asarray(given["hold_time"] + given["legs"] * _LEG_S + np.maximum(over, up + down))


# --- multicopters under PX4: a trajectory with limited jerk, corners as fast as their radius lets -------------------

# PX4 1.15: seconds between arming and lifting off (COM_SPOOLUP_TIME, MPC_TKO_RAMP_T), share of the acceleration that
# is there in a corner, height below which a landing is slow (MPC_LAND_ALT2) and from which it slows down
# (MPC_LAND_ALT1), the way within which a return flies home as high as it is (RTL_MIN_DIST).
_SPOOL_S, _SLOW_BELOW_M, _SLOWS_FROM_M, _NEAR_HOME_M = 4.0, 5.0, 10.0, 10.0
_PX4_LIMITS = ("speed", "fastest", "acceleration", "jerk", "lean_limit")
_PX4_CRUISE = (*_LEGS, *_PX4_LIMITS, "radius", "climb_speed", "descent_speed")
_PX4_TAKEOFF = ("takeoff_height", "takeoff_speed", "climb_speed")
_PX4_RETURN = (*_END, *_PX4_LIMITS, "climb_speed")
_PX4_DESCENT = (*_END, "descent_speed", "descend_height", "landing_delay", "landing_speed")
_PX4_LANDING = ("landing_speed", "detection_time", "disarm_time")
_PX4_MISSION = tuple(
    dict.fromkeys((*_PX4_CRUISE, "hold_time", *_PX4_TAKEOFF, *_PX4_RETURN, *_PX4_DESCENT, *_PX4_LANDING))
)


@formula(*_PX4_TAKEOFF)
def px4_takeoff_time(given: Given) -> Floats:
    """Arming to the first leg."""
    return _SPOOL_S + _rise_time(given["takeoff_height"], np.minimum(given["takeoff_speed"], given["climb_speed"]))


@formula(*_PX4_CRUISE)
def px4_cruise_time(given: Given) -> Floats:
    """All legs without the waits at their ends. A corner without a wait is flown through at the speed that keeps the
    acceleration within a circle of the acceptance radius (PX4: PositionSmoothing, computeMaxSpeedInWaypoint)."""
    wanted = np.where(given["commanded_speed"] > 0, given["commanded_speed"], given["speed"])
    speed = np.minimum(wanted, given["fastest"])
    acceleration, jerk = _within_lean(given), given["jerk"]
    count = np.maximum(given["legs"], 1)
    climbing, descending = given["climbing_legs"], given["descending_legs"]
    legs = np.array([count - climbing - descending, climbing, descending])[:, None] / 2
    length = given["path_length"] / count
    rise = np.array(
        [np.zeros_like(length), given["climb"] / np.maximum(climbing, 1), given["descent"] / np.maximum(descending, 1)]
    )[:, None]
    limit = np.array([np.full_like(length, np.inf), given["climb_speed"], given["descent_speed"]])[:, None]
    flat = np.array(_two_lengths(length, given["leg_variation"]))
    fastest = np.minimum(speed, limit * flat / np.maximum(rise, _TINY))
    peak, ramp = _ramps(flat, fastest, acceleration, jerk, 0.0)
    time, top = ((legs * part).sum(axis=(0, 1)) for part in (flat / peak + ramp, peak))
    inside = np.radians(180.0 - np.clip(given["corner_turn"], 1.0, 179.0)) / 2
    through = np.minimum(np.sqrt(acceleration * given["radius"] * np.tan(inside)), top / count)
    gained = through * (2 * top / count - through) / (acceleration * np.maximum(top / count, _TINY))
    return np.asarray(np.maximum(time - given["flown_corners"] * gained, given["path_length"] / speed))


@formula(*_PX4_CRUISE)
def px4_cruise_speed(given: Given) -> Floats:
    """Length of the legs over the time for them."""
    return np.asarray(given["path_length"] / np.maximum(px4_cruise_time(given), _TINY))


@formula(*_PX4_RETURN)
def px4_return_time(given: Given) -> Floats:
    """From the last waypoint to above home: up and over. Nothing where the mission ends elsewhere."""
    way = np.maximum(given["return_distance"], 1.0)
    peak, ramp = _ramps(way, np.minimum(given["speed"], given["fastest"]), _within_lean(given), given["jerk"], 0.0)
    over = np.where(given["return_distance"] > 1.0, way / peak + ramp, 0.0)
    up = _rise_time(_px4_return_height(given) - given["end_height"], given["climb_speed"])
    return np.asarray(given["returns"] * (up + over))


@formula(*_PX4_DESCENT)
def px4_descent_time(given: Given) -> Floats:
    """From the height of the return, or of the last waypoint, to where a landing is slow, with the wait on the way."""
    high = _px4_return_height(given)
    slows = np.minimum(high, _SLOWS_FROM_M)
    fast = _rise_time(high - slows, given["descent_speed"])
    middle = np.maximum((given["descent_speed"] + given["landing_speed"]) / 2, _TINY)
    wait = given["returns"] * given["landing_delay"]
    return np.asarray(fast + np.maximum(slows - _SLOW_BELOW_M, 0.0) / middle + wait)


@formula(*_PX4_LANDING)
def px4_landing_time(given: Given) -> Floats:
    """The slow last metres, to disarming."""
    down = _SLOW_BELOW_M / np.maximum(given["landing_speed"], _TINY)
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


# --- robots on goals: driven from one to the next, turned at each --------------------------------------------------

# What the goals of training took at the reference configuration of move_base (0.5 m/s, 1 rad/s): the way at full speed,
# the turns at full rate, and 4 s a goal to speed up, to find the way and to come to rest. The medians of five goals,
# 33 to 41 runs each, lie within 10 % of it. What other speeds do is learned as a ratio: with the run's own speed in its
# place, times of runs left out were predicted to 21 % instead of 20 % (rms of the logarithm).
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
