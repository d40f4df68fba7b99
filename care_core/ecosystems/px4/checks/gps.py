"""A receiver that was good enough for the estimator and no longer is."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.px4.flight import Px4Flight
from care_core.ecosystems.spans import inside, runs
from care_core.logs.base import Wanted
from care_core.numbers import median

_TOPICS, _FIELDS = ("vehicle_gps_position", "sensor_gps"), ("fix_type", "eph", "satellites_used")
READS: Wanted = dict.fromkeys(_TOPICS, _FIELDS)
LIMITS = Limits()
_LEAST_FIX = LIMITS.add("fix", 3, "", "SensorGps.msg: 3 is one in all three dimensions")
_WORST_M = LIMITS.add("horizontal accuracy", 3.0, "m", "EKF2_REQ_EPH as shipped, which the estimator asks for")
_FEWEST = LIMITS.add("satellites", 6, "", "EKF2_REQ_NSATS as shipped, which the estimator asks for")
_GOOD_S = LIMITS.add("shortest good time before it", 10.0, "s", "EKF2_REQ_GPS_H as shipped")
_BAD_S = LIMITS.add("shortest bad time", 3.0, "s", "a choice: an antenna that leans over is back sooner")
_TRUE_P = LIMITS.add("probability that it is so", 0.9, "", "flights: 11 of 11, and none of 468 without")
_LOSES_P = LIMITS.add("probability that a mission fails with it", 0.9, "", "flights: 11 of 11")


def find(flight: Px4Flight) -> Iterator[Finding]:
    """The first such time of a flight."""
    table = next((one for one in (flight.table(topic, *_FIELDS) for topic in _TOPICS) if one is not None), None)
    if table is None or flight.has_no("gps"):
        return
    t, accuracy_m, satellites = table.t, table["eph"], table["satellites_used"]
    worst_m = max(_WORST_M, flight.parameter("EKF2_REQ_EPH") or 0.0)
    fewest = min(_FEWEST, flight.parameter("EKF2_REQ_NSATS") or _FEWEST)
    poor = (table["fix_type"] < _LEAST_FIX) | (accuracy_m > worst_m) | (satellites < fewest)
    poor &= inside(flight.armed, t)
    span = next((one for one in runs(t, poor) if one[1] - one[0] >= _BAD_S), None)
    if span is None:
        return
    before, during = (t >= span[0] - _GOOD_S) & (t < span[0]), (t >= span[0]) & (t <= span[1])
    if not before.any() or t[0] > span[0] - _GOOD_S or poor[before].any():
        return
    few, many = (int(median(satellites[rows])) for rows in (during, before))
    off_m, good_m = (float(median(np.nan_to_num(accuracy_m[rows]))) for rows in (during, before))
    yield Finding(
        kind="gps",
        title="GPS reception became poor",
        onset_s=span[0],
        end_s=span[1],
        severity="warning",
        evidence=(
            f"for {span[1] - span[0]:.0f} s {few} satellites and {off_m:.1f} m, {many} and {good_m:.1f} m just before "
            f"(limits {fewest:.0f} and {worst_m:g} m)"
        ),
        source=f"{_TOPICS[0]} or {_TOPICS[1]}: {', '.join(_FIELDS)}",
        probability=_TRUE_P,
        mission_lost=_LOSES_P,
    )


CHECK = Check("gps", "a receiver that was good enough and no longer is", READS, LIMITS, find)
