"""A look at an ArduPilot log, by the log alone: its timeline and its findings, in one reading."""

from __future__ import annotations

import numpy as np

from care_core.ecosystems.ardupilot import flight as flight_model
from care_core.ecosystems.ardupilot import timeline
from care_core.ecosystems.ardupilot.checks import CHECKS
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.messages import MESSAGES, expanded
from care_core.ecosystems.findings import NOT_FLOWN, TOO_SHORT, Finding, Health
from care_core.ecosystems.plausible import clock_doubt
from care_core.ecosystems.ranking import rank_findings
from care_core.logs.base import Wanted, merge_needs

_TOO_SHORT_S = 2.0
_TELLING = ("MODE", "MSG", "ATT", "IMU")

READS: Wanted = merge_needs(
    expanded(reads) for reads in (flight_model.READS, timeline.READS, *(check.reads for check in CHECKS))
)
"""All that the timeline and any check look at, for one reading."""


def find(flight: Flight) -> tuple[Finding, ...]:
    """Findings of a flight, the first cause first, its consequences under it."""
    flight.expect(READS)
    with np.errstate(all="ignore"):
        found = [finding for check in CHECKS for finding in check.find(flight)]
    return rank_findings(found, flight.down_s)


def examine(flight: Flight) -> Health:
    """What happened in a DataFlash or telemetry log."""
    tables = flight.sound(READS)
    is_readable = flight.end_s >= _TOO_SHORT_S and any(name in tables for name in _TELLING)
    findings = find(flight) if is_readable else ()
    too_little = TOO_SHORT if not is_readable else "" if flight.armed else NOT_FLOWN
    if not too_little and not findings:
        # Times that cannot be are no reason to keep quiet about what was found, but none to call the rest fine.
        too_little = clock_doubt(MESSAGES, tables, 0.0, flight.end_s)
    return Health(flight.vehicle.title, timeline.timeline(flight, tables.values()), findings, too_little)
