"""A plane's motor that draws less for its throttle than before, that leaves it on the ground, or at full throttle far
below its airspeed: the motor, its controller or the propeller failed.

The current of a propeller goes with the square of its throttle, near enough: over 300 simulated flights with a sound
motor it stays within 0.93 and 1.08 times what it was, at any throttle above 30%.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.statistics import lasting, steady
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.spans import during, seconds_in
from care_core.logs.base import Wanted
from care_core.numbers import Floats, median, quantile

READS: Wanted = {
    "BAT": ("Curr",),
    "CTUN": ("ThO", "As"),
    "GPS": ("Spd",),
}

LIMITS = Limits()
_PULLS = LIMITS.add("throttle at which the current tells", 0.3, "", "a choice: less hardly draws any")
_DROP = LIMITS.add("current for its throttle, as a share of before", 0.65, "", "simulated sound motors: 0.93 to 1.08")
_LASTS_S = LIMITS.add("shortest time of a lesser current", 5.0, "s", "a choice: a dive is over sooner")
_ENOUGH_A = LIMITS.add("current that tells", 1.0, "A", "a choice: sensors have an offset")
_FAILED_P = LIMITS.add("probability of the motor", 0.9, "", "none of 300 sound flights")
_UNDER_WAY = LIMITS.add("speed, as a share of the usual, at which it tells", 0.6, "", "a choice: at rest it takes more")
_BEFORE, _DRAWS = 10, 0.9
"""Records of a flight before it tells, and the quantile of its current that has to tell."""
_FULL = LIMITS.add("throttle of a take-off run", 0.95, "", "a choice: a plane that can fly takes off with it")
_RUNS_S = LIMITS.add("time of full throttle on the ground", 10.0, "s", "simulated planes lift off within 3 to 6 s")
_SLOW = LIMITS.add("speed of such a run, as a share of AIRSPEED_MIN", 0.8, "", "a choice: near it, a plane lifts off")
_GAINS_MS = LIMITS.add("speed that it still gains in so long", 1.0, "m/s", "a choice: more, and the run goes on")
_SHARE = LIMITS.add(
    "airspeed at full throttle, as a share of AIRSPEED_CRUISE", 0.75, "", "simulated planes whose engine is sound: more"
)
_SLOW_S = LIMITS.add("time at full throttle below it", 10.0, "s", "none of 200 simulated flights with a sound engine")
_LEVEL_MS = LIMITS.add("climb beside which it tells", 1.0, "m/s", "a choice: a climb takes speed")
_LACKS_P = LIMITS.add("probability of the motor then", 0.7, "", "a choice: drag, or ice, looks the same")
_FLIES_MS = 6.0
"""Slower than any plane flies: what hovers has no airspeed to tell."""
_LEAST_MS = 9.0
"""AIRSPEED_MIN as shipped (ArduPlane, Parameters.cpp)."""


def find(flight: Flight) -> Iterator[Finding]:
    """A drop of the current that one throttle takes; full throttle that leads to no flight, or to a slow one."""
    if flight.kind == "plane":
        yield from _draws_less(flight)
        yield from _does_not_pull(flight)
    if flight.is_winged:
        yield from _slow_at_full(flight)


def _slow_at_full(flight: Flight) -> Iterator[Finding]:
    driven, height = flight.one("CTUN", "ThO", "As"), flight.height
    cruise = flight.setting("AIRSPEED_CRUISE") or (flight.setting("TRIM_ARSPD_CM") or 0.0) / 100
    if driven is None or height is None or not cruise:
        return
    t, airspeed = driven.t, driven["As"]
    climbs = (np.interp(t + 2.0, *height) - np.interp(t - 2.0, *height)) / 4.0
    is_slow = (airspeed > _FLIES_MS) & (airspeed < _SHARE * cruise) & (climbs < _LEVEL_MS)
    spans = lasting(t, (driven["ThO"] > _FULL) & is_slow & during(flight.airborne, t), 2.0, gap_s=2.0)
    lasted = seconds_in(spans)
    if lasted > _SLOW_S:
        flown = float(np.mean(airspeed[during(spans, t)]))
        yield Finding(
            kind="motor",
            title="full throttle does not bring it to its airspeed",
            onset_s=spans[0][0],
            end_s=spans[-1][1],
            severity="critical",
            evidence=(
                f"{flown:.1f} m/s at full throttle without a climb, for {lasted:.0f} s, where AIRSPEED_CRUISE is "
                f"{cruise:g}: the motor, its controller or the propeller gives too little, or something drags"
            ),
            source="CTUN.ThO, CTUN.As, height",
            probability=_LACKS_P,
        )


def _does_not_pull(flight: Flight) -> Iterator[Finding]:
    driven, moved = flight.one("CTUN", "ThO"), flight.one("GPS", "Spd")
    if flight.airborne or driven is None or moved is None:
        return
    least = flight.setting("AIRSPEED_MIN", "ARSPD_FBW_MIN") or _LEAST_MS
    for start, end in lasting(driven.t, (driven["ThO"] > _FULL) & during(flight.armed, driven.t), _RUNS_S):
        speed = moved["Spd"][(moved.t >= start) & (moved.t <= end)]
        last = moved["Spd"][(moved.t >= end - _RUNS_S) & (moved.t <= end)]
        if not len(last) or float(np.max(speed)) > _SLOW * least or float(last[-1] - last[0]) > _GAINS_MS:
            continue
        yield Finding(
            kind="motor",
            title="it stays on the ground at full throttle",
            onset_s=start,
            end_s=end,
            severity="critical",
            evidence=(
                f"{end - start:.0f} s of full throttle lead to {float(np.max(speed)):.1f} m/s, where AIRSPEED_MIN is "
                f"{least:g}: the motor, its controller or the propeller does not pull, or something holds it"
            ),
            source="CTUN.ThO, GPS.Spd",
            probability=_FAILED_P,
            mission_lost=1.0,
        )
        return


def _draws_less(flight: Flight) -> Iterator[Finding]:
    battery, driven, moved = flight.one("BAT", "Curr"), flight.one("CTUN", "ThO"), flight.one("GPS", "Spd")
    if battery is None or driven is None or moved is None:
        return
    throttle = np.interp(battery.t, driven.t, driven["ThO"])
    pulls = (throttle > _PULLS) & during(flight.flown, battery.t)
    t, current, throttle = battery.t[pulls], battery["Curr"][pulls], throttle[pulls]
    speed = np.interp(t, moved.t, moved["Spd"])
    under_way = speed > _UNDER_WAY * float(median(speed)) if len(t) else pulls[:0]
    if under_way.sum() < 2 * _BEFORE or quantile(current[under_way], _DRAWS) < _ENOUGH_A:
        return
    ratio = current / throttle**2
    sound = steady(t[under_way], steady(t[under_way], ratio[under_way], 4.0), 8.0)
    taken, usual = steady(t, ratio, 4.0), _so_far(t, t[under_way], np.maximum.accumulate(sound))
    spans = lasting(t, taken < _DROP * usual, _LASTS_S, gap_s=3.0)
    if not spans:
        return
    held = during(spans, t)
    now, before = float(np.mean(current[held])), float(np.mean(usual[held] * throttle[held] ** 2))
    yield Finding(
        kind="motor",
        title="the motor lost thrust",
        onset_s=spans[0][0],
        end_s=spans[-1][1],
        severity="critical",
        evidence=(
            f"{now:.1f} A at {100 * float(np.mean(throttle[held])):.0f}% throttle, which drew {before:.1f} A "
            "before "
            f"(limit {_DROP:g} of it)"
        ),
        source="BAT.Curr, CTUN.ThO",
        probability=_FAILED_P,
        mission_lost=0.7,
    )


def _so_far(t: Floats, told_t: Floats, told: Floats) -> Floats:
    """What was told last at each of these times, 0 before the first."""
    last = np.searchsorted(told_t, t, side="right") - 1
    return np.where(last < 0, 0.0, told[np.maximum(last, 0)])


CHECK = Check(
    "propeller",
    "a plane's motor that draws less than before, or that does not bring it off the ground",
    READS,
    LIMITS,
    find,
)
