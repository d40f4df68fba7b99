"""In which order findings are told: the earliest before the impact that explains the later ones leads them.

Severe before mild, likely before suspected, causes before symptoms, what led to a crash before what led to nothing,
then in order of time.
"""

from __future__ import annotations

from collections.abc import Iterable

from care_core.ecosystems.explains import EXPLAINS, REFUSES, Explains
from care_core.ecosystems.findings import LOW_SUPPLY, OF_MONITOR, OWN_SUPPLY, UNCHARGED, Finding, FindingKind
from care_core.records import replace

SLACK_S = 1.5
"""Onsets are told this exactly: a consequence may be seen so much before its cause, which is told first all the same.
"""
LIKELY = 0.5
"""A finding at least this probable is told before suspicions of the same severity, and is no consequence of one."""
MUCH_SURER = 0.2
"""What is surer by so much, and no consequence of the other, brought about what either may have."""
OVER_S = 60.0
"""What was over for so long before something began did not bring it about."""
UNLINKED_S = 30.0
"""The same, where no finding lies between them that would lead from one to the other."""
SYMPTOMS: frozenset[FindingKind] = frozenset(("attitude", "crash", "estimator", "log"))
"""What shows that something is wrong, not what: told after causes of the same weight."""
ON_GROUND: frozenset[FindingKind] = frozenset(("prearm",))
"""What is seen before anything runs: no chain of events lies between it and its cause."""
_OF_A_FAILSAFE: frozenset[FindingKind] = frozenset(("battery", "crash", "log"))
"""What a failsafe that acts for nothing brings about: it lands, wherever that is."""
GRAVITY = {"critical": 0, "warning": 1, "info": 2}


def rank_findings(
    findings: Iterable[Finding], impact_s: float | None = None, explains: Explains = EXPLAINS
) -> tuple[Finding, ...]:
    """Findings in the order told: causes first, what belongs to each folded under it, what comes after the impact last.

    A finding leads to another by a step of the table, or by several through findings that are there, each forwards in
    time. What several steps would reach whose findings are missing, or what is seen within the slack before it, is of
    the same course of events and no more. Neither is much surer than the first: a part that surely failed is no
    consequence of a mere suspicion.

    Args:
        impact_s: when the vehicle was down against its will, None where it was not.
        explains: which kind can bring about which directly.
    """
    marked = [replace(f, after_impact=impact_s is not None and f.onset_s > impact_s) for f in findings]
    reach = _closure(explains)
    left = sorted(marked, key=lambda f: _place(f, marked, reach))
    told = []
    while left:
        root, *left = left
        surer = [one for one in left if _is_much_surer(one, root, reach)]
        below = [
            one for one in left if _belongs(root, one, reach) and not any(_belongs(it, one, reach) for it in surer)
        ]
        led_to = _led_to(root, below, explains)
        unlinked = [one for one in below if one not in led_to and one.onset_s <= root.end_s + UNLINKED_S]
        others = [one for one in unlinked if not _failed_by_itself(root, one)]
        left = [one for one in left if one not in led_to and one not in others]
        told.append(replace(root, consequences=_in_time(led_to), followed_by=_in_time(others)))
    return tuple(sorted(told, key=lambda one: (*_rank(one), not _brought_down(one))))


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


def _in_time(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    return tuple(sorted(findings, key=lambda f: f.onset_s))


def _place(finding: Finding, every: Iterable[Finding], reach: Explains) -> tuple[bool, int, bool, bool, float, bool]:
    """Sorts findings: one whose cause was seen with it, or within the slack after it, comes after that cause."""
    causes = [
        other.onset_s
        for other in every
        if other.onset_s >= finding.onset_s
        and other is not finding
        and _rank(other) == _rank(finding)
        and _belongs(other, finding, reach)
        and not _belongs(finding, other, reach)
    ]
    return *_rank(finding), max(causes, default=finding.onset_s), bool(causes)


def _rank(finding: Finding) -> tuple[bool, int, bool, bool]:
    likely = finding.probability >= LIKELY
    return finding.after_impact, GRAVITY[finding.severity], not likely, finding.kind in SYMPTOMS


def _belongs(root: Finding, finding: Finding, reach: Explains) -> bool:
    """Whether a finding is of the course of events that another began; what somebody had set or done before is none."""
    return (
        not finding.parameters  # somebody changed them
        and not any(one.severity == "info" and one.suspect in ("parameter", "operation") for one in (root, finding))
        and finding.kind in reach.get(root.kind, frozenset())
        and may_refuse(root, finding)
        and not (root.kind == "battery" and _needs_no_pack(root, finding))
        and root.onset_s <= finding.onset_s + SLACK_S
        and root.end_s >= finding.onset_s - OVER_S
        and (finding.probability < LIKELY or (root.probability >= LIKELY and not _only_set(root, finding)))
    )


def _is_much_surer(finding: Finding, root: Finding, reach: Explains) -> bool:
    """Whether a finding stands against another as the cause of what followed both: as grave, much surer, and no
    consequence of it."""
    return (
        _rank(finding) == _rank(root)
        and finding.probability >= root.probability + MUCH_SURER
        and not _belongs(root, finding, reach)
    )


def _brought_down(finding: Finding) -> bool:
    """Whether it led to the loss of a vehicle: that is told before what led to nothing."""
    return any(one.kind in ("attitude", "crash") for one in finding.consequences)


def _needs_no_pack(battery: Finding, finding: Finding) -> bool:
    """Whether a battery is no reason of it. A pack makes no inertial sensor wrong, unless the autopilot's own supply
    fails with it; one that was not charged weakens not one motor among several, nor a supply of 5 V; of a monitor that
    measures none only the failsafe acts: it charges no pack, and empties none; and a supply that was low all along,
    and that did not fall at the end, ends no log."""
    if battery.title.startswith(OF_MONITOR):
        return finding.kind not in _OF_A_FAILSAFE or finding.title == UNCHARGED
    is_one_of_several = finding.kind == "motor" or finding.title.startswith(OWN_SUPPLY)
    of_sensor = finding.kind == "imu" and not battery.title.startswith(OWN_SUPPLY)
    of_the_end = finding.kind == "log" and battery.title == LOW_SUPPLY
    return of_sensor or of_the_end or (battery.title == UNCHARGED and is_one_of_several)


def may_refuse(cause: Finding, finding: Finding) -> bool:
    """Whether a refusal to arm speaks of what a part that failed keeps it from; of anything else there is none."""
    speaks = REFUSES.get(cause.kind)
    return (
        finding.kind != "prearm" or speaks is None or speaks.search(f"{finding.title} {finding.evidence}") is not None
    )


def _led_to(root: Finding, others: Iterable[Finding], explains: Explains) -> list[Finding]:
    """What of others a finding led to, step by step."""
    found, left, steps = list[Finding](), list(others), [root]
    while steps:
        cause = steps.pop()
        after = [one for one in left if cause.onset_s <= one.onset_s and one.kind in explains.get(cause.kind, ())]
        left = [one for one in left if one not in after]
        found += after
        steps += after
    return found


def _failed_by_itself(root: Finding, finding: Finding) -> bool:
    """Whether a part surely failed long after a setting began to tell, by no step from one to the other."""
    surely = finding.suspect == "hardware" and finding.probability >= LIKELY
    return surely and root.suspect == "parameter" and finding.onset_s > root.onset_s + UNLINKED_S


def _only_set(cause: Finding, finding: Finding) -> bool:
    """Whether a setting is to have broken a part that surely failed: both are told, unless it was changed just then."""
    return cause.suspect == "parameter" and not cause.parameters and finding.suspect == "hardware"


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
