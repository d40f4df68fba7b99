"""Extractors of a ROS battery, sensor_msgs/BatteryState."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from care_core.extract.drive import BATTERY_FIELDS, Floats, has, topics
from care_core.extract.registry import Args, Mission, extractor, missing, one_of
from care_core.logs.plausible import is_alive
from care_core.run import Unavailable, Value

_TOO_SHORT = Unavailable("the mission takes no time", "record the whole mission")


@extractor("battery_energy", needs={}, parts=("battery",), unit="Wh")
def battery_energy(mission: Mission, args: Args) -> Value:
    """Energy drawn: voltage times current over time, or where no current is measured charge times mean voltage.

    Drivers differ in the sign of a discharge current, so the magnitude of the sum counts.
    """
    battery = _battery(mission)
    if isinstance(battery, Unavailable):
        return battery
    inside = (battery.t >= mission.start_s) & (battery.t <= mission.end_s)
    if np.isfinite(battery.current).all() and is_alive(battery.current[inside]) and battery.current[inside].any():
        power = battery.voltage * battery.current
        joule = np.concatenate([[0.0], np.cumsum(np.diff(battery.t) * (power[1:] + power[:-1]) / 2)])
        start, end = np.interp([mission.start_s, mission.end_s], battery.t, joule)
        return abs(float(end - start)) / 3600
    if np.isfinite(battery.charge).all() and np.ptp(battery.charge[inside]) > 0:
        start, end = np.interp([mission.start_s, mission.end_s], battery.t, battery.charge)
        return float(start - end) * float(battery.voltage[inside].mean())
    if np.isfinite(battery.current).any() or np.isfinite(battery.charge).any():
        return Unavailable("the battery says the same current and charge throughout", "check its sensor and driver")
    return Unavailable("the battery reports neither current nor charge", "have its driver fill in one of them")


@extractor("battery_power", needs={}, parts=("battery",), unit="W")
def battery_power(mission: Mission, args: Args) -> Value:
    """Mean power drawn."""
    energy_wh = battery_energy(mission, args)
    time_s = mission.end_s - mission.start_s
    return energy_wh if isinstance(energy_wh, Unavailable) else energy_wh * 3600 / time_s if time_s > 0 else _TOO_SHORT


@extractor(
    "battery_voltage",
    needs={},
    parts=("battery",),
    unit="V",
    args={"of": one_of("start or lowest, lowest unless given", "start", "lowest")},
)
def battery_voltage(mission: Mission, args: Args) -> Value:
    """The battery's voltage at the start, or its lowest."""
    battery = _battery(mission)
    if isinstance(battery, Unavailable):
        return battery
    inside = battery.voltage[(battery.t >= mission.start_s) & (battery.t <= mission.end_s)]
    return float(inside[0] if args.get("of") == "start" else inside.min())


@dataclass(frozen=True, slots=True, eq=False)
class _Battery:
    """Battery of the whole log: s, V, A, Ah, each of shape (n,)."""

    t: Floats
    voltage: Floats
    current: Floats
    charge: Floats


def _battery(mission: Mission) -> _Battery | Unavailable:
    """The battery's record, which must cover the mission but for a few seconds."""
    channel = topics(mission.spec).battery
    table = mission.tables.get(channel)
    if table is None or not has(table, BATTERY_FIELDS):
        return missing(channel)
    known = np.isfinite(table["voltage"])
    inside = known & (table.t >= mission.start_s) & (table.t <= mission.end_s)
    edge_s = max(5.0, 0.05 * (mission.end_s - mission.start_s))
    if (
        inside.sum() < 2
        or table.t[inside][0] > mission.start_s + edge_s
        or table.t[inside][-1] < mission.end_s - edge_s
    ):
        return Unavailable(f"{channel} does not cover the mission", "record it from the first goal to the last")
    return _Battery(table.t[known], *(np.asarray(table[name][known], np.float64) for name in BATTERY_FIELDS))
