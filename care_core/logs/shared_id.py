"""Whether two vehicles speak under one system id: each of their messages is then one of two runs, and none can be told.

One vehicle has one clock since its start, one kind and one place. Two that are set up alike take turns in all three.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from care_core.geodesy import METRES_PER_DEGREE
from care_core.logs.base import Table
from care_core.numbers import Floats

READS = {
    "HEARTBEAT": ("type",),
    "ATTITUDE": ("time_boot_ms",),
    "GLOBAL_POSITION_INT": ("time_boot_ms", "lat", "lon"),
}
_TURNS = 6
"""Changes to and fro from which on two take turns: a restart, or a clock that is set, is one."""
_MOSTLY = 0.8
"""Share of the changes that go the other way than the one before: between two there is no other."""
_BACK = 2
"""Times that each of the two is where it was two changes before."""
_BOOT_S = 3.0
"""Clocks since the start farther apart than any delay of a link."""
_APART_M = 30.0
"""Farther than a vehicle gets between two messages and back."""


def sharing(tables: Mapping[str, Table]) -> str:
    """What shows that two vehicles share an id, in one clause; empty where one vehicle speaks."""
    if (beats := tables.get("HEARTBEAT")) is not None and _turns(beats["type"], 0.5):
        return "its heartbeats take turns between two kinds of vehicle"
    for name in ("ATTITUDE", "GLOBAL_POSITION_INT"):
        if (table := tables.get(name)) is not None and _turns(table["time_boot_ms"] / 1e3 - table.t, _BOOT_S):
            return "its messages take turns between two clocks since the start"
    if (place := tables.get("GLOBAL_POSITION_INT")) is not None:
        known = place.where((place["lat"] != 0) | (place["lon"] != 0))
        if any(_turns(known[axis] / 1e7 * METRES_PER_DEGREE, _APART_M) for axis in ("lat", "lon")):
            return "its positions take turns between two places"
    return ""


def _turns(values: Floats, apart: float) -> bool:
    """Whether a series goes to and fro between two levels, again and again. A link that delays leaves one level for
    many others, and a restart comes back to none."""
    steps = np.diff(values)
    rows = np.flatnonzero(np.abs(steps) > apart)
    large = steps[rows]
    if len(large) < _TURNS or np.mean(np.sign(large[1:]) != np.sign(large[:-1])) < _MOSTLY:
        return False
    reached = values[rows + 1]
    is_back = np.abs(reached[2:] - reached[:-2]) < apart / 2
    return all(np.sum(is_back[first::2]) >= _BACK for first in (0, 1))
