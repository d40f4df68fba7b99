"""Compasses: dead, at odds with each other, disturbed by the motors' currents, at odds with the estimator.

Limits: two compasses may differ by 200 mGauss in the level plane (AP_Compass.h: AP_COMPASS_MAX_XY_LENGTH_DIFF) and 90
degrees (AP_COMPASS_MAX_XYZ_ANG_DIFF); of the field's length 30 % may come from the motors, 60 % are too much
(ArduPilot, Compass setup: below 30 % is good, 30 to 60 % a grey area); a length is plausible between 185 and 875 mGauss
(AP_Arming). On the training table healthy compasses agree to a mGauss: those of a simulator are alike.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.spans import Floats, Mask, during
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
from care_core.numbers import known_median, median, quantile

AXES = ("MagX", "MagY", "MagZ")
READS: Wanted = {"MAG": (*AXES, "Health"), "XKF4": ("SM",), "PARM": ("Name", "Value")}

APART = 200.0
MOVED = 140.0
"""mGauss by which the difference of two compasses may change in flight: 70 % of what arming allows, since turning alone
moves it where their calibrations differ."""
_LEANS_DEG = 60.0
"""Further over, as in a flip, the calibrations' difference changes its sign and no longer cancels."""
GREY, TOO_MUCH = 0.3, 0.6
_SHORTEST, _LONGEST = 185.0, 875.0
_LASTS_S, _SILENT_S = 3.0, 1.0
_EKF_YAW_RESET = 62
_CALIBRATION: Calibration = ((1.0, 0.8), (1.5, 0.95), (3.0, 0.98))
"""By millligauss over the limit; on the training table all flights over it have a failing compass, and no other."""
_LOST = 0.65
"""6 of 8 training flights with a compass disturbed in flight failed, of those without a failed part 48 %: 0.5 by it
(the 0.95 of a critical finding counts as four flights)."""


def find(flight: Flight) -> Iterator[Finding]:
    """What is wrong with the compasses while they matter: the first of these that shows."""
    compasses = [table.where(flight.watch(table.t)) for table in flight.all("MAG", *AXES)]
    compasses = [
        table
        for n, table in enumerate(compasses, start=1)
        if len(table) >= 3 and flight.setting("COMPASS_USE" if n == 1 else f"COMPASS_USE{n}") != 0
    ]
    if not compasses or flight.setting("COMPASS_ENABLE", "MAG_ENABLE") == 0:
        return
    for test in (_dead, _apart, _refused, _by_motors, _implausible):
        found = next(iter(test(flight, compasses)), None)
        if found is not None:
            yield found
            return
    yield from _doubted(flight)


def _dead(flight: Flight, compasses: list[Table]) -> Iterator[Finding]:
    """The first compass, which is the one in use, gives nothing; critical where no other takes its place, or what
    followed was lost."""
    first = compasses[0]
    spans = lasting(first.t, _silent(first), _SILENT_S)
    if not spans:
        return
    start, end = spans[0][0], spans[-1][1]
    others = [other.between(start, end) for other in compasses[1:]]
    replaced = any(len(other) and float(_silent(other).mean()) < 0.5 for other in others)
    broken = _not_a_number(flight)
    yield Finding(
        kind="compass",
        title="the compass reads nothing",
        onset_s=start,
        end_s=end,
        severity="critical"
        if not replaced or flight.lost_control_s is not None or _rejected(flight, start)
        else "warning",
        evidence="the field of compass 1 is zero or marked unhealthy"
        + (f"; {broken} is not a number" if broken else ""),
        source="MAG",
        suspect="parameter" if broken else "hardware",
        probability=0.95,
    )


def _silent(compass: Table) -> Mask:
    silent = ~(length(compass[axis] for axis in AXES) > 1.0)
    return silent | (compass["Health"] == 0) if "Health" in compass.columns else silent


def _not_a_number(flight: Flight) -> str:
    """A calibration of the compass that is no number, which makes every field none; "" where there is no such."""
    table = flight.one("PARM", "Name", "Value")
    if table is None:
        return ""
    names = table["Name"][~np.isfinite(table["Value"])].tolist()
    return next((name for name in names if str(name).startswith("COMPASS_")), "")


