"""Log -> judged run: which objectives are broken, which are fine, and which cannot be judged. Nothing else judges."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence

from care_core.causal.counterfactual import CounterfactualQuery
from care_core.causal.model import Model, Summary
from care_core.configs.driven import readable, same_value
from care_core.configs.loading import ConfigFile, resolve
from care_core.diagnose.as_found import as_found
from care_core.diagnose.implied import implied
from care_core.diagnose.limits import limits_ahead, limits_of
from care_core.diagnose.records import MissionVerdict, Need, ObjectiveResult, Status
from care_core.diagnose.reference import Good, Reference, reference_of
from care_core.diagnose.verdict import fault_sentence
from care_core.ecosystems.base import RunModel
from care_core.ecosystems.findings import NOTHING_SEEN, Finding, Health
from care_core.errors import NoRepeatsError, UsageError, nearest
from care_core.extract.plain import read_plain_runs
from care_core.extract.read import mission_number, read_runs
from care_core.logs.digest import Sha256
from care_core.profile.schema import Schema
from care_core.profile.store import Profile
from care_core.records import Record, field, replace
from care_core.run import OutcomeCheck, Run, Setting, Unavailable, Value, is_known
from care_core.variables import Role, Threshold, Variable

_YES = Threshold("==", 1.0)
_ACCOMPLISHED = frozenset(("mission_success", "outcome"))
"""Extractors that say whether a flight was accomplished."""
_AT_END_S = 1.0
"""What is damaged so shortly before a mission's end is its end."""
_FEW = 10
"""As many names can be listed in a sentence."""


class Judged(Record, eq=False):
    """A run with the verdict on each objective. In `run` those are withheld whose value means nothing."""

    run: Run
    bounds: Mapping[str, Threshold]
    """The thresholds in force: the profile's with the operator's put in."""
    own: Mapping[str, float]
    """The operator's."""
    results: tuple[ObjectiveResult, ...]
    checks: tuple[ObjectiveResult, ...] = ()
    """What a run without a mission, or without a profile, is judged by."""
    configs: tuple[ConfigFile, ...] = ()
    """The operator's configuration files, in the order they are loaded."""
    given: Mapping[str, Setting] = field(default_factory=dict)
    """What they say of the profile's parameters."""
    missions: tuple[MissionVerdict, ...] = ()
    """Every mission of the log, this one among them."""
    repeats: tuple[Judged, ...] = ()
    """Other runs of the same configuration under the same conditions: what this one met is read off them too."""
    reference: Reference = field(default_factory=lambda: Reference({}, ""))
    """The configuration that the run is judged against."""

    @property
    def broken(self) -> tuple[ObjectiveResult, ...]:
        return tuple(result for result in self.results if result.status == "fault")


def read_and_judge(
    model: RunModel,
    profile: Profile,
    *,
    configs: Sequence[ConfigFile] = (),
    thresholds: Mapping[str, float] | None = None,
    mission: int | None = None,
    good: Good | None = None,
    sha256: Sha256 | None = None,
    health: Health = NOTHING_SEEN,
) -> Judged:
    """Read one mission of a log and judge it.

    Args:
        configs: configuration files in the order they are loaded, used where the log holds no value.
        thresholds: the operator's own bounds, per objective.
        mission: which mission of the log, from 1; the last when None.
        good: the configuration to judge against, where the operator named one.
        sha256: gives the log's digest, where the caller has begun to work it out.
        health: what was found in the log; no objective is met that it contradicts.

    Raises:
        CareError: the log holds no such mission, the profile has no usable model, or no such objective.
    """
    schema = profile.schema
    check_wishes(schema, (), thresholds or {})
    given = resolve(configs, (parameter for option in schema.options for parameter in readable(option)))
    accomplished = [o.name for o in schema.objectives if o.extract is not None and o.extract.kind in _ACCOMPLISHED]
    runs = read_runs(model, schema, overrides=given, sha256=sha256)
    runs = tuple(as_found(run, found_in(health, run), accomplished) for run in runs)
    judged = [judge(run, schema, profile.model, thresholds, good) for run in runs]
    verdicts = tuple(verdict(one, found_in(health, one.run)) for one in judged)
    return replace(
        judged[mission_number(mission, len(runs)) - 1], configs=tuple(configs), given=given, missions=verdicts
    )


