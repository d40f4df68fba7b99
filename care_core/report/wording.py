"""How times, findings and explanations are put, in reports and in the app. Needs nothing that is slow to import."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, TypeVar

from care_core.diagnose.records import Hypothesis, ObjectiveResult, Status
from care_core.ecosystems.findings import WHOLE_LOG, Finding, Health, Severity
from care_core.ecosystems.ranking import SYMPTOMS
from care_core.run import FIT_WORDS, FitVerdict

if TYPE_CHECKING:
    from care_core.report.document import ObjectiveEntry
    from care_core.report.happened import FindingEntry, FitEntry, HypothesisEntry
    from care_core.run import Fit

GUESS = "\u00a0probability\u00a0(a\u00a0guess)"
NO_LIMIT = "no limit of this mission is known; what happened is told below"
SEVERITY_WORDS: dict[Severity, str] = {"critical": "CRITICAL", "warning": "WARNING", "info": "note"}

F = TypeVar("F", bound="Finding | FindingEntry")


def fit_words(profile: str, verdict: FitVerdict) -> str:
    """Which profile, empty for none, and how well it fits."""
    return f"Profile {profile} {FIT_WORDS[verdict]}" if profile else "No profile fits"


def fit_text(profile: str, fit: Fit | FitEntry) -> str:
    """The first line of every output: which profile (empty: none), and how well it fits."""
    reasons = "; ".join(fit.reasons)
    caution = {"fits": "", "partly": " (confidence low at most)", "no": " (nothing is advised)"}[fit.verdict]
    return f"{fit_words(profile, fit.verdict)}{f': {reasons}' if reasons else ''}{caution if profile else ''}"


def chance(share: float, is_guess: bool = False) -> str:
    """A probability in words. No line is broken before its warning: an operator may read that line alone."""
    return f"{share:.0%}{GUESS if is_guess else ' probability'}"


def noted(findings: Sequence[F]) -> list[F]:
    """The findings but the one that says only that the log holds too little: the headline says so."""
    return [one for one in findings if one.source != WHOLE_LOG]


def unjudged(findings: Sequence[Finding | FindingEntry]) -> str:
    """Why nothing is judged where no profile fits: what kept the vehicle from arming, or that too little is there."""
    refused = next((one.title for one in findings if one.kind == "prearm"), "")
    if refused:
        return f"{refused} (it never armed)"
    return next((one.title for one in findings if one.source == WHOLE_LOG), NO_LIMIT)


NO_LIMITS = "no profile fits: no limits for time and energy, no causes by parameters"
WORST_NAMED = 2
"""Findings in a headline."""


def critical(health: Health) -> list[Finding]:
    """Findings that would stop a mission, those after it was down left out."""
    return [one for one in health.findings if one.severity == "critical" and not one.after_impact]


def said_without_profile(
    status: Status,
    objectives: Sequence[ObjectiveResult | ObjectiveEntry],
    worst: Sequence[str],
    findings: Sequence[Finding | FindingEntry],
) -> str:
    """The verdict on a run that no profile fits: what failed, or how far nothing did; never more than was judged."""
    if status == "fault":
        broken = [one.reason or one.name for one in objectives if one.status == "fault"]
        return "; ".join((*worst[:WORST_NAMED], *broken))
    unknown = [one.name for one in objectives if one.status == "not_evaluated"]
    if not objectives or len(unknown) == len(objectives):
        return unjudged(findings)
    if unknown:
        return f"nothing failed, but {', '.join(unknown)} could not be evaluated ({NO_LIMITS})"
    return f"nothing that could be judged failed ({NO_LIMITS})"


def hypothesis_text(one: Hypothesis | HypothesisEntry, findings: Sequence[Finding | FindingEntry] = ()) -> str:
    """An explanation in a clause; a finding that is itself a symptom stands for what the log does not show."""
    if one.what == "parameter":
        return f"the parameter {one.name}"
    if one.name:
        is_symptom = any(finding.title == one.name and finding.kind in SYMPTOMS for finding in findings)
        return f"something this log does not show: {one.name}" if is_symptom else one.name
    unnamed = {"hardware": "a part whose failure left no trace in this log", "world": "something the robot met"}
    return unnamed.get(one.what, "chance: the reference configuration fails like this as well")
