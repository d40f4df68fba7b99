"""The verdict on a run: composed here once, and only printed by reports, history, watch, fleet and the app.

It is made of a diagnosis, or of the document of one that was remembered. Needs nothing that is slow to import.
"""

from __future__ import annotations

import math
import re
import textwrap
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Literal, Protocol, TypeVar

from care_core.diagnose.next_step import next_step
from care_core.diagnose.records import MISSION_FAILED, UNLIKELY, Confidence, Diagnosis, Hypothesis, Since, Status, helps
from care_core.ecosystems.findings import NOT_READY, SHOW_WHY, WHOLE_LOG, FindingKind, Severity, SuspectKind
from care_core.ecosystems.ranking import LIKELY, SYMPTOMS
from care_core.errors import ExitCode
from care_core.records import Record, replace
from care_core.run import FIT_WORDS, NO_PROFILE_FOR, Fit, FitVerdict
from care_core.text import clean, listed, log_time, percent

RunStatus = Status | Literal["unreadable"]
"""What became of a log: the status of its run, or that it could not be read."""

STATUS_WORDS: dict[RunStatus, str] = {
    "ok": "OK",
    "fault": "FAULT",
    "not_evaluated": "NOT EVALUATED",
    "unreadable": "UNREADABLE",
}
UNKNOWN_PARAMETER = "a parameter that the profile does not know"
GUESS = "\u00a0probability\u00a0(a\u00a0guess)"
NO_GOALS = "no goals are recorded: what the robot was to do is not known"
_MEASURED = re.compile(r"\s*\([^)]*\d[^)]*\)")
"""What a text has in parentheses, with a number."""
_CLAUSE = re.compile(r"\s*[,;(]")
"""What ends the first clause of a reason."""
NO_LIMITS = "no limits for time and energy, no causes by parameters"
FEW = 2
"""Objectives that are named with the reason why they could not be judged."""
MOST_FINDINGS = 2
"""Findings that the sentence names."""
AS_WELL = 0.1
"""Difference from which on it is told that a cause may have acted beside those above it."""
LINE, LINES, _BROKEN = 80, 2, 12
"""Columns, and lines of a headline: what was missed first and what ended the run; the rest stands below. Lines end
between words, so many columns early."""
BUT = "but "
"""What the sentence of a run begins with that met its objectives while a part of it failed."""

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
    @property
    def suspect(self) -> SuspectKind: ...
    @property
    def probability(self) -> float | None: ...


class SeenSuspect(Protocol):
    """A parameter outside the profile that may have lost the run, of a diagnosis or of its document."""

    @property
    def name(self) -> str: ...
    @property
    def text(self) -> str:
        """Value, default, and what speaks against it."""


F = TypeVar("F", bound=SeenFinding)


class Reason(Record):
    """One explanation of the failure in a clause."""

    probability: float
    text: str
    name: str
    """The parameter or the finding that it names, empty for chance and for what no log shows."""
    is_parameter: bool = False

    def __str__(self) -> str:
        return f"{percent(self.probability)} {self.text}"