def judge_plainly(
    model: RunModel,
    *,
    mission: int | None = None,
    sha256: Sha256 | None = None,
    health: Health = NOTHING_SEEN,
) -> Judged | None:
    """Judge one run of a log that no profile fits by what its robot says of itself; None where the log holds no run.

    Without a profile there is no limit, so no value of the run is judged, only what it did; `health` as for
    `read_and_judge`.

    Raises:
        CareError: the log holds no such mission.
    """
    runs = [as_found(run, found_in(health, run)) for run in read_plain_runs(model, sha256)]
    if not runs:
        return None
    judged = [Judged(run, {}, {}, (), tuple(map(_judge_check, run.checks))) for run in runs]
    verdicts = tuple(verdict(one, found_in(health, one.run)) for one in judged)
    return replace(judged[mission_number(mission, len(runs)) - 1], missions=verdicts)


def found_in(health: Health, run: Run) -> tuple[Finding, ...]:
    """What was found in a run's part of the log."""
    return health.of_run(run.mission.start_s).findings


def verdict(judged: Judged, findings: Sequence[Finding] = ()) -> MissionVerdict:
    """What became of a mission, in short: what was broken or found critical, else why it could not be judged."""
    everything = (*judged.results, *judged.checks)
    is_broken = any(result.status == "fault" for result in everything)
    is_one_of_many = judged.run.mission.count > 1
    critical = any(one.severity == "critical" and not one.after_impact for one in findings)
    if is_broken or (is_one_of_many and critical):
        told = fault_sentence(everything, findings if is_one_of_many else ())
        return MissionVerdict(judged.run.mission, "fault", told, everything)
    unknown = [result for result in everything if result.status == "not_evaluated"]
    if not judged.results and not unknown:
        return MissionVerdict(judged.run.mission, "not_evaluated", "what could be judged is OK", everything)
    reason = unknown[0].reason if unknown else ""
    return MissionVerdict(judged.run.mission, "not_evaluated" if unknown else "ok", reason, everything)


def with_repeats(first: Judged, others: Sequence[Judged]) -> Judged:
    """A run and others that repeat it. Raises NoRepeatsError, also for a recording that is given twice."""
    seen = {first.run.log.identity}
    for other in others:
        if other.run.log.identity in seen:
            raise NoRepeatsError("The same recording is no repeat.", hint="Name it once.", where=other.run.log.path)
        seen.add(other.run.log.identity)
        for name in sorted(first.run.config.keys() & other.run.config.keys()):
            mine, theirs = first.run.config[name], other.run.config[name]
            if not same_value(mine, theirs):
                raise NoRepeatsError(
                    f"The logs are no repeats of one configuration: {name} was {mine:g}, then {theirs:g}.",
                    hint="Triage them one by one.",
                    where=other.run.log.path,
                )
    return replace(first, repeats=tuple(others))


