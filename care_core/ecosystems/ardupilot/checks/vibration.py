"""Vibration of the inertial sensors, and clipping of their range.

Limits: "levels below 30 m/s/s are normally acceptable, above 30 may have problems, above 60 nearly always have
problems"; clipping should be 0, and some hundred clips are a serious problem (ArduPilot, Measuring Vibration).
97.5% of the healthy training flights lie below 1.6 m/s^2.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.ardupilot.airborne import OFF_GROUND_M
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.statistics import (
    calibrated,
    calibrated_probability,
    lasting,
    length,
    roughness,
    smooth,
    steady,
    top,
)
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding, Severity
from care_core.ecosystems.spans import during, seconds_in
from care_core.ecosystems.vehicles.errors import VIBRATION
from care_core.logs.base import Table, Wanted
from care_core.numbers import Bools, Floats, quantile

READS: Wanted = {
    "VIBE": ("VibeX", "VibeY", "VibeZ", "Clip"),
    "IMU": ("AccX", "AccY", "AccZ"),
    "XKF4": ("SV", "SH"),
}

LIMITS = Limits()
_PAGE = "ArduPilot, Measuring Vibration"
FELT = LIMITS.add(
    "vibration worth a word", 30.0, "m/s^2", f"{_PAGE}: acceptable below; a real flight with good propellers has 20"
)
HIGH = LIMITS.add("acceptable vibration", 30.0, "m/s^2", _PAGE)
SEVERE = LIMITS.add("severe vibration", 60.0, "m/s^2", _PAGE)
ROSE = LIMITS.add(
    "vibration that rose", 10.0, "m/s^2",
    "a choice: acceptable, yet something came loose; no healthy training flight reaches 2.2",
)  # fmt: skip
_ROSE_HOVERING = LIMITS.add(
    "the same, of a QuadPlane", 20.0, "m/s^2", "9 of 344 sound simulated flights reach 10 to 13 as they land"
)
_TIMES = LIMITS.add("times of what it was before", 5.0, "", "a choice: speed and throttle raise it by less")
_CLIPS = LIMITS.add("clips of an accelerometer's range", 100, "", _PAGE)
_MANY = LIMITS.add("critical clips, in limits", 10, "", "a choice: a hard landing clips less often")
_LASTS_S = LIMITS.add("shortest vibration", 2.0, "s", "a choice: a blow fades within a second")
_SPIN_UP_S = LIMITS.add("left out after arming", 4.0, "s", "a choice: motors that start shake")
_RATIO = LIMITS.add("test ratio of the estimator", 1.0, "", "AP_NavEKF3: above it a measurement is rejected")
_UPSET_S = LIMITS.add("shortest rejection by the estimator", 1.0, "s", "a choice: single outliers are usual")
_RAW = LIMITS.add("leap of an acceleration, without VIBE", 5.0, "m/s^2", "ArduPilot's advice for logs without VIBE")
_RAW_SEVERE = LIMITS.add("critical leap of an acceleration", 15.0, "m/s^2", "a choice: three times that")
_LEVEL_DEG = LIMITS.add("lean at which accelerations are looked at", 15.0, "deg", "a choice: a lean changes them")
_LIES_DEG = LIMITS.add("lean of what lies on the ground", 45.0, "deg", "ANGLE_MAX is 30 to 45 as shipped")
_CALIBRATION = calibrated(
    LIMITS,
    ((0.5, 0.5), (1.0, 0.9), (2.0, 0.97)),
    "every training flight above 10 m/s^2 has failing accelerometers (15 of 15)",
    "acceptable vibration",
)
_RAW_PROBABILITY_P = LIMITS.add("probability without VIBE", 0.6, "", "a choice: accelerations alone tell less")
_SOURCE = "VIBE; limits 30 and 60 m/s^2: ArduPilot, Measuring Vibration"


def find(flight: Flight) -> Iterator[Finding]:
    """Vibration over the documented levels, or that rose sharply in flight."""
    found = [finding for n, table in enumerate(flight.all("VIBE", "VibeX", "VibeY", "VibeZ"))
             if (finding := _of(flight, table, n)) is not None]  # fmt: skip
    if not found and not flight.all("VIBE"):
        found = [finding for finding in [_raw(flight)] if finding is not None]
    if found:
        yield max(found, key=lambda finding: (finding.severity == "critical", finding.probability))


def _of(flight: Flight, table: Table, number: int) -> Finding | None:
    calm = flight.watch(table.t)
    for start, end in flight.watched:  # touching and leaving the ground shakes
        calm &= ~((table.t >= start) & (table.t < start + _SPIN_UP_S)) | (end - start < 3 * _SPIN_UP_S)
    if flight.is_winged:  # wheels on grass, a catapult, a belly landing
        calm &= during(((start + _SPIN_UP_S, end - _SPIN_UP_S) for start, end in flight.flown), table.t)
    if (struck_s := flight.struck_s) is not None:  # what it hit shakes it
        calm &= table.t < struck_s
    calm &= ~_scrapes(flight, table.t)
    t = table.t[calm]
    if len(t) < 3:
        return None
    level = np.maximum(np.maximum(table["VibeX"], table["VibeY"]), table["VibeZ"])[calm]
    level = steady(t, np.where(np.isfinite(level), level, 0.0), _LASTS_S)  # not a blow, which fades within a second
    aloft = during(flight.flown, t)  # on the ground its motors idle, which says nothing of what it was
    before = quantile(level[aloft] if aloft.any() else level, 0.05)
    upset = _upset(flight)
    rose_to = _ROSE_HOVERING if flight.kind == "quadplane" else ROSE
    limit = rose_to if before < rose_to / _TIMES or upset else FELT
    spans = lasting(t, level > limit, _LASTS_S)
    clips = _clipped(table, calm)
    if not spans and clips < _CLIPS:
        return None
    start, end = (spans[0][0], spans[-1][1]) if spans else _clipping(table, calm)
    peak = top(level[(t >= start) & (t <= end)], 0.9)
    severity = _severity(flight, peak, clips, any(at >= start - 1 for at in upset), before < peak / _TIMES)
    rose = f", from {before:.1f}" if before < peak / _TIMES else ""
    lasted = seconds_in(spans) if spans else end - start
    clipping = f"; {clips:.0f} clips of the accelerometer's range" if clips else ""
    return Finding(
        kind="vibration",
        title=f"strong vibration ({peak:.0f} m/s^2)" if spans else "an accelerometer exceeds its range",
        onset_s=start,
        end_s=end,
        severity=severity,
        evidence=f"VIBE of IMU {number + 1} at {peak:.0f} m/s^2{rose} for {lasted:.0f} s ({_against(peak)}){clipping}",
        source=_SOURCE,
        probability=calibrated_probability(max(peak / HIGH, 1.0 if clips >= _CLIPS else 0.0), _CALIBRATION),
    )


def _scrapes(flight: Flight, t: Floats) -> Bools:
    """When a copter leans so far, so low, that an arm of it is on the ground: that shakes it, and is no vibration."""
    if not flight.is_copter or flight.tilt is None or flight.height is None:
        return np.zeros(len(t), dtype=bool)
    return np.asarray((np.interp(t, *flight.tilt) > _LIES_DEG) & (np.interp(t, *flight.height) < OFF_GROUND_M))


def _against(peak: float) -> str:
    """What the documentation says of such a level."""
    return f"limit {HIGH:.0f}" if peak > HIGH else f"below the usual limit of {HIGH:.0f}, yet it rose"


def _clipped(table: Table, calm: np.ndarray) -> float:
    """Clips counted in flight; the counter only ever rises."""
    if "Clip" not in table.columns or not calm.any():
        return 0.0
    counts = table["Clip"][calm]
    return max(float(counts[-1] - counts[0]), 0.0)


def _clipping(table: Table, calm: np.ndarray) -> tuple[float, float]:
    counts, t = table["Clip"][calm], table.t[calm]
    rising = t[1:][np.diff(counts) > 0]
    return float(rising[0]), float(rising[-1])


def _severity(flight: Flight, peak: float, clips: float, is_upset: bool, has_risen: bool) -> Severity:
    """Critical where it is severe, made the firmware go over to its vibration failsafe, or upset the estimator."""
    if peak > SEVERE or clips >= _MANY * _CLIPS or any(code for _, code in flight.errors(VIBRATION)) or is_upset:
        return "critical"
    return "warning" if peak > HIGH or clips >= _CLIPS or has_risen else "info"


def _upset(flight: Flight) -> list[float]:
    """When the estimator rejected its velocity or height, which vibration is the usual reason for."""
    return [
        start
        for core in flight.all("XKF4", "SV", "SH")
        for start, _ in lasting(
            core.t, ((core["SV"] > _RATIO) | (core["SH"] > _RATIO)) & flight.watch(core.t), _UPSET_S
        )
    ]


def _raw(flight: Flight) -> Finding | None:
    """Before firmware 3.3: acceleration itself, which should stay within 3 m/s^2 on the level axes and within 5 of
    gravity on the third (ArduPilot's advice for logs without VIBE)."""
    table = flight.one("IMU", "AccX", "AccY", "AccZ")
    if table is None or len(table) < 50:
        return None
    t = table.t
    calm = during(flight.flown, t)
    if flight.tilt is not None:
        calm &= np.interp(t, *flight.tilt) < _LEVEL_DEG
    rough = smooth(t, length(roughness(table[axis]) for axis in ("AccX", "AccY", "AccZ")), 2.0)
    spans = lasting(t, calm & (rough > _RAW), _LASTS_S)
    if not spans:
        return None
    start, end = spans[0][0], spans[-1][1]
    peak = top(rough[calm & (t >= start) & (t <= end)], 0.9)
    severity: Severity = "critical" if peak > _RAW_SEVERE else "warning"
    return Finding(
        kind="vibration",
        title=f"strong vibration ({peak:.0f} m/s^2)",
        onset_s=start,
        end_s=end,
        severity=severity,
        evidence=f"accelerations jump by {peak:.0f} m/s^2 between records for {end - start:.0f} s (limit {_RAW:g})",
        source="IMU; limits of 3 and 5 m/s^2 for logs without VIBE: ArduPilot, Measuring Vibration",
        probability=_RAW_PROBABILITY_P,
    )


CHECK = Check("vibration", "vibration of the inertial sensors, and clipping of their range", READS, LIMITS, find)
