"""A look at a PX4 log, by the log alone: its timeline and its findings, in one reading."""

from __future__ import annotations

from care_core.ecosystems.findings import NOT_FLOWN, TOO_SHORT, Finding, FindingKind, Health
from care_core.ecosystems.px4 import checks, timeline
from care_core.ecosystems.px4 import flight as flights
from care_core.ecosystems.px4.flight import STATUS, Px4Flight
from care_core.ecosystems.px4.upset import hit
from care_core.ecosystems.ranking import rank_findings
from care_core.ecosystems.vehicles import vehicle_of
from care_core.logs.base import Wanted, merge_needs

_TOO_SHORT_S = 2.0
_FALLING: frozenset[FindingKind] = frozenset(("attitude", "motor", "vibration", "estimator", "imu"))
"""What a vehicle shows that falls, or lies, with its motors cut."""


def reads() -> Wanted:
    """All that the model, the timeline and the checks read."""
    return merge_needs((flights.READS, timeline.READS, *(check.reads for check in checks.CHECKS)))


def examine(flight: Px4Flight) -> Health:
    """What happened in a ULog."""
    tables = flight.tables(reads())
    impact = hit(flight)
    findings = rank_findings(_findings(flight), None if impact is None else impact.time_s)
    is_readable = STATUS in tables and flight.end_s >= _TOO_SHORT_S
    too_little = TOO_SHORT if not is_readable else "" if flight.armed else NOT_FLOWN
    title = vehicle_of(flight.log.facts, flight.log.settings()).title
    return Health(title, timeline.timeline(flight, tables.values()), findings, too_little)


def _findings(flight: Px4Flight) -> list[Finding]:
    """What the checks find, but for what only tells that a vehicle falls after somebody cut its motors."""
    cut_s = flight.killed_s()
    found = [finding for check in checks.CHECKS for finding in check.find(flight)]
    return [one for one in found if cut_s is None or one.onset_s < cut_s or one.kind not in _FALLING]
