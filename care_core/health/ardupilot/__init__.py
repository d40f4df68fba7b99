"""What happened on an ArduPilot vehicle and what went wrong, by its log alone: no profile, no training data needed."""

from __future__ import annotations

import numpy as np

from care_core.health.ardupilot import account, flight
from care_core.health.ardupilot.checks import CHECKS
from care_core.health.ardupilot.leads import LEADS
from care_core.health.ardupilot.signals import expanded
from care_core.health.records import Finding
from care_core.health.telling import told
from care_core.logs.base import Log, LogFormat, Wanted
from care_core.logs.plausible import plausible
from care_core.logs.telemetry import as_dataflash


def _plan() -> Wanted:
    """All that the account and any check look at, for one reading."""
    wanted: dict[str, tuple[str, ...]] = {}
    for reads in (flight.READS, account.READS, *(check.READS for check in CHECKS)):
        for name, fields in expanded(reads).items():
            wanted[name] = tuple(dict.fromkeys((*wanted.get(name, ()), *fields)))
    return wanted


READS: Wanted = _plan()


_LAST_S = 1.0
"""Damage so near to the end is the end."""


def flight_of(log: Log) -> flight.Flight:
    """The flight that a DataFlash or telemetry log holds."""
    tables = plausible(as_dataflash(log).read(READS))
    end_s, is_telemetry = log.duration_s, log.format is LogFormat.MAVLINK_TLOG
    breaks_off = any(damage.time_s is None or damage.time_s >= end_s - _LAST_S for damage in log.damage)
    clock_jumps = any(damage.is_jump for damage in log.damage)
    return flight.Flight(tables, log.settings(), log.facts, end_s, is_telemetry, breaks_off, clock_jumps)


def find(of: flight.Flight) -> tuple[Finding, ...]:
    """Findings of a flight in the order told: the first cause first, its consequences under it."""
    with np.errstate(all="ignore"):
        found = [finding for check in CHECKS for finding in check.find(of)]
    return told(found, LEADS, of.down_s)
