"""Values that cannot be: DataFlash records carry no checksum, so a flipped bit is read as a flight to the moon.

Rows that say the impossible are left out before anything is computed from them. What is merely bad stays.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from care_core.logs.base import Table

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

LIMITS: Mapping[str, Mapping[str, tuple[float, float]]] = {
    "POS": {"Lat": (-90, 90), "Lng": (-180, 180), "RelHomeAlt": (-1e4, 1e5)},
    "ORGN": {"Lat": (-90, 90), "Lng": (-180, 180)},
    "CMD": {"Lat": (-90, 90), "Lng": (-180, 180), "Alt": (-1e4, 1e5)},
    "BAT": {"Volt": (0, 1e3), "Curr": (-1e3, 1e4), "EnrgTot": (0, 1e6)},
    "ATT": {"Roll": (-360, 360), "Pitch": (-360, 360), "Yaw": (-360, 720)},
    "GPS": {"HDop": (0, 655.35)},
}
"""Lowest and highest value of a field that any vehicle could record."""

JUMPS: Mapping[str, Mapping[str, float]] = {
    "POS": {"Lat": 5e-4, "Lng": 5e-4, "RelHomeAlt": 50.0},  # 50 m in a sample
    "BAT": {"Volt": 5.0, "EnrgTot": 5.0},
}
"""A step that no vehicle makes from one sample to the next and back again: away by more, and back to within half."""


def plausible(tables: Mapping[str, Table]) -> dict[str, Table]:
    """The tables without the rows in which a field is beyond its limits, or leaps away for one sample."""
    return {name: _cleaned(name, table) for name, table in tables.items()}


def _cleaned(name: str, table: Table) -> Table:
    limits, jumps = LIMITS.get(name, {}), JUMPS.get(name, {})
    keep = np.ones(len(table), dtype=bool)
    for field, (low, high) in limits.items():
        if field in table.columns:
            column = table[field]
            keep &= np.isnan(column) | ((column >= low) & (column <= high))
    if not keep.all():
        table = table.where(keep)
    keep = np.ones(len(table), dtype=bool)
    for own in _instances(table):
        for field, step in jumps.items():
            if field in table.columns:
                keep[own] &= ~_leaps(table[field][own], step)
    return table if keep.all() else table.where(keep)


def _instances(table: Table) -> list[Mask]:
    """The rows of each sensor: samples of two batteries alternate without leaping."""
    name = next((name for name in ("Inst", "Instance", "I") if name in table.columns), None)
    if name is None:
        return [np.ones(len(table), dtype=bool)]
    return [np.asarray(table[name] == number) for number in np.unique(table[name])]


def _leaps(column: Floats, step: float) -> Mask:
    """Samples that lie further than `step` from both neighbours, which lie close to each other."""
    leaps = np.zeros(len(column), dtype=bool)
    if len(column) > 2:
        before, here, after = column[:-2], column[1:-1], column[2:]
        leaps[1:-1] = (
            (np.abs(here - before) > step) & (np.abs(here - after) > step) & (np.abs(after - before) <= step / 2)
        )
    return leaps
