"""A look at an ArduPilot log: its account and its findings, in one reading."""

from __future__ import annotations

from care_core.health.ardupilot import account as telling_of
from care_core.health.ardupilot.flight import READS, Flight
from care_core.health.ardupilot.signals import expanded
from care_core.health.records import Health
from care_core.logs.base import Log, Wanted
from care_core.logs.plausible import plausible
from care_core.logs.telemetry import as_dataflash

_TOO_SHORT_S = 2.0


def examine(log: Log) -> Health:
    """What happened in a DataFlash or telemetry log."""
    wanted: dict[str, tuple[str, ...]] = {}
    for reads in (READS, telling_of.READS):
        for name, fields in reads.items():
            wanted[name] = tuple(dict.fromkeys((*wanted.get(name, ()), *fields)))
    flight = _flight(log, wanted)
    account = telling_of.account(flight, log.damage)
    is_told = any(name in flight.tables for name in ("MODE", "MSG", "ATT", "IMU"))
    return Health(flight.vehicle.title, account, (), is_readable=is_told and flight.end_s >= _TOO_SHORT_S)


def _flight(log: Log, wanted: Wanted) -> Flight:
    tables = plausible(as_dataflash(log).read(expanded(wanted)))
    return Flight.of(tables, log.settings(), log.facts, log.duration_s)
