"""The published triage document, `care.triage/1`: what other programs read. Its keys and types are an interface.

`Report` is the document with what people want beside it: the diff and the commands.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final, Literal

from care_core.configs.changes import apply_commands, unified_diff
from care_core.configs.driven import parameter_value
from care_core.configs.formats import format_for
from care_core.diagnose.records import (
    Cause,
    Circumstance,
    Confidence,
    Diagnosis,
    Fix,
    MissionVerdict,
    ObjectiveResult,
    Prediction,
    Since,
    Status,
)
from care_core.numbers import six_digits
from care_core.records import field
from care_core.report.happened import (
    FindingEntry,
    FitEntry,
    HypothesisEntry,
    MomentEntry,
    account_entries,
    finding_entries,
    fit_entry,
    hypothesis_entries,
)
from care_core.report.published import Document
from care_core.run import Evidence, ProfileChoice, Value, is_known
from care_core.text import clean
from care_core.variables import ASSUMED, Change, Kind, Op, Threshold

SCHEMA_ID: Final = "care.triage/1"


class ProfileEntry(Document, kw_only=True):
    name: str
    version: str
    platform: str


class DamageEntry(Document, kw_only=True):
    what: str
    byte: int | None
    time_s: float | None


class LogEntry(Document, kw_only=True):
    path: str
    format: str
    start: str | None
    duration_s: float
    damage: list[DamageEntry]
    sha256: str


class ThresholdEntry(Document, kw_only=True):
    op: Op
    value: float


class NeedEntry(Document, kw_only=True):
    """What the reference configuration would need for this mission, with its 80 % interval."""

    value: float
    low: float
    high: float


class ObjectiveEntry(Document, kw_only=True):
    name: str
    value: float | None
    unit: str
    kind: Kind
    threshold: ThresholdEntry | None
    needs: NeedEntry | None = None
    basis: str = ""
    """What the threshold was made of, empty where it is a fixed one."""
    status: Status
    reason: str | None


class PredictedValue(Document, kw_only=True):
    value: float
    low: float
    high: float


class PredictedObjective(PredictedValue, kw_only=True):
    status: Status


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
    p_fixed: float | None
    confidence: Confidence
    edge_support: list[float | None]
    in_support: bool
    notes: list[str]


class FaultEntry(Document, kw_only=True):
    objective: str
    causes: list[CauseEntry]


class ChangeEntry(Document, kw_only=True):
    option: str
    parameter: str | list[str]
    from_: int | float = field(name="from")
    to: int | float
    assumed: bool = False
    """Whether no source holds `from`."""
    reboot_required: bool

    @property
    def values(self) -> str:
        """From what to what."""
        return f"from {self.from_:g}{ASSUMED if self.assumed else ''} to {self.to:g}"


class FixSet(Document, kw_only=True):
    changes: list[ChangeEntry]
    p_fixed: float
    guess: bool = False
    """Whether a value is one that no training run came near."""
    predicted: dict[str, PredictedObjective]


class FixEntry(FixSet, kw_only=True):
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
    """What the run met and no option set; `low` to `high` is where 95 % of the training runs lie."""

    circumstance: str
    variable: str | None
    value: float | None
    unit: str
    low: float | None
    high: float | None
    text: str


class DismissedEntry(Document, kw_only=True):
    """A cause that the operator has set aside."""

    option: str
    reason: str


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
    fit: FitEntry = field(default_factory=lambda: FitEntry(verdict="fits", reasons=[]))
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
    account: list[MomentEntry] = field(default_factory=list)
    """What happened, in order of time."""
    findings: list[FindingEntry] = field(default_factory=list)
    """In the order told, the first cause first."""
    hypotheses: list[HypothesisEntry] = field(default_factory=list)
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
    dismissed: list[DismissedEntry] = field(default_factory=list)


class Report(TriageDocument, kw_only=True):
    """The document with the diff and the commands that apply it."""

    diff: str
    apply: list[str]


def json_schema() -> dict[str, Any]:
    """The JSON Schema of the triage document."""
    return TriageDocument.json_schema()


def build_document(diagnosis: Diagnosis) -> Report:
    """The document of a diagnosis. Text is cleaned; what is not a finite number becomes null."""
    run, log = diagnosis.run, diagnosis.run.log
    warnings = tuple(clean(warning) for warning in diagnosis.profile.fit.reasons)
    return Report(
        profile=profile_entry(diagnosis.profile) if diagnosis.profile.name else None,
        fit=fit_entry(diagnosis.profile.fit),
        log=LogEntry(
            path=clean(log.path),
            format=log.format,
            start=log.start,
            duration_s=log.duration_s,
            damage=[
                DamageEntry(what=clean(damage.what), byte=damage.byte, time_s=_finite(damage.time_s))
                for damage in log.damage
            ],
            sha256=log.sha256,
        ),
        config={name: plain_number(value) for name, value in run.config.items() if math.isfinite(value)},
        context=_values(run.context),
        metrics=_values(run.metrics),
        objectives=[objective_entry(objective) for objective in diagnosis.objectives],
        faults=[
            FaultEntry(
                objective=fault.objective.variable.name, causes=[_cause(cause, warnings) for cause in fault.causes]
            )
            for fault in diagnosis.faults
        ],
        fix=None if diagnosis.fix is None else _fix(diagnosis.fix, diagnosis.alternatives),
        abstained=None if diagnosis.abstained is None else clean(diagnosis.abstained),
        notes=list(dict.fromkeys((*warnings, *(clean(note) for note in diagnosis.notes)))),
        sources={name: clean(source) for name, source in run.sources.items()},
        since=None if diagnosis.since is None else _since(diagnosis.since),
        missions=[_mission(verdict, run.mission.index) for verdict in diagnosis.missions],
        evidence=[_evidence(evidence) for evidence in run.evidence],
        rivals=[_circumstance(rival) for rival in diagnosis.rivals],
        tell_more=[clean(advice) for advice in diagnosis.tell_more],
        dismissed=[DismissedEntry(option=d.option, reason=clean(d.reason)) for d in diagnosis.dismissed],
        account=account_entries(diagnosis.health),
        findings=finding_entries(diagnosis.health),
        hypotheses=hypothesis_entries(diagnosis.hypotheses),
        diff=unified_diff(run, diagnosis.fix.changes) if diagnosis.fix is not None else "",
        apply=apply_commands(diagnosis.fix.changes, format_for(log.format, run.settings))
        if diagnosis.fix is not None
        else [],
    )


def _since(since: Since) -> SinceEntry:
    return SinceEntry(
        log=clean(since.log),
        warnings=[clean(warning) for warning in since.warnings],
        changes=[
            ParameterChangeEntry(
                parameter=clean(change.parameter),
                option=None if change.option is None else change.option.name,
                from_=_setting_value(change.before),
                to=_setting_value(change.after),
            )
            for change in since.changes
        ],
    )


def _setting_value(value: float | str | None) -> float | str | None:
    return clean(value) if isinstance(value, str) else _finite(value)


def _finite(value: float | None) -> float | None:
    return float(value) if value is not None and math.isfinite(value) else None


def estimate(value: float | None) -> float | None:
    """What the model says, to six digits, None where that is no finite number."""
    return six_digits(value) if value is not None and math.isfinite(value) else None


def plain_number(value: float) -> int | float:
    """A whole number without its point, as configuration files have it."""
    return int(value) if float(value).is_integer() else float(value)


def _values(values: Mapping[str, Value]) -> dict[str, float | None]:
    return {name: _finite(value) if is_known(value) else None for name, value in values.items()}


def profile_entry(choice: ProfileChoice) -> ProfileEntry:
    """The profile that was used."""
    return ProfileEntry(name=choice.name, version=choice.version, platform=choice.platform)


def wanted_text(entry: ObjectiveEntry) -> str:
    """The threshold of an objective with its unit and what it was made of, empty where it has none."""
    if entry.threshold is None or (entry.basis and entry.value is None):
        return ""  # one made for this mission says nothing where it was not flown to its end
    bound = f"{entry.threshold.op} {entry.threshold.value:g} {entry.unit}".rstrip()
    return f"{bound} ({entry.basis})" if entry.basis else bound


def objective_entry(result: ObjectiveResult) -> ObjectiveEntry:
    """An objective of a run against its threshold."""
    variable = result.variable
    threshold, need = result.threshold, result.need
    return ObjectiveEntry(
        name=variable.name,
        value=_finite(result.value),
        unit=variable.unit,
        kind=variable.kind or "non-functional",
        threshold=None if threshold is None else _threshold(threshold, is_estimate=bool(result.basis)),
        needs=None
        if need is None
        else NeedEntry(value=six_digits(need.value), low=six_digits(need.low), high=six_digits(need.high)),
        basis=result.basis,
        status=result.status,
        reason=clean(result.reason) or None,
    )


def _threshold(threshold: Threshold, *, is_estimate: bool) -> ThresholdEntry:
    return ThresholdEntry(op=threshold.op, value=six_digits(threshold.bound) if is_estimate else threshold.bound)


def _mission(verdict: MissionVerdict, judged: int) -> MissionEntry:
    mission = verdict.mission
    return MissionEntry(
        index=mission.index,
        start_s=_finite(mission.start_s),
        end_s=_finite(mission.end_s),
        ended=mission.ended,
        status=verdict.status,
        reason=clean(verdict.reason),
        judged=mission.index == judged,
    )


def _evidence(evidence: Evidence) -> EvidenceEntry:
    return EvidenceEntry(
        time_s=_finite(evidence.time_s),
        kind=evidence.kind,
        text=clean(evidence.text),
        options=list(evidence.options),
        says=clean(evidence.says),
    )


def _circumstance(one: Circumstance) -> CircumstanceEntry:
    return CircumstanceEntry(
        circumstance=one.name,
        variable=one.variable or None,
        value=_finite(one.value),
        unit=one.unit,
        low=_finite(one.low),
        high=_finite(one.high),
        text=clean(one.text),
    )


def _cause(cause: Cause, warnings: tuple[str, ...]) -> CauseEntry:
    notes = [clean(note.text) for note in cause.notes]
    return CauseEntry(
        rank=cause.rank,
        option=cause.option.name,
        path=[node.name for node in cause.path],
        path_ace=estimate(cause.path_ace),
        contribution=estimate(cause.contribution),
        current=plain_number(cause.current),
        assumed=cause.is_assumed,
        suggested=None if cause.suggested is None else plain_number(cause.suggested),
        predicted=None if cause.predicted is None else _predicted(cause.predicted),
        p_fixed=estimate(cause.p_fixed),
        confidence=cause.confidence,
        edge_support=[_finite(node.support) for node in cause.path[:-1]],
        in_support=cause.in_support,
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
    return (
        None
        if value is None
        else PredictedObjective(value=value.value, low=value.low, high=value.high, status=prediction.status())
    )


def _fix(fix: Fix, alternatives: tuple[Fix, ...]) -> FixEntry:
    chosen = _fix_set(fix)
    return FixEntry(
        changes=chosen.changes,
        p_fixed=chosen.p_fixed,
        guess=chosen.guess,
        predicted=chosen.predicted,
        alternatives=[_fix_set(alternative) for alternative in alternatives],
    )


def _fix_set(fix: Fix) -> FixSet:
    entries = {name: predicted_objective(prediction) for name, prediction in fix.predicted.items()}
    return FixSet(
        changes=[_change(change) for change in fix.changes],
        p_fixed=six_digits(fix.p_fixed),
        guess=fix.is_guess,
        predicted={name: entry for name, entry in entries.items() if entry is not None},
    )


def _change(change: Change) -> ChangeEntry:
    parameters = change.option.parameters
    return ChangeEntry(
        option=change.option.name,
        parameter=parameters[0] if len(parameters) == 1 else list(parameters),
        from_=plain_number(parameter_value(change.option, change.current)),
        to=plain_number(parameter_value(change.option, change.suggested)),
        assumed=change.is_assumed,
        reboot_required=change.option.reboot_required,
    )
