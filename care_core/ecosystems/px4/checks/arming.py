"""A vehicle that was not ready to fly and never armed."""

from __future__ import annotations

from collections.abc import Iterator

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.px4.flight import MESSAGES, STATUS, Px4Flight, reason_of
from care_core.ecosystems.timeline import counted
from care_core.logs.base import Wanted

READS: Wanted = {STATUS: ("arming_state",), MESSAGES: ("message",)}
LIMITS = Limits()  # the vehicle applies its own


def find(flight: Px4Flight) -> Iterator[Finding]:
    if not flight.complaints or flight.armed:
        return
    reasons = list(dict.fromkeys(reason_of(text) for _, text in flight.refusals))
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


CHECK = Check("arming", "preflight checks that kept it from arming", READS, LIMITS, find)
