"""Compasses: dead, at odds with each other, disturbed by the motors' currents, at odds with the estimator.

Limits: two compasses may differ by 200 mGauss in the level plane (AP_Compass.h: AP_COMPASS_MAX_XY_LENGTH_DIFF) and 90
degrees (AP_COMPASS_MAX_XYZ_ANG_DIFF); of the field's length 30% may come from the motors, 60% are too much
(ArduPilot, Compass setup: below 30% is good, 30 to 60% a grey area); a length is plausible between 185 and 875 mGauss
(AP_Arming). On the training table healthy compasses agree to a mGauss: those of a simulator are alike.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.ardupilot.checks.refused_by import refusing
from care_core.ecosystems.ardupilot.checks.settings import heading
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.statistics import (
    aligned,
    calibrated,
    calibrated_probability,
    lasting,
    length,
    smooth,
)
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding, Severity
from care_core.ecosystems.liveness import says_nothing
from care_core.ecosystems.not_numbers import broken
from care_core.ecosystems.spans import during
from care_core.logs.base import Table, Wanted
from care_core.numbers import Bools, Floats, known_median, median, quantile

AXES = ("MagX", "MagY", "MagZ")
READS: Wanted = {"MAG": (*AXES, "Health"), "XKF4": ("SM",)}

LIMITS = Limits()
APART = LIMITS.add("two compasses apart in the level plane", 200.0, "mGauss", "AP_COMPASS_MAX_XY_LENGTH_DIFF")
MOVED = LIMITS.add(
    "change of their difference in flight", 140.0, "mGauss",
    "70% of what arming allows, since turning alone moves it where their calibrations differ",
)  # fmt: skip
_LEANS_DEG = LIMITS.add(
    "lean at which compasses are compared", 60.0, "deg", "a choice: further over calibrations no longer cancel"
)
GREY = LIMITS.add("share of the field from the motors", 0.3, "", "ArduPilot, Compass setup: a grey area above")
TOO_MUCH = LIMITS.add("share that makes it unusable", 0.6, "", "ArduPilot, Compass setup")
_FOLLOWS = LIMITS.add("correlation of field and throttle", 0.6, "", "a choice: turning moves the field as well")
_SPREAD = LIMITS.add("spread of the throttle to compare with", 0.15, "", "a choice: less tells nothing")
_PLACE = LIMITS.add(
    "share of it that the field may have changed at rest", 0.5, "", "a choice: what stays without current is the place"
)
_TURNS = LIMITS.add("share of the throttle's spread above which motors turn", 0.1, "", "a choice: idling takes little")
_RESTS = LIMITS.add("records at rest before and after", 10.0, "", "a choice: a second at 10 Hz")
_SHORTEST = LIMITS.add("shortest field", 185.0, "mGauss", "AP_Arming's limits of the field")
_LONGEST = LIMITS.add("longest field", 875.0, "mGauss", "AP_Arming's limits of the field")
_LASTS_S = LIMITS.add("shortest disturbance", 3.0, "s", "a choice: passing steel is over sooner")
_SILENT_S = LIMITS.add("shortest silence", 1.0, "s", "a choice: single records are lost now and then")
_NOTHING = LIMITS.add("field that is none", 1.0, "mGauss", "a choice: the Earth's is 250 to 650")
_RATIO = LIMITS.add("test ratio of the estimator", 1.0, "", "AP_NavEKF3: above it the compass is rejected")
_CALIBRATION = calibrated(
    LIMITS,
    ((1.0, 0.8), (1.5, 0.95), (3.0, 0.98)),
    "all training flights over the limit have a failing compass, and no other",
)
_LOST_ON_WINGS_P = LIMITS.add(
    "probability that it costs a plane its mission", 0.2, "", "1 of 7 training flights: a plane steers by its course"
)
_LOST_P = LIMITS.add(
    "probability that it costs the mission", 0.65, "",
    "6 of 8 such training flights failed, of those without a failed part 48% (a critical finding counts as four)",
)  # fmt: skip
_DEAD_P = LIMITS.add("probability of a dead compass", 0.95, "", "its field is zero, or it says so itself")
_REFUSED_P = LIMITS.add("probability where arming was refused for it", 0.7, "", "the firmware's own word")
_MOTORS_P = LIMITS.add(
    "probability of a field that follows the motors",
    0.5,
    "",
    "a choice: battery leads do that, and many vehicles fly so",
)
_MOTORS_MUCH_P = LIMITS.add(
    "probability of one that follows them much", 0.7, "", "a choice: more than the share that makes it unusable"
)
_ODD_P = LIMITS.add("probability of a field that the Earth does not have", 0.5, "", "a choice: steel is near, or not")
_DOUBTED_P = LIMITS.add("probability where the estimator alone doubts it", 0.2, "", "a choice: mostly others are wrong")
_REPLACES = 0.5
"""Share of records without a field below which another compass takes its place: it has more with one than without."""


_FIELD_WORDS = re.compile("mag field|compass|mag anomaly", re.IGNORECASE)


def find(flight: Flight) -> Iterator[Finding]:
    """What is wrong with the compasses while they matter: the first of these that shows, but no parameter."""
    compasses = _in_use(flight)
    if flight.setting("COMPASS_ENABLE", "MAG_ENABLE") == 0 or heading.wrong_setting(flight) is not None:
        return
    if any(name.startswith("COMPASS_") for name in broken(flight.settings)):
        return  # it makes every field none
    if not compasses:
        yield from _refused(flight, compasses)
        return
    for test in (_dead, _apart, _refused, _by_motors, _implausible):
        found = next(iter(test(flight, compasses)), None)
        if found is not None:
            yield found
            return
    yield from _doubted(flight)


def _in_use(flight: Flight) -> list[Table]:
    """The compasses that are used and say something, while they matter."""
    return [
        watched
        for n, table in enumerate(flight.all("MAG", *AXES), start=1)
        if len(watched := table.where(flight.watch(table.t))) >= 3
        and flight.setting("COMPASS_USE" if n == 1 else f"COMPASS_USE{n}") != 0
        and not all(says_nothing(table[axis]) for axis in AXES)
    ]


def reads_nothing(flight: Flight) -> bool:
    """Whether the first compass, which is the one in use, gives nothing for a while."""
    return any(lasting(first.t, _silent(first), _SILENT_S) for first in _in_use(flight)[:1])


def _dead(flight: Flight, compasses: list[Table]) -> Iterator[Finding]:
    """The first compass, which is the one in use, gives nothing; critical where no other takes its place, or what
    followed was lost."""
    first = compasses[0]
    spans = lasting(first.t, _silent(first), _SILENT_S)
    if not spans:
        return
    start, end = spans[0][0], spans[-1][1]
    others = [other.between(start, end) for other in compasses[1:]]
    replaced = any(len(other) and float(_silent(other).mean()) < _REPLACES for other in others)
    yield Finding(
        kind="compass",
        title="the compass reads nothing",
        onset_s=start,
        end_s=end,
        severity="critical"
        if not replaced or flight.lost_control_s is not None or _rejected(flight, start)
        else "warning",
        evidence="the field of compass 1 is zero or marked unhealthy",
        source="MAG",
        probability=_DEAD_P,
    )


def _silent(compass: Table) -> Bools:
    silent = ~(length(compass[axis] for axis in AXES) > _NOTHING)
    return silent | (compass["Health"] == 0) if "Health" in compass.columns else silent


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
        beyond = inside & (over > 1.0)
        has_moved = float(median(moved[beyond])) / MOVED > float(median(level[beyond])) / APART
        size = float(median((moved if has_moved else level)[beyond]))
        worse = _odd_one(compasses, n)
        yield Finding(
            kind="compass",
            title=f"compass {worse} is disturbed",
            onset_s=start,
            end_s=end,
            severity=_severity(flight, start, worse == 1),
            evidence=(
                f"the difference of compasses 1 and {n} changes by {size:.0f} mGauss in flight (limit {MOVED:.0f})"
                if has_moved
                else f"compasses 1 and {n} differ by {size:.0f} mGauss in the level plane (limit {APART:.0f})"
            ),
            source="MAG, MAG2; AP_COMPASS_MAX_XY_LENGTH_DIFF 200 mGauss",
            probability=calibrated_probability(ratio, _CALIBRATION),
            mission_lost=_LOST_ON_WINGS_P if flight.is_winged else _LOST_P,
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


def _severity(flight: Flight, start: float, is_used: bool) -> Severity:
    """Critical where the compass in use is the bad one and the estimator's yaw suffered; a plane steers by course."""
    if flight.kind == "plane" and not flight.was_refused:
        return "warning"
    return "critical" if is_used and (_rejected(flight, start) or flight.was_refused) else "warning"


