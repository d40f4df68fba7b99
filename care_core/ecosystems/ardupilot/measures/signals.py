"""How an ArduPilot vehicle was controlled and what its sensors said: a statistic of one channel each."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from care_core.ecosystems.ardupilot.measures import rests
from care_core.ecosystems.ardupilot.measures.flown_mission import NEEDS
from care_core.ecosystems.ardupilot.measures.phases import PHASE_ARGS
from care_core.ecosystems.ardupilot.measures.series import register, series
from care_core.ecosystems.measures import Args, Mission, extractor, one_of
from care_core.ecosystems.statistic import statistic
from care_core.ecosystems.vehicles import motor_outputs
from care_core.logs.base import Table, Wanted, merge_needs
from care_core.numbers import Floats
from care_core.run import Unavailable, Value


def _wrapped(degrees: Floats) -> Floats:
    return np.asarray((degrees + 180.0) % 360.0 - 180.0)


_AXES = {"roll": ("R", "RDes", "ROut"), "pitch": ("P", "PDes", "POut"), "yaw": ("Y", "YDes", "YOut")}
_AXIS = {"axis": one_of("roll, pitch or yaw; roll unless given", *_AXES)}
_TILT = {"axis": one_of("roll, pitch, yaw, or tilt (roll and pitch together); tilt unless given", *_AXES, "tilt")}


def _attitude_error(table: Table, mission: Mission, args: Args) -> Floats:
    errors = {
        "roll": table["DesRoll"] - table["Roll"],
        "pitch": table["DesPitch"] - table["Pitch"],
        "yaw": _wrapped(table["DesYaw"] - table["Yaw"]),
    }
    axis = args.get("axis", "tilt")
    return np.asarray(np.hypot(errors["roll"], errors["pitch"]) if axis == "tilt" else errors[axis])


def _of_axis(column: Callable[[Table, tuple[str, str, str]], Floats]) -> Callable[[Table, Mission, Args], Floats]:
    return lambda table, _mission, args: column(table, _AXES[args.get("axis", "roll")])


def _lean(table: Table) -> Floats:
    return np.asarray(np.degrees(np.arccos(np.cos(np.radians(table["Roll"])) * np.cos(np.radians(table["Pitch"])))))


def _motor_columns(mission: Mission) -> tuple[str, ...]:
    """The columns of RCOU that drive motors; the first four where no parameter says which."""
    outputs = motor_outputs(mission.settings).values() or range(1, 5)
    return tuple(f"C{output}" for output in sorted(outputs))


def _motors(table: Table, mission: Mission) -> Floats:
    """Outputs of the motors, shape (rows, motors), as a share of their range of 1000 to 2000 microseconds."""
    return np.asarray((np.column_stack([table[name] for name in _motor_columns(mission)]) - 1000.0) / 1000.0)


def _at_limit(table: Table, mission: Mission, _args: Args) -> Floats:
    limit = mission.settings.get("MOT_SPIN_MAX", 0.95)
    top = float(limit) if isinstance(limit, (int, float)) else 0.95
    return np.asarray(_motors(table, mission).max(axis=1) >= top - 0.005, dtype=np.float64)


_ATTITUDE = {"ATT": ("DesRoll", "Roll", "DesPitch", "Pitch", "DesYaw", "Yaw")}
_RATE = {"RATE": ("R", "RDes", "ROut", "P", "PDes", "POut", "Y", "YDes", "YOut")}
_LEAN = {"ATT": ("Roll", "Pitch")}
_SINK = {"PSCD": ("VD",)}
_OUTPUTS = {"RCOU": tuple(f"C{output}" for output in range(1, 15))}

register("attitude_error", _ATTITUDE, "deg", "Wanted minus flown attitude.", _attitude_error, stat="rms", args=_TILT)
register("rate_error", _RATE, "deg/s", "Wanted minus flown rotation rate: slack or oscillation of one axis.",
          _of_axis(lambda t, c: t[c[0]] - t[c[1]]), stat="rms", args=_AXIS)  # fmt: skip
register("rate_activity", _RATE, "deg/s", "Rotation rate of one axis.",
          _of_axis(lambda t, c: t[c[0]]), stat="rms", args=_AXIS)  # fmt: skip
register("rate_output", _RATE, "", "Output of one axis' rate controller: how hard it works.",
          _of_axis(lambda t, c: t[c[2]]), stat="rms", args=_AXIS)  # fmt: skip
register("lean_angle", _LEAN, "deg", "Angle between the vehicle's mast and the vertical.",
          lambda t, _m, _a: _lean(t), stat="peak")  # fmt: skip
register("altitude_error", {"PSCD": ("TPD", "PD")}, "m", "Wanted minus flown height.",
          lambda t, _m, _a: np.abs(t["TPD"] - t["PD"]), stat="rms")  # fmt: skip
register("climb_rate_error", {"PSCD": ("TVD", "VD")}, "m/s", "Wanted minus flown vertical speed.",
          lambda t, _m, _a: np.abs(t["TVD"] - t["VD"]), stat="rms")  # fmt: skip
register("vertical_acceleration_error", {"PSCD": ("TAD", "AD")}, "m/s/s", "Wanted minus flown vertical acceleration.",
          lambda t, _m, _a: np.abs(t["TAD"] - t["AD"]), stat="rms")  # fmt: skip
register("climb_rate", _SINK, "m/s", "Speed upwards.", lambda t, _m, _a: -t["VD"], stat="peak")
register("descent_rate", _SINK, "m/s", "Speed downwards.", lambda t, _m, _a: t["VD"], stat="peak")
register("motor_saturation", _OUTPUTS, "", "Share of the time in which a motor is at MOT_SPIN_MAX.",
          _at_limit, stat="mean", columns=_motor_columns)  # fmt: skip
register("motor_output", _OUTPUTS, "", "Mean output of the motors, as a share of their range.",
          lambda t, m, _a: _motors(t, m).mean(axis=1), stat="mean", columns=_motor_columns)  # fmt: skip
register("motor_spread", _OUTPUTS, "", "How far the motors differ from each other, as a share of their range.",
          lambda t, m, _a: np.ptp(_motors(t, m), axis=1), stat="mean", columns=_motor_columns)  # fmt: skip
register("throttle", {"CTUN": ("ThO",)}, "", "Throttle out of the attitude controller, 0 to 1.",
          lambda t, _m, _a: t["ThO"], stat="mean")  # fmt: skip
register("vibration", {"VIBE": ("IMU", "VibeX", "VibeY", "VibeZ")}, "m/s/s", "Vibration of the first IMU, all axes.",
          lambda t, _m, _a: np.sqrt(t["VibeX"] ** 2 + t["VibeY"] ** 2 + t["VibeZ"] ** 2), stat="mean")  # fmt: skip
register("gps_quality", {"GPS": ("I", "HDop")}, "", "Horizontal dilution of precision of the first GPS.",
          lambda t, _m, _a: t["HDop"], stat="mean")  # fmt: skip
register("ekf_velocity_innovation", {"XKF3": ("C", "IVN", "IVE")}, "m/s",
          "Horizontal velocity measured minus estimated, first core.",
          lambda t, _m, _a: np.hypot(t["IVN"], t["IVE"]), stat="rms")  # fmt: skip
register("ekf_position_innovation", {"XKF3": ("C", "IPN", "IPE")}, "m",
          "Horizontal position measured minus estimated, first core.",
          lambda t, _m, _a: np.hypot(t["IPN"], t["IPE"]), stat="rms")  # fmt: skip


@extractor(
    "ekf_innovation",
    needs=lambda args: merge_needs((NEEDS, {"XKF4": ("C", str(args.get("field", "SV")))})),
    unit="",
    args={
        "field": one_of("SV velocity, SP position, SH height, SM compass", "SV", "SP", "SH", "SM"),
        "stat": one_of("mean, max, rms or peak", "mean", "max", "rms", "peak"),
        **PHASE_ARGS,
    },
    rests_on=rests.of("XKF4"),
)
def ekf_innovation(mission: Mission, args: Args) -> Value:
    """Innovation test ratio of the first estimator core (above 1 it rejects the sensor). Mean unless `stat`."""
    field = str(args.get("field", "SV"))
    table = series(mission, "XKF4", (field,), args)
    return table if isinstance(table, Unavailable) else statistic(table[field], str(args.get("stat", "mean")))


@extractor(
    "mean_lean_angle",
    needs=merge_needs((NEEDS, _ATTITUDE)),
    unit="deg",
    args=PHASE_ARGS,
    rests_on=rests.of("ATT", "Roll", "Pitch", "Yaw"),
)
def mean_lean_angle(mission: Mission, args: Args) -> Value:
    """Angle of the lean averaged over the earth's directions while airborne: what steady wind asks for."""
    table = series(mission, "ATT", ("Roll", "Pitch", "Yaw"), args)
    if isinstance(table, Unavailable):
        return table
    roll, pitch, yaw = (np.radians(table[name]) for name in ("Roll", "Pitch", "Yaw"))
    forward, right = -np.tan(pitch), np.tan(roll) / np.cos(pitch)
    north, east = forward * np.cos(yaw) - right * np.sin(yaw), forward * np.sin(yaw) + right * np.cos(yaw)
    # A tumbling vehicle passes through 90 degrees, where the tangent has no bound.
    level = np.hypot(north, east) < 2.0
    if not level.any():
        return Unavailable("the vehicle was never near level", "")
    return math.degrees(math.atan(math.hypot(float(north[level].mean()), float(east[level].mean()))))


