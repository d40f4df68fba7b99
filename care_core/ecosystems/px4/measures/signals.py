"""How a PX4 vehicle was controlled and what its sensors said: a statistic of one topic each, in the air or in a phase.

What was wanted is held until it is wanted otherwise, so an error is the flown value less the last wanted one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from care_core.ecosystems.coverage import EXTREME, MEAN, USUAL, Samples
from care_core.ecosystems.measures import Args, Mission, RestsOn, extractor, has, missing, one_of
from care_core.ecosystems.px4.attitude import ATTITUDE, WANTED
from care_core.ecosystems.px4.flight import POSITION
from care_core.ecosystems.px4.measures.flown import NEEDS, PHASE_ARGS, flown_mission, span_of_phase
from care_core.ecosystems.px4.measures.requested import flight_of
from care_core.ecosystems.statistic import STATISTIC, statistic
from care_core.logs.base import Table, Wanted, merge_needs
from care_core.numbers import Floats, median
from care_core.run import Unavailable, Value

_MIN_ROWS = 5
_HELD_S = 1.0
"""What was not wanted anew for so long is wanted no more."""
_AT_TOP = 0.98
"""Share of a motor's range from which it is at its limit."""
_AXES = {"roll": 0, "pitch": 1, "yaw": 2}
_AXIS = {"axis": one_of("roll, pitch or yaw; roll unless given", *_AXES)}
_SETPOINT, _MOTORS = "vehicle_local_position_setpoint", "actuator_motors"
_RATE, _RATE_WANTED = "vehicle_angular_velocity", "vehicle_rates_setpoint"


def _q(name: str) -> tuple[str, ...]:
    return tuple(f"{name}[{number}]" for number in range(4))


def series(mission: Mission, topic: str, fields: Sequence[str], args: Args) -> Table | Unavailable:
    """Rows of a topic in the air, or in a phase, with all of `fields` finite."""
    flown = flown_mission(mission)
    if isinstance(flown, Unavailable):
        return flown
    table = mission.table(topic)
    if not has(table, *fields):
        return missing(topic)
    if "phase" in args:
        span = span_of_phase(mission, args)
        if isinstance(span, Unavailable):
            return span
        table = table.between(*span)
    elif flown.track is None:
        return missing(POSITION)
    else:
        table = table.where(flown.under_way(table.t))
    table = table.where(np.logical_and.reduce([np.isfinite(table[field]) for field in fields]))
    if len(table) < _MIN_ROWS:
        return Unavailable(f"too little {topic} in this part of the flight", "was the vehicle in the air?")
    return table


def wanted_at(mission: Mission, topic: str, field: str, t: Floats) -> Floats:
    """What was wanted at times `t`: the last value published before, not a number where that is long ago."""
    table = mission.tables.get(topic)
    if not has(table, field):
        return np.full(len(t), math.nan)
    at = np.searchsorted(table.t, t, side="right") - 1
    value = table[field][np.maximum(at, 0)]
    return np.where((at >= 0) & (t - table.t[np.maximum(at, 0)] < _HELD_S), value, math.nan)


Measure = Callable[[Mission, Table, Args], Floats]


def register(
    name: str,
    wanted: Wanted,
    unit: str,
    doc: str,
    measure: Measure,
    *,
    stat: str,
    args: Mapping[str, str] | None = None,
) -> None:  # fmt: skip
    """Register a statistic of the first topic of `wanted`; further ones hold what was wanted of it."""
    topic = next(iter(wanted))
    fields = wanted[topic]

    def compute(mission: Mission, given: Args) -> Value:
        table = series(mission, topic, fields, given)
        if isinstance(table, Unavailable):
            return table
        values = measure(mission, table, given)
        known = values[np.isfinite(values)]
        if len(known) < _MIN_ROWS:
            return missing(" and ".join(list(wanted)[1:]) or topic)
        return statistic(known, str(given.get("stat", stat)))

    compute.__doc__ = f"{doc} Statistic: {stat} unless `stat` says otherwise."
    compute.__module__ = __name__
    described = {"stat": STATISTIC, **PHASE_ARGS, **(args or {})}
    extractor(name, needs=merge_needs((NEEDS, wanted)), unit=unit, args=described, rests_on=_rests(topic))(compute)


