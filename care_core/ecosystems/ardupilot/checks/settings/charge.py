"""How the battery's current is measured, against the motors and against what the pack's voltage says was used.

A current is what the sensor's volts less BATT_AMP_OFFSET times BATT_AMP_PERVLT give (AP_BattMonitor_Analog). Its scale
moves current, charge and energy alike, so they agree with each other at any. What does not follow it is the voltage at
rest: between a full pack before take-off and the same pack after landing it tells which share of the charge is gone,
and BATT_CAPACITY how much that is. Two wrong values may make up for each other, so the default has to fit where the
scale does not.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.ardupilot.battery import Battery
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.lithium import CHARGED_V, charge_left
from care_core.ecosystems.spans import during
from care_core.logs.base import Table, Wanted
from care_core.numbers import known_median
from care_core.run import shown

READS: Wanted = {"BAT": ("Volt", "Curr")}

LIMITS = Limits()
_FULL = LIMITS.add("cell of a pack that was charged", CHARGED_V, "V", "cells of lithium polymer packs")
_USED = LIMITS.add("share of the charge used, by its voltage", 0.2, "", "a choice: of less the voltage tells little")
_FLOWN = "99 of 100 flights at the right scale have 0.61 to 0.94"
_LEAST = LIMITS.add("charge that was measured, times that share, at least", 0.5, "", _FLOWN)
_MOST = LIMITS.add("charge that was measured, times that share, at most", 1.4, "", _FLOWN)
_FITS = 0.55, 1.2
"""Times that share that the default has to give."""
_ANSWERS_A = LIMITS.add(
    "current that flying takes more than standing", 0.5, "A", "a choice: the smallest takes several"
)
_FEWEST, _LANDED = 20, 2
_SURE_P = LIMITS.add("probability of a pin with no sensor on it", 0.9, "", "motors that turn draw a current")
_LIKELY_P = LIMITS.add(
    "probability of a wrong scale of the current", 0.8, "", "a choice: BATT_CAPACITY may be wrong instead"
)
_LOST_P = LIMITS.add("probability that it costs the mission", 0.05, "", "0 of 2 flights at half and twice failed")
_AS_PER_MAH = 3.6


def find(flight: Flight) -> Iterator[Finding]:
    """What is wrong with how the current is measured."""
    wrong = wrong_current(flight)
    if wrong is not None:
        yield wrong


def wrong_current(flight: Flight) -> Finding | None:
    """The parameter by which the current says nothing, or another charge than the voltage does; None where it fits."""
    battery = next(iter(flight.batteries), None)
    if battery is None or "Curr" not in battery.table.columns or not flight.airborne:
        return None
    table = battery.table.where(np.isfinite(battery.table["Curr"]))
    return _no_sensor(flight, table) or _wrong_scale(flight, battery, table)


def _no_sensor(flight: Flight, table: Table) -> Finding | None:
    pin = flight.default_left("BATT_CURR_PIN")
    flying = during(flight.airborne, table.t)
    standing = table.t < flight.armed[0][0]
    if pin is None or flying.sum() < _FEWEST or not standing.any():
        return None
    more = float(known_median(table["Curr"][flying])) - float(known_median(table["Curr"][standing]))
    if abs(more) > _ANSWERS_A:
        return None
    return _finding(
        flight, "BATT_CURR_PIN", pin, "the battery's current does not answer to the motors",
        f"flying takes {more:.2f} A more than standing (limit {_ANSWERS_A:g}) with "
        f"BATT_CURR_PIN={shown(flight.setting('BATT_CURR_PIN'))} (default {shown(pin)})",
        "BAT.Curr in flight and before arming", _SURE_P,
    )  # fmt: skip


def _wrong_scale(flight: Flight, battery: Battery, table: Table) -> Finding | None:
    default, scale = flight.default_left("BATT_AMP_PERVLT"), flight.setting("BATT_AMP_PERVLT", "BATT_AMP_PERVOLT")
    capacity, rested = flight.setting("BATT_CAPACITY"), _used_by_voltage(flight, battery)
    if not default or not scale or not capacity or rested is None:
        return None
    until_s, used = rested
    current, t = table["Curr"][table.t <= until_s], table.t[table.t <= until_s]
    drawn = float(np.sum((current[1:] + current[:-1]) / 2 * np.diff(t))) / _AS_PER_MAH
    times = drawn / capacity / used
    if _LEAST <= times <= _MOST or not _FITS[0] <= times * default / scale <= _FITS[1]:
        return None
    return _finding(
        flight, "BATT_AMP_PERVLT", default, "the battery's current is measured at a wrong scale",
        f"{drawn:.0f} mAh is {100 * drawn / capacity:.0f}% of BATT_CAPACITY {capacity:g}, and the voltage at rest "
        f"says that {100 * used:.0f}% were used (limits {_LEAST:g} and {_MOST:g} times that), with BATT_AMP_PERVLT="
        f"{scale:.4g} (default {default:.4g}, at which it would be {100 * drawn / capacity * default / scale:.0f}%)",
        "BAT.Curr over the flight against BAT.Volt before and after it", _LIKELY_P,
    )  # fmt: skip


def _used_by_voltage(flight: Flight, battery: Battery) -> tuple[float, float] | None:
    """When the pack rests most after the last landing, and which share of its charge is then gone; None where it was
    not full before, or too little is gone to tell."""
    table, landed_s = battery.table, flight.airborne[-1][1]
    landed = table.where(table.t > landed_s)
    if battery.rest_v is None or battery.rest_v / battery.cells < _FULL or len(landed) < _LANDED:
        return None
    row = int(np.argmax(landed["Volt"]))
    used = 1.0 - charge_left(float(landed["Volt"][row]) / battery.cells)
    return (float(landed.t[row]), used) if used >= _USED else None


def _finding(
    flight: Flight, parameter: str, wanted: float, title: str, evidence: str, source: str, probability: float
) -> Finding:
    return Finding(
        kind="battery",
        title=title,
        onset_s=0.0,
        end_s=flight.end_s,
        severity="warning",
        evidence=evidence,
        source=source,
        suspect="parameter",
        probability=probability,
        mission_lost=_LOST_P,
        parameters=(parameter,),
        wanted=((parameter, wanted),),
    )


CHECK = Check(
    "charge settings", "a current that is measured wrongly, by the motors and the voltage", READS, LIMITS, find
)
