"""A rover that moves where it should stand, and one that stands where it should move.

An output stands at its trim while the vehicle is disarmed (SRV_Channel.cpp): where that is not the middle of its motor
controller, the vehicle drives off before it is armed, and its estimator, which aligns at rest, keeps it from arming. A
skid-steered rover stands for WP_PIVOT_DELAY seconds before and after it turns on the spot (AR_WPNav.cpp).
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.statistics import lasting
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.spans import Span, during, runs
from care_core.logs.base import Table, Wanted
from care_core.metadata.output_functions import LEFT, RIGHT, STEERING, THROTTLE
from care_core.run import shown

READS: Wanted = {
    "RCOU": tuple(f"C{n}" for n in range(1, 15)),
    "THR": ("Speed",),
    "STER": ("TurnRate",),
}
LIMITS = Limits()
_MOVES_MS = LIMITS.add("speed of a rover that drives", 0.5, "m/s", "a choice: above the noise of the estimate")
_TURNS_DPS = LIMITS.add("turn rate of one that turns on the spot", 10.0, "deg/s", "a choice: far above a gyro's drift")
_MOVES_S = LIMITS.add("time for which it moves while disarmed", 5.0, "s", "a choice: who pushes it stops sooner")
_OFF_US = LIMITS.add("output off its middle", 50.0, "us", "trims that are right are within 26 in 541 drives")
_CREEPS_MS = LIMITS.add(
    "even speed of a rover that creeps while disarmed", 0.1, "m/s", "a choice: above the noise at rest"
)
_CREEPS_S = LIMITS.add("time for which it creeps", 8.0, "s", "a choice: it is metres off where it was set down")
_EVEN_MS = LIMITS.add("change of an even speed", 0.1, "m/s", "a choice: who pushes is not as even")
_STANDS_MS = LIMITS.add("speed of a rover that stands", 0.2, "m/s", "a choice: below what it can hold")
_STANDS_DPS = LIMITS.add("turn rate of a rover that stands", 2.0, "deg/s", "a choice: above what a gyro wanders by")
_AS_LONG = LIMITS.add("share of the delay by which a stand differs", 0.1, "", "a choice: it slows down and speeds up")
_PIVOT_S = LIMITS.add("shortest delay that is told", 3.0, "s", "a choice: shorter ones are lost among the stops")
_LONG = LIMITS.add("share of the drive that loses the mission", 0.2, "", "missions are given 1.3 times their time")
_SURE_P = LIMITS.add("probability of the parameter", 0.95, "", "it is measured")
_LOST_P = LIMITS.add(
    "probability that shorter stands lose it", 0.3, "", "a choice: most missions have the time for them"
)
_DRIVES = frozenset((STEERING, THROTTLE, LEFT, RIGHT))
_MIDDLE_US = 1500.0
_DELAY = "WP_PIVOT_DELAY"


def find(flight: Flight) -> Iterator[Finding]:
    """Outputs off their middles that drive it while it is disarmed, and waits before it turns on the spot."""
    if flight.kind == "rover":
        yield from _driven_off(flight)
        yield from _waits(flight)


def _driven_off(flight: Flight) -> Iterator[Finding]:
    moved, turned, told = flight.one("THR", "Speed"), flight.one("STER", "TurnRate"), flight.one("RCOU")
    if moved is None or turned is None or told is None:
        return
    rate = np.interp(moved.t, turned.t, turned["TurnRate"])
    moves = (np.abs(moved["Speed"]) > _MOVES_MS) | (np.abs(rate) > _TURNS_DPS)
    spans, least_s, least_us = lasting(moved.t, moves & ~during(flight.armed, moved.t), _MOVES_S), _MOVES_S, _OFF_US
    if not spans:
        spans, least_s, least_us = _creeping(flight, moved), _CREEPS_S, 0.0
    drives = [n for n in range(1, 15) if flight.setting(f"SERVO{n}_FUNCTION") in _DRIVES and f"C{n}" in told.columns]
    off = [n for n in drives if _trim_is_off(flight, n, least_us)]
    held = during(spans, told.t)
    driven = [n for n in off if (np.abs(told[f"C{n}"][held] - _MIDDLE_US) > least_us).any()]
    if not spans or not driven:
        return
    names = [f"SERVO{n}_TRIM" for n in driven]
    speed = float(np.max(np.abs(moved["Speed"][during(spans, moved.t)])))
    values = "; ".join(f"{name} is {shown(flight.setting(name))} (default {_MIDDLE_US:g})" for name in names)
    yield Finding(
        kind="drive",
        title="it drives while it is disarmed",
        onset_s=spans[0][0],
        end_s=spans[-1][1],
        severity="critical",
        evidence=f"for {sum(b - a for a, b in spans):.0f} s, at up to {speed:.1f} m/s (limit {least_s:g} s): {values}",
        source="RCOU, THR.Speed, STER.TurnRate; PARM",
        suspect="parameter",
        probability=_SURE_P,
        parameters=tuple(names),
        wanted=tuple((name, _MIDDLE_US) for name in names),
    )


def _creeping(flight: Flight, moved: Table) -> list[Span]:
    """When it crept at an even speed while it was disarmed, which nobody pushes a rover at."""
    crept = lasting(moved.t, (np.abs(moved["Speed"]) > _CREEPS_MS) & ~during(flight.armed, moved.t), _CREEPS_S)
    return [span for span in crept if np.ptp(moved["Speed"][during([span], moved.t)]) < _EVEN_MS]


def _trim_is_off(flight: Flight, output: int, least_us: float) -> bool:
    name = f"SERVO{output}_TRIM"
    trim = flight.setting(name)
    return trim is not None and flight.default_left(name) is not None and abs(trim - _MIDDLE_US) > least_us


def _waits(flight: Flight) -> Iterator[Finding]:
    moved, turned = flight.one("THR", "Speed"), flight.one("STER", "TurnRate")
    delay, default = flight.setting(_DELAY), flight.default_left(_DELAY)
    if moved is None or turned is None or delay is None or default is None or delay < _PIVOT_S:
        return
    by_itself = flight.drives_itself(moved.t)
    rate = np.interp(moved.t, turned.t, turned["TurnRate"])
    stands = (np.abs(moved["Speed"]) < _STANDS_MS) & (np.abs(rate) < _STANDS_DPS) & by_itself
    spans = [(a, b) for a, b in runs(moved.t, stands) if abs(b - a - delay) <= _AS_LONG * delay]
    drive = sum(b - a for a, b in runs(moved.t, by_itself))
    if not spans or not drive:
        return
    share = sum(b - a for a, b in spans) / drive
    is_long = share > _LONG
    yield Finding(
        kind="drive",
        title="it stands before it turns on the spot",
        onset_s=spans[0][0],
        end_s=spans[-1][1],
        severity="critical" if is_long else "warning",
        evidence=(
            f"{len(spans)} times, for {share:.0%} of the drive (limit {_LONG:.0%}): {_DELAY} is {shown(delay)} s "
            f"(default {shown(default)})"
        ),
        source="THR.Speed, STER.TurnRate; PARM",
        suspect="parameter",
        probability=_SURE_P,
        mission_lost=None if is_long else _LOST_P,
        parameters=(_DELAY,),
        wanted=((_DELAY, default),),
    )


CHECK = Check(
    "standing", "a rover that drives while it is disarmed, or stands before each turn on the spot", READS, LIMITS, find
)
