"""The battery: not charged, sagging under its load, a failsafe, a dark board, a monitor that cannot be true.

Limits a cell of a lithium polymer pack: full 4.2 V, resting below 3.9 V it is far from full, 3.5 V is the low and 3.3 V
the critical level that ArduPilot's failsafe page advises for BATT_LOW_VOLT and BATT_CRT_VOLT, 3.0 V harms it.
The board needs 4.3 V at least (ArduPilot, Power module and brown-outs: Vcc 5 V, at least 4.3 V, swings below 0.15 V).
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.ardupilot.flight import Flight, Mask
from care_core.ecosystems.ardupilot.measure import Calibration, lasting, likely, smooth
from care_core.ecosystems.ardupilot.messages import Floats
from care_core.ecosystems.findings import Finding, Severity
from care_core.logs.base import Table, Wanted
from care_core.numbers import known_median, median, quantile

READS: Wanted = {"BAT": ("Volt", "Curr"), "POWR": ("Vcc",)}

FULL, NOT_FULL, LOW, CRITICAL, RUINOUS = 4.2, 3.9, 3.5, 3.3, 3.0
"""Volts a cell."""
_FAILSAFE_BATT = 6
_LASTS_S = 2.0
_ALIVE_V, _HIGHEST_V = 4.0, 120.0
_BOARD_V = 4.3
_LEAST_FULL = 3.0
"""A pack whose best moment is below this a cell has fewer cells than the parameter says."""
_CALIBRATION: Calibration = ((0.001, 0.6), (0.05, 0.9), (0.1, 0.97))
"""By share of a cell's 3.9 V that is missing at rest; on the training table all flights that rest below 3.9 V a cell
have a drained pack (16 of 16), and no other does."""


def find(flight: Flight) -> Iterator[Finding]:
    """What is wrong with the supply."""
    for table in flight.all("BAT", "Volt")[:1]:
        yield from _monitor(flight, table)
        alive = table.where((table["Volt"] > _ALIVE_V) & (table["Volt"] < _HIGHEST_V))
        if len(alive) >= 3 and np.ptp(alive["Volt"]) > 0:
            yield from _pack(flight, alive)
    yield from _board(flight)


def cells_of(flight: Flight, highest_v: float) -> int:
    """How many cells in series: as the parameters for a full pack say, else the fewest that can give the voltage."""
    full = flight.setting("MOT_BAT_VOLT_MAX", "MOT_V_MAX", "Q_M_BAT_VOLT_MAX")
    fewest = max(math.ceil((highest_v - 0.3) / (FULL + 0.05)), 1)
    told = round(full / FULL) if full else 0
    return told if told >= fewest and highest_v / told >= _LEAST_FULL else fewest


def _pack(flight: Flight, table: Table) -> Iterator[Finding]:
    t, volts = table.t, table["Volt"]
    cells = cells_of(flight, quantile(volts, 0.99))
    rest = _at_rest(flight, t, volts)
    watched = flight.watch(t)
    failsafe = _failsafe(flight)
    lowest = smooth(t, volts, 2.0) / cells
    low = lasting(t, watched & (lowest < CRITICAL), _LASTS_S)
    deep = bool(lasting(t, watched & (lowest < RUINOUS), _LASTS_S))
    flown = float(np.min(lowest[watched])) if watched.any() else math.nan
    if rest is not None and rest / cells < NOT_FULL and flight.watched:
        missing = 1 - rest / cells / NOT_FULL
        severity: Severity = "critical" if failsafe is not None or low else "warning" if flight.armed else "info"
        begin = flight.watched[0][0]
        yield Finding(
            "battery", "the battery was not charged", begin, flight.watched[-1][1], severity,
            f"{rest:.1f} V at rest before take-off, {rest / cells:.2f} V for each of {cells} cells (full 4.2, limit "
            f"{NOT_FULL})" + _said(failsafe),
            "BAT.Volt before take-off; voltages of lithium polymer cells", probability=likely(missing, _CALIBRATION),
        )  # fmt: skip
    elif low:
        start, end = low[0]
        amps = _load(table, start, end)
        yield Finding(
            "battery", "the battery sags under its load", start, low[-1][1],
            "critical" if deep or failsafe is not None else "warning",
            f"down to {flown * cells:.1f} V, {flown:.2f} V for each of {cells} cells{amps}; {CRITICAL} V is the "
            f"critical level" + _said(failsafe),
            "BAT.Volt; 3.3 V a cell: ArduPilot, Battery Failsafe",
            probability=0.4 if deep else 0.25,
        )  # fmt: skip
    elif failsafe is not None:
        limit = flight.setting("BATT_LOW_VOLT", "FS_BATT_VOLTAGE", "LOW_VOLT") or 0.0
        at_v = float(np.interp(failsafe, t, volts))
        early = limit / cells > LOW + 0.05
        yield Finding(
            "battery", "battery failsafe", failsafe, flight.end_s, "critical",
            f"failsafe at {at_v:.1f} V, {at_v / cells:.2f} V for each of {cells} cells"
            + (f"; BATT_LOW_VOLT={limit:g} asks for it at {limit / cells:.2f} V a cell, 3.5 is usual" if early else ""),
            "ERR of the battery failsafe; BAT.Volt", suspect="parameter" if early else "operation",
            probability=0.1,
        )  # fmt: skip


def _at_rest(flight: Flight, t: Floats, volts: Floats) -> float | None:
    """The voltage before motors draw anything: until they lift, or all of a log that never flew."""
    until = flight.armed[0][0] + 1.0 if flight.armed else flight.end_s
    if (driven := flight.throttle) is not None:
        at, throttle = driven
        lifting = at[(throttle > 0.05) & flight.during(flight.armed, at)]
        until = float(lifting[0]) if len(lifting) else until
    before = volts[t <= until]
    return float(median(before[-50:])) if len(before) >= 2 else None


def _failsafe(flight: Flight) -> float | None:
    """When the firmware's battery failsafe began, in flight."""
    told = [t for t, code in flight.errors(_FAILSAFE_BATT) if code > 0]
    told += [t for t, text in flight.messages if "battery" in text.casefold() and "failsafe" in text.casefold()]
    inside = [t for t in told if any(start <= t <= end + 1 for start, end in flight.armed)]
    return min(inside, default=None)


