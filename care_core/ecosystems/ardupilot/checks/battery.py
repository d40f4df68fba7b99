"""The battery: not charged, sagging under its load, a failsafe, a dark board, a monitor that cannot be true.

Limits a cell of a lithium polymer pack: full 4.2 V, resting below 3.9 V it is far from full, 3.5 V is the low and 3.3 V
the critical level that ArduPilot's failsafe page advises for BATT_LOW_VOLT and BATT_CRT_VOLT, 3.0 V harms it.
The board needs 4.3 V at least (ArduPilot, Power module and brown-outs: Vcc 5 V, at least 4.3 V, swings below 0.15 V).
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.ardupilot import sources
from care_core.ecosystems.ardupilot.battery import Battery, within_reason
from care_core.ecosystems.ardupilot.checks.settings import supply
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.statistics import calibrated, calibrated_probability, lasting, smooth
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import (
    BATTERY_FAILSAFE,
    LOW_SUPPLY,
    MONITOR_SILENT,
    NO_BATTERY,
    OWN_SUPPLY,
    SAGS,
    UNCHARGED,
    Finding,
    Severity,
)
from care_core.ecosystems.lithium import CHARGED_V, CRITICAL_V, FULL_V, HARMED_V, LOW_V, NOT_FULL_V
from care_core.ecosystems.spans import Span, during
from care_core.logs.base import Table, Wanted
from care_core.numbers import Bools, Floats, known_median, median
from care_core.text import log_time

_MISSING = re.compile(r"Battery (?P<number>\d+) is missing", re.IGNORECASE)
_ACTED = re.compile(r"Battery Failsafe", re.IGNORECASE)
READS: Wanted = {"BAT": ("Volt", "Curr"), "POWR": ("Vcc",)}

LIMITS = Limits()
_CELLS = "voltages of lithium polymer cells"
_ADVICE = "ArduPilot, Battery Failsafe"
NOT_FULL = LIMITS.add("cell at rest, charged", NOT_FULL_V, "V", _CELLS)
FULL = LIMITS.add("cell at rest, full", CHARGED_V, "V", _CELLS)
LOW = LIMITS.add("usual low level of a cell", LOW_V, "V", _ADVICE)
CRITICAL = LIMITS.add("critical level of a cell", CRITICAL_V, "V", _ADVICE)
RUINOUS = LIMITS.add("level that harms a cell", HARMED_V, "V", _CELLS)
_ACTS_S = LIMITS.add("time in which a failsafe acts", 2.0, "s", "a choice: it acts at once, telemetry is late")
_LASTS_S = LIMITS.add("shortest sag", 2.0, "s", "a choice: a burst of throttle is over sooner")
_EARLY_V = LIMITS.add("failsafe above the usual low level by", 0.05, "V", "a choice: voltages are set to a tenth")
_DRAWS_A = LIMITS.add("current that is drawn", 0.5, "A", "a choice: monitors are off by less")
_BOARD_V = LIMITS.add("supply of the board", 4.3, "V", "ArduPilot, Power module and brown-outs")
_BOARD_LEAST_V = LIMITS.add("supply that is measured", 0.5, "V", "a choice: below it nothing measures")
_DIP_V = LIMITS.add("depth of a dip", 0.2, "V", "a choice: a weak but steady supply lets it fly")
_DIPS = LIMITS.add("records of a critical dip", 5, "", "a choice: one or two may be noise")
_CALIBRATION = calibrated(
    LIMITS,
    ((0.001, 0.6), (0.05, 0.9), (0.1, 0.97)),
    "by the share of 3.9 V that is missing: all 16 training flights that rest below it have a drained pack, no other",
    "missing",
)
_HELD_P = LIMITS.add(
    "probability that a pack that held loses a mission", 0.05, "", "none below 3.9 V and above 3.3 did"
)
_SOON_S = LIMITS.add("flight after which a charged pack is still strong", 60.0, "s", "a choice: packs last for minutes")
_WEAK_P = LIMITS.add("probability of a charged pack that sags deep so soon", 0.9, "", "a choice: worn, or too small")
_GONE_V = LIMITS.add("drop of a cell at rest since the first run", 0.1, "V", "a choice: it has been flown since")
_DEEP_P = LIMITS.add("probability of a pack that sags deep", 0.4, "", "a choice: a weak pack, or a full throttle")
_SAGS_P = LIMITS.add("probability of a pack that sags", 0.25, "", "a choice: most packs do at the end of a flight")
_FAILSAFE_P = LIMITS.add("probability of a bad pack, failsafe alone", 0.1, "", "a choice: mostly a flight too long")
_NOTHING_P = LIMITS.add("probability of a monitor that measures nothing", 0.95, "", "the vehicle flew on")
_SILENT_P = LIMITS.add("probability of a monitor that fell silent", 0.95, "", "the firmware's own word")
_MONITOR_P = LIMITS.add("probability of a monitor not calibrated", 0.3, "", "a choice: it harms failsafes only")
_BOARD_P = LIMITS.add("probability of a weak board supply", 0.7, "", "a choice: below 4.3 V the board may restart")


def find(flight: Flight) -> Iterator[Finding]:
    """What is wrong with the supply. A voltage that is measured wrongly says nothing of the pack."""
    for battery in () if supply.wrong_scale(flight) else flight.batteries[:1]:
        nothing = _of_no_battery(flight, battery.table)
        yield from _monitor(flight, battery.table) if nothing is None else (nothing,)
        alive = within_reason(battery.table)
        if len(alive) >= 3 and np.ptp(alive["Volt"]) > 0:
            yield from _pack(flight, battery, alive)
    if not flight.batteries:
        yield from filter(None, (_of_no_battery(flight, one) for one in flight.all("BAT", "Volt")[:1]))
    yield from _silent(flight)
    yield from _board(flight)


def _pack(flight: Flight, battery: Battery, table: Table) -> Iterator[Finding]:
    t, cells, rest = table.t, battery.cells, battery.rest_v
    watched = flight.watch(t)
    lowest = smooth(t, table["Volt"], 2.0) / cells
    low = lasting(t, watched & (lowest < CRITICAL), _LASTS_S)
    if rest is not None and rest / cells < NOT_FULL and flight.watched:
        yield _not_charged(flight, rest, cells, float(np.min(lowest[watched])) if low else None)
    elif low:
        deep = bool(lasting(t, watched & (lowest < RUINOUS), _LASTS_S))
        yield _sags(flight, table, low, float(np.min(lowest[watched])), cells, is_deep=deep)
    elif (failsafe := flight.battery_failsafe_s) is not None and supply.early_failsafe(flight) is None:
        yield _failsafe(flight, failsafe, float(np.interp(failsafe, t, table["Volt"])), cells, rest)


def _not_charged(flight: Flight, rest: float, cells: int, lowest: float | None) -> Finding:
    """`lowest`: the voltage of a cell to which it fell, where it fell below the critical level."""
    failsafe = flight.battery_failsafe_s
    is_lost = failsafe is not None or lowest is not None
    severity: Severity = "critical" if is_lost else "warning" if flight.armed else "info"
    return Finding(
        kind="battery",
        title=UNCHARGED,
        onset_s=flight.watched[0][0],
        end_s=flight.watched[-1][1],
        severity=severity,
        evidence=(
            f"{rest:.1f} V at rest, {rest / cells:.2f} V for each of {cells} cells "
            f"(full {FULL_V}, limit {NOT_FULL})"
            + _flown_down(flight, rest, cells)
            + ("" if lowest is None else f"; down to {_under_load(lowest, cells)}")
            + _and_failsafe(failsafe)
        ),
        source="BAT.Volt before take-off; voltages of lithium polymer cells",
        probability=calibrated_probability(1 - rest / cells / NOT_FULL, _CALIBRATION),
        mission_lost=None if is_lost else _HELD_P,
    )


def _flown_down(flight: Flight, rest: float, cells: int) -> str:
    """What the same pack had before the first run of the log, where that was more."""
    first = flight.whole.batteries[0].rest_v if flight.whole.batteries else None
    if first is None or (first - rest) / cells < _GONE_V:
        return ""
    return f"; {first:.1f} V before the first run of this log: flown down since then, or another pack"


def _under_load(lowest: float, cells: int) -> str:
    return f"{lowest * cells:.1f} V over {_LASTS_S:g} s, {lowest:.2f} V for each of {cells} cells"


def _sags(flight: Flight, table: Table, low: list[Span], lowest: float, cells: int, *, is_deep: bool) -> Finding:
    failsafe = flight.battery_failsafe_s
    is_weak = is_deep and low[0][0] - flight.watched[0][0] < _SOON_S
    return Finding(
        kind="battery",
        title=SAGS,
        onset_s=low[0][0],
        end_s=low[-1][1],
        severity="critical" if is_deep or failsafe is not None else "warning",
        evidence=(
            f"down to {_under_load(lowest, cells)}{_load(table, *low[0])}; {CRITICAL} V is the critical level"
            + ("; a charged pack does not sag so soon: it is worn or too small" if is_weak else "")
            + _and_failsafe(failsafe)
        ),
        source=f"BAT.Volt; {CRITICAL} V a cell: {_ADVICE}",
        probability=_WEAK_P if is_weak else _DEEP_P if is_deep else _SAGS_P,
    )


def _failsafe(flight: Flight, failsafe: float, volts: float, cells: int, rest: float | None) -> Finding:
    """A failsafe of a battery that was flown until then."""
    limit = flight.setting(*supply.LOW_VOLT) or 0.0
    is_early = limit / cells > LOW + _EARLY_V
    is_full = rest is None or rest / cells >= FULL
    asks = f"; BATT_LOW_VOLT={limit:g} asks for it at {limit / cells:.2f} V a cell, {LOW} is usual" if is_early else ""
    asks += "" if rest is None or is_full else f"; not full before take-off: {rest / cells:.2f} V a cell"
    return Finding(
        kind="battery",
        title=BATTERY_FAILSAFE,
        onset_s=failsafe,
        end_s=flight.end_s,
        severity="critical",
        evidence=f"failsafe at {volts:.1f} V, {volts / cells:.2f} V for each of {cells} cells{asks}",
        source="ERR of the battery failsafe; BAT.Volt",
        suspect="operation",
        probability=_FAILSAFE_P,
    )


def _of_no_battery(flight: Flight, table: Table) -> Finding | None:
    """A failsafe of a monitor that measures nothing of the battery. At 0 V the firmware takes none for low
    (AP_BattMonitor_Backend::update_failsafes)."""
    failsafe = flight.battery_failsafe_s
    volts = 0.0 if failsafe is None or not len(table) else float(np.interp(failsafe, table.t, table["Volt"]))
    why = sources.no_pack_on(table, flight.hovering) if len(table) else ""
    if failsafe is None or volts <= 0.0 or (volts >= supply.DRIVES_V and not why):
        return None
    return Finding(
        kind="battery",
        title=f"{NO_BATTERY}, and its failsafe {'acted' if _acted(flight, failsafe) else 'was told'}",
        onset_s=failsafe,
        end_s=flight.end_s,
        severity="critical",
        evidence=(f"{volts:.1f} V drive no vehicle" if volts < supply.DRIVES_V else why)
        + ": look at its wiring and its pin; the thresholds are not to blame",
        source="BAT.Volt; battery failsafe",
        probability=_NOTHING_P,
    )


def _silent(flight: Flight) -> Iterator[Finding]:
    """A monitor of which the firmware got no readings for so long that it takes the battery for missing, and acts as on
    one that is empty (AP_BattMonitor_Backend::update_failsafes); before arming as well, for that stays on."""
    for t, text in flight.whole.messages:
        if (match := _MISSING.match(text)) is not None and t <= flight.end_s:
            failsafe = next((at for at, said in flight.whole.messages if at >= t and _ACTED.match(said)), None)
            yield Finding(
                kind="battery",
                title=MONITOR_SILENT,
                onset_s=t,
                end_s=t,
                severity="warning" if failsafe is None else "critical",
                evidence=f"the firmware says '{text}': no pack is empty for that{_and_failsafe(failsafe)}",
                source=f"MSG: Battery {match['number']} is missing",
                probability=_SILENT_P,
            )
            return


def _acted(flight: Flight, failsafe: float) -> bool:
    """Whether a failsafe did anything: it was set to, or the mode or the arming changed with it."""
    changes = [
        *(mode.start_s for mode in flight.modes),
        *(one.time_s for one in flight.arm_changes if not one.is_armed),
    ]
    is_set = flight.setting("BATT_FS_LOW_ACT", "FS_BATT_ENABLE") != 0
    return is_set or any(failsafe <= t <= failsafe + _ACTS_S for t in changes)


def _and_failsafe(failsafe: float | None) -> str:
    return "" if failsafe is None else f"; battery failsafe at {log_time(failsafe)}"


def _load(table: Table, start: float, end: float) -> str:
    if "Curr" not in table.columns:
        return ""
    part = table["Curr"][(table.t >= start) & (table.t <= end)]
    return f" at {median(part):.0f} A" if len(part) and median(part) > _DRAWS_A else ""


def _monitor(flight: Flight, table: Table) -> Iterator[Finding]:
    """Numbers that no battery gives: a voltage that does not move while motors work, or none at all."""
    loaded = during(flight.flown, table.t)
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
    elif float(median(known)) < supply.DRIVES_V:
        odd = f"{median(known):.2f} V drive no vehicle: nothing is connected to it, or its scale is wrong"
    elif len(amps) and np.isfinite(amps).any() and known_median(amps) < -_DRAWS_A:
        odd = f"the current reads {known_median(amps):.1f} A"
    if odd:
        span = flight.flown[0][0], flight.flown[-1][1]
        yield Finding(
            kind="battery",
            title="the battery monitor is not calibrated",
            onset_s=span[0],
            end_s=span[1],
            severity="info",
            evidence=odd,
            source="BAT",
            suspect="parameter",
            probability=_MONITOR_P,
        )


def _board(flight: Flight) -> Iterator[Finding]:
    """The supply of the autopilot itself."""
    table = flight.one("POWR", "Vcc")
    if table is None:
        return
    volts: Floats = np.where(table["Vcc"] > 100, table["Vcc"] / 1000, table["Vcc"])
    weak: Bools = (volts > _BOARD_LEAST_V) & (volts < _BOARD_V) & flight.watch(table.t)
    if weak.sum() < 2:
        return
    at, least, usual = table.t[weak], float(volts[weak].min()), float(median(volts[flight.watch(table.t)]))
    dips = usual - least > _DIP_V
    yield Finding(
        kind="battery",
        title=f"{OWN_SUPPLY} dips" if dips else LOW_SUPPLY,
        onset_s=float(at[0]),
        end_s=float(at[-1]),
        severity="critical" if dips and weak.sum() > _DIPS else "warning",
        evidence=f"Vcc down to {least:.2f} V (limit {_BOARD_V}), {usual:.2f} V in the middle",
        source="POWR.Vcc; 4.3 V: ArduPilot, Diagnosing problems using logs",
        probability=_BOARD_P,
    )


CHECK = Check("battery", "an uncharged or sagging pack, its failsafe, a weak board supply", READS, LIMITS, find)
