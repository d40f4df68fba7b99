"""Parts that `care.triage/1` and `care.inspect/1` have in common: events, findings, damage."""

from __future__ import annotations

from collections.abc import Iterable

from care_core.ecosystems.findings import Finding, FindingKind, Health, Severity
from care_core.report.published import Document, publish
from care_core.run import Damage


class EventEntry(Document, kw_only=True):
    """A line of the account; `time_s` counts from the start of the log, null where its source has no time."""

    time_s: float | None
    kind: str
    text: str
    source: str


class ConsequenceEntry(Document, kw_only=True):
    """A later finding that an earlier one explains."""

    kind: FindingKind
    title: str
    onset_s: float | None
    severity: Severity


class FindingEntry(Document, kw_only=True):
    """Something that was not as it should be; what it explains is folded under it."""

    kind: FindingKind
    title: str
    onset_s: float | None
    end_s: float | None
    severity: Severity
    after_impact: bool
    evidence: str
    source: str
    consequences: list[ConsequenceEntry]


class DamageEntry(Document, kw_only=True):
    what: str
    byte: int | None
    time_s: float | None


def event_entries(health: Health) -> list[EventEntry]:
    return [publish(EventEntry, one) for one in health.timeline]


def finding_entries(health: Health) -> list[FindingEntry]:
    return [_finding(one) for one in health.findings]


def _finding(finding: Finding) -> FindingEntry:
    consequences = [publish(ConsequenceEntry, below) for below in finding.consequences]
    return publish(FindingEntry, finding, consequences=consequences)


def damage_entries(places: Iterable[Damage]) -> list[DamageEntry]:
    return [publish(DamageEntry, one) for one in places]
