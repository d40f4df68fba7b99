"""The published triage document, `care.triage/1`: what other programs read. Its keys and types are an interface.

`Report` is the document with what people want beside it: the verdict, the diff and the commands.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Final, Literal

from care_core.configs.changes import apply_commands, unified_diff
from care_core.configs.driven import parameter_value
from care_core.configs.formats import format_for
from care_core.diagnose.records import (
    Cause,
    Circumstance,
    Confidence,
    Diagnosis,
    Dismissal,
    Fix,
    Hypothesis,
    MissionVerdict,
    Need,
    ObjectiveResult,
    Prediction,
    Since,
    Status,
    outcome,
    told_in_full,
)
from care_core.diagnose.verdict import (
    Advice,
    Verdict,
    alone,
    alone_of,
    chance,
    compose,
    promise,
    reasons_of,
    share_of,
    verdict_of,
    why_of,
)
from care_core.numbers import six_digits
from care_core.records import Meta, field
from care_core.report.entries import (
    DamageEntry,
    EventEntry,
    FindingEntry,
    damage_entries,
    event_entries,
    finding_entries,
)
from care_core.report.published import Document, publish, publishable
from care_core.run import FITS, Fit, Value, is_known, profile_title
from care_core.text import clean
from care_core.variables import ASSUMED, Change, Kind, Op, Threshold

SCHEMA_ID: Final = "care.triage/1"

Share = Annotated[float, Meta(ge=0, le=1)]
"""A probability, or a part of a whole."""


class ProfileEntry(Document, kw_only=True, omit_defaults=True):
    name: str
    version: str
    platform: str
    origin: str = ""
    """Where it is from, if it neither came with the program nor is one of the user's."""

    @property
    def title(self) -> str:
        """Its name, and where it is from if that needs to be known."""
        return profile_title(self.name, self.origin)


class LogEntry(Document, kw_only=True, omit_defaults=True):
    path: str
    format: str
    start: str | None
    duration_s: float
    damage: list[DamageEntry]
    sha256: str
    frame: str = ""
    """As the log says it; empty where it does not."""
    robot: str = ""
    """What tells whether a later log is of the same robot, without naming it; empty where nothing tells for sure."""


class ThresholdEntry(Document, kw_only=True):
    op: Op
    value: float

    def __str__(self) -> str:
        return f"{self.op} {self.value:g}"


class ObjectiveEntry(Document, kw_only=True):
    name: str
    value: float | None
    unit: str
    kind: Kind
    threshold: ThresholdEntry | None
    needs: Need | None = None
    """What the reference configuration would need for this mission, with its 80% interval."""
    basis: str = ""
    """What the threshold was made of, empty where it is a fixed one."""
    status: Status
    reason: str | None

    @property
    def sentence(self) -> str:
        """What it came to, where it was missed."""
        return outcome(self.name, self.kind, self.value, self.unit, str(self.threshold or ""), self.reason or "")

    @property
    def measured(self) -> str:
        """The value with its unit, empty where there is none."""
        return "" if self.value is None else f"{self.value:.4g} {self.unit}".rstrip()

    def prediction(self, predicted: PredictedValue) -> str:
        """A predicted value with its interval; empty for a yes-or-no objective, which has a probability alone."""
        if self.kind == "functional":
            return ""
        return f"{predicted.value:.4g} ({predicted.low:.4g} to {predicted.high:.4g}) {self.unit}".rstrip()

    @property
    def wanted(self) -> str:
        """The threshold with its unit and what it was made of, empty where it has none."""
        if self.threshold is None or (self.basis and self.value is None):
            return ""  # one made for this mission says nothing where it was not flown to its end
        bound = f"{self.threshold} {self.unit}".rstrip()
        return f"{bound} ({self.basis})" if self.basis else bound


class PredictedValue(Document, kw_only=True):
    value: float
    low: float
    high: float


class PredictedObjective(PredictedValue, kw_only=True):
    status: Status


