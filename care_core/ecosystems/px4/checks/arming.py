"""A vehicle that was not ready to fly and never armed."""

from __future__ import annotations

import re
from collections.abc import Iterator

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.px4.flight import MESSAGES, STATUS, Px4Flight, reason_of
from care_core.ecosystems.timeline import counted
from care_core.logs.base import Wanted

READS: Wanted = {STATUS: ("arming_state",), MESSAGES: ("message",)}
_DENIED = re.compile(r"Arming denied", re.IGNORECASE)
LIMITS = Limits()  # the vehicle applies its own


def find(flight: Px4Flight) -> Iterator[Finding]:
    if not flight.complaints or flight.armed:
        return
    reasons = _reasons(flight)
    first, last = flight.complaints[0][0], flight.complaints[-1][0]
    others = "".join(f"{text}; " for text in reasons[-3:-1])
    yield Finding(
        kind="prearm",
        title=f"not ready to fly: {reasons[-1]}",
        onset_s=first,
        end_s=max(last, first),
        severity="warning",
        evidence=f"{others}{counted(len(flight.complaints), 'complaint')}, and it never armed",
        source=f"{MESSAGES} of the preflight checks",
        suspect="parameter",
    )


def _reasons(flight: Px4Flight) -> list[str]:
    """What kept it from arming, each once; the bare denial only where nothing else was said."""
    told = list(dict.fromkeys(reason_of(text) for _, text in flight.complaints))
    return [one for one in told if not _DENIED.match(one)] or told


CHECK = Check("arming", "preflight checks that kept it from arming", READS, LIMITS, find)