def _said(failsafe: float | None) -> str:
    return "" if failsafe is None else f"; battery failsafe at {failsafe:.1f} s"


def _load(table: Table, start: float, end: float) -> str:
    if "Curr" not in table.columns:
        return ""
    part = table["Curr"][(table.t >= start) & (table.t <= end)]
    return f" at {median(part):.0f} A" if len(part) and median(part) > 0.5 else ""


def _monitor(flight: Flight, table: Table) -> Iterator[Finding]:
    """Numbers that no battery gives: a voltage that does not move while motors work, or none at all."""
    loaded = flight.during(flight.flown, table.t)
    if loaded.sum() < 20 or not flight.setting("BATT_MONITOR") or flight.is_simulated:
        return
    volts = table["Volt"][loaded]
    if not np.isfinite(volts).any():
        return
    known = volts[np.isfinite(volts)]
    amps = table["Curr"][loaded] if "Curr" in table.columns else np.empty(0)
    odd = ""
    if np.ptp(known) == 0:
        odd = f"the voltage stays at {known[0]:.2f} V in flight"
    elif float(median(known)) < _ALIVE_V:
        odd = f"{median(known):.2f} V drive no vehicle: nothing is connected to it, or its scale is wrong"
    elif len(amps) and np.isfinite(amps).any() and known_median(amps) < -0.5:
        odd = f"the current reads {known_median(amps):.1f} A"
    if odd:
        span = flight.flown[0][0], flight.flown[-1][1]
        yield Finding(
            "battery", "the battery monitor is not calibrated", *span, "info", odd, "BAT", suspect="parameter",
            probability=0.3,
        )  # fmt: skip


def _board(flight: Flight) -> Iterator[Finding]:
    """The supply of the autopilot itself."""
    table = flight.one("POWR", "Vcc")
    if table is None:
        return
    volts: Floats = np.where(table["Vcc"] > 100, table["Vcc"] / 1000, table["Vcc"])
    weak: Mask = (volts > 0.5) & (volts < _BOARD_V) & flight.watch(table.t)
    if weak.sum() < 2:
        return
    at = table.t[weak]
    yield Finding(
        "battery", "the autopilot's own supply dips", float(at[0]), float(at[-1]), "critical" if weak.sum() > 5 else
        "warning", f"Vcc down to {volts[weak].min():.2f} V (limit {_BOARD_V})",
        "POWR.Vcc; 4.3 V: ArduPilot, Diagnosing problems using logs", probability=0.7,
    )  # fmt: skip
