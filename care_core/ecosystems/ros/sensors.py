"""Laser scanners and batteries as a drive tells of them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_core.ecosystems.ros.messages import BATTERY, SCAN, believable, holds
from care_core.ecosystems.ros.motion import when_made
from care_core.logs.base import Table
from care_core.numbers import Floats, median
from care_core.records import Record

LEAST_V, MOST_V = 2.0, 1e3
"""A lithium cell is empty above the one, no vehicle's battery reaches the other. Simple drivers say a fixed voltage."""


class Scans(Record, eq=False):
    """Scans of one laser. `ranges` has shape (n, rays), m, nan where nothing came back; `angles` (rays,), rad."""

    topic: str
    t: Floats
    ranges: NDArray[np.float32]
    angles: Floats
    raw: NDArray[Any]
    """As recorded, shape (n,) of arrays."""


class Battery(Record, eq=False):
    """A battery where it tells a voltage: s, V, A, Ah, the last two nan where they are not measured; shape (n,)."""

    topic: str
    t: Floats
    voltage: Floats
    current: Floats
    """As its driver signs it."""
    charge: Floats

    @property
    def is_alive(self) -> bool:
        """Whether its voltage is one: positive and not ever the same."""
        low, high = float(self.voltage.min()), float(self.voltage.max())
        return len(self.t) >= 5 and low >= 0 and high > max(low, LEAST_V)

    @property
    def drawn(self) -> Floats:
        """Current, positive when discharging: sensor_msgs/BatteryState says negative, many drivers the magnitude."""
        measured = self.current[np.isfinite(self.current)]
        return -self.current if len(measured) and median(measured) < 0 else self.current


def scans_of(topic: str, table: Table) -> Scans | None:
    """The scans of a topic with as many rays as most have; None where there are none."""
    if not holds(table, SCAN):
        return None
    sizes = np.array([len(one) for one in table["ranges"]])
    rays = int(median(sizes))
    good = sizes == rays
    if rays < 2 or not good.any():
        return None
    raw = table["ranges"][good]
    ranges = np.stack(list(raw)).astype(np.float32)
    low, high = float(median(table["range_min"])), float(median(table["range_max"]))
    with np.errstate(invalid="ignore", over="ignore"):
        # A range beyond its limits is none (REP 117); some drivers give the highest one for no return.
        ranges[~((ranges >= low) & (ranges < high * (1 - 1e-6)))] = np.nan
    first, step = (float(believable(table, SCAN, name)[good][0]) for name in ("angle_min", "angle_increment"))
    if not np.isfinite(first + step):
        return None
    angles: Floats = first + np.arange(rays, dtype=np.float64) * step
    return Scans(topic, when_made(table)[good], ranges, angles, raw)


def battery_of(topic: str, table: Table) -> Battery | None:
    """The battery of a topic; None where its messages tell no voltage that any has."""
    if not {"voltage", "current"} <= set(table.columns):
        return None
    voltage, current = (believable(table, BATTERY, name) for name in ("voltage", "current"))
    counts = "charge" in table.columns
    charge = believable(table, BATTERY, "charge") if counts else np.full(len(table), np.nan)
    good = np.isfinite(voltage)
    return Battery(topic, table.t[good], voltage[good], current[good], charge[good]) if good.any() else None
