"""The published triage document, `care.triage/1`: what other programs read. Its keys and types are an interface.

`Report` is the document with what people want beside it: the diff and the commands.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final, Literal

from pydantic import BaseModel, ConfigDict, Field

from care_core.configs import apply_commands, format_for, unified_diff
from care_core.diagnose.records import (
    Cause,
    Change,
    Circumstance,
    Confidence,
    Diagnosis,
    Fix,
    ObjectiveResult,
    Prediction,
    Since,
    Status,
)
from care_core.run import Evidence, Value, is_known
from care_core.text import clean
from care_core.variables import Kind, Op

SCHEMA_ID: Final = "care.triage/1"


class _Model(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class ProfileEntry(_Model):
    name: str
    version: str
    platform: str


class DamageEntry(_Model):
    what: str
    byte: int | None
    time_s: float | None


class LogEntry(_Model):
    path: str
    format: str
    start: str | None
    duration_s: float
    damage: list[DamageEntry]
    sha256: str


class ThresholdEntry(_Model):
    op: Op
    value: float


class ObjectiveEntry(_Model):
    name: str
    value: float | None
    unit: str
    kind: Kind
    threshold: ThresholdEntry | None
    status: Status
    reason: str | None


class PredictedValue(_Model):
    value: float
    low: float
    high: float


class PredictedObjective(PredictedValue):
    status: Status


class CauseEntry(_Model):
    rank: int
    option: str
    path: list[str]
    path_ace: float | None
    contribution: float | None
    current: int | float
    suggested: int | float | None
    predicted: PredictedValue | None
    p_fixed: float | None
    confidence: Confidence
    edge_support: list[float | None]
    in_support: bool
    notes: list[str]


class FaultEntry(_Model):
    objective: str
    causes: list[CauseEntry]


class ChangeEntry(_Model):
    option: str
    parameter: str | list[str]
    from_: int | float = Field(serialization_alias="from")
    to: int | float
    reboot_required: bool


class FixSet(_Model):
    changes: list[ChangeEntry]
    p_fixed: float
    predicted: dict[str, PredictedObjective]


class FixEntry(FixSet):
    alternatives: list[FixSet]


class ParameterChangeEntry(_Model):
    parameter: str
    option: str | None
    from_: float | str | None = Field(serialization_alias="from")
    to: float | str | None


class SinceEntry(_Model):
    """What changed since a good run; `warnings` say what is odd about that log."""

    log: str
    warnings: list[str]
    changes: list[ParameterChangeEntry]


class EvidenceEntry(_Model):
    """A message of the log that speaks about the failure."""

    time_s: float | None
    kind: str
    text: str
    options: list[str]
    says: str


class CircumstanceEntry(_Model):
    """What the run met and no option set; `low` to `high` is where 95 % of the training runs lie."""

    circumstance: str
    variable: str | None
    value: float | None
    unit: str
    low: float | None
    high: float | None
    text: str


class TriageDocument(_Model):
    """The answer for one run, as `care triage --json` prints it."""

    model_config = ConfigDict(title=SCHEMA_ID)

    schema_: Literal["care.triage/1"] = Field(default=SCHEMA_ID, serialization_alias="schema")
    profile: ProfileEntry
    log: LogEntry
    config: dict[str, int | float]
    context: dict[str, float | None]
    metrics: dict[str, float | None]
    objectives: list[ObjectiveEntry]
    faults: list[FaultEntry]
    fix: FixEntry | None
    abstained: str | None
    notes: list[str] = []
    """What the operator should know of the log, the configuration and the profile."""
    sources: dict[str, str] = {}
    """Where the value of each option came from: a record or topic of the log, or file:line."""
    since: SinceEntry | None = None
    """Only with `--since`."""
    evidence: list[EvidenceEntry] = Field(default_factory=list)
    rivals: list[CircumstanceEntry] = Field(default_factory=list)
    tell_more: list[str] = Field(default_factory=list)


class Report(TriageDocument):
    """The document with the diff and the commands that apply it."""

    diff: str
    apply: list[str]


def json_schema() -> dict[str, Any]:
    """The JSON Schema of the triage document."""
    return TriageDocument.model_json_schema(by_alias=True, mode="serialization")


def build_document(diagnosis: Diagnosis) -> Report:
    """The document of a diagnosis. Text is cleaned; what is not a finite number becomes null."""
    run, log = diagnosis.run, diagnosis.run.log
    warnings = tuple(clean(warning) for warning in diagnosis.profile.warnings)
    return Report(
        profile=ProfileEntry(
            name=diagnosis.profile.name, version=diagnosis.profile.version, platform=diagnosis.profile.platform
        ),
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
        config={name: _plain(value) for name, value in run.config.items() if math.isfinite(value)},
        context=_values(run.context),
        metrics=_values(run.metrics),
        objectives=[_objective(objective) for objective in diagnosis.objectives],
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
        evidence=[_evidence(evidence) for evidence in run.evidence],
        rivals=[_circumstance(rival) for rival in diagnosis.rivals],
        tell_more=[clean(advice) for advice in diagnosis.tell_more],
        diff=unified_diff(run, diagnosis.fix) if diagnosis.fix is not None else "",
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


def _plain(value: float) -> int | float:
    """A whole number without its point, as configuration files have it."""
    return int(value) if float(value).is_integer() else float(value)


def _values(values: Mapping[str, Value]) -> dict[str, float | None]:
    return {name: _finite(value) if is_known(value) else None for name, value in values.items()}


def _objective(result: ObjectiveResult) -> ObjectiveEntry:
    variable = result.variable
    threshold = result.threshold
    return ObjectiveEntry(
        name=variable.name,
        value=_finite(result.value),
        unit=variable.unit,
        kind=variable.kind or "non-functional",
        threshold=None if threshold is None else ThresholdEntry(op=threshold.op, value=threshold.value),
        status=result.status,
        reason=clean(result.reason) or None,
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
    notes = [clean(note) for note in cause.notes]
    return CauseEntry(
        rank=cause.rank,
        option=cause.option.name,
        path=[node.name for node in cause.path],
        path_ace=_finite(cause.path_ace),
        contribution=_finite(cause.contribution),
        current=_plain(cause.current),
        suggested=None if cause.suggested is None else _plain(cause.suggested),
        predicted=None if cause.predicted is None else _predicted(cause.predicted),
        p_fixed=_finite(cause.p_fixed),
        confidence=cause.confidence,
        edge_support=[_finite(node.support) for node in cause.path[:-1]],
        in_support=cause.in_support,
        notes=list(dict.fromkeys((*notes, *warnings))),
    )


def _predicted(prediction: Prediction) -> PredictedValue | None:
    value, low, high = _finite(prediction.value), _finite(prediction.low), _finite(prediction.high)
    if value is None or low is None or high is None:
        return None
    return PredictedValue(value=value, low=low, high=high)


def _fix(fix: Fix, alternatives: tuple[Fix, ...]) -> FixEntry:
    chosen = _fix_set(fix)
    return FixEntry(
        changes=chosen.changes,
        p_fixed=chosen.p_fixed,
        predicted=chosen.predicted,
        alternatives=[_fix_set(alternative) for alternative in alternatives],
    )


def _fix_set(fix: Fix) -> FixSet:
    predicted = {}
    for name, prediction in fix.predicted.items():
        value = _predicted(prediction)
        if value is not None:
            predicted[name] = PredictedObjective(**value.model_dump(), status=prediction.status())
    return FixSet(changes=[_change(change) for change in fix.changes], p_fixed=fix.p_fixed, predicted=predicted)


def _change(change: Change) -> ChangeEntry:
    parameters = change.option.parameters
    return ChangeEntry(
        option=change.option.name,
        parameter=parameters[0] if len(parameters) == 1 else list(parameters),
        from_=_plain(change.current),
        to=_plain(change.suggested),
        reboot_required=change.option.reboot_required,
    )
