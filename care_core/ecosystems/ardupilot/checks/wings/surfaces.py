"""Ailerons and elevator: they turn the plane the wrong way, or are out to their stop and do not turn it as they should.

What tells is the plane itself while the autopilot flies it, fast and high enough for its surfaces to act: with its
surface out one way, it turns the other way, by much and not for a moment. A gust does that for less than a second, a
swing comes back.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from care_core.ecosystems.ardupilot.checks.wings import straight
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.statistics import lasting
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.spans import Span, during, runs
from care_core.logs.base import Wanted, merge_needs
from care_core.numbers import Floats, median

READS: Wanted = merge_needs(
    (
        straight.READS,
        {"AETR": ("Ail", "Elev"), "PIDR": ("Tar", "Act"), "PIDP": ("Tar", "Act"), "ATT": ("Roll", "Pitch")},
    )
)

LIMITS = Limits(straight.LIMITS)
_FLIES_MS = LIMITS.add("speed at which surfaces act", 7.0, "m/s", "a choice: slower, the air hardly moves them")
_HIGH_M = LIMITS.add("height at which surfaces are looked at", 10.0, "m", "a choice: a roll-out turns no plane")
_OUT = LIMITS.add("surface that is out", 0.25, "of its travel", "a choice: trims and gusts take less")
_AGAINST_DPS = LIMITS.add("rate against its surface", 15.0, "deg/s", "a choice: gusts bring less")
_TURNED_DEG = LIMITS.add("turn against its surface", 25.0, "deg", "a choice: a swing comes back sooner")
_AGAINST_S = LIMITS.add("shortest time against its surface", 0.5, "s", "a choice: a gust is over sooner")
_TUMBLES_S = LIMITS.add(
    "time after control was lost", 3.0, "s", "a choice: a surface that took it turns it against itself at once"
)
_STOP = LIMITS.add("surface at its stop", 0.85, "of its travel", "a choice: what is left hardly turns the plane")
_STOP_S = LIMITS.add("shortest time at the stop", 5.0, "s", "a choice: a turn is over sooner")
_LACKS_DPS = LIMITS.add("rate that is lacking at the stop", 4.0, "deg/s", "a choice: three times the noise of a rate")
_ONE_SIDE = LIMITS.add("mean of a surface over its size", 0.6, "", "a choice: what swings goes both ways")
_UP = LIMITS.add("elevator that is up on the take-off run", 0.5, "of its travel", "a choice: a rotation takes less")
_OVER_LEAST = LIMITS.add("speed of that run", 1.2, "of AIRSPEED_MIN", "a choice: with less it may not fly yet")
_DOWN_S = LIMITS.add("time in which the nose stays down", 3.0, "s", "a choice: a rotation is over in one")
_LIFTED_M = LIMITS.add("height of what left the ground", 3.0, "m", "a choice: heights drift by less")
_WRONG_WAY_P = LIMITS.add(
    "probability of a surface that turns it the wrong way", 0.9, "", "all 6 of 313 simulated flights that are turned so"
)
_STUCK_P = LIMITS.add(
    "probability of one at its stop", 0.3, "", "4 of 14 simulated flights: gains, limits and a stall hold it there, too"
)
_FLOWN_S = LIMITS.add(
    "flight that no reversed surface allows", 10.0, "s", "a choice: a controller drives it over in one"
)
_MANUAL = 0
"""The mode in which no controller moves a surface."""
_FULL = 4500.0
"""AETR of a surface out to its stop (SRV_Channel.h)."""
_FEWEST = 20
_OVER_DEG = 75.0
"""Beyond what any mode that holds an attitude asks for."""
_FRESH_S = 1.0
"""Controllers are recorded while they act: what lies between records farther apart was flown by hand."""


class _Surface(NamedTuple):
    """What one surface is called, and where it stands in a log."""

    name: str
    verb: str
    controller: str
    output: str
    attitude: str


_SURFACES = (
    _Surface("the elevator", "is", "PIDP", "Elev", "Pitch"),
    _Surface("the ailerons", "are", "PIDR", "Ail", "Roll"),
)


class _Flown(NamedTuple):
    """One surface while the autopilot flies fast enough; arrays of shape (n,)."""

    t: Floats
    out: Floats
    """Share of its travel, up and right positive."""
    middle: float
    """What it is out by in straight flight: a trim that is off shows there."""
    wanted: Floats
    rate: Floats
    angle: Floats
    mode: Floats
    """Number of the mode."""


def find(flight: Flight) -> Iterator[Finding]:
    """One finding a surface: one that turns the plane the wrong way goes to its stop as well."""
    if not flight.is_winged:
        return
    level = straight.straight(flight)
    for surface in _SURFACES:
        flown = _flown(flight, surface, level)
        if flown is not None:
            found = (
                _wrong_way(surface, flown)
                or _keeps_it_down(flight, surface, flown)
                or _at_its_stop(flight, surface, flown)
            )
            if found is not None:
                yield found


def _flown(flight: Flight, surface: _Surface, level: Floats) -> _Flown | None:
    """The surface in flight. `level`: times at which it flies straight (s)."""
    rates, outs = flight.one(surface.controller, "Tar", "Act"), flight.one("AETR", surface.output)
    moved, leans = flight.one("GPS", "Spd"), flight.one("ATT", surface.attitude)
    if rates is None or outs is None or moved is None or leans is None:
        return None
    t = rates.t
    acts = (np.interp(t, moved.t, moved["Spd"]) > _FLIES_MS) & during(flight.armed, t)
    if flight.lost_control_s is not None:  # what tumbles turns against its surfaces, whichever way they act
        acts &= t < flight.lost_control_s + _TUMBLES_S
    if acts.sum() < _FEWEST:
        return None
    out = np.interp(t, outs.t, outs[surface.output]) / _FULL
    angle = np.interp(t, leans.t, np.degrees(np.unwrap(np.radians(leans[surface.attitude]))))
    middle = straight.held_at(level, outs, surface.output) / _FULL if len(level) else 0.0
    mode = flight.modes_at(t[acts])
    return _Flown(t[acts], out[acts], middle, rates["Tar"][acts], rates["Act"][acts], angle[acts], mode)


def _wrong_way(surface: _Surface, flown: _Flown) -> Finding | None:
    found = sorted(turn for side in (1.0, -1.0) for turn in _turns_against(flown, side))
    if not found:
        return None
    start, end, side, turned = found[0]
    out = float(np.max(np.abs(flown.out[during([(start, end)], flown.t)])))
    way, goes = _WAYS[surface.attitude, side]
    many = surface.verb == "are"
    obeyed = _has_obeyed(flown, start)
    what = f"no longer obey{'' if many else 's'}" if obeyed else f"turn{'' if many else 's'} the plane the wrong way"
    return Finding(
        kind="surface",
        title=f"{surface.name} {what}",
        onset_s=start,
        end_s=end,
        severity="critical",
        evidence=(
            f"{way} by {100 * out:.0f}% of the travel, and {goes} by {turned:.0f} deg within {end - start:.1f} s "
            f"(limit {_TURNED_DEG:g}): "
            + (
                "stuck, hard over or torn off, for the autopilot flew by it before"
                if obeyed
                else "reversed, stuck or torn off"
            )
        ),
        source=f"AETR.{surface.output}, {surface.controller}.Tar, Act, ATT.{surface.attitude}",
        probability=_WRONG_WAY_P,
        mission_lost=_WRONG_WAY_P,
    )


def _keeps_it_down(flight: Flight, surface: _Surface, flown: _Flown) -> Finding | None:
    """An elevator that is up on the take-off run, faster than the plane has to fly, while the nose stays down."""
    if surface.attitude != "Pitch" or flight.height is None:
        return None
    t, height = flight.height
    lifted = t[height > _LIFTED_M]
    moved = flight.one("GPS", "Spd")
    runs_on = flown.t < (lifted[0] if len(lifted) else np.inf)
    fast = 0.0 if moved is None else np.interp(flown.t, moved.t, moved["Spd"])
    least = _OVER_LEAST * (flight.setting("AIRSPEED_MIN") or flight.setting("ARSPD_FBW_MIN") or _FLIES_MS)
    is_up = runs_on & (fast > least) & (flown.out > _UP) & (flown.angle < 0.0)
    spans = lasting(flown.t, is_up, _DOWN_S)
    if not spans:
        return None
    start, end = spans[0][0], spans[-1][1]
    held = during(spans, flown.t)
    return Finding(
        kind="surface",
        title="the elevator is up, and the nose stays down",
        onset_s=start,
        end_s=end,
        severity="critical",
        evidence=(
            f"on the take-off run it is up by {100 * float(np.mean(flown.out[held])):.0f}% of the travel for "
            f"{end - start:.0f} s above {least:.0f} m/s, with the nose at {float(np.mean(flown.angle[held])):.0f} deg: "
            "reversed, jammed or not connected"
        ),
        source=f"AETR.{surface.output}, ATT.{surface.attitude}, GPS.Spd, AIRSPEED_MIN",
        probability=_WRONG_WAY_P,
        mission_lost=_WRONG_WAY_P,
    )


def _has_obeyed(flown: _Flown, until_s: float) -> bool:
    """Whether the autopilot flew by the surface before: with a reversed one each correction grows."""
    steps = np.diff(flown.t, prepend=flown.t[0])
    flies = (flown.t < until_s) & (flown.mode != _MANUAL) & (steps < _FRESH_S)
    return float(np.sum(steps[flies])) > _FLOWN_S


_WAYS = {
    ("Pitch", 1.0): ("up", "the nose falls"), ("Pitch", -1.0): ("down", "the nose rises"),
    ("Roll", 1.0): ("right", "it rolls left"), ("Roll", -1.0): ("left", "it rolls right"),
}  # fmt: skip


def _turns_against(flown: _Flown, side: float) -> Iterator[tuple[float, float, float, float]]:
    """Start, end, side and degrees of each turn against a surface that is out to one side."""
    is_out = (side * flown.out > _OUT) & (side * (flown.out - flown.middle) > _OUT)
    against = is_out & (side * flown.rate < -_AGAINST_DPS)
    against &= side * (flown.wanted - flown.rate) > 0
    for start, end in runs(flown.t, against):
        held = during([(start, end)], flown.t)
        if end - start < _AGAINST_S or held.sum() < 3 or not _is_fresh(flown.t[held]):
            continue
        turned = -side * float(flown.angle[held][-1] - flown.angle[held][0])
        if float(np.max(np.abs(flown.angle[held]))) > _OVER_DEG:  # it tumbles, faster than a slow log can follow
            turned = -side * float(np.mean(flown.rate[held])) * (end - start)
        if turned > _TURNED_DEG:
            yield start, end, side, turned


def _is_fresh(t: Floats) -> bool:
    return float(np.max(np.diff(t))) < _FRESH_S


def _at_its_stop(flight: Flight, surface: _Surface, flown: _Flown) -> Finding | None:
    """Out to its stop on one side, and the rate that it is out for does not come."""
    side = np.sign(flown.out)
    lacks = (np.abs(flown.out) > _STOP) & (side * (flown.wanted - flown.rate) > _LACKS_DPS)
    lacks &= during(flight.flown, flown.t)
    if flight.height is not None:
        lacks &= np.interp(flown.t, *flight.height) > _HIGH_M
    spans = [span for span in lasting(flown.t, lacks, _STOP_S) if _stays_on_a_side(flown, span)]
    if not spans:
        return None
    held = during(spans, flown.t)
    return Finding(
        kind="surface",
        title=f"{surface.name} {surface.verb} at the stop, and the {surface.attitude.casefold()} does not follow",
        onset_s=spans[0][0],
        end_s=spans[-1][1],
        severity="critical",
        evidence=(
            f"out by {100 * float(np.mean(np.abs(flown.out[held]))):.0f}% of the travel for "
            f"{sum(b - a for a, b in spans):.0f} s, where {float(median(np.abs(flown.wanted - flown.rate)[held])):.0f} "
            f"deg/s are lacking (limit {_LACKS_DPS:g})"
        ),
        source=f"AETR.{surface.output}, {surface.controller}.Tar, Act",
        probability=_STUCK_P,
    )


def _stays_on_a_side(flown: _Flown, span: Span) -> bool:
    out = flown.out[during([span], flown.t)]
    return abs(float(np.mean(out))) > _ONE_SIDE * float(np.mean(np.abs(out)))


CHECK = Check("surfaces", "ailerons or an elevator that turn a plane the wrong way, or are stuck", READS, LIMITS, find)
