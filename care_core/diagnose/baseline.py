"""Good runs -> limits for their kind: what 95% of such runs keep, with how little a few of them can tell.

An objective whose limit the profile counts in what the reference configuration needs is given a ratio, which holds for
any mission. One with a fixed limit is given a value, which belongs to the mission that all the runs flew.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from care_core.causal.counterfactual import CounterfactualQuery
from care_core.configs.driven import same_value
from care_core.diagnose.judging import Judged
from care_core.diagnose.tolerance import FEW, Quantile, upper_quantile
from care_core.ecosystems.findings import Health
from care_core.numbers import median
from care_core.profile.schema import Schema
from care_core.profile.store import Profile
from care_core.records import Record, replace
from care_core.run import ProfileChoice, is_known
from care_core.variables import Op, Threshold, Variable

_OF_80_PERCENT = 2 * 1.2816
"""Standard deviations between the ends of an 80% interval of a normal distribution."""
_DIGITS = 3


class Proposal(Record):
    """What good runs say of one objective. `low`, `high` and `limit` are ratios where `relative`, else in its unit."""

    objective: Variable
    relative: bool
    seen: tuple[float, ...]
    """One a run that has it, from least to most."""
    limit: float | None
    low: float | None = None
    high: float | None = None
    """Where the 95% quantile lies, with 90%; the limit is the end on the bad side, rounded towards it."""
    method: str = ""
    reason: str = ""
    """Why no limit is proposed."""
    mission: Mapping[str, float] | None = None
    """The mission that a fixed limit belongs to."""

    @property
    def middle(self) -> float:
        """Of what was seen."""
        return float(median(self.seen))

    @property
    def op(self) -> Op:
        bound = self.objective.threshold
        return bound.op if bound is not None else "<="


class Refused(Record):
    """A run, or a whole log (`mission` None), that says nothing of good runs, and why."""

    log: Path
    mission: int | None
    reason: str


class Baseline(Record, eq=False):
    """What the good runs of some logs propose."""

    choice: ProfileChoice
    logs: int
    runs: tuple[Judged, ...]
    refused: tuple[Refused, ...]
    proposals: tuple[Proposal, ...]
    missions: int
    differing: tuple[str, ...]
    """Options that were not driven at one value."""

    @property
    def is_whole(self) -> bool:
        """Whether every run counted and every objective has a limit."""
        return not self.refused and all(proposal.limit is not None for proposal in self.proposals)


def refusal(judged: Judged, health: Health) -> str:
    """Why a run is no good one, in one clause; empty where it is. Slow or thirsty runs may be good: that is asked."""
    if judged.checks:
        return "no mission was flown"
    for result in judged.results:
        if result.variable.kind != "functional":
            continue
        if result.status == "fault":
            said = next((e.says or e.text for e in reversed(judged.run.evidence)), "")
            return f"{result.variable.name} was not met" + (f": {said}" if said else "")
        if result.status == "not_evaluated":
            return f"{result.variable.name} is not known: {result.reason}"
    critical = next((f for f in health.findings if f.severity == "critical"), None)
    return "" if critical is None else f"critical finding: {critical.title}"


def over(judged: Judged) -> str:
    """Which of the profile's limits a run breaks that counts all the same, empty where it keeps them."""
    return "; ".join(
        f"{result.variable.name} {result.value:.4g} {result.variable.unit}, wanted {result.wanted}"
        for result in judged.broken
        if result.value is not None
    )


def propose(runs: Sequence[Judged], profile: Profile) -> tuple[Proposal, ...]:
    """A proposal for each objective that is more than met or not met."""
    schema = profile.schema
    return tuple(_proposal(o, runs, profile) for o in schema.objectives if o.kind == "non-functional")


def missions(runs: Sequence[Judged], schema: Schema) -> int:
    """How many different missions the runs flew, as far as the profile can tell."""
    different: list[Threshold] = []
    for judged in runs:
        if all(mission.mismatch(judged.run.context) for mission in different):
            different.append(Threshold("<=", source="", mission=_mission_context(judged, schema)))
    return len(different)


def differing(runs: Sequence[Judged]) -> tuple[str, ...]:
    """Options that were not driven at one value in all the runs."""
    names = set.intersection(*(set(judged.run.config) for judged in runs)) if runs else set()
    first = runs[0].run.config if runs else {}
    return tuple(sorted(n for n in names if any(not same_value(first[n], j.run.config[n]) for j in runs)))


