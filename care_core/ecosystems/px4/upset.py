"""When a multicopter under PX4 lost control in the air, and when it hit the ground."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from care_core.ecosystems.base import Limits
from care_core.ecosystems.px4 import attitude
from care_core.ecosystems.px4.flight import LANDED, POSITION, ROTARY, STATUS, Px4Flight
from care_core.ecosystems.spans import runs
from care_core.logs.base import Table, Wanted, merge_needs
from care_core.numbers import Bools, Floats

COMBINED = "sensor_combined"
FORCES = tuple(f"accelerometer_m_s2[{n}]" for n in range(3))
READS: Wanted = merge_needs((attitude.READS, {COMBINED: FORCES, POSITION: ("z", "vz"), LANDED: ("landed",)}))

LIMITS = Limits()
LEFT_DEG = LIMITS.add("thrust direction off its demand", 30.0, "deg", "ArduCopter's crash check; PX4 has none")
_TIPPED_DEG = LIMITS.add(
    "lean where no demand is recorded", 60.0, "deg", "FD_FAIL_R and FD_FAIL_P as shipped; MPC_TILTMAX_AIR is 45"
)
HELD_DEG = LIMITS.add("thrust direction that is held", 15.0, "deg", "a choice: half of the first")
_BACK_S = LIMITS.add("time held after which it was back", 2.0, "s", "a choice: a gust")
_CAUGHT_S = LIMITS.add("time held before the ground after which it was back", 1.0, "s", "a choice: a fall is short")
_LASTS_S = LIMITS.add("shortest time off its demand", 0.2, "s", "a choice: a step of the demand is over sooner")
ALOFT_M = LIMITS.add("height in the air", 1.0, "m", "a choice: below, a landing leg may tip it")
_HIT_MS = LIMITS.add("descent into the ground", 3.0, "m/s", "a fall from half a metre; MPC_LAND_SPEED is 0.7")
_FALLS_S = LIMITS.add("time over which it is taken", 0.5, "s", "a choice: what tumbles falls unsteadily")
_SHOCK = LIMITS.add("blow", 30.0, "m/s^2", "three times gravity is no flight")
_OVER_USUAL = LIMITS.add("blow over what it felt before", 2.0, "", "a choice: vibration is no blow")
_USUAL_S = LIMITS.add("time before a blow", 4.0, "s", "a choice: it holds its usual shaking, and not yet a take-off")
_GROUND_M = LIMITS.add("height of the ground around where it was armed", 1.5, "m", "a choice: the barometer drifts")
_LIES_M = LIMITS.add("movement of what lies on the ground", 0.5, "m", "a choice: the estimator still drifts")
_LIES_S = LIMITS.add("time after a fall in which it lies", 2.0, "s", "a choice: what catches itself climbs again")
FALLING = LIMITS.add("what an accelerometer feels in a fall", 5.0, "m/s^2", "half of gravity; the air brakes the rest")
_FALL_S = LIMITS.add("shortest fall", 0.15, "s", "half of that from half a metre; a bounce is over sooner")
_CUT_S = LIMITS.add("time in which it falls without motors", 1.0, "s", "a choice: they stop at once")
_HANGS_S = LIMITS.add(
    "time in which what was cut loose leans over", 2.0, "s", "a choice: a swing on a line lasts longer"
)
_STILL = LIMITS.add("change of what an accelerometer feels that lies", 1.0, "m/s^2", "motors shake it by more")
_ENDED_S = LIMITS.add("time in which it is on the ground or disarmed", 10.0, "s", "COM_DISARM_LAND: 2 s, and margin")
_ACRO = 10
"""nav_state of acro, in which every attitude is meant (vehicle_status.msg)."""


class Hit(NamedTuple):
    """A contact with the ground at a speed that no landing has."""

    time_s: float
    speed_ms: float
    blow: float | None
    """m/s^2; None where the record of the accelerations is too sparse to hold one."""
    falls_s: float
    """When it began to fall."""


class Lost(NamedTuple):
    """A loss of control."""

    time_s: float
    fall: tuple[float, float]
    """Forward and right parts of where it leaned, off what was wanted."""
    most_deg: float
    """How far off its demand it came."""


def force_of(felt: Table) -> Floats:
    """What the accelerometers feel in all, m/s^2."""
    return np.asarray(np.sqrt(sum(felt[name] ** 2 for name in FORCES)))


def hit(flight: Px4Flight) -> Hit | None:
    """The first time that it hit the ground at speed: a fast descent that ended the flight, with a blow, or near the
    height at which it was armed."""
    hits = (one for one in (_struck(flight), _dropped(flight)) if one is not None)
    return min(hits, key=lambda one: one.time_s, default=None)


def _dropped(flight: Px4Flight) -> Hit | None:
    """The first fall from which it did not move again. A fall is seen in speed and height: estimators leap in one."""
    for start, end in flight.armed:
        heights, position = flight.heights((start, end)), flight.table(POSITION, "z", "vz")
        if heights is None or position is None or not flight.hovers:
            continue
        vz = np.interp(heights.t, position.t, np.nan_to_num(position["vz"]))
        for begin, over in runs(heights.t, vz > _HIT_MS):
            before = heights.between(begin - _FALLS_S, over)["height"]
            after = heights.between(over + _FALLS_S, over + _FALLS_S + _LIES_S)
            if len(after) < 3 or after.t[-1] - after.t[0] < _LIES_S / 2 or over + _LIES_S > end:
                continue
            lies = np.ptp(after["height"]) < _LIES_M and bool(np.all(np.abs(after["height"]) < _GROUND_M))
            if lies and before.max() - before.min() > _HIT_MS * _FALLS_S / 2:
                return Hit(over, float(vz[(heights.t >= begin) & (heights.t <= over)].max()), None, begin)
    return None


def _struck(flight: Px4Flight) -> Hit | None:
    """The first blow at the end of a fast descent that ended the flight."""
    table, position = flight.table(COMBINED, *FORCES), flight.table(POSITION, "z")
    if table is None or position is None:
        return None
    felt = force_of(table)
    known = np.isfinite(position["z"])
    if not known.any():
        return None
    t, z = position.t[known], position["z"][known]
    for at in table.t[felt > _SHOCK].tolist():
        if not any(start <= at <= end + 1.0 for start, end in flight.armed):
            continue
        speed = float(np.interp(at, t, z) - np.interp(at - _FALLS_S, t, z)) / _FALLS_S
        blow = float(np.max(felt[(table.t >= at) & (table.t <= at + 1.0)]))
        usual = felt[(table.t >= at - _USUAL_S) & (table.t < at - 0.2)]
        is_blow = not len(usual) or blow > _OVER_USUAL * float(np.max(usual))
        windows = ((table.t >= at + n * _LIES_S) & (table.t <= at + (n + 1) * _LIES_S) for n in (1, 2))
        parts = (felt[window] for window in windows)  # it may bounce first, and stay armed, as planes do
        lies = any(len(part) > 2 and float(np.ptp(part)) < _STILL for part in parts)
        if speed > _HIT_MS and is_blow and (lies or _ends_after(flight, at)):
            return Hit(at, speed, blow, at - _FALLS_S)
    return None


def _ends_after(flight: Px4Flight, at: float) -> bool:
    """Whether the flight is over soon after."""
    landed = flight.during(LANDED, "landed", (at, at + _ENDED_S))
    return (
        not any(start <= at and end > at + _ENDED_S for start, end in flight.armed)
        or flight.end_s < at + _ENDED_S
        or (landed is not None and bool(np.any(landed["landed"] == 1)))
    )


def falls_after(flight: Px4Flight, cut_s: float) -> bool | None:
    """Whether it fell when its motors were cut, as its accelerometers feel; None where they are hardly recorded."""
    table = flight.table(COMBINED, *FORCES)
    soon = None if table is None else table.between(cut_s, cut_s + _CUT_S)
    if soon is None or len(soon) < 3 * _CUT_S / _FALL_S:
        return None
    force = force_of(soon)
    return any(end - start >= _FALL_S for start, end in runs(soon.t, force < FALLING))


def leans_over_deg(flight: Px4Flight, cut_s: float) -> float | None:
    """How far what was upright when its motors were cut leans over without them, as it falls or hangs on a line; None
    where the log does not tell, or where it lay already."""
    lean = flight.lean
    after = np.empty(0) if lean is None else lean.tilt_deg[(lean.t >= cut_s) & (lean.t <= cut_s + _HANGS_S)]
    return float(np.max(after) - after[0]) if len(after) and after[0] < LEFT_DEG else None


def lost_control(flight: Px4Flight) -> Lost | None:
    """When a multicopter in the air stopped following its attitude demand and was not back before it was down."""
    lean = flight.lean
    if lean is None or not flight.armed:
        return None
    off = np.where(np.isfinite(lean.error_deg), lean.error_deg > LEFT_DEG, False)
    if not np.isfinite(lean.error_deg).any():
        off = lean.tilt_deg > _TIPPED_DEG
    impact = hit(flight)
    for start, end in runs(lean.t, off):
        falls = impact is not None and start <= impact.time_s <= end + _ENDED_S
        stays = _stays(flight, lean, end, impact.time_s if falls and impact is not None else math.inf)
        if not is_aloft(flight, start) or not stays or not (falls or end - start >= _LASTS_S):
            continue
        now = (lean.t >= start) & (lean.t <= start + _LASTS_S)
        fall = lean.off[:, now].mean(axis=1)
        until = end if impact is None else min(max(end, start + _LASTS_S), impact.time_s)
        error = np.where(np.isfinite(lean.error_deg), lean.error_deg, lean.tilt_deg)
        most = float(np.max(error[(lean.t >= start) & (lean.t <= max(until, end))]))
        return Lost(start, (float(fall[0]), float(fall[1])), most)
    return None


def is_aloft(flight: Px4Flight, at: float) -> bool:
    """Whether it hovered, armed and above the ground, in a mode in which not every attitude is meant."""
    height = flight.height_m(at)
    mode = [mode for t, mode in flight.modes if t <= at][-1:]
    return (
        any(start < at <= end for start, end in flight.armed)
        and flight.last(STATUS, "vehicle_type", at) in (ROTARY, None)
        and flight.last(LANDED, "landed", at - 2.0) in (0, None)
        and (height is None or height > ALOFT_M)
        and mode != [_ACRO]
    )


def _stays(flight: Px4Flight, lean: attitude.Lean, since: float, hit_s: float) -> bool:
    """Whether it was not back within limits after a time, while armed and before it hit the ground."""
    until = min(next((end for start, end in flight.armed if start <= since <= end), since), hit_s)
    held: Bools = (lean.error_deg < HELD_DEG) & (lean.t > since) & (lean.t <= until)
    enough_s = _BACK_S if hit_s == math.inf else _CAUGHT_S
    return not any(end - start > enough_s for start, end in runs(lean.t, held))
