"""Values that cannot both be meant: pairs as data, and footprints against inflation."""

from __future__ import annotations

import ast
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from care_core.lint.problems import Entry, LintedFile, Problem


class Pair(NamedTuple):
    """Two parameters of one scope of which the first may not be above the second."""

    low: str
    high: str
    why: str
    source: str
    off: bool = False
    """Whether 0 switches either of them off."""


_BATTERY = "a battery below the critical voltage was below the low one before"
_REFUSED, _AIRSPEEDS = "the firmware calls such airspeeds invalid", "PerformanceModel.cpp of PX4, runSanityChecks"
_MONITOR = "AP_BattMonitor's arming check refuses it"
VEHICLE_PAIRS: tuple[Pair, ...] = (
    *(
        pair
        for prefix in ("BATT_", *(f"BATT{number}_" for number in range(2, 10)))
        for pair in (
            Pair(f"{prefix}CRT_VOLT", f"{prefix}LOW_VOLT", _BATTERY, _MONITOR, True),
            Pair(f"{prefix}CRT_MAH", f"{prefix}LOW_MAH", "what is left is low before it is critical", _MONITOR, True),
        )
    ),
    Pair("MOT_BAT_VOLT_MIN", "MOT_BAT_VOLT_MAX", "", "AP_MotorsMulticopter scales by both"),
    Pair("MOT_SPIN_ARM", "MOT_SPIN_MIN", "armed motors would turn faster than flying ones", "the list asks for it"),
    Pair("MOT_SPIN_MIN", "MOT_SPIN_MAX", "", "AP_MotorsMulticopter scales by both"),
    Pair("MOT_PWM_MIN", "MOT_PWM_MAX", "", "AP_MotorsMulticopter refuses it", True),
    Pair("FENCE_ALT_MIN", "FENCE_ALT_MAX", "the floor is above the ceiling", "AC_Fence keeps between them"),
    Pair("ARSPD_FBW_MIN", "ARSPD_FBW_MAX", "", "the list of ARSPD_FBW_MIN"),
    Pair("AIRSPEED_MIN", "AIRSPEED_MAX", "", "the list of AIRSPEED_MIN"),
    Pair("BAT_CRIT_THR", "BAT_LOW_THR", _BATTERY, "PX4's battery thresholds follow each other"),
    Pair("BAT_EMERGEN_THR", "BAT_CRIT_THR", _BATTERY, "PX4's battery thresholds follow each other"),
    Pair("MPC_XY_CRUISE", "MPC_XY_VEL_MAX", "the speed is above its limit", "PX4's position controller limits it"),
    Pair("FW_AIRSPD_STALL", "FW_AIRSPD_MIN", _REFUSED, _AIRSPEEDS),
    Pair("FW_AIRSPD_MIN", "FW_AIRSPD_TRIM", _REFUSED, _AIRSPEEDS),
    Pair("FW_AIRSPD_TRIM", "FW_AIRSPD_MAX", _REFUSED, _AIRSPEEDS),
    Pair("MPC_THR_MIN", "MPC_THR_MAX", "", "PX4's position controller scales by both"),
)  # fmt: skip