class Advice(Record):
    """What to change with what it promises, or why nothing is advised."""

    change: str = ""
    """Empty where nothing is advised."""
    odds: float | None = None
    """Probability that all objectives are met with the change; None where it was not measured."""
    odds_as_driven: float | None = None
    """The same without it; None for a remembered run."""
    is_guess: bool = False
    """Whether a value of the change is one that no training run came near."""
    cause: float | None = None
    """Probability that what is changed caused the failure; None where it is not among what explains it."""
    alone: str = ""
    """The one of several changes that explains it; the others only add to the odds. Empty where more of them do."""
    confidence: Confidence | None = None
    """How well training supports that."""
    by_hand: bool = False
    """Whether the operator chose the change: what is predicted of it is told, and nobody advises it."""
    why: str = ""
    """Why another parameter is changed than the likeliest cause, or why it adds little; empty where neither."""
    refusal: str = ""
    """Why nothing is advised, empty where nothing failed."""

    def __str__(self) -> str:
        if not self.change:
            return f"No change advised: {self.refusal}" if self.refusal else ""
        change = f"Chosen by hand: {self.change}" if self.by_hand else f"Change {self.change}{self._sure}"
        why = f"; {self.why}" if self.why else ""
        if self.by_hand and not helps(self.odds, self.odds_as_driven):
            why = f"; it is not predicted to help{why}"
        return f"{change}: {promise(self.odds, self.odds_as_driven, self.is_guess)}{why}"

    @property
    def _sure(self) -> str:
        """How likely it is the cause, and a warning where training says little of that."""
        if self.cause is None:
            return "" if self.confidence is None else f" ({self.confidence} confidence in the cause)"
        together = " together" if ", " in self.change and not self.alone else ""
        doubt = ", weak training support" if self.confidence == "low" else ""
        alone = f"{self.alone} " if self.alone else ""
        return f" ({alone}{percent(self.cause)} the cause{together}{doubt})"


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
    others: str = ""
    """Which other missions of the log failed, empty where none did."""
    against: str = ""
    """Whose configuration it was judged against, where that is not the profile's own reference."""

    @property
    def word(self) -> str:
        return STATUS_WORDS[self.status]

    @property
    def told(self) -> str:
        """The rest of the headline, from its colon or comma on."""
        return f", {self.failed}" if self.has_but else f": {self.failed}"

    @property
    def has_but(self) -> bool:
        """Whether the run met its objectives while a part of it failed."""
        return self.failed.startswith(BUT)

    @property
    def headline(self) -> str:
        return f"{self.word}{self.told}"

    @property
    def exit_code(self) -> ExitCode:
        return exit_code(self.status)

    @property
    def lines(self) -> tuple[str, ...]:
        """The verdict as every report begins."""
        next_step = f"Next: {self.next_step}" if self.next_step else ""
        return tuple(filter(None, (self.headline, self.against, self.others, str(self.advice), next_step, self.fit)))

    @property
    def in_short(self) -> str:
        """For a line among many: the likeliest reason of a fault, or what could not be judged; empty where all is
        well."""
        if self.status == "fault" and self.reasons and self.reasons[0].name:
            return f"{percent(self.reasons[0].probability)} {self.reasons[0].name}"
        if self.status == "fault":
            return f"{self.failed}; no cause stands out"
        return "" if self.status == "ok" and not self.has_but else self.failed


def verdict_of(diagnosis: Diagnosis) -> Verdict:
    """The verdict of a diagnosis."""
    fit, objectives, findings = diagnosis.profile.fit, diagnosis.objectives, diagnosis.health.findings
    status = status_of({one.status for one in objectives}, {one.severity for one in findings}, fit.verdict)
    own = diagnosis.run.mission.index
    missions = diagnosis.missions
    verdict = compose(
        diagnosis.profile.title,
        fit,
        objectives,
        findings,
        reasons_of(diagnosis.hypotheses, findings, diagnosis.outside),
        _advice(diagnosis),
        next_step(diagnosis, has_failed=status == "fault"),
        [(m.mission.index, m.reason) for m in missions if m.status == "fault" and m.mission.index != own],
    )
    return replace(verdict, against=_against(diagnosis.since))


def _against(since: Since | None) -> str:
    if since is None or not since.is_reference:
        return ""
    return f"Judged against the configuration of {Path(since.log).name}, not against the profile's own reference"


def why_of(shown_by: str, abstained: str | None, otherwise: str) -> str:
    """What stands beside a change: that nothing is advised, what shows it, or why this one."""
    if abstained:
        return f"no change is advised: {abstained}"
    return f"this run shows it: {shown_by}" if shown_by else otherwise


def share_of(changed: Collection[str], hypotheses: Sequence[Hypothesis]) -> float | None:
    """Probability that these parameters caused the failure; None where none of them is among what explains it."""
    shares = [one.probability for one in hypotheses if one.what == "parameter" and one.name in changed]
    return min(sum(shares), 1.0) if shares else None


def alone_of(changed: Collection[str], hypotheses: Sequence[Hypothesis]) -> str:
    """Which of several changed parameters explains the failure, empty where more than one of them may have acted."""
    acts = {one.name: one.acts for one in hypotheses if one.what == "parameter" and one.name in changed}
    acted = [name for name, share in acts.items() if share >= UNLIKELY]
    return acted[0] if len(acted) == 1 and len(changed) > 1 else ""


def _advice(diagnosis: Diagnosis) -> Advice:
    fix = diagnosis.fix
    if fix is None:
        return Advice(refusal=clean(diagnosis.abstained or ""))
    changed = {change.option.name for change in fix.changes}
    causes = (cause for fault in diagnosis.faults for cause in fault.causes)
    return Advice(
        change=clean(", ".join(map(str, fix.changes))),
        odds=fix.odds,
        odds_as_driven=diagnosis.odds_as_driven,
        is_guess=fix.is_guess,
        cause=share_of(changed, diagnosis.hypotheses),
        alone=clean(alone_of(changed, diagnosis.hypotheses)),
        confidence=next((cause.confidence for cause in causes if cause.option.name in changed), None),
        by_hand=fix.by_hand,
        why=clean(why_of(fix.shown_by, diagnosis.abstained, diagnosis.why_this)),
    )


