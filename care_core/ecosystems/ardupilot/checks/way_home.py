"""The way home of a copter, phase by phase, against the parameters that set its length: the flight back, the wait over
home, the descent, and what it stays at.

A slow way home is an operator's choice and no fault. It is told where its time follows from a parameter that is off its
default, and it cost the flight clearly more than the default would have.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.statistics import smooth
from care_core.ecosystems.ardupilot.texts import mission_item
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.spans import Span, runs, seconds_in
from care_core.geodesy import offset_m
from care_core.logs.base import Wanted
from care_core.numbers import Bools, Floats, quantile

READS: Wanted = {"POS": ("Lat", "Lng", "RelHomeAlt")}

LIMITS = Limits()
_COSTS_S = LIMITS.add("time that a phase costs beside the default", 10.0, "s", "a choice: less is lost in any wind")
_SHARE = LIMITS.add(
    "that time, as a share of the rest of the flight", 0.25, "", "none of 490 training flights that met their limits"
)
_SHARE_CUT_SHORT = LIMITS.add(
    "that share where the battery did not last", 0.15, "", "a choice: what a gust costs is less"
)
_MOST_SHARE = LIMITS.add(
    "that share where most missions fail", 0.4, "", "missions are planned with a reserve of 0.3 of their time"
)
_LIKE = LIMITS.add("speed or height off what the parameter says", 0.15, "", "a choice: wind and control take some")
_STILL_MS = LIMITS.add("speed of what waits in its place", 0.4, "m/s", "a choice: gusts move it by less")
_SURE_P = LIMITS.add("probability of a parameter that a phase follows", 0.9, "", "its value and the phase agree")
_LEAST_LOST_P = LIMITS.add(
    "probability that a mission fails of a phase at the limit",
    0.3,
    "",
    "a choice: there most missions still have the time",
)
_SURELY_LOST_P = LIMITS.add(
    "probability that a mission fails of a phase far beyond", 0.9, "", "a choice: there hardly any has the time"
)

_RTL, _LAND, _AUTO = 6, 9, 3
"""Modes of ArduCopter (ArduCopter/mode.h)."""
_STEP_S, _OVER_S = 0.5, 2.0
_NEAR_M, _LEFT_M, _ACCEL_MS2 = 3.0, 1.0, 2.5
_OVER_OBSTACLES = "RTL_ALT"
"""Which height the way home needs is the site's, and no default's."""
_DEFAULTS = {
    "RTL_ALT": 1500.0, "RTL_CLIMB_MIN": 0.0, "RTL_SPEED": 0.0, "RTL_LOIT_TIME": 5000.0, "RTL_ALT_FINAL": 0.0,
    "LAND_SPEED": 50.0, "LAND_SPEED_HIGH": 0.0, "LAND_ALT_LOW": 1000.0,
}  # fmt: skip
"""ArduCopter/config.h."""


class _Way(NamedTuple):
    """Where the vehicle was after it set out for home, every half second."""

    t: Floats
    away_m: Floats
    """From where it ended."""
    height_m: Floats
    speed_ms: Floats
    sinks_ms: Floats


class _Slow(NamedTuple):
    """A phase that took as long as a parameter makes it."""

    parameter: str
    span: Span
    costs_s: float
    title: str
    shown: str


def find(flight: Flight) -> Iterator[Finding]:
    """The parameter whose phases cost most, of all the times that it went home."""
    if not flight.is_copter or not flight.armed or flight.lost_control_s is not None:
        return
    phases: dict[str, _Slow] = {}
    for returns, way in _ways(flight):
        for phase in (*(_return(flight, way) if returns else ()), *_descent(flight, way)):
            before = phases.get(phase.parameter)
            costs_s = phase.costs_s + (0.0 if before is None else before.costs_s)
            longest = phase if before is None or phase.costs_s > before.costs_s else before
            phases[phase.parameter] = longest._replace(costs_s=costs_s)
    worst = max(phases.values(), key=lambda phase: phase.costs_s, default=None)
    if worst is not None:
        yield from _slow_phase(flight, worst)


def _slow_phase(flight: Flight, phase: _Slow) -> Iterator[Finding]:
    flown = seconds_in(flight.armed)
    share = phase.costs_s / max(flown - phase.costs_s, 1.0)
    value, default = flight.setting(phase.parameter), _default(flight, phase.parameter)
    least = _SHARE if flight.battery_failsafe_s is None else _SHARE_CUT_SHORT
    if value == default or phase.costs_s < _COSTS_S or share < least:
        return
    lost = float(np.interp(share, (least, _MOST_SHARE), (_LEAST_LOST_P, _SURELY_LOST_P)))
    if _emptied(flight, phase):
        lost = _SURELY_LOST_P
    yield Finding(
        kind="commands",
        title=phase.title,
        onset_s=phase.span[0],
        end_s=phase.span[1],
        severity="warning",
        evidence=(
            f"{phase.shown}: {phase.parameter} is {value:g} (default {default:g}); that took "
            f"{phase.costs_s:.0f} s more than the default, {100 * share:.0f}% of the rest of the flight (limit "
            f"{_COSTS_S:g} s and {100 * least:.0f}%)"
        ),
        source="POS, MODE, MSG; PARM",
        suspect="parameter",
        probability=_SURE_P,
        mission_lost=lost,
        parameters=(phase.parameter,),
        wanted=() if phase.parameter == _OVER_OBSTACLES else ((phase.parameter, default),),
    )


def _emptied(flight: Flight, phase: _Slow) -> bool:
    """Whether the battery's failsafe came in the time that the default would have saved."""
    at = flight.battery_failsafe_s
    return at is not None and phase.span[0] <= at <= phase.span[1] + phase.costs_s


