"""Parameters that are not numbers."""

from __future__ import annotations

from collections.abc import Iterator

from care_core.ecosystems import not_numbers
from care_core.ecosystems.base import Check
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.not_numbers import FLY, LIMITS
from care_core.ecosystems.px4 import upset
from care_core.ecosystems.px4.flight import Px4Flight
from care_core.metadata import px4

READS = upset.READS


def find(flight: Px4Flight) -> Iterator[Finding]:
    """What is not a number, by what reads it."""
    settings = flight.log.settings()
    if not not_numbers.broken(settings):
        return
    is_lost = upset.lost_control(flight) is not None or upset.hit(flight) is not None
    failed = FLY if is_lost else frozenset()
    yield from not_numbers.find(settings, _default, flight.end_s, failed=failed, source="parameters")


def _default(name: str) -> float | None:
    fact = px4.fact_of(name)
    return None if fact is None else fact.default_number


CHECK = Check("not numbers", "parameters that are not numbers", READS, LIMITS, find)
