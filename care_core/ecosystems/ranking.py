"""In which order findings are told: the earliest before the impact that explains the later ones leads them.

Severe before mild, likely before suspected, causes before symptoms, then in order of time.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from care_core.ecosystems.findings import Finding, FindingKind
from care_core.records import replace

Explains = Mapping[FindingKind, frozenset[FindingKind]]
"""Per kind of finding the kinds that it can bring about."""

SLACK_S = 1.5
"""Onsets are told this exactly: a consequence may be seen so much before its cause is."""
LIKELY = 0.5
"""A finding at least this probable is told before suspicions of the same severity, and is no consequence of one."""
OVER_S = 60.0
"""What was over for so long before something began did not bring it about."""
SYMPTOMS: frozenset[FindingKind] = frozenset(("attitude", "crash", "estimator", "log"))
"""What shows that something is wrong, not what: told after causes of the same weight."""
ON_GROUND: frozenset[FindingKind] = frozenset(("prearm",))
"""What is seen before anything runs: no chain of events lies between it and its cause."""
_SEVERITY = {"critical": 0, "warning": 1, "info": 2}


def rank_findings(
    findings: Iterable[Finding], explains: Explains, impact_s: float | None = None
) -> tuple[Finding, ...]:
    """Findings in the order told: causes first, what each explains folded under it, what comes after the impact last.

    A finding is explained by one that is told before it and began before it, whose kind can lead to its kind, directly
    or by others, and that is not much less sure: a part that surely failed is no consequence of a mere suspicion.

    Args:
        explains: which kind can bring about which.
        impact_s: when the vehicle was down against its will, None where it was not.
    """
    marked = [replace(f, after_impact=impact_s is not None and f.onset_s > impact_s) for f in findings]
    reach = _closure(explains)
    roots: list[tuple[Finding, list[Finding]]] = []
    for finding in sorted(marked, key=lambda f: _place(f, marked, reach)):
        cause = next((entry for entry in roots if _explains(entry[0], finding, reach)), None)
        if cause is None:
            roots.append((finding, []))
        else:
            cause[1].append(finding)
    return tuple(replace(root, consequences=tuple(sorted(below, key=lambda f: f.onset_s))) for root, below in roots)


def lost_by(findings: Iterable[Finding], *, is_judged: bool) -> tuple[str, ...]:
    """By title, what lost a run and no prediction from its options knows of: whether it happens again, they cannot say.

    Args:
        is_judged: whether an objective was found broken. Predictions know of that, and so of its symptoms and of what
            speaks of a parameter.
    """
    critical = [one for one in findings if one.severity == "critical" and not one.after_impact]
    return tuple(
        one.title for one in critical if not (is_judged and (one.suspect == "parameter" or one.kind in SYMPTOMS))
    )


def _place(finding: Finding, every: Iterable[Finding], reach: Explains) -> tuple[bool, int, bool, bool, float, bool]:
    """Sorts findings: one whose cause was seen within the slack after it comes after that cause."""
    causes = (
        other.onset_s
        for other in every
        if other.onset_s > finding.onset_s
        and _rank(other) == _rank(finding)
        and _explains(other, finding, reach)
        and not _explains(finding, other, reach)
    )
    onset_s = max(causes, default=finding.onset_s)
    return *_rank(finding), onset_s, onset_s > finding.onset_s


def _rank(finding: Finding) -> tuple[bool, int, bool, bool]:
    likely = finding.probability >= LIKELY
    return finding.after_impact, _SEVERITY[finding.severity], not likely, finding.kind in SYMPTOMS


def _explains(cause: Finding, finding: Finding, reach: Explains) -> bool:
    return (
        not (finding.severity == "info" and finding.suspect == "parameter")  # it was set so before anything failed
        and finding.kind in reach.get(cause.kind, frozenset())
        and cause.onset_s <= finding.onset_s + SLACK_S
        and cause.end_s >= finding.onset_s - OVER_S
        and (finding.probability < LIKELY or (cause.probability >= LIKELY and not _only_set(cause, finding)))
    )


def _only_set(cause: Finding, finding: Finding) -> bool:
    """Whether a setting is to have broken a part that surely failed: both are told."""
    return cause.suspect == "parameter" and finding.suspect == "hardware"


def _closure(explains: Explains) -> dict[FindingKind, frozenset[FindingKind]]:
    """Every kind with all that it leads to by any number of steps."""
    reach = {kind: set(after) for kind, after in explains.items()}
    while True:
        grown = {kind: after.union(*(reach.get(one, set()) for one in after)) for kind, after in reach.items()}
        if grown == reach:
            return {
                kind: frozenset(after - (ON_GROUND - explains.get(kind, frozenset()))) for kind, after in reach.items()
            }
        reach = grown
