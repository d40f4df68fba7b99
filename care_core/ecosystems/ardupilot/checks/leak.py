"""Water in the hull of a submarine, as its leak detectors tell."""

from __future__ import annotations

from collections.abc import Iterator

from care_core.ecosystems.ardupilot.flight import Flight
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.spans import within
from care_core.ecosystems.vehicles.errors import LEAK
from care_core.logs.base import Wanted
from care_core.text import log_time

READS: Wanted = {}

LIMITS = Limits()
_DETECTED_P = LIMITS.add("probability of a leak", 0.9, "", "the firmware's own word")


def find(flight: Flight) -> Iterator[Finding]:
    """The first time that a detector told of water while the vehicle was watched."""
    if flight.kind != "sub":
        return
    told = [t for t, code in flight.errors(LEAK) if code > 0]
    told += [t for t, text in flight.messages if text.casefold().startswith("leak detected")]
    since = min((t for t in told if within(flight.watched, t)), default=None)
    if since is None:
        return
    yield Finding(
        kind="leak",
        title="water leaked into the hull",
        onset_s=since,
        end_s=flight.watched[-1][1],
        severity="critical",
        evidence=f"a leak detector tells of water from {log_time(since)} on",
        source=f"ERR {LEAK}, MSG",
        probability=_DETECTED_P,
        mission_lost=_DETECTED_P,
    )


CHECK = Check("leak", "water in the hull of a submarine", READS, LIMITS, find)
