"""Motors that somebody cut in the air."""

from __future__ import annotations

import math
from collections.abc import Iterator

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import KILLED, Finding
from care_core.ecosystems.px4 import attitude
from care_core.ecosystems.px4.flight import LANDED, MESSAGES, POSITION, SAID_WITHIN_S, Px4Flight
from care_core.ecosystems.px4.upset import COMBINED, FORCES, falls_after, leans_over_deg
from care_core.ecosystems.spans import Span
from care_core.logs.base import Wanted, merge_needs

READS: Wanted = merge_needs(
    ({MESSAGES: ("message",), POSITION: ("z",), COMBINED: FORCES, LANDED: ("landed",)}, attitude.READS)
)
LIMITS = Limits()
_LEANS_DEG = LIMITS.add("how far it leans over then", 20.0, "deg", "what stands on the ground stays as it stands")
_LEANS_HIGH_DEG = LIMITS.add("the same, where its height tells so too", 12.0, "deg", "a choice: two signs say the same")
_ALOFT_M = LIMITS.add("height", 0.5, "m", "a choice: the height of a vehicle on the ground drifts by less")


def killed_aloft_s(flight: Px4Flight, span: Span = (-math.inf, math.inf)) -> float | None:
    """When the kill switch cut the motors in the air, None where it did not or the log does not tell. What falls or
    leans over without its motors was; a height alone does not tell: it drifts in a flight."""
    killed_s = flight.killed_s(span)
    if killed_s is None or flight.last(LANDED, "landed", killed_s - SAID_WITHIN_S) == 1:
        return None
    height_m = flight.height_m(killed_s)
    is_high = height_m is not None and height_m > _ALOFT_M
    falls, leans_deg = falls_after(flight, killed_s), leans_over_deg(flight, killed_s)
    if falls is None and leans_deg is None:
        return killed_s if is_high else None
    return killed_s if falls or (leans_deg or 0.0) > (_LEANS_HIGH_DEG if is_high else _LEANS_DEG) else None


def find(flight: Px4Flight) -> Iterator[Finding]:
    killed_s = killed_aloft_s(flight)
    if killed_s is not None:
        yield Finding(
            kind="crash",
            title=KILLED,
            onset_s=killed_s,
            end_s=flight.end_s,
            severity="critical",
            evidence="the commander says so" + _how_high(flight.height_m(killed_s)),
            source=f"{MESSAGES}; {POSITION}.z",
            suspect="operation",
            probability=0.9,
        )


def _how_high(height_m: float | None) -> str:
    """A height in words, nothing of one that is none."""
    is_one = height_m is not None and height_m > _ALOFT_M
    return f", {height_m:.1f} m above where it was armed" if is_one else ", and it leant over or fell"


CHECK = Check("kill switch", "motors cut in the air by the kill switch", READS, LIMITS, find)
