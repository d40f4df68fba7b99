"""A look at an ArduPilot log, by the log alone: its account and its findings, in one reading."""

from __future__ import annotations

import numpy as np

from care_core.ecosystems.ardupilot import flight as course
from care_core.ecosystems.ardupilot import timeline
from care_core.ecosystems.ardupilot.checks import CHECKS
from care_core.ecosystems.ardupilot.explains import EXPLAINS
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.ardupilot.messages import expanded
from care_core.ecosystems.base import RunModel
from care_core.ecosystems.findings import NOT_FLOWN, TOO_SHORT, Finding, Health
from care_core.ecosystems.ranking import rank_findings
from care_core.logs import formats
from care_core.logs.base import Wanted
from care_core.logs.plausible import clock_doubt, plausible

_TOO_SHORT_S = 2.0
_TELLING = ("MODE", "MSG", "ATT", "IMU")
_LAST_S = 1.0
"""Damage so near to the end is the end."""


def _plan() -> Wanted:
    """All that the account and any check look at, for one reading."""
    wanted: dict[str, tuple[str, ...]] = {}
    for reads in (course.READS, timeline.READS, *(check.READS for check in CHECKS)):
        for name, fields in expanded(reads).items():
            wanted[name] = tuple(dict.fromkeys((*wanted.get(name, ()), *fields)))
    return wanted


READS: Wanted = _plan()


def flight_of(model: RunModel) -> Flight:
    """The flight that a DataFlash or telemetry log holds."""
    log, tables = model.log, plausible(model.tables(READS))
    end_s, is_telemetry = log.duration_s, log.format is formats.MAVLINK_TLOG
    breaks_off = any(damage.time_s is None or damage.time_s >= end_s - _LAST_S for damage in log.damage)
    clock_jumps = any(damage.is_jump for damage in log.damage)
    return Flight(tables, log.settings(), log.facts, end_s, is_telemetry, breaks_off, clock_jumps)


def find(of: Flight) -> tuple[Finding, ...]:
    """Findings of a flight in the order told: the first cause first, its consequences under it."""
    with np.errstate(all="ignore"):
        found = [finding for check in CHECKS for finding in check.find(of)]
    return rank_findings(found, EXPLAINS, of.down_s)


def examine(model: RunModel) -> Health:
    """What happened in a DataFlash or telemetry log."""
    flight = flight_of(model)
    is_readable = flight.end_s >= _TOO_SHORT_S and any(name in flight.tables for name in _TELLING)
    findings = find(flight) if is_readable else ()
    too_little = TOO_SHORT if not is_readable else "" if flight.armed else NOT_FLOWN
    if not too_little and not findings:
        # Times that cannot be are no reason to keep quiet about what was found, but none to call the rest fine.
        too_little = clock_doubt(flight.tables, 0.0, flight.end_s)
    return Health(flight.vehicle.title, timeline.timeline(flight, model.log.damage), findings, too_little)
