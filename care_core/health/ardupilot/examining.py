"""A look at an ArduPilot log: its account and its findings, in one reading."""

from __future__ import annotations

from care_core.health.ardupilot import find, flight_of
from care_core.health.ardupilot.account import account
from care_core.health.records import NOT_FLOWN, TOO_SHORT, Health
from care_core.logs.base import Log
from care_core.logs.plausible import clock_doubt

_TOO_SHORT_S = 2.0
_TELLING = ("MODE", "MSG", "ATT", "IMU")


def examine(log: Log) -> Health:
    """What happened in a DataFlash or telemetry log."""
    flight = flight_of(log)
    is_readable = flight.end_s >= _TOO_SHORT_S and any(name in flight.tables for name in _TELLING)
    findings = find(flight) if is_readable else ()
    too_little = TOO_SHORT if not is_readable else "" if flight.armed else NOT_FLOWN
    if not too_little and not findings:
        # Times that cannot be are no reason to keep quiet about what was found, but none to call the rest fine.
        too_little = clock_doubt(flight.tables, 0.0, flight.end_s)
    return Health(flight.vehicle.title, account(flight, log.damage), findings, too_little)
