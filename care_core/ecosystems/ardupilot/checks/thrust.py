"""Too little thrust: all that the motors have is used, or hovering takes most of it.

The firmware learns a hover throttle up to 0.6875 (AP_MotorsMulticopter.h: AP_MOTORS_THST_HOVER_MAX); a vehicle that
needs more has too little in hand to keep its attitude. 97.5% of the healthy training flights hover below 0.68.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import numpy as np

from care_core.ecosystems.ardupilot.checks import bench
from care_core.ecosystems.ardupilot.checks.settings import hover
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.statistics import lasting, smooth
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding, Severity, SuspectKind
from care_core.ecosystems.spans import Span, during, runs, seconds_in
from care_core.ecosystems.vehicles.errors import BATTERY_FAILSAFE
from care_core.logs.base import Wanted
from care_core.numbers import Floats, median
from care_core.records import replace
from care_core.text import log_time

READS: Wanted = {"CTUN": ("ThO", "Alt", "DAlt", "CRt", "DCRt"), "MOTB": ("ThLimit", "LiftMax")}

LIMITS = Limits()
HOVER_MOST = LIMITS.add("hover throttle", 0.6875, "", "AP_MotorsMulticopter.h: AP_MOTORS_THST_HOVER_MAX")
_LASTS_S = LIMITS.add("shortest hover at a high throttle", 10.0, "s", "a choice: a climb is over sooner")
_SHARE = LIMITS.add("share of the flight at a high throttle", 0.3, "", "a choice: gusts take less")
FULL = LIMITS.add("throttle of all that the motors have", 0.95, "", "a choice: MOT_SPIN_MAX as shipped")
_NEARLY_FULL = LIMITS.add(
    "throttle of nearly all that they have", 0.9, "", "a choice: a pilot's stick is not at its end"
)
_SINKS_MS = LIMITS.add(
    "sink that goes on with it", 1.0, "m/s", "a choice: what has thrust to spare has stopped by then"
)
_LEVEL_DEG = LIMITS.add("lean of what should not sink with it", 25.0, "deg", "its lift is 9% less")
_FULL_LASTS_S = LIMITS.add("shortest time at full throttle", 3.0, "s", "a choice: a gust is over sooner")
_BELOW_M = LIMITS.add("height below the one wanted", 2.0, "m", "a choice: height control is within a metre")
_CLIMBS_MS = LIMITS.add("climb of what has thrust to spare", 1.0, "m/s", "a choice: half of PILOT_SPEED_UP as shipped")
_GROUNDED_S = LIMITS.add("full throttle on the ground", 5.0, "s", "a choice: a take-off takes less")
SPIN_MOST = LIMITS.add("MOT_SPIN_MAX that keeps motors down", 0.9, "", "AP_MotorsMulticopter: 0.95 as shipped")
_FLYING = LIMITS.add("least throttle in the air", 0.05, "", "a choice: above it motors turn")
_LACKS_P = LIMITS.add(
    "probability where it sinks with nearly all, or hovered at too much before", 0.7, "", "a choice: wash sinks it too"
)
_PROBABILITY: Mapping[SuspectKind, float] = {
    "hardware": LIMITS.add(
        "probability of a weak part", 0.3, "", "7 of 83 such training flights have one, and those vary little in weight"
    ),
    "parameter": LIMITS.add("probability of a weak part where MOT_SPIN_MAX is low", 0.1, "", "the same 83 flights"),
}


def find(flight: Flight) -> Iterator[Finding]:
    """Saturation first, for it says more than a high hover throttle."""
    driven = flight.throttle
    if not flight.is_copter or flight.kind == "heli" or driven is None:
        return  # what a helicopter records as throttle is its collective pitch
    if hover.kept_down(flight) is not None or bench.unmoved(flight) is not None:
        return  # a parameter keeps it down, or it has no propellers
    t, throttle = driven
    flown = during(flight.flown or flight.watched, t) & (throttle > _FLYING)
    if flown.sum() < 5:
        return
    level = smooth(t, throttle, 4.0)
    spans = lasting(t, flown & (level > HOVER_MOST), _LASTS_S, gap_s=5.0)
    high = [span for span in spans if not climbs(flight, *span)]
    full = [span for span in saturated(flight) if _below(flight, *span) or not climbs(flight, *span)]
    if strained := full or _sinking(flight):
        start = strained[0][0]
        before = float(median(throttle[flown & (t <= max(start, t[flown][0] + 5))]))
        begin = min([start, *[a for a, _ in high]])
        yield _too_little(flight, full, begin, before) if full else _sinks(flight, strained, before)
    elif high and seconds_in(high) > _SHARE * float(flown.sum()) * float(median(np.diff(t))):
        share = 100 * float(median(level[flown]))
        evidence = f"mean throttle {share:.0f}% (the firmware learns up to {100 * HOVER_MOST:.0f}%)"
        title = f"hovering takes {share:.0f}% of the throttle"
        yield _finding(flight, title, (high[0][0], high[-1][1]), "warning", evidence)


def _too_little(flight: Flight, full: list[Span], begin: float, before: float) -> Finding:
    """The motors give all that they have.

    Args:
        full: when they do. begin: when the throttle first was high. before: the throttle until then.
    """
    start, end = full[0][0], full[-1][1]
    below, lasted = _below(flight, start, end), seconds_in(full)
    grounded = not flight.flown and lasted > _GROUNDED_S
    lost = flight.impact_s is not None or any(code for _, code in flight.errors(BATTERY_FAILSAFE))
    since = f"{100 * HOVER_MOST:.0f}% from {log_time(begin, 0)} on, above " if begin < start else ""
    evidence = f"throttle above {since}{100 * FULL:.0f}% for {lasted:.0f} s from {log_time(start, 0)} on"
    evidence += f", {below:.1f} m below the height wanted" if below else ""
    evidence += _until_then(before)
    severity: Severity = "critical" if grounded or lost or below > 2 * _BELOW_M else "warning"
    found = _finding(flight, "too little thrust", (begin, end), severity, evidence)
    is_heavy = before > HOVER_MOST and lasted > _LASTS_S
    return replace(found, probability=max(found.probability, _LACKS_P)) if is_heavy else found


def _until_then(before: float) -> str:
    return f"; before that the throttle was at {100 * before:.0f}%"


def _sinks(flight: Flight, sinking: list[Span], before: float) -> Finding:
    """It sinks though the motors give nearly all."""
    start, end = sinking[0][0], sinking[-1][1]
    evidence = (
        f"throttle above {100 * _NEARLY_FULL:.0f}% for {seconds_in(sinking):.0f} s from {log_time(start, 0)} on, and "
        f"it sank by {_sank_m(flight, *sinking[0]):.1f} m at that{_until_then(before)}"
    )
    found = _finding(flight, "too little thrust", (start, end), "critical", evidence)
    return replace(found, probability=max(found.probability, _LACKS_P))


def _finding(flight: Flight, title: str, span: Span, severity: Severity, evidence: str) -> Finding:
    behind = _behind(flight)
    return Finding(
        kind="thrust",
        title=title,
        onset_s=span[0],
        end_s=span[1],
        severity=severity,
        evidence=evidence + behind.why,
        source="CTUN.ThO; AP_MOTORS_THST_HOVER_MAX 0.6875",
        suspect=behind.suspect,
        probability=behind.probability,
        parameters=behind.parameters,
        wanted=behind.wanted,
    )


def saturated(flight: Flight) -> list[Span]:
    """When the motors give all that they have."""
    driven = flight.throttle
    if driven is None:
        return []
    t, throttle = driven
    flown = during(flight.flown or flight.watched, t)
    return lasting(t, flown & (throttle > FULL), _FULL_LASTS_S, gap_s=1.0)


def _sinking(flight: Flight) -> list[Span]:
    """When it sinks no slower with nearly all that its motors have, level, by estimate and barometer alike: a descent
    that began before gets slower at that, and what leans far spends its thrust elsewhere."""
    driven, known, leans = flight.throttle, flight.height, flight.tilt
    if driven is None or known is None or leans is None:
        return []
    t, throttle = driven
    level = np.interp(t, leans[0], smooth(*leans, 1.0)) < _LEVEL_DEG
    spans = []
    for start, end in runs(t, (throttle > _NEARLY_FULL) & level & during(flight.watched, t)):
        at = t[(t >= start + _FULL_LASTS_S) & (t <= end)]
        heights = [one for one in (known, flight.barometer) if one is not None]
        sank = np.all([_fell(height, at, _FULL_LASTS_S) > _BELOW_M for height in heights], axis=0)
        first_m, last_m = _fell(known, at - _FULL_LASTS_S + 1.0, 1.0), _fell(known, at, 1.0)
        sinks = (last_m > _SINKS_MS) & (last_m >= first_m)
        spans += [(a - _FULL_LASTS_S, b) for a, b in runs(at, sank & sinks, gap_s=_FULL_LASTS_S)]
    return spans


def _fell(height: tuple[Floats, Floats], at: Floats, for_s: float) -> Floats:
    """How far a height fell in the time before."""
    return np.interp(at - for_s, *height) - np.interp(at, *height)


def _sank_m(flight: Flight, start: float, end: float) -> float:
    assert flight.height is not None
    return float(np.interp(start, *flight.height) - np.interp(end, *flight.height))


class _Behind(NamedTuple):
    """What lacks where thrust does."""

    suspect: SuspectKind
    why: str
    probability: float
    parameters: tuple[str, ...] = ()
    wanted: tuple[tuple[str, float], ...] = ()


def _behind(flight: Flight) -> _Behind:
    """Whether a parameter keeps the motors from their full output. A low MOT_SPIN_MAX is left to a profile, which knows
    what it does."""
    most = flight.setting("MOT_SPIN_MAX")
    if most is not None and 0.0 < most < SPIN_MOST:
        why = f"; MOT_SPIN_MAX={most:g} keeps the motors from their full output (0.95 is usual)"
        return _Behind("parameter", why, _PROBABILITY["parameter"])
    kept = hover.ended(flight)
    if kept is None:
        return _Behind("hardware", "", _PROBABILITY["hardware"])
    why = f"; the outputs end at {kept.end_us:.0f} us of {kept.whole_us:.0f}: {kept}"
    wanted = ((kept.parameter, kept.wanted),)
    return _Behind("parameter", why, hover.keeps_down(kept), (kept.parameter,), wanted)


def climbs(flight: Flight, start: float, end: float) -> bool:
    """Whether it climbs with all its thrust, as a pilot's stick asks."""
    known = flight.height
    if known is None:
        return False
    low, high = np.interp((start, end), *known)
    return float(high - low) > _CLIMBS_MS * (end - start)


def _below(flight: Flight, start: float, end: float) -> float:
    """Metres by which the vehicle stays below the height that it wants, 0 where it does not or nothing says so."""
    table = flight.one("CTUN", "Alt", "DAlt")
    if table is None or not np.any(table["DAlt"]):
        return 0.0
    part = table.between(start, end)
    gap = float(median(part["DAlt"] - part["Alt"])) if len(part) else 0.0
    return gap if gap > _BELOW_M else 0.0


CHECK = Check("thrust", "motors at their limit, or a high hover throttle", READS, LIMITS, find)