class PromisedObjective(PredictedObjective, kw_only=True):
    p_ok: Share | None = None
    """Probability that its threshold is kept."""

    def odds(self, is_guess: bool) -> str:
        """How likely its threshold is kept, in words."""
        return "odds not measured" if self.p_ok is None else chance(self.p_ok, is_guess)


class CauseEntry(Document, kw_only=True):
    rank: int
    option: str
    path: list[str]
    path_ace: float | None
    contribution: float | None
    current: int | float
    assumed: bool = False
    """Whether no source holds `current`."""
    suggested: int | float | None
    predicted: PredictedValue | None
    p_fixed: Share | None
    confidence: Confidence
    edge_support: list[float | None]
    in_support: bool
    notes: list[str]

    @property
    def change(self) -> str:
        """From what was driven to what is suggested."""
        suggested = "" if self.suggested is None else f" → {self.suggested:g}"
        return f"{self.current:g}{ASSUMED if self.assumed else ''}{suggested}"

    def worth(self, as_driven: float | None) -> str:
        """What is to be thought of it, in clauses."""
        odds = "" if self.p_fixed is None else f", {alone(self.p_fixed, as_driven)}"
        outside = "" if self.in_support else ", outside the training runs"
        return f"{self.confidence} confidence{odds}{outside}"


class FaultEntry(Document, kw_only=True):
    objective: str
    causes: list[CauseEntry]


class ChangeEntry(Document, kw_only=True):
    option: str
    parameter: str | list[str]
    from_: int | float | None = field(name="from")
    """None where the vehicle had what is not a number."""
    to: int | float
    assumed: bool = False
    """Whether no source holds `from`."""
    reboot_required: bool

    @property
    def values(self) -> str:
        """From what to what."""
        return f"from {number_shown(self.from_)}{ASSUMED if self.assumed else ''} to {self.to:g}"

    def __str__(self) -> str:
        return f"{self.option} {number_shown(self.from_)}{ASSUMED if self.assumed else ''} -> {self.to:g}"


class FixSet(Document, kw_only=True):
    changes: list[ChangeEntry]
    p_fixed: Share | None
    """Null where the odds were not measured."""
    guess: bool = False
    """Whether a value is one that no training run came near."""
    shown_by: str = ""
    """The finding that shows the cause, where training says little of it."""
    predicted: dict[str, PromisedObjective]

    @property
    def odds(self) -> float | None:
        """What it promises, None where that was not measured."""
        return None if self.shown_by else self.p_fixed

    def sentence(self, as_driven: float | None) -> str:
        """The changes with what they promise."""
        return f"{', '.join(map(str, self.changes))}: {promise(self.odds, as_driven, self.guess)}"


class FixEntry(FixSet, kw_only=True):
    by_hand: bool = False
    """Whether the operator chose it, and no suggestion is."""
    why_this: str = ""
    """Why another parameter is changed than the likeliest cause, or why it adds little."""
    alternatives: list[FixSet]


class ParameterChangeEntry(Document, kw_only=True):
    parameter: str
    option: str | None
    from_: float | str | None = field(name="from")
    to: float | str | None


class SinceEntry(Document, kw_only=True):
    """What changed since a good run; `warnings` say what is odd about that log."""

    log: str
    warnings: list[str]
    changes: list[ParameterChangeEntry]


class EvidenceEntry(Document, kw_only=True):
    """A message of the log that speaks about the failure."""

    time_s: float | None
    kind: str
    text: str
    options: list[str]
    says: str


class CircumstanceEntry(Document, kw_only=True):
    """What the run met and no option set; `low` to `high` is where 95% of the training runs lie."""

    circumstance: str
    variable: str | None
    value: float | None
    unit: str
    low: float | None
    high: float | None
    text: str


class OutsideEntry(Document, kw_only=True):
    """A parameter that the profile does not model, and that may have lost the run."""

    name: str
    value: float | None
    """None where the vehicle had what is not a number."""
    usual: float
    """The last good run's value, else the firmware's default."""
    text: str


