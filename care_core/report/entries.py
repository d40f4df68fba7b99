"""Parts that `care.triage/1` and `care.inspect/1` have in common: events, findings, damage."""

from __future__ import annotations

import math
from collections.abc import Iterable

from care_core.ecosystems.findings import Event, Finding, FindingKind, Health, Severity, SuspectKind, linked
from care_core.records import field
from care_core.report.published import Document, publish
from care_core.run import Damage


class EventEntry(Document, kw_only=True):
    """A line of the account; `time_s` counts from the start of the log, null where its source has no time."""

    time_s: float | None
    kind: str
    text: str
    source: str


class ConsequenceEntry(Document, kw_only=True):
    """A finding that is folded under another."""

    kind: FindingKind
    title: str
    onset_s: float | None
    severity: Severity


class FindingEntry(Document, kw_only=True):
    """Something that was not as it should be; what belongs to it is folded under it."""

    kind: FindingKind
    title: str
    onset_s: float | None
    end_s: float | None
    severity: Severity
    suspect: SuspectKind = "hardware"
    """What it speaks of: a part, what the robot met, how it was set, what its operator did."""
    probability: float | None = None
    """How likely the thing named really failed (0 to 1); null in a report of an earlier version."""
    after_impact: bool
    evidence: str
    source: str
    consequences: list[ConsequenceEntry]
    """Later findings that it led to, by physical steps each forwards in time."""
    followed_by: list[ConsequenceEntry] = field(default_factory=list)
    """Findings of its course of events that nothing shows it to have led to."""

    @property
    def links(self) -> tuple[tuple[str, tuple[ConsequenceEntry, ...]], ...]:
        """What is folded under it, by the words for how it hangs together."""
        return linked(self.onset_s, self.consequences, self.followed_by)


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
    followed_by = [publish(ConsequenceEntry, below) for below in finding.followed_by]
    return publish(FindingEntry, finding, consequences=consequences, followed_by=followed_by)


def health_again(account: Iterable[EventEntry], findings: Iterable[FindingEntry]) -> Health:
    """What happened, as far as a report that was read back tells it."""
    timeline = (Event(_time(one.time_s), one.kind, one.text, one.source) for one in account)
    return Health("", tuple(timeline), tuple(map(_finding_again, findings)))


def _finding_again(one: FindingEntry) -> Finding:
    consequences, followed_by = (tuple(map(_below_again, some)) for some in (one.consequences, one.followed_by))
    return Finding(
        one.kind, one.title, _time(one.onset_s), _time(one.end_s), one.severity, one.evidence, one.source,
        after_impact=one.after_impact, consequences=consequences, followed_by=followed_by,
    )  # fmt: skip


def _below_again(one: ConsequenceEntry) -> Finding:
    return Finding(one.kind, one.title, _time(one.onset_s), _time(one.onset_s), one.severity, "", "")


def _time(time_s: float | None) -> float:
    """A time as the log's own records have it, where none is no number."""
    return math.nan if time_s is None else time_s


def damage_entries(places: Iterable[Damage]) -> list[DamageEntry]:
    return [publish(DamageEntry, one) for one in places]
