"""How the battery is measured, and which threshold of its failsafe acted.

A pack at rest is full at 4.2 V a cell. A reading that no pack of that many cells gives, and that the default of
BATT_VOLT_MULT or BATT_VOLT_PIN makes that of a full one, is how it is measured and not how it was charged. Which
threshold of the failsafe acted the firmware says itself: "Battery 1 is low 11.83V used 101 mAh" (AP_BattMonitor).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.ardupilot.battery import Battery
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import BATTERY_FAILSAFE, Finding
from care_core.ecosystems.lithium import CHARGED_V, CRITICAL_V, FULL_V, HIGHEST_V, LOW_V, NO_CELL_V, NOT_FULL_V, RUNS_V
from care_core.logs.base import Table, Wanted
from care_core.numbers import known_median
from care_core.records import Record
from care_core.run import shown
from care_core.text import log_time

READS: Wanted = {"BAT": ("Volt", "Curr")}

LIMITS = Limits()
_LOW_CELL = "cells of lithium polymer packs"
_NOT_FULL = LIMITS.add("cell at rest that a pack may have and not be full", NOT_FULL_V, "V", _LOW_CELL)
_FULL = LIMITS.add("cell of a pack that was charged", CHARGED_V, "V", _LOW_CELL)
_MOST = LIMITS.add("highest cell", HIGHEST_V, "V", _LOW_CELL)
_NO_CELL = LIMITS.add("cell that no pack has", NO_CELL_V, "V", "lithium polymer cells of high voltage: 4.35 V")
_NO_PACK = LIMITS.add("cell at rest that no vehicle flies on", 2.5, "V", "lithium polymer cells are ruined below 3 V")
_AT_REST_A = LIMITS.add("current before arming", 3.0, "A", "a choice: boards, radios and cameras draw less")
_NONE_A = LIMITS.add(
    "current before arming that is none", 1.0, "A", "a choice: a board draws less, and sensors are off by less"
)
_ADVISED = {
    "low": LIMITS.add("usual low level of a cell", 3.55, "V", "ArduPilot, Battery Failsafe: 3.5 V, set to a tenth"),
    "critical": LIMITS.add("usual critical level of a cell", 3.4, "V", "ArduPilot, Battery Failsafe: 3.3 V"),
}
_LEFT = LIMITS.add("cell under load that holds much charge", LOW_V, "V", "ArduPilot, Battery Failsafe: low at 3.5 V")
_MOST_USED = LIMITS.add("share of the capacity used by then", 0.6, "", "a choice: a fifth is a usual reserve")
_SLACK = LIMITS.add("charge that a threshold is met by", 0.03, "", "a choice: records are rounded")
_SURE_P = LIMITS.add("probability of a wrong scale", 0.95, "", "no pack reads so, and one at the default scale does")
_ACTED_P = LIMITS.add(
    "probability of the threshold that acted", 0.9, "", "the firmware's own word, and a pack that was well"
)
LOW_VOLT = ("BATT_LOW_VOLT", "FS_BATT_VOLTAGE", "LOW_VOLT")
"""What the voltage of the low level was called."""
DRIVES_V = LIMITS.add("voltage that drives a vehicle", RUNS_V, "V", "one full cell")
_USUAL = {"low": LOW_V, "critical": CRITICAL_V}
_SAID_WITHIN_S = 1.0
_BY_VOLTAGE, _BY_CHARGE = ("BATT_LOW_VOLT", "BATT_CRT_VOLT"), ("BATT_LOW_MAH", "BATT_CRT_MAH")
"""The thresholds of the failsafe that rest on a measured voltage, and on a measured current."""
_WELL_ABOVE_V = LIMITS.add(
    "volts a cell above the level that is advised, from which it surely acted early",
    0.2,
    "V",
    "a choice: at 3.7 V a cell half of a full pack is left, and a weak or long flight passes what lies just above 3.5",
)
_SAID = re.compile(r"Battery 1 is (low|critical) ([\d.]+)\s?V used ([\d.]+) ?mAh", re.IGNORECASE)


class Acted(Record):
    """A threshold of the battery failsafe that acted."""

    time_s: float
    parameter: str
    evidence: str
    probability: float


def find(flight: Flight) -> Iterator[Finding]:
    """What is wrong with how the battery is measured, or with the threshold that ended the flight."""
    scale = wrong_scale(flight)
    if scale is not None:
        yield scale
    yield from filter(None, (not_measured(flight), wrong_current(flight)))
    acted = None if scale is not None else early_failsafe(flight)
    if acted is not None:
        yield Finding(
            kind="battery",
            title=BATTERY_FAILSAFE,
            onset_s=acted.time_s,
            end_s=flight.end_s,
            severity="critical",
            evidence=acted.evidence,
            source="MSG of the battery failsafe; BAT",
            suspect="parameter",
            probability=acted.probability,
            parameters=(acted.parameter,),
        )


def wrong_scale(flight: Flight) -> Finding | None:
    """The parameter by which the voltage reads what no pack of the vehicle gives; None where it reads rightly."""
    table = _first(flight)
    rest = None if table is None else _at_rest(flight, table, "Volt")
    cells = _cells(flight)
    if rest is None or cells is None:
        return None
    default, scale = flight.default_left("BATT_VOLT_MULT"), flight.setting("BATT_VOLT_MULT")
    at_default = rest * default / scale if default and scale else 0.0
    if scale and default and _FULL <= at_default / cells <= _MOST and not _NOT_FULL <= rest / cells <= _NO_CELL:
        wanted = _near(scale * FULL_V * cells / rest, default)
        return _scale_finding(
            flight, "BATT_VOLT_MULT", wanted, rest,
            f"{rest:.1f} V at rest, {rest / cells:.2f} V for each of {cells} cells, with "
            f"BATT_VOLT_MULT={scale:.4g} (default {default:.4g}, which would read {at_default:.1f} V: a full pack)",
        )  # fmt: skip
    pin = flight.default_left("BATT_VOLT_PIN")
    if pin is not None and rest / cells < _NO_PACK and flight.throttle is not None and flight.armed:
        return _scale_finding(
            flight, "BATT_VOLT_PIN", pin, rest,
            f"{rest:.1f} V at rest, and the motors turned: nothing of the battery is on "
            f"BATT_VOLT_PIN={shown(flight.setting('BATT_VOLT_PIN'))} (default {shown(pin)})",
        )  # fmt: skip
    return None


def _scale_finding(flight: Flight, parameter: str, wanted: float, rest: float, evidence: str) -> Finding:
    failsafe = flight.battery_failsafe_s
    harmed = failsafe is not None or flight.was_refused
    return Finding(
        kind="battery",
        title="the battery's voltage is measured wrongly",
        onset_s=0.0,
        end_s=flight.end_s,
        severity="critical" if harmed else "warning",
        evidence=evidence + (f"; battery failsafe at {log_time(failsafe)}" if failsafe is not None else ""),
        source="BAT.Volt before take-off; voltages of lithium polymer cells",
        suspect="parameter",
        probability=_SURE_P,
        mission_lost=None if harmed else 0.05,
        parameters=(parameter,),
        wanted=((parameter, wanted),),
    )


def not_measured(flight: Flight) -> Finding | None:
    """A monitor that measures no voltage or no current, and is not the one that was to: wrong where a failsafe rests on
    it. None where both are measured."""
    default = flight.default_left("BATT_MONITOR")
    if not default or not flight.watched:
        return None
    table = _first(flight)
    lacking = next((field for field in ("Volt", "Curr") if table is None or not _says(table, field)), None)
    if lacking is None:
        return None
    what, thresholds = ("voltage", _BY_VOLTAGE) if lacking == "Volt" else ("current", _BY_CHARGE)
    rests = next((name for name in thresholds if (flight.setting(name) or 0.0) > 0.0), "")
    refused = flight.refused_for("battery") is not None
    value = shown(flight.setting("BATT_MONITOR"))
    return Finding(
        kind="battery",
        title=f"the battery's {what} is not measured",
        onset_s=0.0,
        end_s=flight.end_s,
        severity="critical" if refused else "warning" if rests else "info",
        evidence=f"no {what} is recorded with BATT_MONITOR={value} (default {shown(default)})"
        + (f", and {rests} rests on it" if rests else ""),
        source="BAT; BATT_MONITOR",
        suspect="parameter",
        probability=_SURE_P,
        parameters=("BATT_MONITOR",),
        wanted=(("BATT_MONITOR", default),),
    )


def _says(table: Table, field: str) -> bool:
    values = table[field] if field in table.columns else np.empty(0)
    return bool(np.isfinite(values).any()) and (field != "Volt" or bool(np.nanmax(values) > DRIVES_V))


def wrong_current(flight: Flight) -> Finding | None:
    """A current that flows before the motors turn, and would not at the default of its offset; None where none does."""
    table = _first(flight)
    rest = None if table is None or "Curr" not in table.columns else _at_rest(flight, table, "Curr")
    default, offset = flight.default_left("BATT_AMP_OFFSET"), flight.setting("BATT_AMP_OFFSET")
    scale = flight.setting("BATT_AMP_PERVLT", "BATT_AMP_PERVOLT")
    if rest is None or default is None or offset is None or not scale or abs(rest) < _AT_REST_A:
        return None
    if abs(rest + (offset - default) * scale) > _NONE_A:
        return None
    wanted = _near(offset + rest / scale, default)
    return Finding(
        kind="battery",
        title="the battery's current is measured wrongly",
        onset_s=0.0,
        end_s=flight.end_s,
        severity="warning",
        evidence=(
            f"{rest:.1f} A before the motors turn (limit {_AT_REST_A:g}) with BATT_AMP_OFFSET={offset:.4g} "
            f"(default {default:.4g}, at which it would be 0 A)"
        ),
        source="BAT.Curr before arming",
        suspect="parameter",
        probability=_SURE_P,
        parameters=("BATT_AMP_OFFSET",),
        wanted=(("BATT_AMP_OFFSET", wanted),),
    )


def early_failsafe(flight: Flight) -> Acted | None:
    """The threshold that acted while the pack was well: by the charge drawn, or above the voltage that is usual."""
    failsafe, battery = flight.battery_failsafe_s, next(iter(flight.batteries), None)
    if failsafe is None or battery is None or not len(battery.table):
        return None
    texts = (_SAID.search(text) for t, text in flight.messages if abs(t - failsafe) < _SAID_WITHIN_S)
    said = next((match for match in texts if match), None)
    level = "low" if said is None else said[1].casefold()
    volts = float(np.interp(failsafe, battery.table.t, battery.table["Volt"])) if said is None else float(said[2])
    if volts < DRIVES_V:
        return None
    by_charge = None if said is None else _by_charge(flight, level, volts, float(said[3]), battery)
    acted = by_charge or _by_voltage(flight, level, volts, battery)
    return None if acted is None else Acted(failsafe, *acted)


def _by_charge(
    flight: Flight, level: str, volts: float, used: float, battery: Battery
) -> tuple[str, str, float] | None:
    name = _BY_CHARGE[level == "critical"]
    reserve, capacity = flight.setting(name) or 0.0, flight.setting("BATT_CAPACITY") or 0.0
    if reserve <= 0 or capacity <= 0 or used < (1 - _SLACK) * (capacity - reserve):
        return None
    if used > _MOST_USED * capacity or volts / battery.cells < _LEFT:
        return None
    evidence = (
        f"{name}={reserve:g}{_default(flight, name)} acted with {used:.0f} of {capacity:.0f} mAh used, while the pack "
        f"still held {volts:.1f} V, {volts / battery.cells:.2f} V for each of {battery.cells} cells"
    )
    return name, evidence, _ACTED_P


def _by_voltage(flight: Flight, level: str, volts: float, battery: Battery) -> tuple[str, str, float] | None:
    name = _BY_VOLTAGE[level == "critical"]
    limit = flight.setting(*(LOW_VOLT if level == "low" else (name,))) or 0.0
    rest = battery.rest_v
    is_full = rest is None or rest / battery.cells >= _FULL
    if not is_full or limit / battery.cells <= _ADVISED[level]:
        return None
    evidence = (
        f"failsafe at {volts:.1f} V, {volts / battery.cells:.2f} V for each of {battery.cells} cells, of a pack that "
        f"was full; {name}={limit:g}{_default(flight, name)} asks for it at {limit / battery.cells:.2f} V a cell, "
        f"{_USUAL[level]} is usual"
    )
    return name, evidence, _ACTED_P * min(1.0, (limit / battery.cells - _ADVISED[level]) / _WELL_ABOVE_V)


def _default(flight: Flight, name: str) -> str:
    default = flight.default_left(name)
    return "" if default is None else f" (default {default:g})"


def _near(value: float, default: float) -> float:
    """A measured value, or the default where it is that within what the measurement can tell."""
    return default if math.isclose(value, default, rel_tol=0.02, abs_tol=0.02) else float(f"{value:.4g}")


def _first(flight: Flight) -> Table | None:
    return flight.one("BAT", "Volt")


def _at_rest(flight: Flight, table: Table, field: str) -> float | None:
    """What was measured before the first arming; None where nothing was."""
    until = flight.armed[0][0] if flight.armed else flight.end_s
    before = table[field][table.t <= until]
    value = known_median(before) if len(before) >= 2 else math.nan
    return value if math.isfinite(value) else None


def _cells(flight: Flight) -> int | None:
    """How many cells the parameters say that the pack has; of two that say two things the one that nobody changed. None
    where they say nothing, or as much."""
    asked = ((("MOT_BAT_VOLT_MAX", "Q_M_BAT_VOLT_MAX"), FULL_V), (LOW_VOLT, LOW_V))
    said = {names: round(volts / cell) for names, cell in asked if (volts := flight.setting(*names))}
    if len(set(said.values())) > 1:
        said = {names: cells for names, cells in said.items() if not any(map(flight.default_left, names))}
    return next(iter(said.values())) if len(set(said.values())) == 1 else None


CHECK = Check(
    "supply settings",
    "a battery that is measured wrongly, or a threshold of its failsafe that acted early",
    READS,
    LIMITS,
    find,
)