def _rejected(flight: Flight, start: float) -> bool:
    return any(
        bool(lasting(one.t, (one["SM"] > _RATIO) & (one.t >= start - 1) & flight.watch(one.t), 1.0))
        for one in flight.all("XKF4", "SM")
    )


def _refused(flight: Flight, compasses: list[Table]) -> Iterator[Finding]:
    """The firmware refused arming for a compass: it knows what the Earth's field should be there. One that is to be
    calibrated, or was and wants a restart, is not wrong, nor one beside a parameter that cannot hold."""
    begin = flight.refused_for("mag field", "compass", "mag anomaly", but="calibrat")
    if begin is not None and not any(one.is_shown for one in refusing(flight)):
        told = [one.text for one in flight.refusals if one.time_s == begin]
        said = next((text for text in told if _FIELD_WORDS.search(text)), told[0])
        yield Finding(
            kind="compass",
            title="the firmware finds the compass wrong",
            onset_s=begin,
            end_s=flight.end_s,
            severity="critical",
            evidence=said,
            source="MSG; AP_Arming's compass checks",
            probability=_REFUSED_P,
        )


def _by_motors(flight: Flight, compasses: list[Table]) -> Iterator[Finding]:
    """A field whose length follows the throttle."""
    driven = flight.throttle
    if driven is None:
        return
    first = compasses[0]
    strength = length(first[axis] for axis in AXES)
    throttle = np.interp(first.t, *driven)
    usable: Bools = np.isfinite(strength) & (strength > 1.0)
    if usable.sum() < 20 or np.ptp(throttle[usable]) < _SPREAD:
        return
    x, y = throttle[usable], strength[usable]
    base, slope = _line(x, y)
    with np.errstate(invalid="ignore"):
        match = float(np.corrcoef(x, y)[0, 1])
    effect = abs(slope) * quantile(x, 0.95)
    share = effect / max(base, 1.0)
    if share > GREY and abs(match) > _FOLLOWS and _changed_at_rest(x, y) < _PLACE * effect:
        yield Finding(
            kind="compass",
            title="the motors' currents disturb the compass",
            onset_s=float(first.t[usable][0]),
            end_s=float(first.t[-1]),
            severity="critical" if share > TOO_MUCH and _rejected(flight, 0.0) else "warning",
            evidence=(
                f"the field changes by {100 * share:.0f}% with the throttle (correlation {match:.2f}; limit 30%, "
                "above 60% it is unusable)"
            ),
            source="MAG against CTUN.ThO; ArduPilot, Compass setup",
            probability=_MOTORS_MUCH_P if share > TOO_MUCH else _MOTORS_P,
        )