def _apart(flight: Flight, compasses: list[Table]) -> Iterator[Finding]:
    """Two compasses whose difference exceeds what arming allows, or moves in flight."""
    for n, other in enumerate(compasses[1:], start=2):
        t = compasses[0].t
        apart = np.stack([compasses[0][axis] - aligned(t, other.t, other[axis]) for axis in AXES])
        if not np.isfinite(apart).all(axis=0).any():
            continue
        early = median(apart[:, : max(len(t) // 10, 3)], axis=1)
        moved = smooth(t, length(apart - early[:, None]), 2.0)
        level = smooth(t, np.hypot(apart[0], apart[1]), 2.0)
        over = np.maximum(level / APART, moved / MOVED)
        if flight.tilt is not None:
            over = np.where(np.interp(t, *flight.tilt) < _LEANS_DEG, over, 0.0)
        spans = lasting(t, over > 1.0, _LASTS_S)
        if not spans:
            continue
        start, end = spans[0][0], spans[-1][1]
        inside = (t >= start) & (t <= end)
        ratio = float(median(over[inside]))
        has_moved = float(median(moved[inside])) / MOVED > float(median(level[inside])) / APART
        size = float(median((moved if has_moved else level)[inside]))
        worse = _odd_one(compasses, n)
        yield Finding(
            kind="compass",
            title=f"compass {worse} is disturbed",
            onset_s=start,
            end_s=end,
            severity=_gravity(flight, start, worse == 1),
            evidence=(
                f"the difference of compasses 1 and {n} changes by {size:.0f} mGauss in flight (limit {MOVED:.0f})"
                if has_moved
                else f"compasses 1 and {n} differ by {size:.0f} mGauss in the level plane (limit {APART:.0f})"
            ),
            source="MAG, MAG2; AP_COMPASS_MAX_XY_LENGTH_DIFF 200 mGauss",
            probability=calibrated_probability(ratio, _CALIBRATION),
            mission_lost=_LOST,
        )


def _odd_one(compasses: list[Table], other: int) -> int:
    """Which of compass 1 and another is the bad one: the third agrees with the good one, else the unsteadier length."""
    t = compasses[0].t
    rest = [n for n in range(2, len(compasses) + 1) if n != other]
    if rest:
        third = compasses[rest[0] - 1]

        def from_third(table: Table) -> float:
            gaps = (aligned(t, table.t, table[axis]) - aligned(t, third.t, third[axis]) for axis in AXES)
            return known_median(length(gaps))

        return 1 if from_third(compasses[0]) >= from_third(compasses[other - 1]) else other
    sd = [float(np.nanstd(length(table[axis] for axis in AXES))) for table in (compasses[0], compasses[other - 1])]
    return 1 if sd[0] >= sd[1] else other


def _gravity(flight: Flight, start: float, is_used: bool) -> Severity:
    """Critical where the compass in use is the bad one and the estimator's yaw suffered."""
    return "critical" if is_used and (_rejected(flight, start) or flight.was_refused) else "warning"


def _rejected(flight: Flight, start: float) -> bool:
    return any(
        bool(lasting(one.t, (one["SM"] > 1.0) & (one.t >= start - 1) & flight.watch(one.t), 1.0))
        for one in flight.all("XKF4", "SM")
    )


def _refused(flight: Flight, compasses: list[Table]) -> Iterator[Finding]:
    """The firmware refused arming for a compass: it knows what the Earth's field should be there. One that is to be
    calibrated, or was and wants a restart, is not wrong."""
    begin = flight.refused_for("mag field", "compass", "mag anomaly", but="calibrat")
    if begin is not None:
        said = next(text for t, text in flight.messages if t == begin)
        yield Finding(
            kind="compass",
            title="the firmware finds the compass wrong",
            onset_s=begin,
            end_s=flight.end_s,
            severity="critical",
            evidence=said,
            source="MSG; AP_Arming's compass checks",
            probability=0.7,
        )


def _by_motors(flight: Flight, compasses: list[Table]) -> Iterator[Finding]:
    """A field whose length follows the throttle."""
    driven = flight.throttle
    if driven is None:
        return
    first = compasses[0]
    strength = length(first[axis] for axis in AXES)
    throttle = np.interp(first.t, *driven)
    usable: Mask = np.isfinite(strength) & (strength > 1.0)
    if usable.sum() < 20 or np.ptp(throttle[usable]) < 0.15:
        return
    x, y = throttle[usable], strength[usable]
    base, slope = _line(x, y)
    with np.errstate(invalid="ignore"):
        match = float(np.corrcoef(x, y)[0, 1])
    share = abs(slope) * quantile(x, 0.95) / max(base, 1.0)
    if share > GREY and abs(match) > 0.6:
        yield Finding(
            kind="compass",
            title="the motors' currents disturb the compass",
            onset_s=float(first.t[usable][0]),
            end_s=float(first.t[-1]),
            severity="critical" if share > TOO_MUCH and _rejected(flight, 0.0) else "warning",
            evidence=(
                f"the field changes by {100 * share:.0f} % with the throttle (correlation {match:.2f}; limit 30 %, "
                "above 60 % it is unusable)"
            ),
            source="MAG against CTUN.ThO; ArduPilot, Compass setup",
            probability=0.7 if share > TOO_MUCH else 0.5,
        )


def _line(x: Floats, y: Floats) -> tuple[float, float]:
    """Intercept and slope of a straight line."""
    slope = float(np.cov(x, y)[0, 1] / max(float(np.var(x, ddof=1)), 1e-12))
    return float(y.mean() - slope * x.mean()), slope


def _implausible(flight: Flight, compasses: list[Table]) -> Iterator[Finding]:
    """A field that the Earth does not have."""
    first = compasses[0]
    strength = smooth(first.t, length(first[axis] for axis in AXES), 2.0)
    spans = lasting(first.t, (strength < _SHORTEST) | (strength > _LONGEST), _LASTS_S)
    if spans:
        worst = strength[(first.t >= spans[0][0]) & (first.t <= spans[-1][1])]
        yield Finding(
            kind="compass",
            title="the magnetic field is implausible",
            onset_s=spans[0][0],
            end_s=spans[-1][1],
            severity="critical" if _rejected(flight, spans[0][0]) else "warning",
            evidence=(
                f"length between {worst.min():.0f} and {worst.max():.0f} mGauss (plausible: {_SHORTEST:.0f} to "
                f"{_LONGEST:.0f})"
            ),
            source="MAG; AP_Arming's limits of the field",
            probability=0.5,
        )


def _doubted(flight: Flight) -> Iterator[Finding]:
    """The estimator found the compass wrong in the air, though the compass alone shows nothing."""
    for one in flight.all("XKF4", "SM"):
        spans = lasting(one.t, (one["SM"] > 1.0) & during(flight.flown, one.t), 3.0)
        if spans:
            yield Finding(
                kind="compass",
                title="the estimator rejects the compass",
                onset_s=spans[0][0],
                end_s=spans[-1][1],
                severity="warning",
                evidence=f"test ratio {np.max(one['SM'][flight.watch(one.t)]):.1f} (limit 1)",
                source="XKF4.SM; 1 is the limit of its innovation test",
                probability=0.2,
            )
            return