class MissionEntry(Document, kw_only=True):
    """A mission of the log with what became of it; `judged` is the one that the document is about."""

    index: int
    start_s: float | None
    end_s: float | None
    ended: bool
    status: Status
    reason: str
    judged: bool


class TriageDocument(Document, kw_only=True):
    """The answer for one run, as `care triage --json` prints it."""

    schema_: Literal["care.triage/1"] = field(default=SCHEMA_ID, name="schema")
    fit: Fit = field(default=FITS)
    profile: ProfileEntry | None
    """None where no profile fits the log."""
    log: LogEntry
    config: dict[str, int | float]
    context: dict[str, float | None]
    metrics: dict[str, float | None]
    objectives: list[ObjectiveEntry]
    faults: list[FaultEntry]
    fix: FixEntry | None
    abstained: str | None
    account: list[EventEntry] = field(default_factory=list)
    """What happened, in order of time."""
    findings: list[FindingEntry] = field(default_factory=list)
    """In the order told, the first cause first."""
    hypotheses: list[Hypothesis] = field(default_factory=list)
    """What explains the failure, the likeliest first; empty where nothing failed."""
    notes: list[str] = field(default_factory=list)
    """What the operator should know of the log, the configuration and the profile."""
    sources: dict[str, str] = field(default_factory=dict)
    """Where the value of each option came from: a record or topic of the log, or file:line."""
    since: SinceEntry | None = None
    """Only with `--since`."""
    missions: list[MissionEntry] = field(default_factory=list)
    """Every mission of the log."""
    evidence: list[EvidenceEntry] = field(default_factory=list)
    rivals: list[CircumstanceEntry] = field(default_factory=list)
    tell_more: list[str] = field(default_factory=list)
    dismissed: list[Dismissal] = field(default_factory=list)
    odds_as_driven: float | None = None
    """Probability that the next run meets all objectives as driven; null where nothing failed, or no model tells."""
    headline: str = ""
    """The verdict in a sentence."""
    next_step: str = ""
    """What to do next, empty where there is nothing to be done."""
    outside: list[OutsideEntry] = field(default_factory=list)
    """The suspects among the parameters that the profile does not model."""
    status: Status | None = None
    """What the run came to; null in a document that was written before it was told apart from `headline`."""


class Report(TriageDocument, kw_only=True):
    """The document with the verdict, the diff, and the commands that apply it."""

    verdict: Verdict
    diff: str
    apply: list[str]

    def told(self, fault: FaultEntry) -> tuple[list[CauseEntry], list[str]]:
        """The causes of which all is told, and the names of the others."""
        fixes = (self.fix, *self.fix.alternatives) if self.fix else ()
        changed = {change.option for fix in fixes for change in fix.changes}
        shown = [cause for cause in fault.causes if told_in_full(cause.option, self.hypotheses, changed)]
        return shown, [cause.option for cause in fault.causes if cause not in shown]