def judge(
    run: Run,
    schema: Schema,
    model: Model | None,
    thresholds: Mapping[str, float] | None = None,
    good: Good | None = None,
) -> Judged:
    """Every objective of the profile against its threshold. Not evaluated is not OK.

    Args:
        model: says what the reference configuration needs, which some thresholds are a multiple of; None: they are not
            judged.
        thresholds: the operator's own bounds: they hold for any mission, the profile's for its own alone.
        good: the configuration to judge against, where the operator named one.
    """
    own = dict(thresholds or {})
    schema = _without_limits_of(own, schema)
    bounds = thresholds_in_force(schema, own, elsewhere=bool(run.mission.mismatch))
    so_far = run.objectives
    run = replace(run, objectives=meaningful(run, schema, bounds, own))
    if model is None:
        results = (
            _judge_one(
                o, run.objectives.get(o.name), bounds.get(o.name), literal=_is_literal(o, own), shortfall=run.shortfall
            )
            for o in schema.objectives
        )
        return Judged(run, bounds, own, tuple(results), tuple(map(_judge_check, run.checks)))
    reference = reference_of(run, schema, model, good)
    limits = limits_of(run, schema, model, reference, bounds)
    bounds, needs = {**bounds, **limits.bounds}, limits.needs
    past = _past_their_limits(run, so_far, schema, bounds, needs)
    unknown = {name: why for name, why in limits.unknown.items() if is_known(run.objectives.get(name))}
    run = replace(run, objectives={**run.objectives, **past, **unknown})
    results = (
        _judge_one(
            objective,
            run.objectives.get(objective.name),
            bounds.get(objective.name),
            model.summary_at(objective.name, reference.config),
            needs.get(objective.name),
            so_far=_broken_so_far(run) if objective.name in past else "",
            literal=_is_literal(objective, own),
            shortfall=run.shortfall,
        )
        for objective in schema.objectives
    )
    return Judged(run, bounds, own, tuple(results), tuple(map(_judge_check, run.checks)), reference=reference)


def query_of(judged: Judged, profile: Profile, kept: Iterable[str] = ()) -> CounterfactualQuery:
    """This run, ready to be asked. Options that no source holds are taken to be at their reference, or at what the run
    speaks for; those that were never read at their reference: their value changed nothing.

    Args:
        kept: options that stay as they are.
    """
    run, reference = judged.run, judged.reference.config
    unread = unread_options(profile.schema, run)
    config = {
        **reference,
        **{name: one.value for name, one in implied(run, profile.schema, profile.model, reference).items()},
        **{name: value for name, value in run.config.items() if name not in unread},
    }
    return CounterfactualQuery(
        profile.model,
        config,
        {**run.metrics, **run.objectives},
        judged.bounds,
        [{**other.run.metrics, **other.run.objectives} for other in judged.repeats],
        reference=reference,
        variables=profile.schema.variables,
        kept=frozenset(kept),
        constraints=tuple(one for one in profile.schema.constraints if one.options <= config.keys()),
        assumed=frozenset(option.name for option in profile.schema.options) - frozenset(run.config),
    )


def facing_mission(query: CounterfactualQuery, judged: Judged, profile: Profile) -> CounterfactualQuery:
    """The same for a vehicle whose mission is still before it: the odds of a change are those of every limit, also of
    what this run could not miss."""
    ahead = limits_ahead(profile.schema, query.model, judged.reference, judged.bounds)
    return replace(query, thresholds={**judged.bounds, **ahead})


def unread_options(schema: Schema, run: Run) -> frozenset[str]:
    """Options that only modes read which this run never entered; none where the log does not say."""
    if not run.modes:
        return frozenset()
    entered = {mode.casefold() for mode in run.modes}
    return frozenset(
        option.name
        for option in schema.options
        if option.modes and not entered & {mode.casefold() for mode in option.modes}
    )


_FAILSAFE = "failsafe acted at"
"""How a shortfall tells of a failsafe: where no other is told, all of the mission was flown."""


def _past_their_limits(
    run: Run, so_far: Mapping[str, Value], schema: Schema, bounds: Mapping[str, Threshold], needs: Mapping[str, Need]
) -> dict[str, float]:
    """Objectives that are broken already, however much the reference configuration needs, for they only grow: of a
    mission whose end the log does not hold, and of one that was flown to its end and that a failsafe came into. Of one
    that a failsafe broke off, the time that it had taken until then."""
    if run.mission.ended and not _was_flown_whole(run):
        if run.mission.left_s is None:
            return {}
        taken_s = run.mission.left_s - run.mission.start_s
        so_far = {objective.name: taken_s for objective in schema.objectives if objective.unit == "s"}
    past: dict[str, float] = {}
    for objective in schema.objectives:
        name, value = objective.name, so_far.get(objective.name)
        if not objective.grows or name not in bounds or not is_known(value):
            continue
        need, relative = needs.get(name), objective.relative
        limit = bounds[name] if need is None or relative is None else relative.for_need(need.high)
        if not limit.met(value):
            past[name] = value
    return past