def _default(flight: Flight, parameter: str) -> float:
    """What this firmware has as shipped, as the log says it; else what ArduPilot's has."""
    history = flight.settings.get(parameter, ())
    said = history[0].default if history else None
    return float(said) if isinstance(said, (int, float)) else _DEFAULTS[parameter]


def _ways(flight: Flight) -> Iterator[tuple[bool, _Way]]:
    """Per time that it set out for home or to land: whether it was to return, and where it was from then on."""
    starts = [(mode.start_s, mode.number == _RTL) for mode in flight.modes if mode.number in (_RTL, _LAND)]
    for t, text in flight.messages:
        mode, item = flight.mode_at(t), mission_item(text)
        if (
            item is not None
            and item[1] in ("RTL", "ReturnToLaunch", "Land")
            and mode is not None
            and mode.number == _AUTO
        ):
            starts.append((t, item[1] != "Land"))
    for start, returns in sorted(starts):
        span = next(((start, end) for begin, end in flight.armed if begin <= start < end), None)
        others = [mode.start_s for mode in flight.modes if mode.start_s > start]
        way = None if span is None else _way(flight, (start, min([span[1], *others])))
        if way is not None:
            yield returns, way


def _way(flight: Flight, span: Span) -> _Way | None:
    table, height = flight.one("POS", "Lat", "Lng"), flight.height
    t = np.arange(span[0], span[1], _STEP_S)
    if table is None or height is None or len(t) < 5:
        return None
    there = table.between(*span)
    if len(there) < 5:
        return None
    home = float(there["Lat"][-1]), float(there["Lng"][-1])
    x, y = (np.interp(t, there.t, metres) for metres in offset_m(home, there["Lat"], there["Lng"]))
    h = np.interp(t, *height)
    speed = smooth(t, np.hypot(np.gradient(x, t), np.gradient(y, t)), _OVER_S)
    return _Way(t, np.hypot(x, y), h, speed, -smooth(t, np.gradient(h, t), _OVER_S))


def _return(flight: Flight, way: _Way) -> Iterator[_Slow]:
    """The flight back, and what it waits over home for: to land, or for the pilot."""
    arrived = np.flatnonzero(way.away_m > _NEAR_M)
    if len(arrived):
        yield from _flight_back(flight, way, slice(0, int(arrived[-1]) + 1))
    yield from _climb(flight, way)
    still = (way.speed_ms < _STILL_MS) & (np.abs(way.sinks_ms) < _STILL_MS / 2) & (way.height_m > _LEFT_M)
    waits = [span for span in runs(way.t, still, gap_s=_STEP_S) if _is_home(way, span)]
    if not waits:
        return
    longest = max(waits, key=lambda span: span[1] - span[0])
    lasted, height = longest[1] - longest[0], float(np.interp(longest[0], way.t, way.height_m))
    final = flight.setting("RTL_ALT_FINAL") or 0.0
    if final > 0 and abs(100 * height - final) < max(_LIKE * final, 100 * _LEFT_M):
        yield _Slow(
            "RTL_ALT_FINAL", longest, lasted, "it came home and did not land",
            f"it stayed {lasted:.0f} s at {height:.1f} m over home, where 0 makes it land",
        )  # fmt: skip
    loiter = flight.setting("RTL_LOIT_TIME")
    if loiter and lasted > (1 - _LIKE) * loiter / 1000:
        usual = _default(flight, "RTL_LOIT_TIME")
        yield _Slow(
            "RTL_LOIT_TIME", longest, (min(1000 * lasted, loiter) - usual) / 1000,
            "it waited long over home", f"it stayed {lasted:.0f} s at {height:.1f} m over home",
        )  # fmt: skip


