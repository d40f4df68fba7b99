"""Arming that was refused: what the firmware said, where the vehicle never armed."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator

from care_core.health.ardupilot.flight import Flight
from care_core.health.records import Finding, Severity
from care_core.logs.base import Wanted

READS: Wanted = {}

_REFUSAL = re.compile(r"^(Pre)?Arm: (?P<why>.+)")
_STARTING_S = 30.0
"""Complaints that end within this time of the start are those of sensors that warm up."""


def find(flight: Flight) -> Iterator[Finding]:
    """The refusal that lasted, where no arming followed it."""
    if flight.armed:
        return
    refusals = [(t, match["why"], match[1] is None) for t, text in flight.messages if (match := _REFUSAL.match(text))]
    if not refusals:
        return
    last = refusals[-1][0]
    lasting = [(t, why, asked) for t, why, asked in refusals if last - t < _STARTING_S]
    counts = Counter(_plain(why) for _, why, _ in lasting)
    why = max(counts, key=lambda one: counts[one])
    begin = next(t for t, one, _ in refusals if _plain(one) == why)
    asked = any(is_order for _, _, is_order in refusals)
    severity: Severity = "critical" if asked and not flight.breaks_off else "warning"
    yield Finding(
        "prearm", f"arming was refused: {why}", begin, last, severity,
        "; ".join(dict.fromkeys(_plain(one) for _, one, _ in lasting)), "MSG", suspect="parameter", probability=0.3,
    )  # fmt: skip


def _plain(why: str) -> str:
    """A complaint without the numbers that change from one to the next."""
    return re.sub(r"\s*\([^)]*\d[^)]*\)", "", why)
