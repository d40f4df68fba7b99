"""What an ArduPilot vehicle drew from its batteries, and their voltage."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.ardupilot.checks.settings import charge, supply
from care_core.ecosystems.ardupilot.flight import as_flight
from care_core.ecosystems.ardupilot.instances import split
from care_core.ecosystems.ardupilot.measures.flown_mission import NEEDS
from care_core.ecosystems.ardupilot.measures.modes import is_armed
from care_core.ecosystems.ardupilot.measures.phases import PHASE_ARGS, span_of_phase
from care_core.ecosystems.ardupilot.measures.samples import samples, whole
from care_core.ecosystems.ardupilot.measures.series import MIN_ROWS, series
from care_core.ecosystems.coverage import EXTREME, SUM, Bears, Samples
from care_core.ecosystems.measures import Args, Mission, RestsOn, extractor, has, missing
from care_core.ecosystems.plausible import is_alive
from care_core.ecosystems.statistic import statistic
from care_core.ecosystems.vehicles.arming import NEVER_ARMED
from care_core.logs.base import Table, Wanted, merge_needs
from care_core.run import Unavailable, Value, is_known, shown

_BATTERY: Wanted = {"BAT": ("Inst", "Instance", "Volt", "Curr", "EnrgTot")}
_LEAST_V = 2.0
"""A lithium cell is empty above it."""
_LEAST_W, _MOST_W = 1.0, 1e5
"""Mean power while armed: an autopilot and its receivers alone take more than a watt, air taxis up to 100 kW."""
_AGREE, _ENOUGH_FOR_DOUBT = 2.0, 20
"""By what factor the monitor's counter and voltage times current may differ; thinned logs miss peaks, not half."""
_NO_VOLTAGE = Unavailable(
    "BAT says the same voltage throughout, or none", "is BATT_MONITOR one that measures voltage?", never_varied=True
)


def _throughout(bears: Bears) -> RestsOn:
    """The battery from arming to disarming, or in a phase."""

    def rests_on(mission: Mission, args: Args) -> Iterator[Samples]:
        span = span_of_phase(mission, args) if "phase" in args else whole(mission)
        spans = [] if isinstance(span, Unavailable) else [span]
        yield samples(mission, "BAT", ("Volt",), spans, bears)
        table = mission.tables.get("BAT")
        for other in () if table is None else split("BAT", table)[1:]:
            if has(other, "Volt") and _has_voltage(other):  # what measures nothing is no battery
                yield samples(mission, "BAT", ("Volt",), spans, bears, one=other)

    return rests_on


def _at_start(mission: Mission, args: Args) -> Iterator[Samples]:
    yield samples(mission, "BAT", ("Volt",), (), SUM, [mission.start_s])


@extractor("energy_used", needs=merge_needs((NEEDS, _BATTERY)), unit="Wh", args=PHASE_ARGS, rests_on=_throughout(SUM))
def energy_used(mission: Mission, args: Args) -> Value:
    """Energy drawn between arming and disarming, or in a part of it: the monitor's counter, else voltage times current
    over time."""
    if not is_armed(mission):
        return NEVER_ARMED
    span = span_of_phase(mission, args) if "phase" in args else (mission.start_s, mission.end_s)
    if isinstance(span, Unavailable):
        return span
    if wrong := mission.shared(_measured_wrongly):
        return wrong
    table = mission.tables.get("BAT")
    if table is None or not len(table):
        return missing("BAT")
    batteries = [battery for battery in split("BAT", table) if not has(battery, "Volt") or _has_voltage(battery)]
    if not batteries:
        return _NO_VOLTAGE
    used = [_energy(battery, *span) for battery in batteries]
    known = [value for value in used if isinstance(value, float)]
    if known:
        return _unless_absurd(sum(known), mission.end_s - mission.start_s) if "phase" not in args else sum(known)
    if not has(table, "EnrgTot") and not has(table, "Volt", "Curr"):
        return missing("BAT energy, or voltage with current")
    doubt = next((value for value in used if isinstance(value, Unavailable)), None)
    return doubt or Unavailable(
        "BAT says the same current throughout, or none", "is BATT_MONITOR one that measures current?"
    )


def _measured_wrongly(mission: Mission) -> Unavailable | None:
    """Why no energy follows from how the battery is measured: without a current, or with one that is off."""
    flight = as_flight(mission.model)
    wrong = supply.not_measured(flight) or supply.wrong_current(flight) or charge.wrong_current(flight)
    if wrong is None:
        return None
    back = " and ".join(f"put {name} back to {shown(value)}" for name, value in wrong.wanted)
    return Unavailable(f"{wrong.title}: {wrong.evidence}", back)


