"""What only ArduPilot's rovers log: speed and steering, wanted and driven, and what the vehicle itself is like.

Missions, phases, path and energy are those of `flight` and `ardupilot`.
"""

from __future__ import annotations

import numpy as np

from care_core.ecosystems.ardupilot.measures import rests
from care_core.ecosystems.ardupilot.measures.flown_mission import NEEDS
from care_core.ecosystems.ardupilot.measures.phases import PHASE_ARGS, flown_mission
from care_core.ecosystems.ardupilot.measures.series import register, series
from care_core.ecosystems.coverage import SUM, USUAL
from care_core.ecosystems.measures import Args, Mission, extractor, one_of
from care_core.ecosystems.vehicles import is_skid_steered
from care_core.logs.base import Table, Wanted, merge_needs
from care_core.numbers import Floats, median, quantile
from care_core.run import Unavailable, Value

_SPEED: Wanted = {"THR": ("ThrOut", "DesSpeed", "Speed")}
_STEERING: Wanted = {"STER": ("SteerOut", "LatAcc", "DesTurnRate", "TurnRate")}
_BATTERY: Wanted = {"BAT": ("Volt", "Curr")}
_FULL_STEERING = 4500.0
"""STER.SteerOut of the whole steering (AP_MotorsUGV.h: -4500 to 4500)."""
_LEAST_THROTTLE = 30.0
"""Percent below which MOT_THR_MAX counts as this (AP_MotorsUGV.cpp: sanity_check_parameters)."""
_TURNING_DEG_S = 10.0
"""Turn rate from which a vehicle is said to turn."""
_STANDING = 0.2
"""Share of its usual speed below which a vehicle stands."""
_AT_LIMIT = 0.99

_STEADY = 0.5
"""Share of its usual speed above which a vehicle is well under way, and the throttle mostly holds its speed."""
_MIN_STEADY = 5
_NOISE_MS = 0.3
"""A speed no larger than the noise that the estimator expects of a GPS velocity (EK3_VELNE_M_NSE) tells nothing."""


def _full_throttle(mission: Mission) -> float:
    limit = mission.settings.get("MOT_THR_MAX", 100.0)
    return max(float(limit), _LEAST_THROTTLE) if isinstance(limit, (int, float)) else 100.0


def _beyond(output: Floats, limit: float) -> Floats:
    return np.asarray(np.abs(output) >= _AT_LIMIT * limit, dtype=np.float64)


register("speed_error", _SPEED, "m/s", "Wanted minus driven speed of a rover.",
         lambda t, _m, _a: t["DesSpeed"] - t["Speed"], stat="rms")  # fmt: skip
register("drive_throttle", _SPEED, "%", "Throttle of a rover, forwards or backwards.",
         lambda t, _m, _a: np.abs(t["ThrOut"]), stat="mean")  # fmt: skip
register("throttle_saturation", _SPEED, "", "Share of the time in which a rover's throttle is at MOT_THR_MAX.",
         lambda t, m, _a: _beyond(t["ThrOut"], _full_throttle(m)), stat="mean")  # fmt: skip
register("turn_rate_error", _STEERING, "deg/s", "Wanted minus driven turn rate of a rover.",
         lambda t, _m, _a: t["DesTurnRate"] - t["TurnRate"], stat="rms")  # fmt: skip
register("steering_output", _STEERING, "", "How far a rover steers, as a share of what it can.",
         lambda t, _m, _a: t["SteerOut"] / _FULL_STEERING, stat="rms")  # fmt: skip
register("steering_saturation", _STEERING, "", "Share of the time in which a rover steers as far as it can.",
         lambda t, _m, _a: _beyond(t["SteerOut"], _FULL_STEERING), stat="mean")  # fmt: skip
register("lateral_acceleration", _STEERING, "m/s/s", "Acceleration to the side in a rover's turns.",
         lambda t, _m, _a: np.abs(t["LatAcc"]), stat="peak")  # fmt: skip


