"""Motors that somebody cut in the air."""

from __future__ import annotations

import math
from collections.abc import Iterator

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.px4 import attitude
from care_core.ecosystems.px4.flight import LANDED, MESSAGES, POSITION, Px4Flight, Span
from care_core.ecosystems.px4.upset import COMBINED, FORCES, falls_after, leans_over_after
from care_core.logs.base import Wanted, merge_needs

READS: Wanted = merge_needs(
    ({MESSAGES: ("message",), POSITION: ("z",), COMBINED: FORCES, LANDED: ("landed",)}, attitude.READS)
)
LIMITS = Limits()
_ALOFT_M = LIMITS.add("height", 0.5, "m", "a choice: the height of a vehicle on the ground drifts by less")


def killed_aloft_s(flight: Px4Flight, span: Span = (-math.inf, math.inf)) -> float | None:
    """When the kill switch cut the motors in the air, None where it did not or the log tells no height. A height alone
    does not tell: it drifts in a flight."""
    killed_s = flight.killed_s(span)
    height_m = None if killed_s is None else flight.height_m(killed_s)
    if killed_s is None or height_m is None or height_m <= _ALOFT_M:
        return None
    falls = falls_after(flight, killed_s)
    is_aloft = flight.last(LANDED, "landed", killed_s) != 1 if falls is None else falls
    return killed_s if is_aloft or leans_over_after(flight, killed_s) else None


def find(flight: Px4Flight) -> Iterator[Finding]:
    killed_s = killed_aloft_s(flight)
    if killed_s is not None:
        yield Finding(
            kind="crash",
            title="the kill switch cut the motors in the air",
            onset_s=killed_s,
            end_s=flight.end_s,
            severity="critical",
            evidence=f"the commander says so, {flight.height_m(killed_s):.1f} m above where it was armed",
            source=f"{MESSAGES}; {POSITION}.z",
            suspect="operation",
            probability=0.9,
        )


CHECK = Check("kill switch", "motors cut in the air by the kill switch", READS, LIMITS, find)