def _was_flown_whole(run: Run) -> bool:
    """Whether a failsafe is all that a mission is told to have failed by."""
    return all(_FAILSAFE in clause for clause in run.shortfall or ("",))


def _broken_so_far(run: Run) -> str:
    """Why what was broken was so before the end, empty where the mission was flown to it."""
    if not run.mission.ended:
        return "the log ends before the mission does"
    return "" if _was_flown_whole(run) else "a failsafe broke the mission off"


def meaningful(
    run: Run, schema: Schema, bounds: Mapping[str, Threshold], judged_anyway: Container[str] = ()
) -> dict[str, Value]:
    """The run's objectives, those withheld whose value means nothing for its mission."""
    if not run.mission.ended and not run.checks:
        last = [one for one in run.log.damage if one.time_s is None or one.time_s >= run.mission.end_s - _AT_END_S]
        longer = "the file breaks off: see whether the original is longer"
        cut = Unavailable(
            "the log ends before the mission does", longer if last else "record until the mission has ended"
        )
        return {
            name: value if isinstance(value, Unavailable) and value.reason != cut.reason else cut
            for name, value in run.objectives.items()
        }
    missed = _not_accomplished(run, schema, bounds)
    found = dict(run.objectives)
    for objective in schema.objectives:
        name = objective.name
        if objective.kind == "functional":
            continue
        if run.checks:
            found[name] = Unavailable("no mission was flown")
        elif not is_known(value := found.get(name)) and not (missed and _never_varied(value)):
            continue
        elif missed:
            found[name] = Unavailable(f"not judged: {missed}")
        elif name not in judged_anyway and (mismatch := _of_another_mission(objective, run, schema)):
            hint = f"give this mission's bound with --threshold {name}=VALUE"
            found[name] = Unavailable(mismatch, hint)
    return found


def _never_varied(value: Value | None) -> bool:
    """Whether a sensor only said the same: of a vehicle that never set out it does so rightly."""
    return isinstance(value, Unavailable) and value.never_varied


def _of_another_mission(objective: Variable, run: Run, schema: Schema) -> str:
    """Why the threshold in force is not one of this run's mission, empty where it is."""
    if objective.threshold is None or objective.threshold.source is None:
        travels = objective.relative is not None and not schema.learned_elsewhere
        return "" if travels else run.mission.mismatch
    return objective.threshold.mismatch(run.context)


def _not_accomplished(run: Run, schema: Schema, bounds: Mapping[str, Threshold]) -> str:
    """Why the mission does not count as completed, empty where it does."""
    why = ""
    for objective in schema.objectives:
        if objective.kind != "functional":
            continue
        value, bound = run.objectives.get(objective.name), bounds.get(objective.name)
        if not is_known(value):
            why = "whether the mission was completed is not known"
        elif bound is not None and not bound.met(value):
            return "the mission was not completed"
    return why


def _without_limits_of(named: Container[str], schema: Schema) -> Schema:
    """The schema without the site file's limits of objectives that the operator bounds for this run."""
    freed = {
        o.name: replace(o, threshold=replace(o.threshold, source=None, mission={}))
        for o in schema.objectives
        if o.threshold is not None and o.threshold.source is not None and o.name in named
    }
    return replace(schema, variables={**schema.variables, **freed}) if freed else schema


