"""Bumpers that are pressed: the robot touches something, or stays against it."""

from __future__ import annotations

from collections.abc import Iterator

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.ros.drive import Drive
from care_core.logs.base import Wanted

LIMITS = Limits()
STAYS_S = LIMITS.add(
    "time that a bumper stays pressed", 3.0, "s", "a robot that minds its bumper backs off in a second"
)
READS: Wanted = {}
"""Bumpers are known by their names and types, see `bumpers`: the drive reads them with whatever else is read."""


def find(drive: Drive) -> Iterator[Finding]:
    """Contacts as their switches tell them. A vacuum cleaner touches what it cleans along: that alone is no fault."""
    spans = drive.bumps
    if not spans:
        return
    topics, count = ", ".join(drive.bumper_topics), len(spans)
    start_s, end_s = max(spans, key=lambda span: span[1] - span[0])
    if end_s - start_s >= STAYS_S:
        more = f"; {count} contacts in all" if count > 1 else ""
        yield Finding(
            kind="blocked",
            title="the robot stays against something: its bumper is pressed",
            onset_s=start_s,
            end_s=end_s,
            severity=drive.severity(start_s),
            evidence=f"pressed for {end_s - start_s:.1f} s{more}",
            source=topics,
            suspect="world",
            probability=0.85,
        )
        return
    yield Finding(
        kind="blocked",
        title="the robot touches something: its bumper is pressed",
        onset_s=spans[0][0],
        end_s=spans[-1][1],
        severity="info",
        evidence=f"{count} contact{'s' if count > 1 else ''} of up to {end_s - start_s:.1f} s",
        source=topics,
        suspect="world",
        probability=0.5,
    )


CHECK = Check("contacts", "bumpers that are pressed, and stay so", READS, LIMITS, find)
