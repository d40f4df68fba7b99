"""Thresholds of a first profile: from the good runs among the logs, else as ratios that hold for any mission."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from care_core.diagnose.tolerance import upper_quantile
from care_core.ecosystems.examine import examine
from care_core.ecosystems.registry import run_model
from care_core.records import Record, replace
from care_core.scaffold.measures import Measure, Measures
from care_core.variables import Role, Threshold, Variable

RATIO = 1.3
"""What the bundled profiles allow over what the reference configuration needs; used where runs are too few to tell how
much they differ."""


class ProposedThreshold(Record):
    """A bound, and where it comes from. None: the objective brings its own."""

    bound: Threshold
    remark: str


def good_runs(measures: Measures) -> tuple[int, ...]:
    """Places of the runs that met every functional objective, in logs without a critical finding."""
    functional = [one for one in measures.of(Role.OBJECTIVE) if one.variable.kind == "functional"]
    critical = {
        id(log): any(finding.severity == "critical" for finding in examine(run_model(log.opened)).findings)
        for log in {id(log): log for log, _ in measures.runs}.values()
    }
    return tuple(
        place
        for place, (log, run) in enumerate(measures.runs)
        if run.mission.ended and not critical[id(log)] and all(_met(one, place) for one in functional)
    )


def _met(objective: Measure, place: int) -> bool:
    value, bound = objective.values[place], objective.variable.fixed
    return value is not None and bound is not None and bound.met(value)


def proposed_thresholds(
    objectives: Sequence[Measure], good: Sequence[int], *, alike: bool
) -> Mapping[str, ProposedThreshold]:
    """A limit for each objective. Absolute ones belong to a mission, so they are given only where all logs hold one.

    Args:
        good: places of the good runs.
        alike: whether the logs hold the same mission.
    """
    return {one.variable.name: _proposed(one, good, alike=alike) for one in objectives}


def _proposed(objective: Measure, good: Sequence[int], *, alike: bool) -> ProposedThreshold:
    variable = objective.variable
    if variable.kind == "functional" and variable.threshold is not None:
        return ProposedThreshold(variable.threshold, "met or not met")
    values = [value for place in good if (value := objective.values[place]) is not None]
    bound = variable.threshold
    is_ceiling = bound is None or bound.op in ("<=", "<")
    if alike and values and min(values) > 0 and is_ceiling:
        found = upper_quantile([math.log(value) for value in values])
        if found is not None:
            remark = f"what 95% of runs like the {len(values)} good ones keep ({min(values):.4g} to {max(values):.4g})"
            return ProposedThreshold(Threshold("<=", float(f"{math.exp(found.high):.3g}")), remark)
        worst = max(values)
        remark = f"{RATIO:g} x the largest of {len(values)} good runs ({min(values):.4g} to {worst:.4g})"
        return ProposedThreshold(Threshold("<=", float(f"{RATIO * worst:.3g}")), remark)
    if not is_ceiling and variable.fixed is not None:
        return ProposedThreshold(variable.fixed, "that of the profile it is from: correct it")
    why = "nothing says that the logs hold the same mission" if values else "no run was good"
    return ProposedThreshold(_ratio(variable), f"a ratio: {why}")


def _ratio(variable: Variable) -> Threshold:
    return replace(variable.relative, value=None) if variable.relative else Threshold("<=", ratio=RATIO)