def thresholds_in_force(
    schema: Schema, overrides: Mapping[str, float], *, elsewhere: bool = False
) -> dict[str, Threshold]:
    """The profile's fixed thresholds with the operator's values put in.

    Args:
        elsewhere: the mission is not the profile's own, so what has a ratio too is bounded by that.
    """
    bounds: dict[str, Threshold] = {}
    for objective in schema.objectives:
        bound = None if elsewhere and objective.relative is not None else objective.fixed
        if objective.name in overrides:
            declared = objective.threshold
            bound = Threshold(declared.op if declared else "<=", overrides[objective.name])
        if bound is not None:
            bounds[objective.name] = bound
    return bounds


def check_wishes(schema: Schema, keep: Iterable[str], thresholds: Mapping[str, float]) -> None:
    """Refuse options to keep and thresholds that the profile does not have. Raises UsageError."""
    for name in keep:
        _known(name, schema.options, "parameter", "--keep", schema.name)
    for name, bound in thresholds.items():
        objective = _known(name, schema.objectives, "objective", "--threshold", schema.name)
        if wrong := objective.wrong_limit(bound):
            hint = "Leave it out." if objective.is_yes_or_no else f"Write --threshold {name}=NUMBER with one above 0."
            raise UsageError(wrong, hint=hint, where="--threshold")


def _known(name: str, variables: Iterable[Variable], what: str, where: str, profile: str) -> Variable:
    by_name = {variable.name: variable for variable in variables}
    if name not in by_name:
        few = len(by_name) <= _FEW
        known = f"Known are {', '.join(by_name)}." if few else f"List them with 'care profiles show {profile}'."
        hint = nearest(name, by_name) or known
        raise UsageError(f"The profile has no {what} '{name}'.", hint=hint, where=where)
    return by_name[name]


def _judge_one(
    objective: Variable,
    value: Value | None,
    bound: Threshold | None,
    summary: Summary | None = None,
    need: Need | None = None,
    *,
    so_far: str = "",
    literal: bool = False,
    shortfall: Sequence[str] = (),
) -> ObjectiveResult:
    """`literal`: the bound is the operator's, who knows how well it can be told. `shortfall`: how a mission failed."""
    if value is None:
        reason = "the profile does not say how to read it from a log"
        return ObjectiveResult(objective, None, bound, "not_evaluated", reason, need=need)
    if isinstance(value, Unavailable):
        reason = f"{value.reason} ({value.hint})" if value.hint else value.reason
        return ObjectiveResult(objective, None, bound, "not_evaluated", reason, need=need)
    if bound is None:
        return ObjectiveResult(objective, value, None, "not_evaluated", "no threshold: give one with --threshold")
    status: Status = "ok" if bound.met(value) else "fault"
    reason = ""
    if status == "fault" and not literal and _is_too_close(objective, value, bound):
        status, reason = "ok", f"beyond its limit by less than the {objective.accuracy:.1%} to which a log tells it"
    # A yes-or-no result has no place among others.
    percentile = summary.percentile(value) if summary and objective.kind == "non-functional" else None
    if so_far:
        reason = f"so far: {so_far}"
    elif status == "fault" and objective.kind == "functional":
        reason = "; ".join(shortfall)
    return ObjectiveResult(objective, value, bound, status, reason, percentile=percentile, need=need)


def _is_literal(objective: Variable, own: Container[str]) -> bool:
    """Whether the bound is the operator's, for this run or for the site."""
    return objective.name in own or (objective.threshold is not None and objective.threshold.source is not None)


def _is_too_close(objective: Variable, value: float, bound: Threshold) -> bool:
    """Whether a value off its bound may be within it, for all that a log can tell."""
    return any(bound.met(value * (1 + side * objective.accuracy)) for side in (-1, 1))


def _judge_check(check: OutcomeCheck) -> ObjectiveResult:
    variable = Variable(check.name, Role.OBJECTIVE, type="bool", doc=check.doc, kind="functional", threshold=_YES)
    result = _judge_one(variable, check.value, _YES)
    return replace(result, reason=check.otherwise) if result.status == "fault" else result