_LIMITS = "the planners of ROS navigation sample velocities between the two"
ROS_PAIRS: tuple[Pair, ...] = (
    Pair("min_vel_x", "max_vel_x", "", _LIMITS),
    Pair("min_vel_y", "max_vel_y", "", _LIMITS),
    Pair("min_vel_theta", "max_vel_theta", "", _LIMITS),
    Pair("min_vel_trans", "max_vel_trans", "", _LIMITS),
    Pair("min_trans_vel", "max_trans_vel", "", _LIMITS),
    Pair("min_vel_trans", "max_vel_x", "no speed forwards is allowed", _LIMITS),
    Pair("min_trans_vel", "max_vel_x", "no speed forwards is allowed", _LIMITS),
    Pair("min_speed_xy", "max_vel_x", "no speed forwards is allowed", _LIMITS),
    Pair("min_in_place_vel_theta", "max_vel_theta", "no turn in place is allowed", _LIMITS),
    Pair("min_rot_vel", "max_rot_vel", "", _LIMITS),
    Pair("min_speed_xy", "max_speed_xy", "", _LIMITS),
    Pair("max_vel_x", "max_speed_xy", "the speed forwards never reaches its limit",
         "dwb_plugins, kinematic_parameters.cpp: faster than max_speed_xy is no valid speed", True),
    Pair("vx_min", "vx_max", "", _LIMITS),
    Pair("ax_min", "ax_max", "", _LIMITS),
    Pair("min_particles", "max_particles", "", "amcl keeps their number between them"),
    Pair("laser_min_range", "laser_max_range", "", "amcl keeps ranges between them", True),
    Pair("min_obstacle_height", "max_obstacle_height", "no point is between them", "the layer keeps what is between"),
    Pair("obstacle_min_range", "obstacle_max_range", "no point is between them", "the layer keeps what is between"),
    Pair("raytrace_min_range", "raytrace_max_range", "nothing is cleared", "the layer clears between them"),
    Pair("min_lookahead_dist", "max_lookahead_dist", "", "the look-ahead is between"),
    Pair("min_rotational_vel", "max_rotational_vel", "", "the behaviour turns between"),
    Pair("v_linear_min", "v_linear_max", "", "the controller keeps between them"),
)  # fmt: skip

_INFLATION = (
    "costmap_2d inflates by inflation_radius from the obstacle; the inscribed radius is of the padded footprint"
)


def pairs(file: LintedFile, values: Mapping[str, Entry], known: Sequence[Pair]) -> Iterator[Problem]:
    """Pairs of one scope that contradict each other."""
    for pair in known:
        low, high = values.get(pair.low), values.get(pair.high)
        if low is None or high is None or low.number is None or high.number is None:
            continue
        if pair.off and (low.number <= 0 or high.number <= 0):
            continue
        if low.number > high.number:
            why = f": {pair.why}" if pair.why else ""
            text = f"{low.keys[-1]} ({low.number:g}) is above {high.keys[-1]} ({high.number:g}){why}."
            hint = f"The other is in line {high.line}." if high.line else ""
            yield file.warning("contradiction", low, text, hint, pair.source, [high])


def inscribed_radius(footprint: Entry | None, radius: Entry | None) -> float | None:
    """The radius of the largest circle about the robot's centre within its footprint, m; None where nothing says."""
    if footprint is not None and isinstance(footprint.value, str):
        points = _points(footprint.value)
        if points:
            ends = zip(points, [*points[1:], points[0]], strict=True)
            return min(_distance_to(*one, *other) for one, other in ends)
    return None if radius is None else radius.number


def reach(footprint: Entry) -> float | None:
    """How far the farthest corner of a footprint is from the robot's centre, m."""
    points = _points(footprint.value) if isinstance(footprint.value, str) else []
    return max((math.hypot(x, y) for x, y in points), default=None)


def _points(text: str) -> list[tuple[float, float]]:
    try:
        held = ast.literal_eval(text.strip())
        points = [(float(x), float(y)) for x, y in held]
    except (ValueError, TypeError, SyntaxError, MemoryError, RecursionError):
        return []
    return points if len(points) > 2 else []


def _distance_to(x: float, y: float, to_x: float, to_y: float) -> float:
    """How far the origin is from a line between two points."""
    along_x, along_y = to_x - x, to_y - y
    length = along_x**2 + along_y**2
    share = 0.0 if length == 0 else min(1.0, max(0.0, -(x * along_x + y * along_y) / length))
    return math.hypot(x + share * along_x, y + share * along_y)


def inflation(file: LintedFile, radius: float | None, inflations: Sequence[Entry]) -> Iterator[Problem]:
    """Inflation that is smaller than the robot."""
    for entry in inflations:
        if radius is not None and entry.number is not None and 0 < entry.number < radius * (1 - 1e-6):
            text = f"inflation_radius ({entry.number:g} m) is smaller than the robot ({radius:.3g} m from its centre)."
            hint = "Plans may touch obstacles: give it at least the robot's inscribed radius."
            yield file.warning("clearance", entry, text, hint, _INFLATION)
