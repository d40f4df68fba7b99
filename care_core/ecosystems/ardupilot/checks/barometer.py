"""Barometers: noisy, drifting from GPS or range finder, at odds with each other.

The firmware refuses arming where the height of the barometer and of the estimator are 1 m apart (Copter AP_Arming:
"Altitude disparity", PREARM_MAX_ALT_DISPARITY_CM). Good barometers resolve 0.1 to 0.2 m; GPS heights wander by some
metres in minutes, 10 m is far. On the training table healthy barometers differ by at most 0.24 m.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from care_core.ecosystems.ardupilot.checks.gps import glitches, height_leaps
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.statistics import (
    aligned,
    calibrated,
    calibrated_probability,
    lasting,
    parts,
    roughness,
    smooth,
)
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding, Severity
from care_core.ecosystems.spans import during, inside
from care_core.ecosystems.vehicles import flies
from care_core.geodesy import offset_m
from care_core.logs.base import Table, Wanted
from care_core.numbers import Bools, Floats, median, quantile

READS: Wanted = {
    "POS": ("Lat", "Lng"),
    "BARO": ("Alt", "Press", "Health"),
    "GPS": ("Status", "Alt", "NSats"),
    "RFND": ("Dist", "Stat"),
    "CTUN": ("Alt", "BAlt", "SAlt"),
}

LIMITS = Limits()
APART_M = LIMITS.add("two barometers apart", 3.0, "m", "three times what arming allows between barometer and estimator")
DRIFT_M = LIMITS.add("drift from the GPS height", 10.0, "m", "a choice: GPS heights wander by some metres in minutes")
_OF_HEIGHT = LIMITS.add(
    "share of a height that it may be off", 0.08, "", "air that is 20 K off the standard atmosphere"
)
NOISE_M = LIMITS.add("noise from record to record", 0.5, "m", "three times what a good barometer resolves")
_SMOOTH_S = LIMITS.add("time over which noise is averaged", 10.0, "s", "a choice: a gust is over sooner")
_DIVES_MS = LIMITS.add("dive or climb of a copter that counts", 5.0, "m/s", "twice PILOT_SPEED_UP as shipped")
_STEADY_S = LIMITS.add("time over which its speed is averaged", 2.0, "s", "a choice: a dive lasts longer")
_APART_S = LIMITS.add("time between records of what climbs fast", 0.15, "s", "a choice: half of what thinned logs hold")
_LASTS_S = LIMITS.add("shortest time over a limit", 5.0, "s", "a choice: landing gusts press on it for a second")
_SEVERE = LIMITS.add("times the limit that cost the height", 2.0, "", "a choice: the vehicle holds its height by it")
_LOW_M = LIMITS.add("range at which it is compared", 3.0, "m", "a choice: higher, terrain explains a difference")
_BEGAN_M = LIMITS.add("distance from the start at which it is compared", 10.0, "m", "a choice: the same terrain")
_NO_RANGE_M = LIMITS.add("least range", 0.02, "m", "a choice: range finders say 0 where they see nothing")
_WATER_PA_M = LIMITS.add("pressure of a metre, in water", 1000.0, "Pa/m", "water has 9800, air 12")
_GOOD_SATS = LIMITS.add("satellites of a height to compare with", 8, "", "a choice: two more than the estimator wants")
_BEFORE_LEAP_S = LIMITS.add("time before a leap of the GPS height", 5.0, "s", "a choice: it drifts off before")
_CALIBRATION = calibrated(
    LIMITS, ((1.0, 0.8), (2.0, 0.97)), "only training flights with a failing barometer exceed a limit (17 of 17)"
)
_ON_WINGS = calibrated(
    LIMITS,
    ((1.0, 0.3), (2.0, 0.97)),
    "8 of 9 simulated flights of planes above twice a limit have a failing barometer, none of 3 below",
    "a limit, of a plane",
)
_LOST_P = LIMITS.add(
    "probability that it costs the mission", 0.55, "",
    "12 of those 17 failed, of flights without a failed part 48% (a critical finding counts as four flights)",
)  # fmt: skip
_ODDS_P = LIMITS.add("probability where a range finder contradicts it", 0.3, "", "a choice: either may be wrong")
_RANGE_GOOD = 4
"""RangeFinder::Status::Good (AP_RangeFinder.h)."""
_FIX = 3
_COMPARED, _NEAR_S, _AVERAGED_S = 10, 3.0, 5.0
"""Fewer heights tell no drift; between fixes further apart the height is not known; and a receiver's noise is over
sooner."""
_AT_FIRST = 20
"""The two begin together in the first of so many parts, which is short beside a drift."""


class _Test(NamedTuple):
    """How far off it is, how far it may be, both in m and of shape (n,), and how that is told."""

    size: Floats
    allowed: Floats
    limit: float
    words: str


def find(flight: Flight) -> Iterator[Finding]:
    """A barometer that is not to be believed, and one that a range finder contradicts near the ground."""
    yield from _contradicted(flight)
    baros = [table.where(flight.watch(table.t)) for table in flight.all("BARO", "Alt")]
    baros = [table for table in baros if len(table) >= 5 and np.ptp(table["Alt"]) > 0]
    if flight.kind == "sub":
        baros = [table for table in baros if _feels_water(table)]
    if not baros:
        return
    first = baros[0]
    t, height = first.t, first["Alt"]
    noise = _noise(flight, t, height)
    tests = [_Test(noise, NOISE_M + _moved_between(flight, t), NOISE_M, "jumps by {:.1f} m from record to record")]
    for other in baros[1:]:
        apart = height - aligned(t, other.t, other["Alt"])
        apart -= median(apart[: max(len(t) // _AT_FIRST, 3)])
        off = np.abs(smooth(t, apart, 3.0))
        tests.append(_Test(off, np.full(len(t), APART_M), APART_M, "is {:.1f} m off the second barometer"))
    drift = None if flight.kind == "sub" else _drift(flight, first)  # no receiver hears a satellite under water
    if drift is not None:
        allowed = DRIFT_M + _OF_HEIGHT * np.abs(height - height[0])
        tests.append(_Test(np.abs(drift), allowed, DRIFT_M, "drifts {:.0f} m from the GPS height"))
    broken = [(spans, one) for one in tests if (spans := lasting(t, one.size > one.allowed, _LASTS_S, gap_s=5.0))]
    if not broken:
        return
    start = min(spans[0][0] for spans, _ in broken)
    end = max(spans[-1][1] for spans, _ in broken)
    during_it = [((t >= spans[0][0]) & (t <= spans[-1][1]), one) for spans, one in broken]
    peaks = [quantile((one.size / one.allowed)[rows], 0.9) for rows, one in during_it]
    said = "; ".join(
        f"{one.words.format(quantile(one.size[rows], 0.9))} (limit {one.limit:g} m)" for rows, one in during_it
    )
    yield Finding(
        kind="barometer",
        title="the barometer is noisy or drifts",
        onset_s=start,
        end_s=end,
        severity=_severity(flight, start, max(peaks)),
        evidence=f"it {said}",
        source="BARO.Alt against its neighbours, BARO of the second, GPS.Alt; Copter's pre-arm check allows 1 m",
        probability=calibrated_probability(max(peaks), _ON_WINGS if flight.is_winged else _CALIBRATION),
        mission_lost=_LOST_P,
    )


def _feels_water(table: Table) -> bool:
    """Whether a submarine's pressure sensor is in the water: the one on its board feels the air of the hull, which
    warms up, and tells no depth."""
    return "Press" in table.columns and float(np.ptp(table["Press"])) > _WATER_PA_M * float(np.ptp(table["Alt"]))


def _contradicted(flight: Flight) -> Iterator[Finding]:
    """A barometer that moved away from the range finder, low and where the vehicle began: terrain explains it not."""
    baro = _first(flight, ("BARO", "Alt"), ("CTUN", "BAlt"))
    ranger = _first(flight, ("RFND", "Dist"), ("CTUN", "SAlt"))
    if baro is None or ranger is None or not flies(flight.kind):
        return
    (heard, height), (table, distance) = baro, ranger
    near = (table[distance] > _NO_RANGE_M) & (table[distance] < _LOW_M)
    if "Stat" in table.columns:
        near &= table["Stat"] == _RANGE_GOOD
    if near.sum() < 20:
        return
    near &= _where_it_began(flight, table.t)
    low = table.where(near)
    if len(low) < 20 or np.ptp(low[distance]) == 0:
        return
    at = low.t
    apart = np.interp(at, heard.t, heard[height]) - low[distance]
    apart = smooth(at, apart - median(apart[: max(len(apart) // _AT_FIRST, 3)]), 3.0)
    spans = lasting(at, np.abs(apart) > APART_M, _LASTS_S, gap_s=5.0)
    if spans:
        most = quantile(np.abs(apart)[np.abs(apart) > APART_M], 0.9)
        yield Finding(
            kind="barometer",
            title="barometer and range finder are at odds",
            onset_s=spans[0][0],
            end_s=spans[-1][1],
            severity="info",
            evidence=f"they drifted {most:.1f} m apart within {_LOW_M:g} m of the ground (limit {APART_M:g} m)",
            source="BARO or CTUN.BAlt against RFND or CTUN.SAlt; Copter's pre-arm check allows 1 m to the estimator",
            probability=_ODDS_P,
        )


def _first(flight: Flight, *places: tuple[str, str]) -> tuple[Table, str] | None:
    """The first of these messages and fields that the log holds."""
    told = ((flight.one(name, field), field) for name, field in places)
    return next(((table, field) for table, field in told if table is not None), None)


def _where_it_began(flight: Flight, t: Floats) -> Bools:
    """Which of these times are within some metres of the first position; all where the log holds none."""
    track = flight.one("POS", "Lat", "Lng")
    if track is None:
        return np.ones(len(t), dtype=bool)
    first = track.where(slice(0, 1))
    lat, lng = float(first["Lat"][0]), float(first["Lng"][0])

    def away(part: Table) -> Floats:
        return np.asarray(np.hypot(*offset_m((lat, lng), part["Lat"], part["Lng"])))

    return np.asarray(np.interp(t, track.t, np.concatenate([*map(away, parts(track))])) < _BEGAN_M)


def _noise(flight: Flight, t: Floats, height: Floats) -> Floats:
    """Roughness of the height beside what the vehicle's own estimate explains, shape of `height`."""
    known = flight.height
    moved = np.interp(t, *known) if known is not None else np.zeros(len(t))
    return np.minimum(smooth(t, roughness(height - moved), _SMOOTH_S), smooth(t, roughness(height), _SMOOTH_S))