def _rests(topic: str) -> RestsOn:
    """The topic where the vehicle was in the air, or in the phase that is asked for."""

    def rests_on(mission: Mission, args: Args) -> Iterator[Samples]:
        table, position = mission.tables.get(topic), mission.tables.get(POSITION)
        t = np.empty(0) if table is None else table.t
        dead = flight_of(mission).repeats(topic)
        bears = {"max": EXTREME, "min": EXTREME}.get(str(args.get("stat", "")), MEAN)
        span = span_of_phase(mission, args) if "phase" in args else _in_the_air(mission)
        yield Samples(topic, t, () if isinstance(span, Unavailable) else [span], bears, dead=dead)
        if "phase" not in args:
            heights = np.empty(0) if position is None else position.t
            whole = (mission.start_s, mission.end_s)
            yield Samples(f"the position ({POSITION})", heights, [whole], USUAL)

    return rests_on


def _in_the_air(mission: Mission) -> tuple[float, float] | Unavailable:
    flown = flown_mission(mission)
    if isinstance(flown, Unavailable) or flown.track is None:
        return missing(POSITION)
    up = flown.track.t[flown.under_way(flown.track.t)]
    return (float(up[0]), float(up[-1])) if len(up) else Unavailable("the vehicle was never in the air")


# --- attitude and rates -------------------------------------------------------------------------------------------


def _euler(q: Sequence[Floats], axis: int) -> Floats:
    """Roll, pitch or yaw of a quaternion, degrees."""
    w, x, y, z = q
    angle = (
        lambda: np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
        lambda: np.arcsin(np.clip(2 * (w * y - z * x), -1.0, 1.0)),
        lambda: np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
    )[axis]()
    return np.asarray(np.degrees(angle))


def _attitude_error(mission: Mission, table: Table, args: Args) -> Floats:
    axis = _AXES[str(args.get("axis", "roll"))]
    flown = _euler([table[name] for name in _q("q")], axis)
    wanted = _euler([wanted_at(mission, WANTED, name, table.t) for name in _q("q_d")], axis)
    return np.asarray((wanted - flown + 180.0) % 360.0 - 180.0)


def _rate_error(mission: Mission, table: Table, args: Args) -> Floats:
    axis = str(args.get("axis", "roll"))
    return np.asarray(np.degrees(wanted_at(mission, _RATE_WANTED, axis, table.t) - table[f"xyz[{_AXES[axis]}]"]))


def _rate(_mission: Mission, table: Table, args: Args) -> Floats:
    return np.asarray(np.degrees(table[f"xyz[{_AXES[str(args.get('axis', 'roll'))]}]"]))


def _tilt(_mission: Mission, table: Table, _args: Args) -> Floats:
    x, y = table["q[1]"], table["q[2]"]
    return np.asarray(np.degrees(np.arccos(np.clip(1 - 2 * (x * x + y * y), -1.0, 1.0))))


_ATTITUDE = {ATTITUDE: _q("q"), WANTED: _q("q_d")}
_RATES = {_RATE: ("xyz[0]", "xyz[1]", "xyz[2]"), _RATE_WANTED: ("roll", "pitch", "yaw")}
register(
    "px4_attitude_error", _ATTITUDE, "deg", "Wanted minus flown attitude.", _attitude_error, stat="rms", args=_AXIS
)
register("px4_rate_error", _RATES, "deg/s", "Wanted minus flown rotation rate: slack or oscillation of one axis.",
         _rate_error, stat="rms", args=_AXIS)  # fmt: skip
register("px4_rate", {_RATE: _RATES[_RATE]}, "deg/s", "Rotation rate of one axis.", _rate, stat="rms", args=_AXIS)
register("px4_lean_angle", {ATTITUDE: _q("q")}, "deg", "Angle between the vehicle's mast and the vertical.",
         _tilt, stat="peak")  # fmt: skip