def compose(
    profile: str,
    fit: Fit,
    objectives: Sequence[JudgedObjective],
    findings: Sequence[SeenFinding],
    reasons: tuple[Reason, ...],
    advice: Advice,
    next_step: str,
    others: Sequence[tuple[int, str]] = (),
) -> Verdict:
    """The verdict out of what was judged and found; `profile` is empty where none fits. `others`: number and reason of
    the other missions of the log that failed."""
    status = status_of({one.status for one in objectives}, {one.severity for one in findings}, fit.verdict)
    failed = clean(_failed(status, fit.verdict, objectives, findings, " in this run" if others else ""))
    return Verdict(
        fit=clean(fit_line(profile, fit, LINES)),
        status=status,
        failed=failed,
        advice=replace(advice, why=_but_for(failed, advice.why), refusal=_but_for(failed, advice.refusal)),
        reasons=reasons,
        next_step=clean(next_step),
        others=clean(_others(others)),
    )


def _but_for(headline: str, text: str) -> str:
    """A text without the end that the headline says in the same words."""
    told, clauses = headline.casefold(), text.replace(NOT_READY, "").split(": ")
    bare = _MEASURED.sub("", told)  # an explanation is told without what was measured
    ends = (i for i in range(len(clauses)) if (said := ": ".join(clauses[i:]).casefold()) in told or said in bare)
    end = next(ends, None)
    return text if end is None else ": ".join(clauses[:end])


def _others(failed: Sequence[tuple[int, str]]) -> str:
    """That a good mission which was flown last hides none that failed."""
    if not failed:
        return ""
    named = ", ".join(f"mission {index} ({reason})" for index, reason in failed[:MOST_FINDINGS])
    more = f" and {len(failed) - MOST_FINDINGS} more" if len(failed) > MOST_FINDINGS else ""
    return f"In the same log: FAULT in {named}{more}; look at it with --mission {failed[0][0]}"


def reasons_of(
    hypotheses: Sequence[Hypothesis], findings: Sequence[SeenFinding], outside: Sequence[SeenSuspect] = ()
) -> tuple[Reason, ...]:
    """What explains a failure in clauses; `outside`: the suspects that no profile models."""
    return tuple(_reason(one, findings, outside) for one in hypotheses)


def _reason(one: Hypothesis, findings: Sequence[SeenFinding], outside: Sequence[SeenSuspect]) -> Reason:
    name = "" if one.what == "chance" else clean(one.name)
    text = clean(hypothesis_text(one, findings, outside))
    return Reason(one.probability, text, name, one.what == "parameter")


def status_of(objectives: Collection[Status], severities: Collection[Severity], fit: FitVerdict) -> Status:
    """What a whole run came to. Not evaluated is not OK; without a profile nobody knows a limit of time or energy."""
    if "fault" in objectives or "critical" in severities:
        return "fault"
    return "not_evaluated" if "not_evaluated" in objectives or not objectives or fit == "no" else "ok"


def exit_code(*statuses: RunStatus) -> ExitCode:
    """What runs mean for the process that asked: the gravest of their statuses."""
    return next((code for status, code in _GRAVEST if status in statuses), ExitCode.OK)


def _failed(
    status: Status,
    fit: FitVerdict,
    objectives: Sequence[JudgedObjective],
    findings: Sequence[SeenFinding],
    where: str,
) -> str:
    """`where`: of which run nothing was found, where another of the log failed."""
    if status == "fault":
        return fault_sentence(objectives, findings)
    unknown = [one for one in objectives if one.status == "not_evaluated"]
    if fit == "no" and len(unknown) == len(objectives):
        return why_unjudged(findings)
    if unknown:
        return _unjudged(unknown, f"no fault was found{where}", is_all=len(unknown) == len(objectives))
    if status == "not_evaluated" and fit == "no":
        met = listed([one.name for one in objectives if one.status == "ok"])
        return f"{met} are OK; no profile fits, so nothing else was judged"
    if status == "not_evaluated":
        return "nothing could be judged"
    part = next(filter(_is_broken_part, findings), None)
    return "all objectives are within their thresholds" if part is None else f"{BUT}{_with_time(part)}"