def _horizontal(*fields: str) -> Wanted:
    """The position controller's records of both horizontal axes, by the letter that the axis puts in a field."""
    return merge_needs(
        (NEEDS, {"PSCN": tuple(f"{field}N" for field in fields), "PSCE": tuple(f"{field}E" for field in fields)})
    )


def _both_axes(mission: Mission, args: Args, of_axis: Callable[[Callable[[str], Floats]], Floats], stat: str,
               fields: Sequence[str]) -> Value:  # fmt: skip
    """A statistic of the length of the vector whose north and east parts `of_axis` gives."""
    parts = []
    for axis in "NE":
        names = [f"{field}{axis}" for field in fields]
        table = series(mission, f"PSC{axis}", names, args)
        if isinstance(table, Unavailable):
            return table
        columns = dict(zip(fields, (table[name] for name in names), strict=True))
        parts.append(of_axis(columns.__getitem__))
    count = min(len(part) for part in parts)
    return statistic(np.hypot(parts[0][:count], parts[1][:count]), str(args.get("stat", stat)))


_HORIZONTAL_ARGS = {
    "stat": one_of("mean, max, rms or peak (95th percentile)", "mean", "max", "rms", "peak"),
    **PHASE_ARGS,
}
_BOTH = rests.all_of(rests.of("PSCN"), rests.of("PSCE"))


