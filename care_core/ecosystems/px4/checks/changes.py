"""Parameters that were changed in flight shortly before an upset."""

from __future__ import annotations

from collections.abc import Iterator

from care_core.ecosystems import changed_in_flight
from care_core.ecosystems.base import Check
from care_core.ecosystems.changed_in_flight import LIMITS, Upset
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.px4 import motors, upset
from care_core.ecosystems.px4.checks import crash
from care_core.ecosystems.px4.flight import LANDED, Px4Flight

READS = upset.READS


def find(flight: Px4Flight) -> Iterator[Finding]:
    settings = flight.log.settings()
    aloft = [one for one in changed_in_flight.changes(settings, flight.armed) if _is_aloft(flight, one.time_s)]
    if aloft:
        upsets = [Upset(one.onset_s, one.title) for one in crash.find(flight)]
        placed = motors.px4_motors(settings)
        yield from changed_in_flight.find(aloft, upsets, placed, is_lost=bool(upsets), source="parameters")


def _is_aloft(flight: Px4Flight, at: float) -> bool:
    return flight.last(LANDED, "landed", at) != 1


CHECK = Check("changes", "parameters changed in flight shortly before an upset", READS, LIMITS, find)