def _energy(battery: Table, start_s: float, end_s: float) -> float | Unavailable | None:
    """Wh of one battery between two times, None where its monitor counts and measures nothing."""
    inside = battery.between(start_s, end_s)
    measured, drawn = _known(inside, "Volt", "Curr"), None
    if len(measured) >= MIN_ROWS and is_alive(measured["Curr"]) and measured["Curr"].any():
        power = measured["Volt"] * measured["Curr"]
        drawn = float(np.sum((power[1:] + power[:-1]) / 2 * np.diff(measured.t)) / 3600)
    counted = _known(inside, "EnrgTot")
    if not len(counted) or np.ptp(counted["EnrgTot"]) <= 0 or (np.diff(counted["EnrgTot"]) < 0).any():
        return drawn
    whole = _known(battery, "EnrgTot")
    start, end = np.interp((start_s, end_s), whole.t, whole["EnrgTot"])
    used = float(end - start)
    if drawn is not None and len(measured) >= _ENOUGH_FOR_DOUBT and not 1 / _AGREE < used / max(drawn, 1e-9) < _AGREE:
        return Unavailable(
            f"BAT counts {used:.3g} Wh, but its voltage times current over time makes {drawn:.3g} Wh",
            "is the scale of the current sensor right, and the log's clock?",
        )
    return used


def _unless_absurd(used: float, time_s: float) -> Value:
    """The energy, unless no vehicle runs on so little or so much."""
    power_w = used * 3600 / time_s if time_s > 0 else math.inf
    if _LEAST_W <= power_w <= _MOST_W:
        return used
    return Unavailable(
        f"BAT says {power_w:.3g} W on average, on which no vehicle runs", "is the scale of the current sensor right?"
    )


def _has_voltage(battery: Table) -> bool:
    """Whether what is called the voltage of a battery is measured: it moves, and no cell is empty at less than 2 V."""
    volts = battery["Volt"][np.isfinite(battery["Volt"])]
    return is_alive(volts) and float(volts.max()) >= _LEAST_V


def _known(table: Table, *fields: str) -> Table:
    """The rows in which all of the fields are numbers; none where the table lacks one."""
    if not has(table, *fields):
        return table.where(slice(0))
    return table.where(np.logical_and.reduce([np.isfinite(table[field]) for field in fields]))


@extractor("min_voltage", needs=merge_needs((NEEDS, _BATTERY)), unit="V", rests_on=_throughout(EXTREME))
def min_voltage(mission: Mission, args: Args) -> Value:
    """The lowest battery voltage between arming and disarming."""
    if not is_armed(mission):
        return NEVER_ARMED
    table = mission.tables.get("BAT")
    if table is not None and has(table, "Volt") and not _has_voltage(next(iter(split("BAT", table)), table)):
        return _NO_VOLTAGE
    volts = series(mission, "BAT", ("Volt",), {}, under_way=False)
    return volts if isinstance(volts, Unavailable) else statistic(volts["Volt"], "min")


@extractor("start_voltage", needs=merge_needs((NEEDS, _BATTERY)), unit="V", rests_on=_at_start)
def start_voltage(mission: Mission, args: Args) -> Value:
    """Battery voltage in the last second before the motors were armed."""
    table = mission.tables.get("BAT")
    if table is None or not has(table, "Volt"):
        return missing("BAT")
    battery = next(iter(split("BAT", table)), table)
    if is_armed(mission) and not _has_voltage(battery):  # no motor, no change
        return _NO_VOLTAGE
    before = battery.between(-math.inf, mission.start_s)
    return float(before["Volt"][-1]) if len(before) else Unavailable("no BAT before arming", "log while disarmed")


@extractor(
    "voltage_margin", needs=merge_needs((NEEDS, _BATTERY)), unit="V", args={"parameter": "the low voltage failsafe"}
)
def voltage_margin(mission: Mission, args: Args) -> Value:
    """How far the lowest voltage of the flight stayed above the low voltage failsafe; below 0 it was crossed."""
    lowest = min_voltage(mission, {})
    name = str(args.get("parameter", "BATT_LOW_VOLT"))
    bound = mission.settings.get(name)
    if not is_known(lowest):
        return lowest
    return lowest - float(bound) if isinstance(bound, (int, float)) else Unavailable(f"no parameter {name} in the log")
