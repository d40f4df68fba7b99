"""What a vehicle that stands feels: gravity, at the bottom of a board that is mounted as it is told."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.base import Limits
from care_core.ecosystems.spans import Span, during, runs
from care_core.geodesy import GRAVITY
from care_core.logs.base import Table, Wanted
from care_core.numbers import Floats, median

AXES = ("AccX", "AccY", "AccZ")
READS: Wanted = {"IMU": AXES}
LIMITS = Limits()
UPRIGHT_DEG = LIMITS.add("gravity at the bottom of a board", 20.0, "deg", "a choice: a slope to take off from")
TURNS_DPS = LIMITS.add("turning at rest", 3.0, "deg/s", "flights whose gyros are calibrated: 1.0 at most")
REST_S = LIMITS.add("time at rest", 2.0, "s", "a choice: a landing that bounces rests for less")
STILL_DEG = LIMITS.add("gravity that stays where it is, at rest", 1.0, "deg", "a third of what 3 deg/s turn meanwhile")
_GYROS, _OFF, _SHAKEN, _RECORDS_AT_REST = ("GyrX", "GyrY", "GyrZ"), 2.5, 1.0, 6
"""m/s^2 by which what rests may be off gravity, not calibrated, and be shaken."""
FEWEST, _IDLES = 3, 0.05
"""Records, and the throttle above which motors may lift."""


def felt(flight: Flight) -> dict[int, Floats]:
    """By the number of its sensor what stands feels, shape (3,)."""
    tables = ((n, standing(flight, table)) for n, table in enumerate(flight.all("IMU", *AXES), start=1))
    return {n: np.array([median(table[axis]) for axis in AXES]) for n, table in tables if len(table) >= FEWEST}


def standing(flight: Flight, table: Table) -> Table:
    """The records of a copter before it is in the air, and before its motors lift; of others until they arm."""
    until = min((start for start, _ in (flight.airborne if flight.is_copter else flight.armed)), default=flight.end_s)
    if flight.throttle is not None and flight.armed:
        t, driven = flight.throttle
        lifting = t[(driven > _IDLES) & (t > flight.armed[0][0])]
        until = min(until, float(lifting[0]) if len(lifting) else until)
    return table.where((table.t < until) & np.isfinite(sum(table[name] for name in table.columns)))


def lean_deg(pull: Floats) -> float:
    """The angle between the bottom of a board and gravity."""
    return float(np.degrees(np.arccos(np.clip(-pull[2] / max(float(np.linalg.norm(pull)), 1e-9), -1.0, 1.0))))


def is_upright(flight: Flight) -> bool:
    """Whether gravity pulls at the bottom of the board; not where nothing tells."""
    every = felt(flight).values()
    return bool(every) and max(map(lean_deg, every)) < UPRIGHT_DEG


class Rest(NamedTuple):
    """Seconds in which an armed copter lay still with its motors down."""

    span: Span
    down: Floats
    """The direction of gravity, of length 1, shape (3,)."""
    turns_dps: float
    """The rate, about axes across gravity, that its gyros tell of all the while."""


def rests(flight: Flight) -> Iterator[Rest]:
    """Each few seconds at rest: gravity stays where it is. About axes across it nothing turns then, whatever gyros say;
    about the vertical somebody may turn it."""
    table, driven = flight.one("IMU", *AXES, *_GYROS), flight.throttle
    if table is None or driven is None or not flight.is_copter:
        return
    t = table.t
    idle = (np.interp(t, *driven) < _IDLES) & during(flight.armed, t)
    for start, end in runs(t, idle, gap_s=0.0):
        for begin in np.arange(start, end - REST_S + 1e-6, REST_S):
            part = table.between(float(begin), float(begin) + REST_S)
            if len(part) >= _RECORDS_AT_REST and (rest := _rest(part)) is not None:
                yield rest


def _rest(part: Table) -> Rest | None:
    felt = np.array([part[axis] for axis in AXES])
    halves = [felt[:, rows].mean(axis=1) for rows in np.array_split(np.arange(len(part)), 2)]
    mean = felt.mean(axis=1)
    size = float(np.linalg.norm(mean))
    if abs(size - GRAVITY) > _OFF or float(felt.std(axis=1).max()) > _SHAKEN:
        return None
    down = mean / size
    rate = np.degrees([part[axis].mean() for axis in _GYROS])
    across = float(np.linalg.norm(rate - (rate @ down) * down))
    cosine = float(halves[0] @ halves[1] / np.prod([np.linalg.norm(half) for half in halves]))
    moved = float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
    if moved > STILL_DEG:
        return None
    return Rest((float(part.t[0]), float(part.t[-1])), down, across)