def build_document(diagnosis: Diagnosis) -> Report:
    """The document of a diagnosis. Text is cleaned; what is not a finite number becomes null."""
    run, log, fix = diagnosis.run, diagnosis.run.log, diagnosis.fix
    warnings = [clean(warning) for warning in diagnosis.profile.fit.reasons]
    verdict = verdict_of(diagnosis)
    return Report(
        profile=publish(ProfileEntry, diagnosis.profile) if diagnosis.profile.name else None,
        fit=publish(Fit, diagnosis.profile.fit),
        log=publish(
            LogEntry,
            log,
            damage=damage_entries(log.damage),
            frame=clean(log.facts.get("frame", "")),
            robot=log.robot.digest if log.robot else "",
        ),
        config={name: plain_number(value) for name, value in run.config.items() if math.isfinite(value)},
        context=_values(run.context),
        metrics=_values(run.metrics),
        objectives=[objective_entry(objective) for objective in diagnosis.objectives],
        faults=[
            FaultEntry(objective=fault.objective.name, causes=[_cause(cause, warnings) for cause in fault.causes])
            for fault in diagnosis.faults
        ],
        fix=None if fix is None else _fix(fix, diagnosis),
        abstained=publishable(diagnosis.abstained),
        odds_as_driven=estimate(diagnosis.odds_as_driven),
        notes=list(dict.fromkeys((*warnings, *map(clean, diagnosis.notes)))),
        sources=publishable(run.sources),
        since=None if diagnosis.since is None else _since(diagnosis.since),
        missions=[_mission(verdict, run.mission.index) for verdict in diagnosis.missions],
        evidence=[publish(EvidenceEntry, evidence) for evidence in run.evidence],
        rivals=[_circumstance(rival) for rival in diagnosis.rivals],
        tell_more=publishable(diagnosis.tell_more),
        dismissed=[publish(Dismissal, one) for one in diagnosis.dismissed],
        account=event_entries(diagnosis.health),
        findings=finding_entries(diagnosis.health),
        hypotheses=[
            publish(Hypothesis, h, probability=six_digits(h.probability), acts=six_digits(h.acts))
            for h in diagnosis.hypotheses
        ],
        outside=[publish(OutsideEntry, one, usual=one.back) for one in diagnosis.outside],
        headline=verdict.headline,
        status=verdict.status,
        next_step=verdict.next_step,
        verdict=verdict,
        diff="" if fix is None else unified_diff(run, fix.changes, by_hand=fix.by_hand),
        apply=[] if fix is None else apply_commands(fix.changes, format_for(log.format, run.settings)),
    )


def remembered_verdict(document: TriageDocument) -> Verdict:
    """The verdict of a document that was read back."""
    return compose(
        document.profile.title if document.profile else "",
        document.fit,
        document.objectives,
        document.findings,
        reasons_of(document.hypotheses, document.findings, document.outside),
        _advice(document),
        document.next_step,
        [(one.index, one.reason) for one in document.missions if one.status == "fault" and not one.judged],
    )


def leading_cause(document: TriageDocument) -> str:
    """What explains the failure of a document that was read back best: a parameter, a finding, or chance in words; of
    a run that nothing else could explain, the option that ranks first. Empty where there is none."""
    for reason in remembered_verdict(document).reasons[:1]:
        return reason.name or reason.text
    return next((cause.option for fault in document.faults for cause in fault.causes), "")


def _advice(document: TriageDocument) -> Advice:
    fix = document.fix
    if fix is None:
        return Advice(refusal=document.abstained or "")
    changed = {change.option for change in fix.changes}
    causes = (cause for fault in document.faults for cause in fault.causes)
    return Advice(
        change=", ".join(map(str, fix.changes)),
        odds=fix.odds,
        odds_as_driven=document.odds_as_driven,
        is_guess=fix.guess,
        cause=share_of(changed, document.hypotheses),
        alone=alone_of(changed, document.hypotheses),
        confidence=next((cause.confidence for cause in causes if cause.option in changed), None),
        by_hand=fix.by_hand,
        why=why_of(fix.shown_by, document.abstained, fix.why_this),
    )


def _since(since: Since) -> SinceEntry:
    changes = [
        ParameterChangeEntry(
            parameter=clean(change.parameter),
            option=None if change.option is None else change.option.name,
            from_=publishable(change.before),
            to=publishable(change.after),
        )
        for change in since.changes
    ]
    return publish(SinceEntry, since, changes=changes)


def estimate(value: float | None) -> float | None:
    """What the model says, to six digits, None where that is no finite number."""
    return six_digits(value) if value is not None and math.isfinite(value) else None


def plain_number(value: float) -> int | float:
    """A whole number without its point, as configuration files have it."""
    return int(value) if float(value).is_integer() else float(value)


def known_number(value: float) -> int | float | None:
    """The same, None for what is not a number."""
    return plain_number(value) if math.isfinite(value) else None


def number_shown(value: float | None) -> str:
    """A number of a document in words."""
    return "not a number" if value is None else f"{value:g}"


def _values(values: Mapping[str, Value]) -> dict[str, float | None]:
    return {name: publishable(float(value)) if is_known(value) else None for name, value in values.items()}