@extractor(
    "turning_time",
    needs=merge_needs((NEEDS, _SPEED, _STEERING)),
    unit="s",
    args={"how": one_of("on the spot, or driving", "spot", "driving"), **PHASE_ARGS},
    rests_on=rests.all_of(rests.of("STER", "TurnRate", bears=SUM), rests.of("THR", "Speed", bears=SUM)),
)
def turning_time(mission: Mission, args: Args) -> Value:
    """Time for which a rover turns faster than 10 degrees a second: on the spot (slower than a fifth of its usual
    speed), or driving."""
    phase = {key: value for key, value in args.items() if key != "how"}
    turned = series(mission, "STER", ("TurnRate",), phase)
    driven = series(mission, "THR", ("Speed",), phase)
    if isinstance(turned, Unavailable):
        return turned
    if isinstance(driven, Unavailable):
        return driven
    standing = np.abs(driven["Speed"]) < _STANDING * _usual_speed(driven)
    is_turning = np.abs(turned["TurnRate"]) > _TURNING_DEG_S
    is_standing = np.interp(turned.t, driven.t, standing.astype(float)) > 0.5
    chosen = is_turning & (is_standing if args.get("how", "spot") == "spot" else ~is_standing)
    return float(median(np.diff(turned.t)) * chosen.sum())


def _usual_speed(driven: Table) -> float:
    """The speed that is passed for a quarter of the way's time: that between the turns."""
    return quantile(np.abs(driven["Speed"]), 0.75)


# --- the vehicle ------------------------------------------------------------------------------------------------


@extractor("steering_kind", needs=NEEDS, unit="")
def steering_kind(mission: Mission, args: Args) -> Value:
    """1 of a skid-steered rover, which drives its sides apart, 0 of one with steered wheels."""
    found = is_skid_steered(mission.settings)
    return Unavailable("no SERVOn_FUNCTION says how it steers") if found is None else float(found)


@extractor("full_throttle_speed", needs=merge_needs((NEEDS, _SPEED)), unit="m/s", rests_on=rests.of("THR", bears=USUAL))
def full_throttle_speed(mission: Mission, args: Args) -> Value:
    """Speed of a rover over its throttle, as it would be at full throttle: median while it is well under way."""
    driven = _steady(mission)
    if isinstance(driven, Unavailable):
        return driven
    pushing = driven.where(driven["ThrOut"] > 0)
    if len(pushing) < _MIN_STEADY:
        return Unavailable("the throttle says nothing of the speed", "record THR", "THR")
    return float(median(pushing["Speed"] / pushing["ThrOut"]) * 100.0)


@extractor(
    "energy_per_metre",
    needs=merge_needs((NEEDS, _SPEED, _BATTERY)),
    unit="J/m",
    rests_on=rests.all_of(rests.of("THR", bears=USUAL), rests.of("BAT", "Volt", "Curr", bears=USUAL)),
)
def energy_per_metre(mission: Mission, args: Args) -> Value:
    """Electric power of a rover over its speed: median while it is well under way."""
    driven = _steady(mission)
    battery = series(mission, "BAT", ("Volt", "Curr"), {})
    if isinstance(driven, Unavailable):
        return driven
    if isinstance(battery, Unavailable):
        return battery
    power = np.interp(driven.t, battery.t, battery["Volt"] * battery["Curr"])
    value = float(median(power / driven["Speed"]))
    return value if value > 0 else Unavailable("the battery's current was never above 0", "calibrate the monitor")


def _steady(mission: Mission) -> Table | Unavailable:
    """The rows of THR in which a rover is faster than half of its usual speed."""
    flown = flown_mission(mission)
    if isinstance(flown, Unavailable):
        return flown
    driven = series(mission, "THR", ("ThrOut", "DesSpeed", "Speed"), {})
    if isinstance(driven, Unavailable):
        return driven
    usual = _usual_speed(driven)
    steady = driven.where(driven["Speed"] > _STEADY * usual) if usual > _NOISE_MS else driven.where(slice(0, 0))
    return steady if len(steady) >= _MIN_STEADY else Unavailable("the vehicle hardly moved")
