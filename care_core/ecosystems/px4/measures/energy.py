"""What a PX4 vehicle drew from its battery, and its voltage."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.coverage import EXTREME, SUM, USUAL, Bears, Samples
from care_core.ecosystems.measures import Args, Mission, RestsOn, extractor, has, missing
from care_core.ecosystems.plausible import is_alive
from care_core.ecosystems.px4.measures.flown import NEEDS, PHASE_ARGS, is_armed, span_of_phase
from care_core.ecosystems.px4.measures.requested import flight_of
from care_core.ecosystems.vehicles.arming import NEVER_ARMED
from care_core.logs.base import Table, Wanted, merge_needs
from care_core.numbers import median
from care_core.run import Unavailable, Value

BATTERY = "battery_status"
_READS: Wanted = merge_needs((NEEDS, {BATTERY: ("voltage_v", "current_a", "remaining", "connected")}))
_MIN_ROWS = 5
_LEAST_W, _MOST_W = 1.0, 1e5
"""Mean power while armed: an autopilot and its receivers alone take more than a watt, air taxis up to 100 kW."""
_LEAST_V = 2.0
"""A lithium cell is empty above it."""
_NO_CURRENT = Unavailable(
    "battery_status says the same current throughout, or none", "does the power module measure it?"
)


def _throughout(bears: Bears) -> RestsOn:
    """The battery from arming to disarming, or in a phase."""

    def rests_on(mission: Mission, args: Args) -> Iterator[Samples]:
        span = span_of_phase(mission, args) if "phase" in args else (mission.start_s, mission.end_s)
        table = mission.tables.get(BATTERY)
        t = np.empty(0) if table is None else table.t
        spans = [] if isinstance(span, Unavailable) else [span]
        yield Samples(f"the battery ({BATTERY})", t, spans, bears, dead=flight_of(mission).repeats(BATTERY))

    return rests_on


def _at_start(mission: Mission, args: Args) -> Iterator[Samples]:
    table = mission.tables.get(BATTERY)
    t = np.empty(0) if table is None else table.t
    yield Samples(f"the battery ({BATTERY})", t, (), SUM, [mission.start_s])


def _measured(mission: Mission, *fields: str) -> Table | Unavailable:
    """The rows of a battery that measures something."""
    table = mission.tables.get(BATTERY)
    if not has(table, *fields):
        return missing(BATTERY)
    known = table.where(np.logical_and.reduce([np.isfinite(table[field]) for field in fields]))
    if len(known) < _MIN_ROWS or not is_alive(known["voltage_v"]) or float(known["voltage_v"].max()) < _LEAST_V:
        return Unavailable(
            "battery_status says the same voltage throughout, or none", "is the power module set up?", never_varied=True
        )
    return known


@extractor("px4_energy_used", needs=_READS, unit="Wh", args=PHASE_ARGS, rests_on=_throughout(SUM))
def energy_used(mission: Mission, args: Args) -> Value:
    """Energy drawn between arming and disarming, or in a part of it: voltage times current over time."""
    if not is_armed(mission):
        return NEVER_ARMED
    span = span_of_phase(mission, args) if "phase" in args else (mission.start_s, mission.end_s)
    if isinstance(span, Unavailable):
        return span
    table = _measured(mission, "voltage_v", "current_a")
    if isinstance(table, Unavailable):
        return table
    inside = table.between(*span)
    if len(inside) < _MIN_ROWS or not is_alive(inside["current_a"]) or float(inside["current_a"].max()) <= 0:
        return _NO_CURRENT
    power = inside["voltage_v"] * inside["current_a"]
    used = float(np.sum((power[1:] + power[:-1]) / 2 * np.diff(inside.t)) / 3600)
    mean_w = used * 3600 / max(span[1] - span[0], 1e-9)
    if "phase" in args or _LEAST_W <= mean_w <= _MOST_W:
        return used
    return Unavailable(f"{mean_w:.3g} W on average, on which no vehicle runs", "is the current sensor's scale right?")


@extractor("px4_hover_power", needs=_READS, unit="W", rests_on=_throughout(USUAL))
def hover_power(mission: Mission, args: Args) -> Value:
    """Median electric power in flight: what the vehicle takes to stay up, with its load."""
    if not is_armed(mission):
        return NEVER_ARMED
    table = _measured(mission, "voltage_v", "current_a")
    if isinstance(table, Unavailable):
        return table
    inside = table.between(mission.start_s, mission.end_s)
    most = float(inside["current_a"].max()) if len(inside) else 0.0
    flown = inside.where(inside["current_a"] > 0.5 * most) if most > 0 else inside.where(slice(0, 0))
    return float(median(flown["voltage_v"] * flown["current_a"])) if len(flown) else _NO_CURRENT


@extractor("px4_min_voltage", needs=_READS, unit="V", rests_on=_throughout(EXTREME))
def min_voltage(mission: Mission, args: Args) -> Value:
    """The lowest battery voltage between arming and disarming."""
    if not is_armed(mission):
        return NEVER_ARMED
    table = _measured(mission, "voltage_v")
    if isinstance(table, Unavailable):
        return table
    inside = table.between(mission.start_s, mission.end_s)
    return float(inside["voltage_v"].min()) if len(inside) else missing(BATTERY)


@extractor("px4_start_voltage", needs=_READS, unit="V", rests_on=_at_start)
def start_voltage(mission: Mission, args: Args) -> Value:
    """Battery voltage just before the motors were armed."""
    table = _measured(mission, "voltage_v")
    if isinstance(table, Unavailable):
        return table
    before = table.between(-math.inf, mission.start_s)
    return (
        float(before["voltage_v"][-1])
        if len(before)
        else Unavailable(f"no {BATTERY} before arming", "set SDLOG_MODE to 1")
    )


@extractor("px4_least_charge", needs=_READS, unit="", rests_on=_throughout(EXTREME))
def least_charge(mission: Mission, args: Args) -> Value:
    """The least remaining charge that the firmware estimated between arming and disarming, 0 to 1."""
    if not is_armed(mission):
        return NEVER_ARMED
    table = mission.table(BATTERY)
    if not has(table, "remaining"):
        return missing(BATTERY)
    known = table["remaining"][np.isfinite(table["remaining"]) & (table["remaining"] >= 0)]
    return float(known.min()) if len(known) else missing(BATTERY)
