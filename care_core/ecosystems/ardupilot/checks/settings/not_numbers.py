"""Parameters that are not numbers."""

from __future__ import annotations

from collections.abc import Iterator

from care_core.ecosystems import not_numbers
from care_core.ecosystems.ardupilot.checks import compass
from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.base import Check
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.not_numbers import FLY, LIMITS
from care_core.logs.base import Wanted
from care_core.metadata.ardupilot import firmware_default

READS: Wanted = compass.READS


def find(flight: Flight) -> Iterator[Finding]:
    """What is not a number, by what reads it."""
    if not not_numbers.broken(flight.settings):
        return
    failed = set(FLY if flight.lost_control_s is not None or flight.impact_s is not None else ())
    if compass.reads_nothing(flight):
        failed.add("compass")
    yield from not_numbers.find(
        flight.settings,
        lambda name: firmware_default(name, flight.kind),
        flight.end_s,
        failed=failed,
        source="PARM",
    )


CHECK = Check("not numbers", "parameters that are not numbers", READS, LIMITS, find)
