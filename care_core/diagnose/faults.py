"""Run and thresholds -> which objectives are broken, which are fine, and which could not be judged."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from care_core.causal.model import Summary
from care_core.diagnose.records import ObjectiveResult, Status
from care_core.errors import UsageError, nearest
from care_core.profile.schema import Schema
from care_core.run import Run, Unavailable
from care_core.variables import Threshold, Variable

_FEW = 10
"""As many names can be listed in a sentence."""


def thresholds_in_force(schema: Schema, overrides: Mapping[str, float]) -> dict[str, Threshold]:
    """The profile's thresholds with the operator's values put in."""
    bounds: dict[str, Threshold] = {}
    for objective in schema.objectives:
        bound = objective.threshold
        if objective.name in overrides:
            bound = Threshold(bound.op if bound else "<=", overrides[objective.name])
        if bound is not None:
            bounds[objective.name] = bound
    return bounds


def check_wishes(schema: Schema, keep: Iterable[str], thresholds: Mapping[str, float]) -> None:
    """Refuse options to keep and thresholds that the profile does not have. Raises UsageError."""
    for name in keep:
        _known(name, schema.options, "option", "--keep", schema.name)
    for name, bound in thresholds.items():
        objective = _known(name, schema.objectives, "objective", "--threshold", schema.name)
        if objective.kind == "functional" and bound not in (0, 1):
            raise UsageError(f"{name} is 0 or 1, never {bound:g}.", hint="Write 0 or 1.", where="--threshold")


def _known(name: str, variables: Iterable[Variable], what: str, where: str, profile: str) -> Variable:
    by_name = {variable.name: variable for variable in variables}
    if name not in by_name:
        few = len(by_name) <= _FEW
        known = f"Known are {', '.join(by_name)}." if few else f"List them with 'care profiles show {profile}'."
        hint = nearest(name, by_name) or known
        raise UsageError(f"The profile has no {what} '{name}'.", hint=hint, where=where)
    return by_name[name]


def judge(
    run: Run, schema: Schema, bounds: Mapping[str, Threshold], summaries: Mapping[str, Summary]
) -> tuple[ObjectiveResult, ...]:
    """Every objective of the profile against its threshold. Not evaluated is not OK."""
    return tuple(
        _judge_one(objective, run, bounds.get(objective.name), summaries.get(objective.name))
        for objective in schema.objectives
    )


def _judge_one(objective: Variable, run: Run, bound: Threshold | None, summary: Summary | None) -> ObjectiveResult:
    value = run.objectives.get(objective.name)
    if value is None:
        return ObjectiveResult(
            objective, None, bound, "not_evaluated", "the profile does not say how to read it from a log"
        )
    if isinstance(value, Unavailable):
        reason = f"{value.reason} ({value.hint})" if value.hint else value.reason
        return ObjectiveResult(objective, None, bound, "not_evaluated", reason)
    if bound is None:
        return ObjectiveResult(objective, value, None, "not_evaluated", "no threshold: give one with --threshold")
    status: Status = "ok" if bound.met(value) else "fault"
    # A yes-or-no result has no place among others.
    percentile = summary.percentile(value) if summary and objective.kind == "non-functional" else None
    return ObjectiveResult(objective, value, bound, status, percentile=percentile)
