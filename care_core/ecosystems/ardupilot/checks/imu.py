"""Gyros and accelerometers: noisy, at odds with each other, marked unhealthy.

Limits: gyros that differ by more than 5 degrees/s and accelerometers by more than 0.75 m/s^2 refuse arming (AP_Arming:
gyros consistent, ARMING_ACCTHRESH). In flight vibration makes both differ: only noise that the measured vibration does
not explain counts. 97.5% of the healthy training flights differ by less than 0.02 degrees/s on their quietest
axis.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from care_core.ecosystems.ardupilot.checks.settings import gravity, level
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.statistics import (
    aligned,
    calibrated,
    calibrated_probability,
    lasting,
    length,
    records,
    smooth,
    steady,
)
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding, Severity
from care_core.ecosystems.spans import Span, during, seconds_in
from care_core.logs.base import Table, Wanted
from care_core.numbers import Bools, Floats, median, quantile

GYROS, ACCELEROMETERS = ("GyrX", "GyrY", "GyrZ"), ("AccX", "AccY", "AccZ")
READS: Wanted = {
    "IMU": (*GYROS, *ACCELEROMETERS, "GH", "AH"),
    "VIBE": ("VibeX", "VibeY", "VibeZ"),
    "XKF1": ("GX", "GY", "GZ"),
    "ATT": ("Roll", "Pitch"),
}

LIMITS = Limits(gravity.LIMITS)
NOISE_DPS = LIMITS.add("noise on the quietest axis", 0.3, "deg/s", "the noisiest healthy training flight has 0.07")
OFFSET_DPS = LIMITS.add("two gyros apart", 5.0, "deg/s", "AP_Arming: gyros inconsistent")
OFFSET_ACC = LIMITS.add(
    "two accelerometers apart", 3.0, "m/s^2", "four times ARMING_ACCTHRESH: arms flex, rotation moves sensors apart"
)
_APART_OVER_S = LIMITS.add(
    "window of two accelerometers apart", 10.0, "s", "a choice: an offset stays, a blow does not"
)
_DPS_PER_VIBE = LIMITS.add(
    "noise that vibration adds, for each m/s^2", 0.4, "deg/s",
    "real flights with good propellers have up to 0.22, those with cut ones no more: about twice that",
)  # fmt: skip
_ACC_PER_VIBE = LIMITS.add(
    "difference that vibration adds, for each m/s^2",
    0.3,
    "m/s^2",
    "a choice: two sensors on one board share most of the shaking",
)
_OF_RATE = LIMITS.add("share of a rate that two gyros differ by", 0.06, "", "MPU-6000: sensitivity +-3% each")
_FAST_DPS = LIMITS.add("rate below which that is nothing", 30.0, "deg/s", "a choice: noise is more")
_CALM_S = LIMITS.add(
    "time in which it hardly turns that tells of noise", 1.0, "s", "a choice: of less time a median is chance"
)
_AT_REST = LIMITS.add("share of the limit that is there where it hardly turns", 0.3, "", "sound gyros have 0.02 deg/s")
_TURNS_OVER_S = LIMITS.add("left out before control was lost", 3.0, "s", "a choice: it turns too fast to compare")
_USUAL_VIBE = LIMITS.add("vibration where none is recorded", 15.0, "m/s^2", "a choice: half of what is acceptable")
_SHAKEN_DPS = LIMITS.add("shaking that hides an offset", 20.0, "deg/s", "a choice: gyros are not sampled at once")
_OFFSET_OVER_S = LIMITS.add(
    "window of an offset", 15.0, "s", "a choice: noise and manoeuvres cancel over it, an offset stays"
)
_STEADY = LIMITS.add(
    "share of it that stays from first to last", 0.5, "", "a choice: an offset drifts, and has one sign"
)
_LASTS_S = LIMITS.add("shortest noise or offset", 3.0, "s", "a choice: a blow is over sooner")
_UNHEALTHY_S = LIMITS.add("shortest time marked unhealthy", 0.5, "s", "a choice: more than one record")
_HELD_DEG = LIMITS.add(
    "attitude error of what no longer holds it",
    10.0,
    "deg",
    "a choice: nine of ten healthy training flights are below 7 deg for 95% of the time",
)
_HELD_SHARE = LIMITS.add(
    "share of the flight with such an error", 0.02, "", "a choice: gusts and take-offs take less of it"
)
_WORSE = LIMITS.add(
    "times the limit that cost the attitude", 1.5, "", "a choice: what is just over the limit may be beside the point"
)
_CALIBRATION = calibrated(
    LIMITS, ((1.0, 0.7), (2.0, 0.93), (10.0, 0.97)), "12 of 13 training flights with failing gyros exceed it, no other"
)
_LOST_P = LIMITS.add(
    "probability that noise costs the mission", 0.15, "",
    "4 of 10 such training flights failed, of those without a failed part 48% (a warning counts as four flights)",
)  # fmt: skip
_OF_CHANGE = LIMITS.add(
    "difference of a plane's gyros, as a share of its rates' change",
    0.06,
    "",
    "a choice: they are read within that share of the time between two records",
)
_ERRORS = LIMITS.add(
    "standard errors by which a plane's sensors differ by chance",
    4.0,
    "",
    "a choice: chance goes beyond it once in many thousand windows",
)
_PLANE_SHAKEN_DPS = LIMITS.add(
    "shaking of a plane that hides an offset",
    12.0,
    "deg/s",
    "a choice: lower than of others, for a plane rolls and pitches all the time",
)
_FAILED_P = LIMITS.add("probability of a sensor marked unhealthy", 0.9, "", "the firmware's own word")
_OFFSET_P = LIMITS.add("probability of a gyro that is offset at rest", 0.9, "", "nothing turns while gravity stays")
_UPSIDE_DOWN_P = LIMITS.add("probability of gravity felt upside down", 0.95, "", "attitude and gravity contradict")
_APART_P = LIMITS.add("probability of accelerometers apart", 0.7, "", "a choice: one of two is wrong")


def find(flight: Flight) -> Iterator[Finding]:
    """What is wrong with the inertial sensors before anything was lost."""
    yield from _offset(flight)
    yield from _upside_down(flight)
    lost = math.inf if flight.lost_control_s is None else flight.lost_control_s - _TURNS_OVER_S
    sensors = [table.where(flight.watch(table.t) & (table.t < lost)) for table in flight.all("IMU", *GYROS)]
    sensors = [table for table in sensors if len(table) >= 5]
    if not sensors:
        return
    yield from _unhealthy(flight, sensors)
    if len(sensors) > 1:
        yield from _gyros(flight, sensors)
        if level.wrong_accelerometer(flight) is None:
            yield from _accelerometers(flight, sensors)


def _unhealthy(flight: Flight, sensors: list[Table]) -> Iterator[Finding]:
    for n, table in enumerate(sensors, start=1):
        for flag, name in (("GH", "gyro"), ("AH", "accelerometer")):
            if flag not in table.columns or not (table[flag] == 1).any():
                continue
            spans = lasting(table.t, table[flag] == 0, _UNHEALTHY_S)
            if spans:
                yield Finding(
                    kind="imu",
                    title=f"{name} {n} failed",
                    onset_s=spans[0][0],
                    end_s=spans[-1][1],
                    severity="critical",
                    evidence=f"{name} {n} is marked unhealthy for {seconds_in(spans):.1f} s",
                    source=f"IMU.{flag}",
                    probability=_FAILED_P,
                )


def _offset(flight: Flight) -> Iterator[Finding]:
    """A gyro that tells of turning while the vehicle lies still: the attitude is carried away with it. Of a run in
    which it never rests, the others of its log tell."""
    rests = list(gravity.rests(flight)) or list(gravity.rests(flight.whole) if flight.armed else ())
    if rests and min(rest.turns_dps for rest in rests) > gravity.TURNS_DPS:  # one that is offset is so each time
        most = float(median(np.array([rest.turns_dps for rest in rests])))
        yield Finding(
            kind="imu",
            title="the gyro is offset at rest",
            onset_s=flight.armed[-1][0],
            end_s=flight.end_s,
            severity="critical" if flight.lost_control_s is not None or flight.impact_s is not None else "warning",
            evidence=(
                f"it turns at {most:.1f} deg/s by its gyro while gravity stays where it is "
                f"(limit {gravity.TURNS_DPS:g}): calibrate the gyros standing still"
            ),
            source="IMU.GyrX, GyrY, GyrZ against AccX, AccY, AccZ with the motors down",
            probability=_OFFSET_P,
        )


def _upside_down(flight: Flight) -> Iterator[Finding]:
    """Accelerometers that feel gravity at the top of a copter that stands upright by its own attitude: climbing feels
    like falling, and its height is held with the wrong sign. What its motors lift meanwhile pulls the same way."""
    ends = min((start for start, _ in flight.airborne), default=0.0)
    attitude = flight.one("ATT", "Roll", "Pitch")
    sensors = [table.between(0.0, ends) for table in flight.all("IMU", *gravity.AXES)]
    stands = None if attitude is None or not flight.is_copter else attitude.between(0.0, ends)
    if stands is None or not sensors or min(map(len, (stands, *sensors))) < gravity.FEWEST:
        return
    tilt = max(abs(float(median(stands[angle]))) for angle in ("Roll", "Pitch"))
    leans = [gravity.lean_deg(np.array([median(table[axis]) for axis in gravity.AXES])) for table in sensors]
    if tilt < gravity.UPRIGHT_DEG and min(leans) > 180.0 - gravity.UPRIGHT_DEG:
        failed = flight.lost_control_s is not None or flight.impact_s is not None
        yield Finding(
            kind="imu",
            title="the accelerometers feel gravity upside down",
            onset_s=0.0,
            end_s=flight.end_s,
            severity="critical" if failed else "warning",
            evidence=(
                f"gravity pulls {min(leans):.0f} degrees off the bottom of the board before take-off, where by the "
                f"attitude it leans {tilt:.0f} degrees"
            ),
            source="IMU.AccX, AccY, AccZ and ATT before take-off",
            probability=_UPSIDE_DOWN_P,
        )


def _gyros(flight: Flight, sensors: list[Table]) -> Iterator[Finding]:
    """Noise and offset of the axis that is quietest: a vehicle that oscillates shakes one or two axes, and its gyros
    are never sampled at quite the same time; a noisy sensor is so on all of them."""
    t = sensors[0].t
    apart = np.degrees([sensors[0][axis] - aligned(t, sensors[1].t, sensors[1][axis]) for axis in GYROS])
    noise = np.min([smooth(t, np.abs(axis - smooth(t, axis, 5.0)), 8.0) for axis in apart], axis=0)
    offset = np.max([np.abs(smooth(t, axis, _OFFSET_OVER_S)) for axis in apart], axis=0)
    vibration = _vibration(flight, t)
    limit = NOISE_DPS + _DPS_PER_VIBE * vibration + _turning(sensors[0]) + _at_another_moment(flight, sensors[0])
    chance = _of_a_mean(flight, t, list(apart), _OFFSET_OVER_S)
    over = np.maximum(noise / limit, np.where(_shaken(flight, sensors[0]), 0.0, offset / (OFFSET_DPS + chance)))
    is_over = over > 1.0
    if flight.kind == "quadplane":  # where it stands its lift motors shake it, and VIBE tells nothing of that
        is_over &= during(flight.flown, t)
    spans = lasting(t, is_over, _LASTS_S, gap_s=3.0)
    if not spans:
        return
    start, end = _beginning(t, over, spans[0]), spans[-1][1]
    inside = (t >= spans[0][0]) & (t <= end)
    ratio = quantile(over[inside], 0.9)
    is_noise = float(np.max((noise / limit)[inside])) > 1.0
    if is_noise and not _is_noisy_at_rest(sensors[0], apart, start):
        return
    if not is_noise and np.abs(apart[:, inside].mean(axis=1)).max() < _STEADY * OFFSET_DPS:
        return  # swings that are too fast for the record: two sensors seem apart now this way, now that
    size = quantile((noise if is_noise else offset)[inside], 0.9)
    allowed = float(median(limit[inside])) if is_noise else OFFSET_DPS
    severity = _severity(flight, ratio, start)
    yield Finding(
        kind="imu",
        title="the gyros are noisy" if is_noise else "the gyros disagree",
        onset_s=start,
        end_s=end,
        severity=severity,
        evidence=(
            f"gyros 1 and 2 differ by {size:.2g} degrees/s on every axis (limit {allowed:.2g} at a vibration of "
            f"{float(median(vibration[inside])):.1f} m/s^2)"
            if is_noise
            else f"gyros 1 and 2 differ by {size:.1f} degrees/s (limit {OFFSET_DPS:g})"
        ),
        source="IMU.GyrX, GyrY, GyrZ of both; AP_Arming allows 5 degrees/s at rest",
        probability=calibrated_probability(ratio, _CALIBRATION),
        mission_lost=_LOST_P if is_noise and severity == "warning" else None,
    )


def _is_noisy_at_rest(table: Table, apart: Floats, since_s: float) -> bool:
    """Whether the two differ, shape (3, n), where it hardly turns as well: what does so only as it turns are samples of
    different moments."""
    rate = smooth(table.t, np.degrees(length(table[axis] for axis in GYROS)), 1.0)
    calm = (rate < _FAST_DPS / 2) & (table.t >= since_s)
    if calm.sum() < records(table.t, _CALM_S):
        return not (rate[table.t >= since_s] > _FAST_DPS).all()
    return min(float(median(np.abs(axis - smooth(table.t, axis, 5.0))[calm])) for axis in apart) > _AT_REST * NOISE_DPS


def _at_another_moment(flight: Flight, table: Table) -> Floats:
    """What a plane's turning adds, degrees/s: it rolls and pitches all the time, and two gyros are not recorded at the
    same moment."""
    if not flight.is_winged:
        return np.zeros(len(table))
    changes = length(np.diff(table[axis], prepend=table[axis][:1]) for axis in GYROS)
    return _OF_CHANGE * smooth(table.t, np.degrees(changes), 8.0)


def _of_a_mean(flight: Flight, t: Floats, differences: Sequence[Floats], width_s: float) -> Floats:
    """By how much the means of two sensors of a plane differ by chance, its frame shaking between their records: so
    many standard errors."""
    if not flight.is_winged:
        return np.zeros(len(t))
    spread = sum(smooth(t, one**2, width_s) - smooth(t, one, width_s) ** 2 for one in differences)
    return np.asarray(_ERRORS * np.sqrt(np.maximum(spread, 0.0) / records(t, width_s)))


def _turning(table: Table) -> Floats:
    """What turning fast adds, degrees/s: a flip, a roll or a tumble shows the scale and delay of each sensor."""
    rate = smooth(table.t, np.degrees(length(table[axis] for axis in GYROS)), 8.0)
    return _OF_RATE * np.maximum(rate - _FAST_DPS, 0.0)


def _beginning(t: Floats, over: Floats, span: Span) -> float:
    """When what fills a span first rose to a third of it: it may stay below the limit for long."""
    third = float(median(over[(t >= span[0]) & (t <= span[1])])) / 3
    before = [start for start, end in lasting(t, over > third, _LASTS_S, gap_s=5.0) if start <= span[0] <= end]
    return min([span[0], *before])


def _shaken(flight: Flight, table: Table) -> Bools:
    """Where the vehicle turns to and fro so fast that two gyros cannot be compared record by record."""
    rates = length(np.abs(table[axis] - smooth(table.t, table[axis], 5.0)) for axis in GYROS)
    limit = _PLANE_SHAKEN_DPS if flight.is_winged else _SHAKEN_DPS
    return np.asarray(smooth(table.t, np.degrees(rates), 8.0) > limit)


def _vibration(flight: Flight, t: Floats) -> Floats:
    """Vibration level at these times; firmware before 3.3 does not record it, then a usual one is assumed."""
    table = flight.one("VIBE", "VibeX", "VibeY", "VibeZ")
    if table is None:
        return np.full(len(t), _USUAL_VIBE)
    level: Floats = np.maximum(np.maximum(table["VibeX"], table["VibeY"]), table["VibeZ"])
    return aligned(t, table.t, level)


def _severity(flight: Flight, ratio: float, start: float) -> Severity:
    """Critical where the vehicle no longer held its attitude with it."""
    error = flight.lean_error
    if flight.lost_control_s is not None or error is None:
        return "critical" if flight.lost_control_s is not None else "warning"
    bad = (error[1] > _HELD_DEG) & (error[0] >= start) & during(flight.flown, error[0])
    return "critical" if bad.mean() > _HELD_SHARE and ratio > _WORSE else "warning"


def _accelerometers(flight: Flight, sensors: list[Table]) -> Iterator[Finding]:
    if not all(axis in table.columns for table in sensors[:2] for axis in ACCELEROMETERS):
        return
    t = sensors[0].t
    differences = [sensors[0][a] - aligned(t, sensors[1].t, sensors[1][a]) for a in ACCELEROMETERS]
    apart = length(steady(t, one, _APART_OVER_S) for one in differences)  # a blow is felt by each at another moment
    limit = OFFSET_ACC + _ACC_PER_VIBE * _vibration(flight, t) + _of_a_mean(flight, t, differences, _APART_OVER_S)
    spans = lasting(t, apart > limit, _LASTS_S)
    if spans:
        inside = (t >= spans[0][0]) & (t <= spans[-1][1])
        yield Finding(
            kind="imu",
            title="the accelerometers disagree",
            onset_s=spans[0][0],
            end_s=spans[-1][1],
            severity="warning",
            evidence=(
                f"accelerometers 1 and 2 differ by {median(apart[inside]):.1f} m/s^2 (limit {OFFSET_ACC:g} beside what "
                "vibration explains)"
            ),
            source="IMU.AccX, AccY, AccZ of both; ARMING_ACCTHRESH 0.75 m/s^2 at rest",
            probability=_APART_P,
        )


CHECK = Check("imu", "noisy, unhealthy or inconsistent gyros and accelerometers", READS, LIMITS, find)