def _moved_between(flight: Flight, t: Floats) -> Floats:
    """How far it climbs or sinks between the records of its barometer and of its estimate, shape of `t`; a copter only
    where it dives or shoots up, since its estimate follows some of a noisy barometer."""
    known = flight.height
    if known is None or len(t) < 3:
        return np.zeros(len(t))
    height = np.interp(t, *known)
    if flight.is_winged:
        return _APART_S * np.abs(np.gradient(height, t))
    speed = np.abs(np.gradient(smooth(t, height, _STEADY_S), t))
    return _APART_S * smooth(t, np.where(speed > _DIVES_MS, speed, 0.0), _SMOOTH_S)


def _drift(flight: Flight, first: Table) -> Floats | None:
    """Metres between barometer and GPS, from where they began; None where the GPS is too poor to say."""
    gps = flight.one("GPS", "Status", "Alt", "NSats")
    if gps is None:
        return None
    live = flight.watch(gps.t) & ~inside(flight.repeats("GPS"), gps.t) & ~_is_led_astray(flight, gps.t)
    good = gps.where((gps["Status"] >= _FIX) & (gps["NSats"] >= _GOOD_SATS) & live)
    if len(good) < _COMPARED:
        return None
    apart = first["Alt"] - aligned(first.t, good.t, good["Alt"])
    nearest = np.interp(first.t, good.t, good.t, left=-np.inf, right=np.inf)
    apart = np.where(np.abs(nearest - first.t) < _NEAR_S, apart, np.nan)
    zero = apart[np.isfinite(apart)][: max(len(apart) // _AT_FIRST, 3)]
    return smooth(first.t, np.nan_to_num(apart - median(zero)), _AVERAGED_S) if len(zero) else None


def _is_led_astray(flight: Flight, t: Floats) -> Bools:
    """Where the receiver's height tells nothing: in a glitch, and once it leapt."""
    leaps, _ = height_leaps(flight)
    return during(glitches(flight), t) | (t >= float(np.min(leaps, initial=np.inf)) - _BEFORE_LEAP_S)


def _severity(flight: Flight, start: float, over: float) -> Severity:
    """Critical far out of limits in the air: the vehicle holds its height by it."""
    return "critical" if over > _SEVERE and any(end > start for _, end in flight.flown) else "warning"


CHECK = Check("barometer", "a noisy or drifting barometer, two at odds", READS, LIMITS, find)
