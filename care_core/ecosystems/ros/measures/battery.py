"""Extractors of a ROS battery, sensor_msgs/BatteryState."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.coverage import EXTREME, SUM, Samples
from care_core.ecosystems.measures import Args, Mission, extractor, has, missing, one_of
from care_core.ecosystems.plausible import is_alive
from care_core.ecosystems.ros.measures.window import drive_of, resting_on, samples_of, topics
from care_core.ecosystems.ros.sensors import LEAST_V, MOST_V, Battery
from care_core.numbers import Floats
from care_core.records import replace
from care_core.run import Unavailable, Value

_LEAST_W = 1.0
"""Mean power of a mission: a computer alone takes more."""
_AGREE, _ENOUGH_AH = 2.0, 0.01
"""By what factor the charge that is gone and current over time may differ, and the least that is compared."""
_TOO_SHORT = Unavailable("the mission takes no time", "record the whole mission")


@extractor("battery_energy", needs={}, parts=("battery",), unit="Wh", rests_on=resting_on("battery", bears=SUM))
def battery_energy(mission: Mission, args: Args) -> Value:
    """Energy drawn: voltage times current over time, or where no current is measured charge times mean voltage.

    Drivers differ in the sign of a discharge current, so the magnitude of the sum counts.
    """
    battery = _battery(mission)
    if isinstance(battery, Unavailable):
        return battery
    inside = (battery.t >= mission.start_s) & (battery.t <= mission.end_s)
    counts = np.isfinite(battery.charge).all() and np.ptp(battery.charge[inside]) > 0
    if np.isfinite(battery.current).all() and is_alive(battery.current[inside]) and battery.current[inside].any():
        joule = _over(mission, battery.t, battery.voltage * battery.current)
        drawn, gone = abs(_over(mission, battery.t, battery.current)) / 3600, float(np.ptp(battery.charge[inside]))
        if counts and max(drawn, gone) > _ENOUGH_AH and not 1 / _AGREE < drawn / gone < _AGREE:
            return Unavailable(
                f"the battery counts {gone:.3g} Ah, but its current over time makes {drawn:.3g} Ah",
                "is its current in amperes, its charge in ampere hours?",
            )
        return _unless_absurd(abs(joule), mission.end_s - mission.start_s)
    if counts:
        start, end = np.interp([mission.start_s, mission.end_s], battery.t, battery.charge)
        return float(start - end) * float(battery.voltage[inside].mean())
    if np.isfinite(battery.current).any() or np.isfinite(battery.charge).any():
        return Unavailable("the battery reports the same current and charge throughout", "check its sensor and driver")
    return Unavailable("the battery reports neither current nor charge", "have its driver fill in one of them")


def _over(mission: Mission, t: Floats, rate: Floats) -> float:
    """A rate over the seconds of the mission."""
    sums = np.concatenate([[0.0], np.cumsum(np.diff(t) * (rate[1:] + rate[:-1]) / 2)])
    start, end = np.interp([mission.start_s, mission.end_s], t, sums)
    return float(end - start)


def _unless_absurd(joule: float, time_s: float) -> Value:
    """The energy in Wh, unless no robot runs on so little."""
    power_w = joule / time_s if time_s > 0 else 0.0
    if power_w >= _LEAST_W:
        return joule / 3600
    return Unavailable(f"the battery reports {power_w:.3g} W, on which no robot runs", "is its current in amperes?")


@extractor("battery_power", needs={}, parts=("battery",), unit="W")
def battery_power(mission: Mission, args: Args) -> Value:
    """Mean power drawn."""
    energy_wh = battery_energy(mission, args)
    time_s = mission.end_s - mission.start_s
    return energy_wh if isinstance(energy_wh, Unavailable) else energy_wh * 3600 / time_s if time_s > 0 else _TOO_SHORT


def _voltage(mission: Mission, args: Args) -> Iterator[Samples]:
    """The battery as the mission began, or throughout."""
    for one in samples_of(mission, "battery", EXTREME):
        yield replace(one, spans=(), moments=[mission.start_s]) if args.get("of") == "start" else one


@extractor(
    "battery_voltage",
    needs={},
    parts=("battery",),
    unit="V",
    args={"of": one_of("start or lowest, lowest unless given", "start", "lowest")},
    rests_on=_voltage,
)
def battery_voltage(mission: Mission, args: Args) -> Value:
    """The battery's voltage at the start, or its lowest."""
    battery = _battery(mission)
    if isinstance(battery, Unavailable):
        return battery
    inside = battery.voltage[(battery.t >= mission.start_s) & (battery.t <= mission.end_s)]
    return float(inside[0] if args.get("of") == "start" else inside.min())


def _battery(mission: Mission) -> Battery | Unavailable:
    """The battery's record."""
    drive, channel = drive_of(mission), topics(mission.spec).battery
    battery = None if drive is None else drive.battery_on(channel)
    if battery is None:
        table = mission.table(channel)
        return _no_battery_has(float(np.nanmax(table["voltage"]))) if has(table, "voltage") else missing(channel)
    inside = battery.t[(battery.t >= mission.start_s) & (battery.t <= mission.end_s)]
    if len(inside) < 2:
        return Unavailable(f"{channel} was hardly recorded in the mission", "record it from the first goal to the last")
    volts = float(battery.voltage.max())
    return battery if LEAST_V <= volts <= MOST_V else _no_battery_has(volts)


def _no_battery_has(volts: float) -> Unavailable:
    return Unavailable(
        f"the battery reports {volts:.3g} V, which no battery has", "check its sensor, and the driver's unit"
    )
