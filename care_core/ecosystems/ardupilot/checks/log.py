"""The log itself: holes in it, and an end in the air."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from care_core.ecosystems.ardupilot.aloft import ends_aloft
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import LOST_SIGHT, Finding
from care_core.ecosystems.spans import Span, seconds_in
from care_core.logs.base import Table, Wanted
from care_core.numbers import Bools, Floats, median, pauses

READS: Wanted = {"ATT": ("Roll",), "RCOU": ("C1",), "POWR": ("Vcc",)}

_STEADY = ("ATT", "RCOU", "CTUN", "IMU")
LIMITS = Limits()
_HOLE_S = LIMITS.add("shortest hole", 2.0, "s", "a choice: a busy card may keep a logger waiting for a second")
_TIMES = LIMITS.add("shortest hole, in usual steps", 20.0, "", "a choice: of logs that are thinned")
_SWITCHED_S = LIMITS.add("around arming and disarming", 1.0, "s", "a choice: loggers are opened and closed there")
_FALLS_V = LIMITS.add(
    "fall of the board's supply", 0.3, "V", "ArduPilot, Power module and brown-outs: twice the swing that is normal"
)
_LEAST_V = LIMITS.add("supply that is recorded", 1.0, "V", "a choice: below it nothing measures")
_HOLE_P = LIMITS.add("probability of a hole", 0.3, "", "a choice: most are the card's")
_POWER_LOST_P = LIMITS.add("probability of lost power", 0.7, "", "a choice: the supply fell before")
_ENDS_P = LIMITS.add("probability of an end in the air", 0.4, "", "a choice: recordings are stopped, too")


def find(flight: Flight) -> Iterator[Finding]:
    """Holes in all of the steady messages at once, a log that ends before the landing, and one of several vehicles."""
    yield from _holes(flight)
    yield from _ends_in_the_air(flight)
    yield from _other_vehicles(flight)


def _other_vehicles(flight: Flight) -> Iterator[Finding]:
    """Telemetry of several vehicles: each message is told of the one whose autopilot sent most, and where two speak
    under one id, of nobody."""
    facts = flight.log.facts
    title = f"another vehicle is in this telemetry: {facts['vehicles']}" if "vehicles" in facts else ""
    evidence = f"all that is told is of vehicle {facts.get('system', '')}"
    if "shared id" in facts:
        title, evidence = "two vehicles speak under one system id", facts["shared id"]
    if title:
        yield Finding(
            kind="log",
            title=title,
            onset_s=0.0,
            end_s=flight.end_s,
            severity="warning",
            evidence=evidence,
            source="HEARTBEAT",
            suspect="operation",
            probability=_HOLE_P,
        )


def holes(flight: Flight) -> list[Span]:
    """Spans while it was armed of which no steady message tells anything."""
    streams = _steady(flight)
    if not streams or flight.clock_jumps:
        return []
    low, high = pauses((table.t for table in streams), _least_hole_s(streams))
    inside = _inside(flight, low, high)
    return list(zip(low[inside].tolist(), high[inside].tolist(), strict=True))


def _steady(flight: Flight) -> list[Table]:
    return [table for name in _STEADY if (table := flight.one(name)) is not None and len(table) > 20]


def _least_hole_s(streams: Sequence[Table]) -> float:
    return max(_HOLE_S, _TIMES * float(median(np.diff(streams[0].t))))


def _holes(flight: Flight) -> Iterator[Finding]:
    if found := holes(flight):
        total = seconds_in(found)
        if flight.is_telemetry:
            yield Finding(
                kind="radio",
                title="telemetry was interrupted",
                onset_s=found[0][0],
                end_s=found[-1][1],
                severity="info",
                evidence=f"{len(found)} times, {total:.1f} s in all; the vehicle's own log has no such holes",
                source="times of the telemetry",
                suspect="world",
                probability=_HOLE_P,
            )
            return
        yield Finding(
            kind="log",
            title=f"the log has {len(found)} hole{'s' * (len(found) > 1)}",
            onset_s=found[0][0],
            end_s=found[-1][1],
            severity="warning",
            evidence=f"{total:.1f} s without any record (limit {_least_hole_s(_steady(flight)):.0f} s)",
            source="times of ATT, RCOU, CTUN, IMU",
            probability=_HOLE_P,
        )


def _inside(flight: Flight, start: Floats, end: Floats) -> Bools:
    """Which steps lie within one span armed and clear of its ends: there loggers are opened and closed."""
    inside = np.zeros(len(start), dtype=bool)
    for begin, over in flight.armed:
        is_open = begin > 0.0
        inside |= (start >= begin + _SWITCHED_S * is_open) & (end <= over) & (start <= over - _SWITCHED_S)
    return inside


def _ends_in_the_air(flight: Flight) -> Iterator[Finding]:
    """Armed and lifting at the last record: power was lost, or the recording was stopped."""
    aloft = ends_aloft(flight) if flight.is_copter else None
    if aloft is None or not flight.armed or flight.armed[-1][1] < flight.end_s:
        return
    if flight.arm_changes and not flight.arm_changes[-1][1]:
        return  # it was disarmed with its last record
    sagging, lost = _supply_falls(flight), flight.silent_s > 0.0
    why = "power was lost or the recording was stopped"
    if lost:
        why = f"its link or its power was lost: the station records for {flight.silent_s:.0f} s more"
    yield Finding(
        kind="battery" if sagging else "radio" if lost else "log",
        title="power was lost in the air" if sagging else LOST_SIGHT if lost else "the log ends in the air",
        onset_s=flight.end_s,
        end_s=flight.end_s,
        severity="critical" if sagging else "warning",
        evidence=f"armed {'and ' * aloft.is_falling}{aloft} at the last record: {sagging or why}",
        source="EV, ARM, CTUN, POS, POWR",
        probability=_POWER_LOST_P if sagging else _ENDS_P,
    )


def _supply_falls(flight: Flight) -> str:
    """What shows that the autopilot's supply fell away at the end; "" where nothing does."""
    table = flight.one("POWR", "Vcc")
    if table is None or len(table) < 10:
        return ""
    volts = np.where(table["Vcc"] > 100, table["Vcc"] / 1000, table["Vcc"])
    usual, last = float(median(volts)), float(np.min(volts[-3:]))
    return f"Vcc fell from {usual:.2f} to {last:.2f} V" if usual - last > _FALLS_V and last > _LEAST_V else ""


CHECK = Check("log", "holes in the log, and an end in the air", READS, LIMITS, find)