def objective_entry(result: ObjectiveResult) -> ObjectiveEntry:
    """An objective of a run against its threshold."""
    variable, threshold, need = result.variable, result.threshold, result.need
    return ObjectiveEntry(
        name=variable.name,
        value=publishable(result.value),
        unit=variable.unit,
        kind=variable.kind or "non-functional",
        threshold=None if threshold is None else _threshold(threshold, is_estimate=bool(result.basis)),
        needs=need and Need(six_digits(need.value), six_digits(need.low), six_digits(need.high)),
        basis=result.basis,
        status=result.status,
        reason=clean(result.reason) or None,
    )


def _threshold(threshold: Threshold, *, is_estimate: bool) -> ThresholdEntry:
    return ThresholdEntry(op=threshold.op, value=six_digits(threshold.bound) if is_estimate else threshold.bound)


def _mission(verdict: MissionVerdict, judged: int) -> MissionEntry:
    mission = verdict.mission
    return publish(
        MissionEntry, mission, status=verdict.status, reason=clean(verdict.reason), judged=mission.index == judged
    )


def _circumstance(one: Circumstance) -> CircumstanceEntry:
    return publish(CircumstanceEntry, one, circumstance=one.name, variable=one.variable or None)


def _cause(cause: Cause, warnings: list[str]) -> CauseEntry:
    notes = [clean(note.text) for note in cause.notes]
    return publish(
        CauseEntry,
        cause,
        option=cause.option.name,
        path=[node.name for node in cause.path],
        path_ace=estimate(cause.path_ace),
        contribution=estimate(cause.contribution),
        current=plain_number(cause.current),
        assumed=cause.is_assumed,
        suggested=None if cause.suggested is None else plain_number(cause.suggested),
        predicted=None if cause.predicted is None else _predicted(cause.predicted),
        p_fixed=estimate(cause.p_fixed),
        edge_support=[publishable(node.support) for node in cause.path[:-1]],
        notes=list(dict.fromkeys((*notes, *warnings))),
    )


def _predicted(prediction: Prediction) -> PredictedValue | None:
    value, low, high = estimate(prediction.value), estimate(prediction.low), estimate(prediction.high)
    if value is None or low is None or high is None:
        return None
    return PredictedValue(value=value, low=low, high=high)


def predicted_objective(prediction: Prediction) -> PredictedObjective | None:
    """A prediction with what it means for the threshold, None where it has no finite value."""
    value = _predicted(prediction)
    return None if value is None else publish(PredictedObjective, value, status=prediction.status())


def _fix(fix: Fix, diagnosis: Diagnosis) -> FixEntry:
    return publish(
        FixEntry,
        _fix_set(fix),
        by_hand=fix.by_hand,
        why_this=clean(diagnosis.why_this),
        alternatives=[_fix_set(alternative) for alternative in diagnosis.alternatives],
    )


def _fix_set(fix: Fix) -> FixSet:
    entries = {name: (predicted_objective(one), one.p_ok) for name, one in fix.predicted.items()}
    return FixSet(
        changes=[_change(change) for change in fix.changes],
        p_fixed=estimate(fix.odds),
        guess=fix.is_guess,
        shown_by=clean(fix.shown_by),
        predicted={
            name: publish(PromisedObjective, entry, p_ok=estimate(odds))
            for name, (entry, odds) in entries.items()
            if entry is not None
        },
    )


def parameter_names(parameters: tuple[str, ...]) -> str | list[str]:
    """Where an option lives: a string, or a list where it sets several."""
    return parameters[0] if len(parameters) == 1 else list(parameters)


def _change(change: Change) -> ChangeEntry:
    return ChangeEntry(
        option=change.option.name,
        parameter=parameter_names(change.option.parameters),
        from_=known_number(parameter_value(change.option, change.current)),
        to=plain_number(parameter_value(change.option, change.suggested)),
        assumed=change.is_assumed,
        reboot_required=change.option.reboot_required,
    )