# --- position and velocity ----------------------------------------------------------------------------------------


def _off(*pairs: tuple[str, str]) -> Measure:
    """Wanted minus flown, of one axis, or of two together."""

    def measure(mission: Mission, table: Table, _args: Args) -> Floats:
        errors = [wanted_at(mission, _SETPOINT, wanted, table.t) - table[flown] for flown, wanted in pairs]
        return np.asarray(np.hypot(*errors) if len(errors) > 1 else errors[0])

    return measure


def _register_error(name: str, unit: str, what: str, *pairs: tuple[str, str]) -> None:
    wanted = {POSITION: tuple(flown for flown, _ in pairs), _SETPOINT: tuple(wanted for _, wanted in pairs)}
    register(name, wanted, unit, f"Wanted minus flown {what}.", _off(*pairs), stat="rms")


_register_error("px4_position_error", "m", "horizontal position", ("x", "x"), ("y", "y"))
_register_error("px4_velocity_error", "m/s", "horizontal velocity", ("vx", "vx"), ("vy", "vy"))
_register_error(
    "px4_acceleration_error", "m/s/s", "horizontal acceleration", ("ax", "acceleration[0]"), ("ay", "acceleration[1]")
)
_register_error("px4_altitude_error", "m", "height", ("z", "z"))
_register_error("px4_climb_rate_error", "m/s", "vertical speed", ("vz", "vz"))
_VELOCITY = {POSITION: ("vx", "vy")}
register("px4_speed", _VELOCITY, "m/s", "Horizontal speed.", lambda _m, t, _a: np.hypot(t["vx"], t["vy"]), stat="mean")
register("px4_climb_rate", {POSITION: ("vz",)}, "m/s", "Speed upwards.", lambda _m, t, _a: -t["vz"], stat="peak")
register("px4_descent_rate", {POSITION: ("vz",)}, "m/s", "Speed downwards.", lambda _m, t, _a: t["vz"], stat="peak")
register("px4_planned_acceleration", {"trajectory_setpoint": ("acceleration[0]", "acceleration[1]")}, "m/s/s",
         "Horizontal acceleration that the trajectory asks for.",
         lambda _m, t, _a: np.hypot(t["acceleration[0]"], t["acceleration[1]"]), stat="peak")  # fmt: skip

# --- motors, sensors, estimator -----------------------------------------------------------------------------------


def _motors(table: Table) -> Floats:
    """Outputs of the motors that the log tells, shape (rows, motors), 0 to 1."""
    names = [name for name in table.columns if np.isfinite(table[name]).any()]
    return np.asarray(np.nan_to_num(np.column_stack([table[name] for name in names])))


def _register_motors(name: str, doc: str, measure: Callable[[Floats], Floats]) -> None:
    wanted = {_MOTORS: tuple(f"control[{number}]" for number in range(12))}

    def compute(mission: Mission, given: Args) -> Value:
        table = series(mission, _MOTORS, ("control[0]",), given)
        if isinstance(table, Unavailable):
            return table
        return statistic(measure(_motors(table)), str(given.get("stat", "mean")))

    compute.__doc__ = f"{doc} Statistic: mean unless `stat` says otherwise."
    compute.__module__ = __name__
    described = {"stat": STATISTIC, **PHASE_ARGS}
    extractor(name, needs=merge_needs((NEEDS, wanted)), unit="", args=described, rests_on=_rests(_MOTORS))(compute)


_register_motors("px4_motor_saturation", "Share of the time in which a motor is at its limit.",
                 lambda m: (m.max(axis=1) >= _AT_TOP).astype(np.float64))  # fmt: skip
