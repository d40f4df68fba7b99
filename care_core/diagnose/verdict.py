"""The verdict on a run: composed here once, and only printed by reports, history, watch, fleet and the app.

It is made of a diagnosis, or of the document of one that was remembered. Needs nothing that is slow to import.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Literal, Protocol

from care_core.diagnose.records import Confidence, Diagnosis, Hypothesis, Status
from care_core.ecosystems.findings import WHOLE_LOG, FindingKind, Severity
from care_core.ecosystems.ranking import SYMPTOMS
from care_core.errors import ExitCode
from care_core.records import Record
from care_core.run import FIT_WORDS, Fit, FitVerdict
from care_core.text import clean, seconds

RunStatus = Status | Literal["unreadable"]
"""What became of a log: the status of its run, or that it could not be read."""

STATUS_WORDS: dict[RunStatus, str] = {
    "ok": "OK",
    "fault": "FAULT",
    "not_evaluated": "NOT EVALUATED",
    "unreadable": "UNREADABLE",
}
GUESS = "\u00a0probability\u00a0(a\u00a0guess)"
NO_LIMIT = "no limit of this mission is known; what happened is told below"
NO_LIMITS = "no profile fits: no limits for time and energy, no causes by parameters"
MOST_FINDINGS = 2
"""Findings that the sentence names."""

_GRAVEST: tuple[tuple[RunStatus, ExitCode], ...] = (
    ("fault", ExitCode.FAULT),
    ("unreadable", ExitCode.UNREADABLE),
    ("not_evaluated", ExitCode.NOT_EVALUATED),
    ("ok", ExitCode.OK),
)


class JudgedObjective(Protocol):
    """An objective of a diagnosis or of its document."""

    @property
    def name(self) -> str: ...
    @property
    def status(self) -> Status: ...
    @property
    def reason(self) -> str | None: ...
    @property
    def sentence(self) -> str:
        """What it came to against what was wanted."""


class SeenFinding(Protocol):
    """A finding of a diagnosis or of its document."""

    @property
    def kind(self) -> FindingKind: ...
    @property
    def title(self) -> str: ...
    @property
    def onset_s(self) -> float | None: ...
    @property
    def severity(self) -> Severity: ...
    @property
    def after_impact(self) -> bool: ...
    @property
    def source(self) -> str: ...


class Reason(Record):
    """One explanation of the failure in a clause."""

    probability: float
    text: str
    name: str
    """The parameter or the finding that it names, empty for chance and for what no log shows."""

    def __str__(self) -> str:
        return f"{self.probability:.0%} {self.text}"


class Advice(Record):
    """What to change with what it promises, or why nothing is advised."""

    change: str = ""
    """Empty where nothing is advised."""
    odds: float = 0.0
    """Probability that all objectives are met with the change."""
    odds_as_driven: float | None = None
    """The same without it; None for a remembered run."""
    is_guess: bool = False
    """Whether a value of the change is one that no training run came near."""
    confidence: Confidence | None = None
    """How sure the cause is that the change mends."""
    refusal: str = ""
    """Why nothing is advised, empty where nothing failed."""

    def __str__(self) -> str:
        if not self.change:
            return f"No change advised: {self.refusal}" if self.refusal else ""
        without = "" if self.odds_as_driven is None else f" ({self.odds_as_driven:.0%} without the change)"
        sure = f", {self.confidence} confidence in the cause" if self.confidence else ""
        return f"Change {self.change}: {chance(self.odds, self.is_guess)} that all objectives are met{without}{sure}"


class Verdict(Record):
    """The answer to one run, its texts clean."""

    fit: str
    """Which profile judged it, and how well that fits."""
    status: Status
    failed: str
    """What failed, or how far nothing did; never more than was judged."""
    advice: Advice
    reasons: tuple[Reason, ...]
    """What explains the failure, the likeliest first."""
    next_step: str

    @property
    def headline(self) -> str:
        return f"{STATUS_WORDS[self.status]}: {self.failed}"

    @property
    def exit_code(self) -> ExitCode:
        return exit_code(self.status)

    @property
    def lines(self) -> tuple[str, ...]:
        """The verdict as every report begins."""
        lines = (self.fit, self.headline, str(self.advice), f"Next: {self.next_step}" if self.next_step else "")
        return tuple(filter(None, lines))

    @property
    def in_short(self) -> str:
        """For a line among many: the likeliest reason of a fault, or what could not be judged; empty where all is
        well."""
        if self.status == "fault" and self.reasons and self.reasons[0].name:
            return f"{self.reasons[0].probability:.0%} {self.reasons[0].name}"
        if self.status == "fault":
            return f"{self.failed}; no cause stands out"
        return "" if self.status == "ok" else self.failed


def verdict_of(diagnosis: Diagnosis) -> Verdict:
    """The verdict of a diagnosis."""
    return compose(
        diagnosis.profile.title,
        diagnosis.profile.fit,
        diagnosis.objectives,
        diagnosis.health.findings,
        diagnosis.hypotheses,
        _advice(diagnosis),
        diagnosis.tell_more,
    )


def _advice(diagnosis: Diagnosis) -> Advice:
    fix = diagnosis.fix
    if fix is None:
        return Advice(refusal=clean(diagnosis.abstained or ""))
    changed = {change.option.name for change in fix.changes}
    causes = (cause for fault in diagnosis.faults for cause in fault.causes)
    return Advice(
        change=clean(", ".join(map(str, fix.changes))),
        odds=fix.p_fixed,
        odds_as_driven=diagnosis.odds_as_driven,
        is_guess=fix.is_guess,
        confidence=next((cause.confidence for cause in causes if cause.option.name in changed), None),
    )


def compose(
    profile: str,
    fit: Fit,
    objectives: Sequence[JudgedObjective],
    findings: Sequence[SeenFinding],
    hypotheses: Sequence[Hypothesis],
    advice: Advice,
    tell_more: Sequence[str],
) -> Verdict:
    """The verdict out of what was judged and found; `profile` is empty where none fits."""
    status = status_of({one.status for one in objectives}, {one.severity for one in findings}, fit.verdict)
    return Verdict(
        fit=clean(fit_text(profile, fit)),
        status=status,
        failed=clean(_failed(status, fit.verdict, objectives, findings)),
        advice=advice,
        reasons=tuple(_reason(one, findings) for one in hypotheses),
        next_step=clean(_next_step(status, fit.verdict, advice, hypotheses, tell_more)),
    )


def _reason(one: Hypothesis, findings: Sequence[SeenFinding]) -> Reason:
    name = "" if one.what == "chance" else clean(one.name)
    return Reason(one.probability, clean(hypothesis_text(one, findings)), name)


def status_of(objectives: Collection[Status], severities: Collection[Severity], fit: FitVerdict) -> Status:
    """What a whole run came to. Not evaluated is not OK; without a profile nobody knows a limit of time or energy."""
    if "fault" in objectives or "critical" in severities:
        return "fault"
    return "not_evaluated" if "not_evaluated" in objectives or not objectives or fit == "no" else "ok"


def exit_code(*statuses: RunStatus) -> ExitCode:
    """What runs mean for the process that asked: the gravest of their statuses."""
    return next((code for status, code in _GRAVEST if status in statuses), ExitCode.OK)


def _failed(
    status: Status, fit: FitVerdict, objectives: Sequence[JudgedObjective], findings: Sequence[SeenFinding]
) -> str:
    if status == "fault":
        broken = [one for one in objectives if one.status == "fault"]
        if fit == "no":
            return "; ".join((*_worst(findings), *(one.reason or one.sentence for one in broken)))
        return "; ".join([one.sentence for one in broken] or _worst(findings))
    unknown = [one for one in objectives if one.status == "not_evaluated"]
    if fit == "no" and len(unknown) == len(objectives):
        return unjudged(findings)
    if unknown:
        reason = next((f": {one.reason}" for one in unknown if one.reason), "")
        limits = f" ({NO_LIMITS})" if fit == "no" else ""
        return f"no fault found, but {', '.join(one.name for one in unknown)} could not be evaluated{reason}{limits}"
    if status == "not_evaluated":
        return f"nothing that could be judged failed ({NO_LIMITS})" if fit == "no" else "nothing could be judged"
    return "all objectives are within their thresholds"


def _worst(findings: Sequence[SeenFinding]) -> list[str]:
    """The first critical findings, those before the impact where there are any."""
    critical = [one for one in findings if one.severity == "critical"]
    named = [one for one in critical if not one.after_impact] or critical
    return [f"{one.title} at {seconds(one.onset_s)}" for one in named[:MOST_FINDINGS]]


def _next_step(
    status: Status, fit: FitVerdict, advice: Advice, hypotheses: Sequence[Hypothesis], tell_more: Sequence[str]
) -> str:
    if advice.change:
        return "make the change, run again, and check what it brought with 'care verify REPORT LOG'"
    first = next(iter(hypotheses), None)
    if first is not None and first.name and first.what in ("hardware", "world"):
        return f"look at what this names: {first.name}"
    if status == "fault" and tell_more:
        return tell_more[0]
    return "'care inspect LOG' tells what each profile would need" if fit == "no" else ""


def unjudged(findings: Sequence[SeenFinding]) -> str:
    """Why nothing is judged where no profile fits: what kept the vehicle from arming, or that too little is there."""
    refused = next((one.title for one in findings if one.kind == "prearm"), "")
    if refused:
        return f"{refused} (it never armed)"
    return next((one.title for one in findings if one.source == WHOLE_LOG), NO_LIMIT)


def fit_words(profile: str, verdict: FitVerdict) -> str:
    """Which profile, empty for none, and how well it fits."""
    return f"Profile {profile} {FIT_WORDS[verdict]}" if profile else "No profile fits"


def fit_text(profile: str, fit: Fit) -> str:
    """Which profile (empty: none) fits how well, and what that means for the answer."""
    reasons = f": {'; '.join(fit.reasons)}" if fit.reasons else ""
    caution = {"fits": "", "partly": ", so confidence is low at most", "no": " (nothing is advised)"}[fit.verdict]
    return f"{fit_words(profile, fit.verdict)}{reasons}{caution if profile else ''}"


def chance(share: float, is_guess: bool = False) -> str:
    """A probability in words. No line is broken before its warning: an operator may read that line alone."""
    return f"{share:.0%}{GUESS if is_guess else ' probability'}"


def hypothesis_text(one: Hypothesis, findings: Sequence[SeenFinding] = ()) -> str:
    """An explanation in a clause; a finding that is itself a symptom stands for what the log does not show."""
    if one.what == "parameter":
        return f"the parameter {one.name}"
    if one.name:
        is_symptom = any(finding.title == one.name and finding.kind in SYMPTOMS for finding in findings)
        return f"{one.name}; the log does not show why" if is_symptom else one.name
    unnamed = {
        "hardware": "a hardware fault that this log cannot show",
        "world": "something in the environment (wind, obstacle, load)",
    }
    return unnamed.get(one.what, "bad luck: this mission sometimes fails with the reference settings too")