def _unjudged(unknown: Sequence[JudgedObjective], found: str, *, is_all: bool) -> str:
    """Why objectives could not be judged, by their reasons; whose a reason is goes without saying where it is that of
    many, or the first of many."""
    named: dict[str, list[JudgedObjective]] = {}
    for one in unknown:
        named.setdefault(_CLAUSE.split(one.reason or "")[0], []).append(one)
    if is_all and len(named) == 1 and unknown[0].reason:
        return unknown[0].reason
    room = LINES * LINE - len(f"{STATUS_WORDS['not_evaluated']}: ; {found}") - _BROKEN
    first, *others = named.values()
    clauses = [_unjudged_for(first, is_one_of_many=len(unknown) > FEW), *(_unjudged_for(group) for group in others)]
    return "; ".join((*_in_lines(clauses, room), found))


def _unjudged_for(alike: Sequence[JudgedObjective], *, is_one_of_many: bool = False) -> str:
    """What kept objectives from being judged that share the first clause of their reasons."""
    names, reason = [one.name for one in alike], alike[0].reason
    told = ", ".join(names).replace("_", " ")
    if _ASKED_OF_RUN.keys() >= set(names):
        told = f"whether it {listed([_ASKED_OF_RUN[name] for name in names])}"
    if not reason:
        return f"{told} could not be evaluated"
    if is_one_of_many or len(alike) > FEW:
        return reason
    answers = told.startswith("whether") and reason.startswith("it ")  # what it did says what is not known
    return _HINT.sub("", reason if answers else f"{told}: {reason}")


_HINT = re.compile(r" \((?:record|the file) .*\)$")
"""What is to be done about a reason, which stands with the objective."""


_ASKED_OF_RUN = {
    "armed": "armed", "took_off": "took off", "moved": "moved", "no_crash": "crashed", "no_failsafe": "met a failsafe",
    "landed": "landed", "disarmed": "was disarmed",
}  # fmt: skip
"""What a run is asked that flew no mission, in words that say neither yes nor no."""


_CAME_DOWN = ("control was lost at ", "it hit the ground at ")
"""How a shortfall begins of which a finding tells more."""


