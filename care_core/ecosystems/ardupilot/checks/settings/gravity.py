"""What a vehicle that stands feels: gravity, at the bottom of a board that is mounted as it is told."""

from __future__ import annotations

import numpy as np

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.base import Limits
from care_core.logs.base import Table, Wanted
from care_core.numbers import Floats, median

AXES = ("AccX", "AccY", "AccZ")
READS: Wanted = {"IMU": AXES}
LIMITS = Limits()
UPRIGHT_DEG = LIMITS.add("gravity at the bottom of a board", 20.0, "deg", "a choice: a slope to take off from")
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
