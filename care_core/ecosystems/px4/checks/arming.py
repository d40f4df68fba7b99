"""A vehicle that was not ready to fly and never armed."""

from __future__ import annotations

import re
from collections.abc import Iterator

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.px4.flight import MESSAGES, STATUS, Px4Flight, is_bare_denial, reason_of
from care_core.ecosystems.timeline import counted
from care_core.logs.base import Wanted

READS: Wanted = {STATUS: ("arming_state",), MESSAGES: ("message",)}
LIMITS = Limits()
_SURE = LIMITS.add("probability of what the vehicle says", 0.95, "", "the firmware says itself that this kept it so")
_UNSAID = LIMITS.add("probability of a parameter where it says nothing", 0.3, "", "a choice: a part is as likely")
_KEPT = LIMITS.add("probability that no mission is flown so", 1.0, "", "it does not arm")

_READ_BY = (
    (re.compile(r"geofence violation", re.IGNORECASE), ("GF_MAX_HOR_DIST", "GF_MAX_VER_DIST")),
    (re.compile(r"first waypoint|too far", re.IGNORECASE), ("MIS_DIST_1WP",)),
)
"""Complaints that follow from a parameter which missions are planned by (feasibility_checker, mission_feasibility)."""


def find(flight: Px4Flight) -> Iterator[Finding]:
    if not flight.complaints or flight.armed:
        return
    reasons = list(dict.fromkeys(reason_of(text) for _, text in flight.refusals))
    first, last = flight.complaints[0][0], flight.complaints[-1][0]
    others = "".join(f"{text}; " for text in reasons[-3:-1])
    named = tuple(dict.fromkeys(name for reason in reasons for pattern, names in _READ_BY if pattern.search(reason)
                                for name in names))  # fmt: skip
    is_unsaid = all(is_bare_denial(reason) for reason in reasons)
    yield Finding(
        kind="prearm",
        title=f"not ready to fly: {reasons[-1]}",
        onset_s=first,
        end_s=max(last, first),
        severity="critical" if flight.was_denied else "warning",
        evidence=f"{others}{counted(len(flight.complaints), 'complaint')}, and it never armed",
        source=f"{MESSAGES} of the preflight checks",
        suspect="parameter" if named or is_unsaid else "operation",
        parameters=named,
        probability=_UNSAID if is_unsaid else _SURE,
        mission_lost=_KEPT,
    )


CHECK = Check("arming", "preflight checks that kept it from arming", READS, LIMITS, find)