def fault_sentence(objectives: Sequence[JudgedObjective], findings: Sequence[SeenFinding]) -> str:
    """What was missed, and the first critical findings: as much of it as two lines hold."""
    broken = list(dict.fromkeys(one.sentence for one in objectives if one.status == "fault"))
    is_refused = any("arming was refused" in sentence for sentence in broken)
    worst = [one for one in _worst(findings) if one.title not in "; ".join(broken)]
    found = [_with_time(one) for one in worst if not (is_refused and one.kind == "prearm")]
    if not found and any(sentence.endswith((MISSION_FAILED, " not met")) for sentence in broken):
        found = [_with_time(one) for one in findings if one.severity == "warning"][:1]
    if not _ASKED_OF_RUN.keys() >= {one.name for one in objectives} and all(one.status == "ok" for one in objectives):
        found.append("every objective was met")
    first, *others = [clause for sentence in broken for clause in sentence.split("; ")] or found[:1]
    told = {log_time(one.onset_s) for one in worst if one.kind in ("attitude", "crash")}
    others = [one for one in others if not (one.startswith(_CAME_DOWN) and one.rpartition(" at ")[2] in told)]
    every = list(dict.fromkeys((first, *found, *others)))
    clauses = [one for one in every if not any(other.startswith(f"{one} at ") for other in every)]
    first = clauses[0]
    kept = _in_lines(clauses, LINES * LINE - len(f"{STATUS_WORDS['fault']}: ") - LINE // 8)
    onsets = [one.onset_s for one in worst if one.onset_s is not None and _with_time(one) in kept]
    begun_s = min(onsets, default=-math.inf)
    early = [one for one in others if one in kept and _time_told(one) < begun_s]
    in_order = list(dict.fromkeys((first, *early, *kept)))
    # Where the first says when it was, what came before it is told before it.
    return "; ".join(sorted(in_order, key=_time_told) if _time_told(first) < math.inf else in_order)


_TIME_TOLD = re.compile(r" at (\d+(?:\.\d+)?) s\b")


def _time_told(clause: str) -> float:
    """When it was, by the words of a clause; infinity where they do not say."""
    told = _TIME_TOLD.search(clause)
    return float(told[1]) if told else math.inf


def _in_lines(clauses: Sequence[str], width: int) -> list[str]:
    """As many of the clauses, the first always, as have room."""
    kept = list(clauses[:1])
    for clause in clauses[1:]:
        if len("; ".join([*kept, clause])) <= width:
            kept.append(clause)
    return kept


def _worst(findings: Sequence[F]) -> list[F]:
    """The first critical findings, those before the impact where there are any."""
    critical = [one for one in findings if one.severity == "critical"]
    return ([one for one in critical if not one.after_impact] or critical)[:MOST_FINDINGS]


def _with_time(finding: SeenFinding) -> str:
    return f"{finding.title} at {log_time(finding.onset_s)}"


def _is_broken_part(finding: SeenFinding) -> bool:
    """Whether a part surely failed."""
    is_sure = finding.probability is not None and finding.probability >= LIKELY
    return finding.severity == "warning" and finding.suspect == "hardware" and is_sure


def why_unjudged(findings: Sequence[SeenFinding]) -> str:
    """Why nothing is judged where no profile fits: what kept the vehicle from arming, or that too little is there."""
    refused = next((one.title for one in findings if one.kind == "prearm"), "")
    if refused:
        return f"{refused} (it never armed)"
    return next((one.title for one in findings if one.source == WHOLE_LOG), NO_GOALS)


def fit_words(profile: str, verdict: FitVerdict) -> str:
    """Which profile, empty for none, and how well it fits."""
    return f"Profile {profile} {FIT_WORDS[verdict]}" if profile else "No profile fits"


def fit_line(profile: str, fit: Fit, lines: int = 1, line: int = LINE) -> str:
    """The same in so many lines of so many cells at most: the first reason, and how many more stand below."""
    if not profile:
        unknown = (one[one.index(NO_PROFILE_FOR) :] for one in fit.reasons if NO_PROFILE_FOR in one)
        return f"No profile fits this log: {next(unknown, NO_LIMITS)}"
    if not fit.reasons:
        return fit_words(profile, fit.verdict)
    more = f" (and {len(fit.reasons) - 1} more)" if len(fit.reasons) > 1 else ""
    width = line if lines == 1 else lines * line - _BROKEN
    text = f"{fit_words(profile, fit.verdict)}: {fit.reasons[0]}"
    return f"{textwrap.shorten(text, width - len(more), placeholder=' ...')}{more}"


def fit_text(profile: str, fit: Fit) -> str:
    """Which profile (empty: none) fits how well, and what that means for the answer."""
    reasons = f": {'; '.join(fit.reasons)}" if fit.reasons else ""
    cautions = {"fits": "", "partly": ", so confidence is low at most", "no": " (training tells nothing of this log)"}
    return f"{fit_words(profile, fit.verdict)}{reasons}{cautions[fit.verdict] if profile else ''}"


def chance(share: float, is_guess: bool = False) -> str:
    """A probability in words. No line is broken before its warning: an operator may read that line alone."""
    return f"{percent(share)}{GUESS if is_guess else ' probability'}"


def promise(share: float | None, as_driven: float | None, is_guess: bool = False) -> str:
    """The odds of a change, where they were measured, beside those of the same run without it."""
    if share is None:
        return "odds not measured"
    return f"{chance(share, is_guess)} that all objectives are met{beside(as_driven)}"


def beside(as_driven: float | None) -> str:
    """What stands behind every promise: the odds as driven, where they are known."""
    return "" if as_driven is None else f"; as driven {percent(as_driven)}"


def alone(share: float, as_driven: float | None) -> str:
    """The odds where only one cause is changed, beside those without."""
    return f"{percent(share)} if only this is changed{beside(as_driven)}"


def hypothesis_text(one: Hypothesis, findings: Sequence[SeenFinding] = (), outside: Sequence[SeenSuspect] = ()) -> str:
    """An explanation in a clause, with how likely it acted beside those above it where that is another matter. What
    likely did has to be right before the next run, however little is left for it to explain alone."""
    is_both = one.what != "chance" and one.acts - one.probability >= AS_WELL
    advice = ", so put it right too" if one.acts >= LIKELY else ""
    too = f"; {percent(one.acts)} that it acted as well{advice}" if is_both else ""
    return f"{_explanation(one, findings, outside)}{too}"


def _explanation(one: Hypothesis, findings: Sequence[SeenFinding], outside: Sequence[SeenSuspect]) -> str:
    """A finding that is itself a symptom stands for what the log does not show."""
    if one.what == "parameter" and not one.name:
        return UNKNOWN_PARAMETER
    if one.what == "parameter":
        return f"the parameter {next((suspect.text for suspect in outside if suspect.name == one.name), one.name)}"
    if one.name:
        is_symptom = any(finding.title == one.name and finding.kind in SYMPTOMS for finding in findings)
        is_symptom &= one.name not in SHOW_WHY
        return f"{one.name}; the log does not show why" if is_symptom else one.name
    return "bad luck: this mission sometimes fails with the reference settings too"