def _mission_context(judged: Judged, schema: Schema) -> dict[str, float]:
    context = judged.run.context
    return {v.name: round(context[v.name], 2) for v in schema.asked if is_known(context.get(v.name))}  # type: ignore[arg-type]


def _proposal(objective: Variable, runs: Sequence[Judged], profile: Profile) -> Proposal:
    relative = objective.relative is not None
    values = [value for judged in runs if (value := _value(objective, judged, relative=relative)) is not None]
    nothing = Proposal(objective, relative, tuple(sorted(values)), None)
    if not values:
        return _without(nothing, f"no run holds {objective.name}" + (" and what it needs" if relative else ""))
    count = missions(runs, profile.schema)
    if not relative and count > 1:
        return _without(nothing, f"the runs are of {count} missions, and a fixed limit is for one: name runs of one")
    found = _quantile(objective, values, _spread(objective, runs, profile, relative=relative))
    if found is None:
        few = f"{len(values)} run{'s' if len(values) > 1 else ''}"
        return _without(nothing, f"{few} cannot tell how much runs differ, {FEW} can")
    limit = _rounded(found.high if nothing.op in ("<=", "<") else found.low, up=nothing.op in ("<=", "<"))
    mission = None if relative else _mission_context(runs[0], profile.schema)
    return Proposal(objective, relative, nothing.seen, limit, found.low, found.high, found.method, mission=mission)


def _without(proposal: Proposal, reason: str) -> Proposal:
    return Proposal(proposal.objective, proposal.relative, proposal.seen, None, reason=reason)


def _value(objective: Variable, judged: Judged, *, relative: bool) -> float | None:
    """The run's value, over what the reference configuration needs where limits are ratios; None where not known."""
    value = judged.run.objectives.get(objective.name)
    result = next(r for r in judged.results if r.variable.name == objective.name)
    if not is_known(value) or not math.isfinite(value):
        return None
    if not relative:
        return value
    return None if result.need is None else value / result.need.value


def _spread(objective: Variable, runs: Sequence[Judged], profile: Profile, *, relative: bool) -> float | None:
    """How much a run differs from another of its configuration, by the profile; on the scale of `_quantile`."""
    if objective.name not in profile.model.outcomes:
        return None
    spreads = []
    for judged in runs:
        config = {**judged.reference.config, **judged.run.config}
        predicted = CounterfactualQuery(profile.model, config, {}, {}).predict(objective.name, [config])
        low, high = float(predicted.low[0]), float(predicted.high[0])
        if low > 0 and math.isfinite(high):
            spreads.append(math.log(high / low) / _OF_80_PERCENT)
    return float(median(spreads)) if spreads else None


def _quantile(objective: Variable, values: Sequence[float], spread: float | None) -> Quantile | None:
    """The 95% quantile on the bad side. Values above 0 differ by factors, so their logarithms are looked at."""
    bound = objective.threshold
    sign = 1.0 if bound is None or bound.op in ("<=", "<") else -1.0
    logs = min(values) > 0
    scaled = [sign * (math.log(value) if logs else value) for value in values]
    found = upper_quantile(scaled, spread if logs else None)
    if found is None:
        return None
    ends = sorted(math.exp(sign * end) if logs else sign * end for end in (found.low, found.high))
    return Quantile(ends[0], ends[1], found.method)


def _rounded(value: float, *, up: bool) -> float:
    """To three digits, never stricter than it is."""
    if value == 0:
        return 0.0
    step = 10.0 ** (math.floor(math.log10(abs(value))) - _DIGITS + 1)
    return float(f"{(math.ceil if up else math.floor)(value / step - (1e-9 if up else -1e-9)) * step:.6g}")


def for_any_mission(schema: Schema) -> Schema:
    """The schema whose objectives are judged whatever the mission: it is the operator's, as the limits will be. The
    profile's fixed limits are for its own mission, so where it has ratios these are what counts."""
    own = {}
    for objective in schema.objectives:
        if (declared := objective.threshold) is not None:
            fixed = None if declared.ratio is not None else declared.value
            own[objective.name] = replace(objective, threshold=replace(declared, value=fixed, source=""))
    return replace(schema, variables={**schema.variables, **own})
