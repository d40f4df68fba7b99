"""A battery that was not charged, and one whose voltage falls under load as no sound one's does."""

from __future__ import annotations

from collections.abc import Iterator

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import UNCHARGED, Finding
from care_core.ecosystems.px4.flight import Px4Flight, Span
from care_core.ecosystems.vehicles.settings import code
from care_core.logs.base import Table, Wanted
from care_core.numbers import median

_TOPIC = "battery_status"
READS: Wanted = {_TOPIC: ("voltage_v", "current_a", "remaining")}
LIMITS = Limits()
_CHARGED = LIMITS.add("charge at arming", 0.5, "of the battery", "a choice: a mission is planned with a full one")
_TIRED = LIMITS.add("resistance of a cell", 30.0, "mOhm", "sound lithium cells have 2 to 10; old ones 20")
_LEAST_A = LIMITS.add("current from which it is told", 3.0, "A", "a choice: below it the voltage hardly falls")
_LOADED_S = LIMITS.add("time after arming in which it is told", 20.0, "s", "a choice: the charge is still the same")
_LOADED = LIMITS.add("current under load", 0.5, "of the most then", "a choice: motors that idle draw less")
_EMPTY = LIMITS.add("probability that it was not charged", 0.9, "", "training flights: 6 of 6, and none of 460 without")
_WORN = LIMITS.add("probability that it is worn", 0.85, "", "training flights: 3 of 3, and none of 460 without")
_LOSES = LIMITS.add("probability that a mission fails with either", 0.9, "", "training flights: 9 of 9")
_FEWEST = 3


def find(flight: Px4Flight) -> Iterator[Finding]:
    table = flight.table(_TOPIC, "voltage_v", "current_a", "remaining")
    if table is None or not flight.arming or flight.arming[0][1]:  # nothing shows it at rest
        return
    armed_s, end_s = flight.armed[0] if flight.armed else (flight.end_s, flight.end_s)
    before = table.between(table.t[0], armed_s)
    if len(before) < _FEWEST:
        return
    if flight.armed or flight.was_denied:
        yield from _not_charged(before, float(before.t[0]) if not flight.armed else armed_s)
    soon = table.between(armed_s, min(armed_s + _LOADED_S, end_s))
    if len(soon):
        loaded = soon.where(soon["current_a"] > _LOADED * float(soon["current_a"].max()))
        yield from _worn(before, loaded, code(flight.log.settings(), "BAT1_N_CELLS") or 0, (armed_s, end_s))


def _not_charged(before: Table, armed_s: float) -> Iterator[Finding]:
    """By the firmware's own estimate of the charge."""
    charge = float(before["remaining"][-1])
    if 0.0 < charge < _CHARGED:
        yield Finding(
            kind="battery",
            title=UNCHARGED,
            onset_s=armed_s,
            end_s=armed_s,
            severity="critical",
            evidence=f"it was to fly with {charge:.0%} of its charge, at {float(before['voltage_v'][-1]):.1f} V",
            source=f"{_TOPIC}.remaining",
            probability=_EMPTY,
            mission_lost=_LOSES,
        )


def _worn(before: Table, loaded: Table, cells: int, span: Span) -> Iterator[Finding]:
    """By the fall of its voltage as the motors spin up, a cell and an ampere."""
    if cells < 1 or len(loaded) < _FEWEST:
        return
    amperes = float(median(loaded["current_a"])) - float(median(before["current_a"]))
    fall_v = float(median(before["voltage_v"])) - float(median(loaded["voltage_v"]))
    if amperes < _LEAST_A or not (ohm := 1000 * fall_v / amperes / cells) > _TIRED:
        return
    yield Finding(
        kind="battery",
        title="the battery's voltage falls under load",
        onset_s=span[0],
        end_s=span[1],
        severity="critical",
        evidence=f"{fall_v:.1f} V at {amperes:.0f} A, {ohm:.0f} mOhm a cell; a sound one has 2 to 10",
        source=f"{_TOPIC}.voltage_v, current_a",
        probability=_WORN,
        mission_lost=_LOSES,
    )


CHECK = Check("battery", "a battery that was not charged, or whose voltage falls under load", READS, LIMITS, find)