def _is_home(way: _Way, span: Span) -> bool:
    return float(np.interp(span[0], way.t, way.away_m)) < _NEAR_M


def _climb(flight: Flight, way: _Way) -> Iterator[_Slow]:
    """The climb before it comes home, which is the descent's as well."""
    up, down = flight.setting("WPNAV_SPEED_UP"), flight.setting("LAND_SPEED_HIGH") or flight.setting("WPNAV_SPEED_DN")
    least, height = flight.setting("RTL_CLIMB_MIN") or 0.0, flight.setting("RTL_ALT")
    begin, top = 100 * float(way.height_m[0]), 100 * float(np.max(way.height_m))
    if not up or not down or height is None:
        return
    usual = {"RTL_CLIMB_MIN": max(begin, height), "RTL_ALT": max(begin + least, _default(flight, "RTL_ALT"))}
    for name, told in (("RTL_CLIMB_MIN", begin + least), ("RTL_ALT", height)):
        more = top - usual[name]
        if more > 0 and abs(top - told) < max(_LIKE * more, 100 * _LEFT_M):
            high = (float(way.t[0]), float(way.t[int(np.argmax(way.height_m))]))
            yield _Slow(
                name, high, more / up + more / down, "it climbed high before it came home",
                f"it climbed from {begin / 100:.0f} to {top / 100:.0f} m"
                + (", a height over obstacles that only the site can tell" if name == _OVER_OBSTACLES else ""),
            )  # fmt: skip


def _flight_back(flight: Flight, way: _Way, rows: slice) -> Iterator[_Slow]:
    told, usual = flight.setting("RTL_SPEED"), flight.setting("WPNAV_SPEED")
    if not told or not usual or told >= usual:
        return
    distance, speed = float(way.away_m[0]), quantile(way.speed_ms[rows], 0.8)
    if abs(100 * speed - told) > _LIKE * told:
        return
    costs = distance * (100 / told - 100 / usual) - usual / 100 / _ACCEL_MS2
    yield _Slow(
        "RTL_SPEED", (float(way.t[0]), float(way.t[rows][-1])), costs, "it came home slowly",
        f"it came {distance:.0f} m home at {speed:.1f} m/s, where 0 is the mission's own speed",
    )  # fmt: skip


def _descent(flight: Flight, way: _Way) -> Iterator[_Slow]:
    """The last metres, and what it takes for them."""
    slow, below = flight.setting("LAND_SPEED"), flight.setting("LAND_ALT_LOW")
    high, down = flight.setting("LAND_SPEED_HIGH"), flight.setting("WPNAV_SPEED_DN")
    if not slow or not below or not down:
        return
    fast, usual_slow, usual_below = high or down, _default(flight, "LAND_SPEED"), _default(flight, "LAND_ALT_LOW")
    for name, speed, usual, bottom, top in (
        ("LAND_SPEED", slow, usual_slow, 0.0, min(below, usual_below)),
        ("LAND_ALT_LOW", slow, fast, usual_below, below),
        ("LAND_SPEED_HIGH", fast, down, below, np.inf),
    ):
        span, metres = _sunk(way, speed, bottom, top)
        costs = metres * (100 / speed - 100 / usual)
        if span is not None and costs > 0:
            begin = float(np.interp(span[0], way.t, way.height_m))
            shown = f"it came down {metres:.0f} m at {speed / 100:.2g} m/s from {begin:.0f} m on"
            yield _Slow(name, span, costs, "it came down slowly", shown)


def _sunk(way: _Way, speed_cms: float, bottom_cm: float, top_cm: float) -> tuple[Span | None, float]:
    """Where it came down at about this speed between two heights, and how many metres."""
    sinks: Bools = np.abs(100 * way.sinks_ms - speed_cms) < _LIKE * speed_cms
    within = (100 * way.height_m > bottom_cm) & (100 * way.height_m < top_cm) & sinks
    if not within.any():
        return None, 0.0
    t = way.t[within]
    return (float(t[0]), float(t[-1])), float(within.sum()) * _STEP_S * speed_cms / 100


CHECK = Check("way_home", "a way home that parameters make long", READS, LIMITS, find)