def _changed_at_rest(throttle: Floats, strength: Floats) -> float:
    """How much the field changed from before the motors first turned to after they last did: what is in the ground
    where it took off, or where it landed, stays when they stop. 0 where one of both is not in the log."""
    turns = np.flatnonzero(throttle > throttle.min() + _TURNS * np.ptp(throttle))
    before, after = strength[: turns[0]], strength[turns[-1] + 1 :]
    enough = min(len(before), len(after)) >= _RESTS
    return abs(float(median(after)) - float(median(before))) if enough else 0.0


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
            evidence=(f"length {_ranging(worst)} mGauss (plausible: {_SHORTEST:.0f} to {_LONGEST:.0f})"),
            source="MAG; AP_Arming's limits of the field",
            probability=_ODD_P,
        )


def _doubted(flight: Flight) -> Iterator[Finding]:
    """The estimator found the compass wrong in the air, though the compass alone shows nothing."""
    for one in flight.all("XKF4", "SM"):
        spans = lasting(one.t, (one["SM"] > _RATIO) & during(flight.flown, one.t), _LASTS_S)
        if spans:
            yield Finding(
                kind="compass",
                title="the estimator rejects the compass",
                onset_s=spans[0][0],
                end_s=spans[-1][1],
                severity="warning",
                evidence=f"test ratio {np.max(one['SM'][flight.watch(one.t)]):.1f} (limit 1)",
                source="XKF4.SM; 1 is the limit of its innovation test",
                probability=_DOUBTED_P,
            )
            return


def _ranging(values: Floats) -> str:
    """The range of values in whole numbers, in words."""
    least, most = f"{values.min():.0f}", f"{values.max():.0f}"
    return least if least == most else f"between {least} and {most}"


CHECK = Check("compass", "dead, disturbed or implausible compasses", READS, LIMITS, find)