_register_motors("px4_motor_output", "Mean output of the motors, 0 to 1.", lambda m: m.mean(axis=1))
_register_motors("px4_motor_spread", "How far the motors differ from each other.", lambda m: np.ptp(m, axis=1))
_register_motors("px4_motor_unrest", "How far the motors move between two records.",
                 lambda m: np.abs(np.diff(m, axis=0)).mean(axis=1))  # fmt: skip
register("px4_vibration", {"vehicle_imu_status": ("accel_vibration_metric",)}, "m/s/s",
         "High-frequency vibration of the first accelerometer, as the firmware measures it.",
         lambda _m, t, _a: t["accel_vibration_metric"], stat="mean")  # fmt: skip
register("px4_gyro_vibration", {"vehicle_imu_status": ("gyro_vibration_metric",)}, "rad/s",
         "High-frequency vibration of the first gyroscope, as the firmware measures it.",
         lambda _m, t, _a: t["gyro_vibration_metric"], stat="mean")  # fmt: skip


_RATIOS = ("vel_test_ratio", "pos_test_ratio", "hgt_test_ratio", "mag_test_ratio")


@extractor(
    "px4_estimator_ratio", needs=merge_needs((NEEDS, {"estimator_status": _RATIOS})), unit="",
    args={"field": one_of(", ".join(_RATIOS), *_RATIOS), "stat": STATISTIC, **PHASE_ARGS},
    rests_on=_rests("estimator_status"),
)  # fmt: skip
def estimator_ratio(mission: Mission, args: Args) -> Value:
    """Innovation test ratio of the estimator's first instance, of what `field` names. Statistic: mean unless `stat`
    says otherwise."""
    field = str(args.get("field", _RATIOS[0]))
    table = series(mission, "estimator_status", (field,), args)
    return table if isinstance(table, Unavailable) else statistic(table[field], str(args.get("stat", "mean")))


register("px4_gps_velocity_innovation", {"estimator_innovations": ("gps_hvel[0]", "gps_hvel[1]")}, "m/s",
         "Horizontal velocity measured minus estimated.",
         lambda _m, t, _a: np.hypot(t["gps_hvel[0]"], t["gps_hvel[1]"]), stat="rms")  # fmt: skip
register("px4_gps_position_innovation", {"estimator_innovations": ("gps_hpos[0]", "gps_hpos[1]")}, "m",
         "Horizontal position measured minus estimated.",
         lambda _m, t, _a: np.hypot(t["gps_hpos[0]"], t["gps_hpos[1]"]), stat="rms")  # fmt: skip
register("px4_gps_accuracy", {"vehicle_gps_position": ("eph",)}, "m", "Horizontal accuracy that the receiver tells.",
         lambda _m, t, _a: t["eph"], stat="mean")  # fmt: skip


@extractor("px4_mean_lean", needs=merge_needs((NEEDS, {ATTITUDE: _q("q")})), unit="deg", rests_on=_rests(ATTITUDE))
def mean_lean(mission: Mission, args: Args) -> Value:
    """Lean averaged over the earth's directions: what steady wind asks for, whatever the heading."""
    table = series(mission, ATTITUDE, _q("q"), args)
    if isinstance(table, Unavailable):
        return table
    w, x, y, z = (table[name] for name in _q("q"))
    north, east = 2 * (x * z + w * y), 2 * (y * z - w * x)
    return math.degrees(math.asin(min(math.hypot(float(north.mean()), float(east.mean())), 1.0)))


_HOVER = "hover_thrust_estimate"


@extractor("px4_hover_thrust", needs=merge_needs((NEEDS, {_HOVER: ("hover_thrust", "valid")})), unit="",
           rests_on=_rests(_HOVER))  # fmt: skip
def hover_thrust(mission: Mission, args: Args) -> Value:
    """Median of the thrust that keeps the vehicle in the air, as the firmware estimates it."""
    table = series(mission, _HOVER, ("hover_thrust",), args)
    if isinstance(table, Unavailable):
        return table
    known = table.where(table["valid"] == 1) if "valid" in table.columns else table
    return float(median(known["hover_thrust"])) if len(known) else Unavailable("the estimate was never valid")
