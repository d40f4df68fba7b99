"""GPS: jumps against its own velocity, glitches that the firmware saw, lost fixes, few satellites, a poor geometry.

Limits: a position may leave what its velocity and 10 m/s^2 predict by 5 m (AP_GPS_Glitch of Copter 3.1:
GPSGLITCH_RADIUS 5 m, GPSGLITCH_ACCEL 10 m/s^2); the estimator wants 6 satellites and an HDop below 2.5
(AP_NavEKF3_VehicleStatus.cpp); HDop below 1.5 is good, over 2 poor (ArduPilot, Diagnosing problems using logs). The
largest jump of 97.5% of the healthy training flights is 0.4 m.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.ardupilot.checks.log import holes
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.statistics import calibrated, calibrated_probability, lasting
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding, Severity
from care_core.ecosystems.spans import Span, during, inside, seconds_in, within
from care_core.ecosystems.vehicles import flies
from care_core.ecosystems.vehicles.errors import GPS, GPS_GLITCH
from care_core.geodesy import METRES_PER_DEGREE, offset_m
from care_core.logs.base import Table, Wanted
from care_core.numbers import Bools, Floats, quantile
from care_core.text import log_time

READS: Wanted = {
    "GPS": ("Status", "NSats", "HDop", "Lat", "Lng", "Alt", "Spd", "GCrs", "GMS"),
    "GPA": ("HAcc", "SAcc"),
    "XKF4": ("SP", "SV"),
}

LIMITS = Limits()
JUMP_M = LIMITS.add("jump that the velocity does not explain", 5.0, "m", "AP_GPS_Glitch: GPSGLITCH_RADIUS")
ACCELERATION = LIMITS.add("acceleration that explains more", 10.0, "m/s^2", "AP_GPS_Glitch: GPSGLITCH_ACCEL")
_AGAIN_S = LIMITS.add("pause between two reports of one glitch", 5.0, "s", "a choice: it comes and goes")
_LEAPS_S, _LEAP_M = (
    LIMITS.add("time of a leap of its height", 2.0, "s", "a choice: two fixes of a slow receiver"),
    LIMITS.add("leap of its height off the barometer's", 15.0, "m", "a choice: heights wander by metres in minutes"),
)
_TIMES_USUAL = LIMITS.add("jump over the usual ones", 5.0, "", "a choice: a velocity that never fits tells nothing")
_LARGE = LIMITS.add("critical jump, in limits", 3.0, "", "a choice: the vehicle follows it")
_SPEED_MS = LIMITS.add("speed that explains a step", 1.0, "m/s", "a choice: one at rest has a speed, too")
_AFTER_S = LIMITS.add("after a hole in the log", 1.5, "s", "a choice: what it missed is recorded soon")
_STEP_S = LIMITS.add("longest step", 3.0, "s", "a choice: over a longer one anything may have happened")
FEWEST = LIMITS.add("fewest satellites", 6, "", "AP_NavEKF3_VehicleStatus.cpp")
FALL = LIMITS.add("satellites lost at once", 3, "", "a choice: of those that there were")
_FEW_S = LIMITS.add("shortest time of few satellites", 2.0, "s", "a choice: a bank hides some for a second")
POOR_HDOP = LIMITS.add("poor HDop", 2.0, "", "ArduPilot, Diagnosing problems using logs")
BAD_HDOP = LIMITS.add("bad HDop", 2.5, "", "AP_NavEKF3_VehicleStatus.cpp")
_NO_HDOP = LIMITS.add("HDop that is none", 90.0, "", "receivers without a fix say 99.99")
_POOR_S = LIMITS.add("shortest time of a poor geometry", 5.0, "s", "a choice: a bank hides satellites for less")
_NO_FIX_S = LIMITS.add("shortest loss of the fix", 0.5, "s", "a choice: two records")
_LONG_S = LIMITS.add("critical loss of the fix", 5.0, "s", "a choice: the estimator drifts by metres then")
_RATIO = LIMITS.add("test ratio of the estimator", 1.0, "", "AP_NavEKF3: above it the position is rejected")
_HACC_M = LIMITS.add("accuracy of the position", 10.0, "m", "twice what the firmware's checks want")
_SACC_MS = LIMITS.add("accuracy of the speed", 3.0, "m/s", "three times what the firmware's checks want")
_TURNS = LIMITS.add("records that lie elsewhere between two of one place", 2, "", "a choice: one may be a glitch")
_CLOCK = LIMITS.add("pace of the receiver's clock, either way", 2.0, "", "a choice: simulators run at their own pace")
_DAY_MS = 86_400_000.0
_FIX = 3
_JUMP = calibrated(
    LIMITS, ((1.0, 0.7), (1.5, 0.95), (3.0, 0.98)), "every training flight with a jump over 5 m has a glitch", "a jump"
)
_FEW = calibrated(
    LIMITS,
    ((1.0, 0.85), (1.5, 0.95)),
    "only training flights with a failing receiver have 6 satellites or fewer",
    "too few satellites",
)
_LOST_P = LIMITS.add(
    "probability that few satellites cost the mission", 0.15, "",
    "4 of 11 such training flights failed, of those without a failed part 48% (a warning counts as four flights)",
)  # fmt: skip
_DRIVES_MS, _DRIVES_S = (
    LIMITS.add("speed that drives", 1.5, "m/s", "a choice: a receiver's speed wanders by less as it stands"),
    LIMITS.add("time of it", 5.0, "s", "a choice: longer than a receiver finds its fix"),
)
_DRIVES = LIMITS.add("throttle that drives", 0.02, "", "a choice: what idles has less")
_NO_FIX_P = LIMITS.add("probability of a lost fix", 0.9, "", "the receiver's own word")
_GLITCHED_P = LIMITS.add("probability of a reported glitch", 0.6, "", "a choice: the firmware's word, without the size")
_LEAPT_P = LIMITS.add("probability of a receiver whose height leaps", 0.8, "", "a choice: nothing flies so")
_DOUBTS_P = LIMITS.add("probability where it is only inaccurate", 0.4, "", "a choice: buildings and trees do that")


def find(flight: Flight) -> Iterator[Finding]:
    """What is wrong with the first receiver while it matters."""
    table = flight.one("GPS", "Status", "NSats")
    if table is None:
        yield from _reported(flight)
        return
    own = table.where(flight.watch(table.t) & ~inside(flight.repeats("GPS"), table.t))
    jumped = list(_jumps(flight, own))
    yield from jumped
    yield from _leaps(flight)
    if not jumped:
        yield from _reported(flight)
    lost = list(_lost(flight, own))
    yield from lost
    if not lost:
        yield from _few(flight, own)
        yield from _inaccurate(flight)


def _jumps(flight: Flight, table: Table) -> Iterator[Finding]:
    """Steps of the position that the velocity does not explain."""
    if not {"Lat", "Lng", "Spd", "GCrs"} <= table.columns.keys():
        return
    fixed = table.where((table["Status"] >= _FIX) & (np.abs(table["Lat"]) > 1e-6))
    late_at = fixed.t[_is_late(fixed)]
    fixed = fixed.where(~_is_late(fixed))
    if len(fixed) < 3:
        return
    new = np.append(True, (np.diff(fixed["Lat"]) != 0) | (np.diff(fixed["Lng"]) != 0) | (np.diff(fixed.t) > 1.0))
    fixed = fixed.where(new)
    if len(fixed) < 3:
        return
    if _of_two(fixed):
        return
    t = fixed.t
    off, dt = _unexplained(fixed)
    limit = JUMP_M + 0.25 * ACCELERATION * np.minimum(dt, 1.5) ** 2 * (fixed["Spd"][1:] > _SPEED_MS)
    limit = np.maximum(limit, _TIMES_USUAL * quantile(off, 0.9))  # a velocity that never fits tells nothing
    late = t[1:] < t[0] + _STEP_S if flight.is_telemetry else np.zeros(len(off), dtype=bool)  # what waited for the link
    late |= during([(low, high + _AFTER_S) for low, high in holes(flight)], t[1:])  # who knows what went on in them
    late |= np.diff(np.searchsorted(late_at, t)) > 0  # whose record the next one is, nobody knows
    beyond = np.flatnonzero((off > limit) & (dt < _STEP_S) & (dt > 0.01) & ~late)
    if not len(beyond):
        return
    start, size, largest = float(t[1:][beyond[0]]), float(off[beyond[0]]), int(beyond[np.argmax(off[beyond])])
    over = float((off / limit)[beyond].max())
    estimate = "; the estimator's position innovation is over its limit" if _upset(flight, start) else ""
    glitch_s = _glitched_before(flight, start)
    at = f", the largest of {off[largest]:.1f} m at {log_time(float(t[1:][largest]))}," if largest != beyond[0] else ""
    yield Finding(
        kind="gps",
        title=f"the GPS position jumps by {size:.0f} m",
        onset_s=start if glitch_s is None else glitch_s,
        end_s=float(t[1:][beyond[-1]]),
        severity=_severity(flight, start, off[largest] > _LARGE * JUMP_M or bool(estimate)),
        evidence=(
            f"{len(beyond)} jump{'s' * (len(beyond) > 1)}{at or f' of {size:.1f} m'} that its own velocity does not "
            f"explain (limit {JUMP_M:g} m and 10 m/s^2){estimate}"
            + ("" if glitch_s is None else f"; the firmware reports a glitch from {log_time(glitch_s)} on")
        ),
        source="GPS.Lat, Lng against Spd and GCrs; GPSGLITCH_RADIUS 5 m, GPSGLITCH_ACCEL 10 m/s^2 of ArduPilot",
        probability=calibrated_probability(over, _JUMP),
    )


def glitches(flight: Flight) -> list[Span]:
    """When the firmware reports a glitch, until it says that it is over; those that follow each other are one."""
    spans: list[Span] = []
    for t, code in flight.errors(GPS):
        if code == GPS_GLITCH and spans and t - spans[-1][1] < _AGAIN_S:
            spans[-1] = (spans[-1][0], math.inf)
        elif code == GPS_GLITCH:
            spans.append((t, math.inf))
        elif spans and not math.isfinite(spans[-1][1]):
            spans[-1] = (spans[-1][0], t)
    return spans


def _glitched_before(flight: Flight, start: float) -> float | None:
    """When the glitch began in which a jump lies; None where the firmware reports none."""
    begun = (a for a, b in glitches(flight) if a <= start <= b + _AGAIN_S and within(flight.watched, a))
    return next(begun, None)


def height_leaps(flight: Flight) -> tuple[Floats, Floats]:
    """When the receiver's height leaps while the barometer's does not, and by how much, m."""
    received, heard = flight.one("GPS", "Alt", "Status"), flight.barometer
    if received is None or heard is None:
        return np.empty(0), np.empty(0)
    fixed = received.where((received["Status"] >= _FIX) & flight.watch(received.t))
    if len(fixed) < 3:
        return np.empty(0), np.empty(0)
    t, height = fixed.t, fixed["Alt"]
    earlier = np.searchsorted(t, t - _LEAPS_S)
    rose, climbed = height - height[earlier], np.interp(t, *heard) - np.interp(t[earlier], *heard)
    leaps = (np.abs(rose - climbed) > _LEAP_M) & (np.abs(rose) > 2 * np.abs(climbed)) & (t - t[earlier] > _LEAPS_S / 2)
    return t[leaps], np.abs(rose - climbed)[leaps]


def _leaps(flight: Flight) -> Iterator[Finding]:
    """A height of the receiver that leaps as no vehicle does: whatever differs from it does not drift."""
    t, by_m = height_leaps(flight)
    if len(t):
        yield Finding(
            kind="gps",
            title="the GPS height leaps",
            onset_s=float(t[0]),
            end_s=float(t[-1]),
            severity="warning",
            evidence=f"by up to {np.max(by_m):.0f} m in {_LEAPS_S:g} s against the barometer (limit {_LEAP_M:g} m)",
            source="GPS.Alt against BARO.Alt or CTUN.BAlt",
            probability=_LEAPT_P,
        )


def _is_late(table: Table) -> Bools:
    """Records that the receiver's own clock puts before earlier ones: two programs that write one file, or a second
    vehicle under the same name, mix them in. A new week begins once."""
    if "GMS" not in table.columns or not len(table):
        return np.zeros(len(table), dtype=bool)
    behind = np.maximum.accumulate(table["GMS"]) - table["GMS"]
    return np.asarray((behind > 0) & (behind < _DAY_MS))


def _of_two(table: Table) -> bool:
    """Whether records of two vehicles take turns: one lies elsewhere, and the next to the last digit where the one
    before did, again and again. A receiver that was led astray comes back to within its noise, and not at once."""
    lat, lng = table["Lat"], table["Lng"]
    is_back = (lat[2:] == lat[:-2]) & (lng[2:] == lng[:-2])
    metres = np.hypot(lat[1:-1] - lat[:-2], (lng[1:-1] - lng[:-2]) * np.cos(np.radians(lat[0]))) * METRES_PER_DEGREE
    return int(np.count_nonzero(is_back & (metres > JUMP_M))) >= _TURNS


def _unexplained(table: Table) -> tuple[Floats, Floats]:
    """Metres by which each step leaves what the mean velocity predicts, and the seconds that it took."""
    dt = np.diff(table.t)
    if "GMS" in table.columns:  # the receiver's own clock: records are written late now and then
        own = np.diff(table["GMS"]) / 1e3
        if float(dt.sum()) / _CLOCK < float(own.sum()) < float(dt.sum()) * _CLOCK:
            dt = np.where(own > 0, own, dt)
    course = np.radians(table["GCrs"])
    north, east = table["Spd"] * np.cos(course), table["Spd"] * np.sin(course)
    went_north, went_east = map(np.diff, offset_m((table["Lat"][0], table["Lng"][0]), table["Lat"], table["Lng"]))
    d_north = went_north - dt * (north[1:] + north[:-1]) / 2
    d_east = went_east - dt * (east[1:] + east[:-1]) / 2
    return np.hypot(d_north, d_east), dt


def _upset(flight: Flight, start: float) -> bool:
    return any(bool(np.any((one["SP"] > _RATIO) & (one.t >= start - 1))) for one in flight.all("XKF4", "SP"))


def _severity(flight: Flight, start: float, is_large: bool) -> Severity:
    return "critical" if is_large and flight.airborne and start >= flight.airborne[0][0] - 5 else "warning"


def _reported(flight: Flight) -> Iterator[Finding]:
    """Glitches and losses as the firmware counted them."""
    inside = [(t, code) for t, code in flight.errors(GPS) if code == GPS_GLITCH and within(flight.flown, t)]
    if inside:
        cleared = [t for t, code in flight.errors(GPS) if code == 0 and t > inside[0][0]]
        yield Finding(
            kind="gps",
            title="GPS glitch",
            onset_s=inside[0][0],
            end_s=cleared[-1] if cleared else inside[-1][0],
            severity="warning",
            evidence=f"{len(inside)} GPS glitch{'es' * (len(inside) > 1)} reported in flight",
            source="ERR 11-2 (GPS glitch)",
            probability=_GLITCHED_P,
        )


def _lost(flight: Flight, table: Table) -> Iterator[Finding]:
    """A fix that went away in the air, or of what drove: a vehicle that stands under a roof has nowhere to go."""
    if not flies(flight.kind) and not _drove(flight):
        return
    had = np.cumsum(table["Status"] >= _FIX) > 0
    out = lasting(table.t, had & (table["Status"] < _FIX) & during(flight.flown, table.t), _NO_FIX_S, records=2)
    if out:
        start = out[0][0]
        total = seconds_in(out)
        severity: Severity = "critical" if total > _LONG_S and not flight.all("GPS")[1:] else "warning"
        yield Finding(
            kind="gps",
            title=f"the GPS fix was lost {'in the air' if flies(flight.kind) else 'on the way'}",
            onset_s=start,
            end_s=out[-1][1],
            severity=severity,
            evidence=f"no 3D fix for {total:.0f} s",
            source="GPS.Status below 3",
            probability=_NO_FIX_P,
        )


def _started(flight: Flight, table: Table) -> Table:
    """Without what a receiver says as it starts: until it first has a fix with satellites enough, or flies with one, no
    mode relies on it."""
    fixed = table["Status"] >= _FIX
    enough = fixed & ((table["NSats"] >= FEWEST) | during(flight.flown, table.t))
    first = enough if enough.any() else fixed
    return table.where(slice(int(np.argmax(first)), None)) if first.any() else table


def _drove(flight: Flight) -> bool:
    """Whether its throttle ever left its middle while it was armed, or its receiver tells of driving by other means;
    where no throttle is recorded, it may have."""
    if flight.throttle is None:
        return True
    t, throttle = flight.throttle
    if np.any(np.abs(throttle[during(flight.armed, t)]) > _DRIVES):
        return True
    moved = flight.one("GPS", "Spd", "Status", "NSats")
    if moved is None:
        return False
    sure = (moved["Status"] >= _FIX) & (moved["NSats"] >= FEWEST) & during(flight.armed, moved.t)
    return bool(lasting(moved.t, sure & (moved["Spd"] > _DRIVES_MS), _DRIVES_S))


def _few(flight: Flight, table: Table) -> Iterator[Finding]:
    """Few satellites, or far fewer than before; a poor HDop."""
    table = _started(flight, table)
    t, sats = table.t, table["NSats"]
    if len(t) < 3 or not (table["Status"] >= _FIX).any():
        return
    usual = quantile(flight.one("GPS", "NSats")["NSats"], 0.9)  # type: ignore[index]
    few = lasting(t, sats < FEWEST, _FEW_S) or lasting(t, (sats <= FEWEST) & (sats <= usual - FALL), _FEW_S)
    if few and usual > 0:  # one that has a fix and never saw a satellite does not count them
        start, end = few[0][0], few[-1][1]
        least = float(np.min(sats[(t >= start) & (t <= end)]))
        harmed = _harmed(flight, start)
        yield Finding(
            kind="gps",
            title=f"only {least:.0f} satellites",
            onset_s=start,
            end_s=end,
            severity="critical" if harmed else "warning",
            evidence=f"{least:.0f} satellites (the estimator wants {FEWEST:.0f}, {usual:.0f} were there)",
            source="GPS.NSats; 6: AP_NavEKF3_VehicleStatus.cpp",
            probability=calibrated_probability(FEWEST / max(least, 1.0), _FEW),
            mission_lost=None if harmed else _LOST_P,
        )
        return
    if "HDop" not in table.columns:
        return
    poor = lasting(t, (table["HDop"] > BAD_HDOP) & (table["HDop"] < _NO_HDOP) & during(flight.flown, t), _POOR_S)
    if poor:
        worst = float(np.max(table["HDop"][(t >= poor[0][0]) & (t <= poor[-1][1])]))
        yield Finding(
            kind="gps",
            title=f"poor satellite geometry (HDop {worst:.1f})",
            onset_s=poor[0][0],
            end_s=poor[-1][1],
            severity="warning",
            evidence=f"HDop up to {worst:.1f} (good below 1.5, poor above {POOR_HDOP:g})",
            source="GPS.HDop; ArduPilot, Diagnosing problems using logs",
            suspect="world",
            probability=_DOUBTS_P,
        )


def _harmed(flight: Flight, start: float) -> bool:
    """Whether the estimator gave up, or arming was refused, for want of a position."""
    refused = flight.refused_for("gps", "3d fix", "position", "ahrs", "ekf", "need alt")
    words = ("position lost", "ekf failsafe", "ekf variance", "gps glitch")
    told = any(t >= start - 1 and any(word in text.casefold() for word in words) for t, text in flight.messages)
    return refused is not None or (told and _upset(flight, start))


def _inaccurate(flight: Flight) -> Iterator[Finding]:
    """What the receiver itself says of its error."""
    table = flight.one("GPA", "HAcc", "SAcc")
    if table is None:
        return
    bad = lasting(
        table.t, ((table["HAcc"] > _HACC_M) | (table["SAcc"] > _SACC_MS)) & during(flight.flown, table.t), _POOR_S
    )
    if bad:
        part = table.between(bad[0][0], bad[-1][1])
        yield Finding(
            kind="gps",
            title="the GPS doubts its position",
            onset_s=bad[0][0],
            end_s=bad[-1][1],
            severity="warning",
            evidence=f"it expects errors of up to {np.max(part['HAcc']):.1f} m and {np.max(part['SAcc']):.1f} m/s",
            source="GPA.HAcc, SAcc; the firmware's checks want 5 m and 1 m/s",
            suspect="world",
            probability=_DOUBTS_P,
        )


CHECK = Check("gps", "jumps, glitches, lost fixes, few satellites, a poor geometry", READS, LIMITS, find)
