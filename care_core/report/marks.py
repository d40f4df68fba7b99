"""What is marked on an axis of time, in the app and in pages. Needs nothing that is slow to import."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from care_core.records import Record
from care_core.report.wording import noted

if TYPE_CHECKING:
    from care_core.diagnose.records import Diagnosis
    from care_core.ecosystems.findings import Severity


class Mark(Record):
    """Something that happened, on an axis of time; the gravest have the least `rank`."""

    time_s: float
    kind: str
    """The kind of the moment, or the severity of the finding."""
    words: str
    rank: int

    @property
    def severity(self) -> Severity:
        """How grave it is."""
        return "critical" if self.rank == 0 else "warning" if self.rank <= _GRAVE else "info"


_RANKS: dict[str, int] = {
    "crash": 0,
    "critical": 0,
    "failsafe": 1,
    "error": 1,
    "warning": 1,
    "evidence": 1,
    "recovery": 2,
    "arming": 3,
    "mode": 3,
    "goal": 3,
    "parameter": 3,
    "flight": 3,
    "info": 4,
}
"""Severities of findings and kinds of moments that are marked on plots; the others are too many."""
_GRAVE = 2


def marks_of(diagnosis: Diagnosis) -> list[Mark]:
    """What happened, in order of time: findings with what is folded under them, the moments that matter, and what the
    diagnosis rests on."""
    findings = [one for found in noted(diagnosis.health.findings) for one in (found, *found.below)]
    marks = [Mark(f.onset_s, f.severity, f.title, _RANKS[f.severity]) for f in findings]
    account = diagnosis.health.timeline
    marks += [Mark(one.time_s, one.kind, one.text, _RANKS[one.kind]) for one in account if one.kind in _RANKS]
    said = {mark.words for mark in marks}
    evidence = (part for part in diagnosis.run.evidence if part.text not in said)
    marks += [Mark(part.time_s, "evidence", part.text, _RANKS["evidence"]) for part in evidence]
    return sorted((mark for mark in marks if math.isfinite(mark.time_s)), key=lambda mark: mark.time_s)
