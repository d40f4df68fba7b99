"""Battery, satellites and radio in brief: how a flight began with them, and at what they were lowest."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.ardupilot.battery import Battery
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.findings import Event
from care_core.ecosystems.spans import Span
from care_core.logs.base import Table

_DEAD_V = 1.0
_SAGS, _WEAK = 0.9, 0.3
_FIXES = {0: "no GPS", 1: "no fix", 2: "2D fix", 3: "3D fix", 4: "3D fix, DGPS", 5: "3D fix, RTK float",
          6: "3D fix, RTK fixed"}  # fmt: skip
_3D = 3
_NO_HDOP = 50.0
"""Receivers without a fix say 99.99 or 655.35."""


def supply_events(flight: Flight) -> Iterator[Event]:
    """Moments about supplies: at each first arming, and the worst while armed."""
    for battery in flight.batteries:
        yield from _battery(flight, battery)
    satellites = flight.one("GPS", "Status")
    if satellites is not None:
        yield from _gps(flight, satellites)
    strength = flight.one("RSSI", "RXRSSI")
    if strength is not None and strength["RXRSSI"].max() > 0:
        worst = _worst(flight.armed, strength, "RXRSSI")
        if worst is not None and worst["RXRSSI"][0] < _WEAK * strength["RXRSSI"].max():
            text = f"radio at its weakest while armed: {worst['RXRSSI'][0] / strength['RXRSSI'].max():.0%} of its best"
            yield Event(float(worst.t[0]), "radio", text, "RSSI")


def _battery(flight: Flight, battery: Battery) -> Iterator[Event]:
    table, name = battery.table, battery.name
    if not len(table) or table["Volt"].max() < _DEAD_V:
        return
    pack = f" ({battery.cells} cells)" if battery.are_cells_known and battery.cells > 1 else ""
    yield Event(battery.start_s, "battery", f"{name} at {battery.start_v:.1f} V{pack}", "BAT")
    worst = _worst(flight.armed, table, "Volt")
    if worst is None or worst["Volt"][0] > _SAGS * battery.start_v:
        return
    amps = f" at {worst['Curr'][0]:.0f} A" if "Curr" in worst.columns and worst["Curr"][0] > 0.5 else ""
    text = f"{name} at its lowest while armed: {worst['Volt'][0]:.1f} V{amps}"
    yield Event(float(worst.t[0]), "battery", text, "BAT")


def _gps(flight: Flight, table: Table) -> Iterator[Event]:
    sane = table.where(np.isfinite(table["Status"]) & np.isfinite(table.t))
    if not len(sane):
        return
    at, before = _at_start(flight, sane)
    yield Event(at, "gps", _fix_words(before, len(before) - 1), "GPS")
    if not flight.armed or before["Status"][-1] < _3D:
        return
    armed = [sane.between(*span) for span in flight.armed]
    lost = [float(part.t[part["Status"] < _3D][0]) for part in armed if len(part) and (part["Status"] < _3D).any()]
    if lost:
        yield Event(lost[0], "gps", "GPS lost its 3D fix while armed", "GPS")
    worst = _worst(flight.armed, sane, "NSats")
    if worst is not None and worst["NSats"][0] < _few(before):
        yield Event(float(worst.t[0]), "gps", f"fewest satellites while armed: {worst['NSats'][0]:.0f}", "GPS")


def _few(before: Table) -> float:
    """Satellites below which a loss is worth a line: two thirds of those at the start."""
    return float(before["NSats"][-1]) * 2 / 3 if "NSats" in before.columns else 0.0


def _fix_words(table: Table, row: int) -> str:
    fix = _FIXES.get(int(table["Status"][row]), "3D fix")
    parts = [fix if fix == "no GPS" else f"GPS: {fix}"]
    if "NSats" in table.columns:
        parts.append(f"{table['NSats'][row]:.0f} satellites")
    if "HDop" in table.columns and 0 < table["HDop"][row] < _NO_HDOP:
        parts.append(f"HDop {table['HDop'][row]:.1f}")
    return ", ".join(parts)


def _at_start(flight: Flight, table: Table) -> tuple[float, Table]:
    """The time of the first arming, or the first row's, and the rows up to then."""
    start = flight.armed[0][0] if flight.armed else float(table.t[0])
    before = table.between(-np.inf, start)
    return (start, before) if len(before) else (float(table.t[0]), table.where(slice(0, 1)))


def _worst(spans: tuple[Span, ...], table: Table, field: str) -> Table | None:
    """The row with the lowest value of a field while armed, as a table of one."""
    if field not in table.columns:
        return None
    parts = [part for span in spans if len(part := table.between(*span))]
    if not parts:
        return None
    part = min(parts, key=lambda one: float(np.nanmin(one[field])))
    row = int(np.nanargmin(part[field]))
    return part.where(slice(row, row + 1))
