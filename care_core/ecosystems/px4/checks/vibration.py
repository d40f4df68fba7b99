"""Accelerometers that vibrate, and gyros that are noisy, by the metrics that the firmware keeps of each.

Flight Review draws the accelerometers' metric orange from 4.9 and red from 9.8 m/s^2. Firmware before 1.13 publishes
other numbers under the same names, which lie far below.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding, FindingKind
from care_core.ecosystems.px4 import upset
from care_core.ecosystems.px4.flight import Px4Flight
from care_core.ecosystems.spans import inside, runs
from care_core.logs.base import Wanted, merge_needs
from care_core.numbers import median
from care_core.records import Record

_IMUS = ("vehicle_imu_status", "vehicle_imu_status#1", "vehicle_imu_status#2")
LIMITS = Limits()
_LASTS_S = LIMITS.add("shortest time of it", 2.0, "s", "a choice: a hard landing is over sooner")
_SEVERE = LIMITS.add("critical vibration or noise, in limits", 2.0, "", "a choice: real quadcopters fly at one limit")
_LATE_S = LIMITS.add("time by which a record comes late", 1.5, "s", "it is of the second before it")
_RISEN = LIMITS.add(
    "vibration that rose in flight, of what it was", 3.0, "", "317 flights with sound accelerometers: 2.3"
)
_ORANGE = LIMITS.add("vibration that counts where it rose", 4.9, "m/s^2", "Flight Review draws it orange from there")
_STAYS_S = LIMITS.add(
    "shortest time of vibration that rose", 10.0, "s", "a choice: a descent through the wake is over sooner"
)
_TRUE_P = LIMITS.add("probability that it is so", 0.9, "", "training flights: 17 of 17, and none of 450 without")


class _Metric(Record):
    """What the firmware keeps of an inertial sensor, and how much of it is too much."""

    field: str
    kind: FindingKind
    title: str
    what: str
    unit: str
    limit: float
    most: float
    """What no such sensor measures."""


VIBRATION = _Metric(
    "accel_vibration_metric", "vibration", "strong vibration", "accelerometers", "m/s^2",
    LIMITS.add("vibration of an accelerometer", 9.81, "m/s^2", "Flight Review draws it red from there"),
    LIMITS.add("vibration that no accelerometer measures", 300.0, "m/s^2", "sensors end at 16 or 32 g"),
)  # fmt: skip
METRICS = (
    VIBRATION,
    _Metric("gyro_vibration_metric", "imu", "noisy gyros", "gyros", "rad/s",
            LIMITS.add("vibration of a gyro", 0.6, "rad/s", "a rough quadcopter of a maker is above 0.5 at times"),
            LIMITS.add("vibration that no gyro measures", 40.0, "rad/s", "sensors end at 2000 deg/s")),
)  # fmt: skip
READS: Wanted = merge_needs(({imu: tuple(metric.field for metric in METRICS) for imu in _IMUS}, upset.READS))


def find(flight: Px4Flight) -> Iterator[Finding]:
    upsets = (upset.hit(flight), upset.lost_control(flight))
    upset_s = min((one.time_s for one in upsets if one is not None), default=math.inf)
    for metric in METRICS:
        found = (_shaken(flight, imu, metric, upset_s) for imu in _IMUS)
        first = min((one for one in found if one is not None), key=lambda one: one.onset_s, default=None)
        if first is None and metric is VIBRATION:
            first = _risen(flight, upset_s)
        if first is not None:
            yield first


def _shaken(flight: Px4Flight, imu: str, metric: _Metric, upset_s: float) -> Finding | None:
    """What one inertial sensor shows that set in before it tumbled: then everything shakes."""
    table = flight.table(imu, metric.field)
    if table is None:
        return None
    spans = runs(table.t, (table[metric.field] > metric.limit) & (table[metric.field] < metric.most))
    lasting = [(start, end) for start, end in spans if end - start >= _LASTS_S and start - _LATE_S <= upset_s]
    if not lasting:
        return None
    (start, _), (_, end) = lasting[0], lasting[-1]
    value = float(median(table.between(start, end)[metric.field]))
    stands = not any(a <= end and b >= start for a, b in flight.armed)  # nothing but the sensor shakes there
    return Finding(
        kind=metric.kind,
        title=metric.title,
        onset_s=max(start - _LATE_S, 0.0),
        end_s=end,
        severity="critical" if stands or value > _SEVERE * metric.limit else "warning",
        evidence=f"{value:.2g} {metric.unit} in the {metric.what}' vibration metric; {metric.limit:g} is too much",
        source=f"{imu}.{metric.field}",
        probability=_TRUE_P,
    )


def _risen(flight: Px4Flight, upset_s: float) -> Finding | None:
    """Vibration below what is too much of any vehicle, and far more than this one had in the air before."""
    table = flight.table(_IMUS[0], VIBRATION.field)
    if table is None:
        return None
    for start, end in runs(table.t, table[VIBRATION.field] > _ORANGE):
        onset_s = start - _LATE_S
        before = table.where(inside(flight.aloft, table.t) & (table.t < onset_s))
        if end - start < _STAYS_S or onset_s > upset_s or not len(before) or np.ptp(before.t) < _STAYS_S:
            continue
        usual, value = (float(median(part[VIBRATION.field])) for part in (before, table.between(start, end)))
        if value > _RISEN * usual:
            return Finding(
                kind=VIBRATION.kind,
                title="vibration that rose in flight",
                onset_s=onset_s,
                end_s=end,
                severity="warning",
                evidence=f"{value:.2g} m/s^2 in the accelerometers' vibration metric, {usual:.2g} before",
                source=f"{_IMUS[0]}.{VIBRATION.field}",
                probability=_TRUE_P,
            )
    return None


CHECK = Check("vibration", "vibration of the accelerometers, and gyros that are noisy", READS, LIMITS, find)
