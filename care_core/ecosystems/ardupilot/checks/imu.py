"""Gyros and accelerometers: noisy, at odds with each other, marked unhealthy.

Limits: gyros that differ by more than 5 degrees/s and accelerometers by more than 0.75 m/s^2 refuse arming (AP_Arming:
gyros consistent, ARMING_ACCTHRESH). In flight vibration makes both differ: only noise that the measured vibration does
not explain counts. 97.5 % of the healthy training flights differ by less than 0.02 degrees/s on their quietest
axis.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.spans import Floats, Mask, Span, during
from care_core.ecosystems.ardupilot.statistics import (
    Calibration,
    aligned,
    calibrated_probability,
    lasting,
    length,
    smooth,
)
from care_core.ecosystems.findings import Finding, Severity
from care_core.logs.base import Table, Wanted
from care_core.numbers import median, quantile

GYROS, ACCELEROMETERS = ("GyrX", "GyrY", "GyrZ"), ("AccX", "AccY", "AccZ")
READS: Wanted = {
    "IMU": (*GYROS, *ACCELEROMETERS, "GH", "AH"),
    "VIBE": ("VibeX", "VibeY", "VibeZ"),
    "XKF1": ("GX", "GY", "GZ"),
}

NOISE_DPS, OFFSET_DPS = 0.3, 5.0
OFFSET_ACC = 3.0
"""m/s^2: four times what arming allows, since arms flex and rotation moves sensors apart."""
_DPS_PER_VIBE = 0.15
"""What vibration may add, degrees/s a m/s^2."""
_OF_RATE, _FAST_DPS = 0.06, 30.0
"""Two gyros of 3 % scale each differ by this share of a rate (MPU-6000 datasheet: sensitivity tolerance +-3 %); below
this mean rate that is nothing beside their noise."""
_TURNS_OVER_S = 3.0
"""Before it is lost a vehicle turns faster than two sensors can be compared for so long."""
_USUAL_VIBE = 15.0
_SHAKEN_DPS = 20.0
_OFFSET_OVER_S = 15.0
_LASTS_S = 3.0
_CALIBRATION: Calibration = ((1.0, 0.7), (2.0, 0.93), (10.0, 0.97))
"""By times over the limit; on the training table 12 of 13 flights with failing gyros exceed it, and no other: the
noisiest healthy one has 0.07 degrees/s on its quietest axis."""
_LOST = 0.15
"""Of 10 training flights whose gyros were noisy while the attitude was held 4 failed, of those without a failed part
48 %: none by it (the 0.6 of a warning counts as four flights)."""


def find(flight: Flight) -> Iterator[Finding]:
    """What is wrong with the inertial sensors before anything was lost."""
    lost = math.inf if flight.lost_control_s is None else flight.lost_control_s - _TURNS_OVER_S
    sensors = [table.where(flight.watch(table.t) & (table.t < lost)) for table in flight.all("IMU", *GYROS)]
    sensors = [table for table in sensors if len(table) >= 5]
    if not sensors:
        return
    yield from _unhealthy(flight, sensors)
    if len(sensors) > 1:
        yield from _gyros(flight, sensors)
        yield from _accelerometers(flight, sensors)


def _unhealthy(flight: Flight, sensors: list[Table]) -> Iterator[Finding]:
    for n, table in enumerate(sensors, start=1):
        for flag, name in (("GH", "gyro"), ("AH", "accelerometer")):
            if flag not in table.columns or not (table[flag] == 1).any():
                continue
            spans = lasting(table.t, table[flag] == 0, 0.5)
            if spans:
                yield Finding(
                    kind="imu",
                    title=f"{name} {n} failed",
                    onset_s=spans[0][0],
                    end_s=spans[-1][1],
                    severity="critical",
                    evidence=f"{name} {n} is marked unhealthy for {sum(b - a for a, b in spans):.1f} s",
                    source=f"IMU.{flag}",
                    probability=0.9,
                )


def _gyros(flight: Flight, sensors: list[Table]) -> Iterator[Finding]:
    """Noise and offset of the axis that is quietest: a vehicle that oscillates shakes one or two axes, and its gyros
    are never sampled at quite the same time; a noisy sensor is so on all of them."""
    t = sensors[0].t
    apart = np.degrees([sensors[0][axis] - aligned(t, sensors[1].t, sensors[1][axis]) for axis in GYROS])
    noise = np.min([smooth(t, np.abs(axis - smooth(t, axis, 5.0)), 8.0) for axis in apart], axis=0)
    offset = np.max([np.abs(smooth(t, axis, _OFFSET_OVER_S)) for axis in apart], axis=0)
    vibration = _vibration(flight, t)
    limit = NOISE_DPS + _DPS_PER_VIBE * vibration + _turning(sensors[0])
    over = np.maximum(noise / limit, np.where(_shaken(sensors[0]), 0.0, offset / OFFSET_DPS))
    spans = lasting(t, over > 1.0, _LASTS_S, gap_s=3.0)
    if not spans:
        return
    start, end = _beginning(t, over, spans[0]), spans[-1][1]
    inside = (t >= spans[0][0]) & (t <= end)
    ratio = quantile(over[inside], 0.9)
    is_noise = float(np.max((noise / limit)[inside])) > 1.0
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
        mission_lost=_LOST if is_noise and severity == "warning" else None,
    )


def _turning(table: Table) -> Floats:
    """What turning fast adds, degrees/s: a flip, a roll or a tumble shows the scale and delay of each sensor."""
    rate = smooth(table.t, np.degrees(length(table[axis] for axis in GYROS)), 8.0)
    return _OF_RATE * np.maximum(rate - _FAST_DPS, 0.0)


def _beginning(t: Floats, over: Floats, span: Span) -> float:
    """When what fills a span first rose to a third of it: it may stay below the limit for long."""
    third = float(median(over[(t >= span[0]) & (t <= span[1])])) / 3
    before = [start for start, end in lasting(t, over > third, _LASTS_S, gap_s=5.0) if start <= span[0] <= end]
    return min([span[0], *before])


def _shaken(table: Table) -> Mask:
    """Where the vehicle turns to and fro so fast that two gyros cannot be compared record by record."""
    rates = length(np.abs(table[axis] - smooth(table.t, table[axis], 5.0)) for axis in GYROS)
    return np.asarray(smooth(table.t, np.degrees(rates), 8.0) > _SHAKEN_DPS)


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
    bad = (error[1] > 10.0) & (error[0] >= start) & during(flight.flown, error[0])
    return "critical" if bad.mean() > 0.02 and ratio > 1.5 else "warning"


def _accelerometers(flight: Flight, sensors: list[Table]) -> Iterator[Finding]:
    if not all(axis in table.columns for table in sensors[:2] for axis in ACCELEROMETERS):
        return
    t = sensors[0].t
    steady = [smooth(t, sensors[0][a] - aligned(t, sensors[1].t, sensors[1][a]), 10.0) for a in ACCELEROMETERS]
    apart = length(steady)
    limit = OFFSET_ACC + 0.3 * _vibration(flight, t)
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
            probability=0.7,
        )