@extractor("velocity_error", needs=_horizontal("TV", "V"), unit="m/s", args=_HORIZONTAL_ARGS, rests_on=_BOTH)
def velocity_error(mission: Mission, args: Args) -> Value:
    """Wanted minus flown horizontal velocity. Statistic: rms unless `stat` says otherwise."""
    return _both_axes(mission, args, lambda of: of("TV") - of("V"), "rms", ("TV", "V"))


@extractor("position_error", needs=_horizontal("TP", "P"), unit="m", args=_HORIZONTAL_ARGS, rests_on=_BOTH)
def position_error(mission: Mission, args: Args) -> Value:
    """Wanted minus flown horizontal position. Statistic: rms unless `stat` says otherwise."""
    return _both_axes(mission, args, lambda of: of("TP") - of("P"), "rms", ("TP", "P"))


@extractor("acceleration_error", needs=_horizontal("TA", "A"), unit="m/s/s", args=_HORIZONTAL_ARGS, rests_on=_BOTH)
def acceleration_error(mission: Mission, args: Args) -> Value:
    """Wanted minus flown horizontal acceleration. Statistic: rms unless `stat` says otherwise."""
    return _both_axes(mission, args, lambda of: of("TA") - of("A"), "rms", ("TA", "A"))


@extractor("planned_acceleration", needs=_horizontal("DA"), unit="m/s/s", args=_HORIZONTAL_ARGS, rests_on=_BOTH)
def planned_acceleration(mission: Mission, args: Args) -> Value:
    """Horizontal acceleration that the path planner asks for. Statistic: peak unless `stat` says otherwise."""
    return _both_axes(mission, args, lambda of: of("DA"), "peak", ("DA",))


@extractor("speed", needs=_horizontal("V"), unit="m/s", args=_HORIZONTAL_ARGS, rests_on=_BOTH)
def speed(mission: Mission, args: Args) -> Value:
    """Horizontal speed while airborne. Statistic: mean unless `stat` says otherwise."""
    return _both_axes(mission, args, lambda of: of("V"), "mean", ("V",))
