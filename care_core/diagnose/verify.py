"""Report and the run after it -> was the change made, and did it do what was promised?

The report is plain data (`ReportedPromise`), so this module knows no file format; `care_core.report.verification`
fills it in. The run comes as triage leaves it: what triage does not find well has not recovered.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from itertools import islice
from typing import Literal

from care_core.configs.driven import option_value, readable, same_value
from care_core.diagnose.judging import thresholds_in_force
from care_core.diagnose.outside.change import outside_option
from care_core.diagnose.records import Diagnosis, ObjectiveResult, Status, first_named
from care_core.diagnose.verdict import status_of, verdict_of
from care_core.ecosystems.vehicles import vehicle_of_run
from care_core.profile.schema import Schema
from care_core.records import Record, field, replace
from care_core.run import LogInfo, Run
from care_core.variables import Threshold, Variable, asks_alike

Made = Literal["made", "not_made", "other_value", "unknown"]
Outcome = Literal["recovered", "kept", "unchanged", "better", "worse", "broken", "unknown"]
VerifyVerdict = Literal["fixed_as_promised", "fixed_although", "not_fixed", "change_not_made", "cannot_tell"]


class ReportedObjective(Record):
    """An objective as the report has it. `need`: what the reference configuration needed for that mission, where the
    threshold is a multiple of it; None where the threshold holds for any mission."""

    value: float | None
    status: Status
    threshold: Threshold | None
    need: float | None = None


SAME_LOG = "this is the log that the report is about, not one of a later run"
OTHER_VEHICLE = "this is another vehicle"

NEITHER = "neither the change nor the mission is that of the report"
OTHER_NEED = 0.1
"""Share by which what two missions need differs where they are not the same one."""
HOME_M = 10.0
"""A way that begins or ends at home is as much longer or shorter where a vehicle is put down elsewhere on its field."""
_FROM_HOME = ("path_length", "return_distance")
_ONE_BY_ONE = ("goals_asked", "px4_mission_asked")
"""Extractors of what a log names as it is begun: a mission that is given up asks for less than all of it."""

NOT_HELD = ReportedObjective(None, "not_evaluated", None)
"""An objective of which the report says nothing."""


class PromisedSet(Record):
    """One set of changes of the report: option -> (from, to), with the outcome it promised."""

    changes: Mapping[str, tuple[float, float]]
    p_fixed: float | None
    """None where the odds were not measured: that promises nothing."""
    intervals: Mapping[str, tuple[float, float]]
    """Per objective the 80% interval."""


class ReportedPromise(Record):
    """What a report said and promised: the suggested set first, then its alternatives."""

    sha256: str
    """Of the log that the report is about."""
    start: str | None
    version: str
    """Of the profile."""

    config: Mapping[str, float]
    objectives: Mapping[str, ReportedObjective]
    sets: tuple[PromisedSet, ...]
    format: str = ""
    frame: str = ""
    """As the log said it; empty where it, or the report, does not."""
    robot: str = ""
    """`Robot.digest` of whose log it was; empty where nothing told for sure."""
    context: Mapping[str, float] = field(default_factory=dict)
    """What the run met, and what its mission asked for."""


class MadeChange(Record):
    """One suggested change and what the next run was driven with."""

    option: Variable
    before: float
    wanted: float
    driven: float | None
    made: Made
    note: str = ""


class OtherChange(Record):
    """An option that nobody suggested to change, and that was changed."""

    option: Variable
    before: float
    driven: float


class ObjectiveCheck(Record):
    """One objective before and after. `inside`: whether the outcome lies in the promised 80% interval, which is scaled
    to the mission of the run after."""

    variable: Variable
    before: ReportedObjective
    after: ObjectiveResult
    outcome: Outcome
    interval: tuple[float, float] | None
    inside: bool | None


class Verification(Record):
    """The whole comparison. `chosen` is 0 where the suggested set was made, else the number of the alternative."""

    verdict: VerifyVerdict
    sentence: str
    chosen: int
    p_fixed: float | None
    changes: tuple[MadeChange, ...]
    others: tuple[OtherChange, ...]
    objectives: tuple[ObjectiveCheck, ...]
    headline: str
    """What triage says of the run."""
    notes: tuple[str, ...] = ()

    @property
    def worked(self) -> bool | None:
        """Whether the promised change repaired the run; None where it was not made or nobody can tell."""
        if self.verdict in ("change_not_made", "cannot_tell") or any(change.made != "made" for change in self.changes):
            return None
        return self.verdict != "not_fixed"


def verify(
    promise: ReportedPromise, diagnosis: Diagnosis, schema: Schema, thresholds: Container[str] = ()
) -> Verification:
    """Compare a run, as triage judged it, with what was promised for it.

    Every objective of the profile counts, whatever the report names, and so does every finding. A limit of the report's
    own is held as well where it is stricter than triage's; a looser one is the operator's to give, not a file's.

    Args:
        promise: at least one set.
        thresholds: objectives whose limit the operator gave for this run, which is what counts for them.
    """
    run = diagnosis.run
    attempts = [_changes(one, run, schema) for one in promise.sets]
    chosen = max(range(len(attempts)), key=lambda i: (_share_made(attempts[i]), -i))
    kept, changes = promise.sets[chosen], attempts[chosen]
    others = tuple(_others(promise, kept, run, schema))
    own = {name: limit for name, limit in _own_limits(promise, schema).items() if name not in thresholds}
    checks = tuple(
        _check(
            promise.objectives.get(one.name, NOT_HELD), _held_to(one, own.get(one.name)), kept.intervals.get(one.name)
        )
        for one in diagnosis.objectives
    )
    another = tuple(islice(_another_mission(checks), 1))
    nothing_alike = another and not any(change.made == "made" for change in changes)
    doubt = _doubt(promise, run, schema, changes) or (NEITHER if nothing_alike else "")
    verdict, sentence = _verdict(changes, others, checks, diagnosis, doubt)
    notes = (*_notes(promise, run, schema, diagnosis.objectives, own), *another)
    if doubt not in ("", NEITHER) and verdict != "cannot_tell":
        notes = (*notes, doubt)
    headline = verdict_of(diagnosis).headline
    return Verification(verdict, sentence, chosen, kept.p_fixed, changes, others, checks, headline, notes)


def _own_limits(promise: ReportedPromise, schema: Schema) -> dict[str, Threshold]:
    """Fixed limits of the report that are not the profile's: whoever made it gave them."""
    usual = thresholds_in_force(schema, {})
    return {
        name: before.threshold
        for name, before in promise.objectives.items()
        if before.threshold is not None
        and before.need is None
        and (name not in usual or usual[name].bound != before.threshold.bound)
    }


def _held_to(result: ObjectiveResult, own: Threshold | None) -> ObjectiveResult:
    """The result, a fault as well where it is well by triage's limit and not by the report's."""
    if own is None or result.status != "ok" or result.value is None or own.met(result.value):
        return result
    return replace(result, threshold=own, need=None, status="fault", reason="by the report's own limit")


def _doubt(promise: ReportedPromise, run: Run, schema: Schema, changes: Iterable[MadeChange]) -> str:
    """Why the run may not be of the same robot or mission, one clause; empty where it is."""
    if run.log.sha256 == promise.sha256:
        return SAME_LOG
    mismatch = "" if schema.travels else run.mission.mismatch
    return mismatch or _another_vehicle(promise, run.log, changes) or next(_asked_otherwise(promise, run, schema), "")


def _another_vehicle(promise: ReportedPromise, log: LogInfo, changes: Iterable[MadeChange]) -> str:
    """What tells that the log is of another vehicle, one clause; a frame that the report changes is the same one's."""
    reframed = any("FRAME" in name for change in changes for name in change.option.parameters)
    frame = log.facts.get("frame", "")
    if promise.format == log.format and promise.frame and frame and promise.frame != frame and not reframed:
        return f"{OTHER_VEHICLE}: its frame is {frame}, that of the report {promise.frame}"
    is_other = log.robot is not None and promise.robot and log.robot.digest and log.robot.digest != promise.robot
    return f"{OTHER_VEHICLE}: it has another id than that of the report" if is_other else ""


def _asked_otherwise(promise: ReportedPromise, run: Run, schema: Schema) -> Iterator[str]:
    """What the run's mission asks for and that of the report does not, in clauses. How a planner writes an item, what
    is no waypoint, and where home is within a field make no other mission."""
    functional = {one.name for one in schema.objectives if one.kind == "functional"}
    given_up = any(promise.objectives.get(name, NOT_HELD).status == "fault" for name in functional)
    for name, now in run.mission.asked:
        extract, unit = schema.variables[name].extract, schema.variables[name].unit
        if extract is None or name not in promise.context or (given_up and extract.kind in _ONE_BY_ONE):
            continue
        before = promise.context[name]
        moves_with_home = extract.args.get("what") in _FROM_HOME and abs(now - before) <= HOME_M
        if not asks_alike(before, now) and not moves_with_home:
            shown = f"{now:.4g} {unit}".rstrip()
            yield f"this is another mission than that of the report: {name} is {shown}, it was {before:.4g} there"


def _another_mission(checks: Iterable[ObjectiveCheck]) -> Iterator[str]:
    """What tells that the mission is another one than the report's: what its reference configuration needs."""
    for one in checks:
        before, after = one.before.need, one.after.need
        if before and after is not None and abs(after.value / before - 1.0) > OTHER_NEED:
            unit = f" {one.variable.unit}" if one.variable.unit else ""
            yield (
                f"another mission: the reference configuration needs {after.value:.4g}{unit} of {one.variable.name} "
                f"for it, {before:.4g}{unit} for that of the report"
            )


def _notes(
    promise: ReportedPromise, run: Run, schema: Schema, results: Iterable[ObjectiveResult], own: Mapping[str, Threshold]
) -> Iterator[str]:
    if promise.version != schema.version:
        yield f"the report was written with version {promise.version} of the profile, not {schema.version}"
    if promise.start and run.log.start and run.log.start < promise.start:
        yield "this log is older than the one of the report"
    for one in results:
        limit = own.get(one.name)
        if limit is not None and one.status != "ok" and one.variable.kind != "functional":
            given = f"give --threshold {one.name}={limit.bound:g} if it is yours"
            yield f"the report's own limit of {one.name}, {limit}, does not count for this run: {given}"


def _changes(promised: PromisedSet, run: Run, schema: Schema) -> tuple[MadeChange, ...]:
    return tuple(
        _made(schema.variables.get(name) or outside_option(name, None, vehicle_of_run(run)), before, wanted, run)
        for name, (before, wanted) in promised.changes.items()
    )


def _made(option: Variable, before: float, wanted: float, run: Run) -> MadeChange:
    """An option that sets several keys is made when all that the log holds have the wanted value."""
    settings = {key: run.settings[key] for key in readable(option) if key in run.settings}
    values = {key: value for key, setting in settings.items() if (value := option_value(option, setting)) is not None}
    if not values and option.name in run.config:
        values = {option.name: run.config[option.name]}
    off = {key: value for key, value in values.items() if not same_value(value, wanted)}
    if not values:
        return MadeChange(option, before, wanted, None, "unknown", "the log does not hold it")
    if not off:
        return MadeChange(option, before, wanted, wanted, "made")
    note = f"{', '.join(off)} was left" if len(off) < len(values) else ""
    driven = next(iter(off.values()))
    return MadeChange(option, before, wanted, driven, "not_made" if same_value(driven, before) else "other_value", note)


def _share_made(changes: Sequence[MadeChange]) -> float:
    return sum(change.made == "made" for change in changes) / max(1, len(changes))


def _others(promise: ReportedPromise, chosen: PromisedSet, run: Run, schema: Schema) -> Iterator[OtherChange]:
    for option in schema.options:
        before, driven = promise.config.get(option.name), run.config.get(option.name)
        if (
            option.name not in chosen.changes
            and before is not None
            and driven is not None
            and not same_value(before, driven)
        ):
            yield OtherChange(option, before, driven)


def _check(before: ReportedObjective, after: ObjectiveResult, interval: tuple[float, float] | None) -> ObjectiveCheck:
    """Both measured by what the reference configuration needs, where the threshold is: the missions may differ."""
    longer = after.need.value / before.need if after.need is not None and before.need else 1.0
    if interval is not None:
        interval = (interval[0] * longer, interval[1] * longer)
    inside = None
    if interval is not None and after.value is not None:
        inside = bool(interval[0] <= after.value <= interval[1])
    expected = None if before.value is None else before.value * longer
    outcome = _outcome(before.status, expected, after, interval)
    return ObjectiveCheck(after.variable, before, after, outcome, interval, inside)


def _outcome(
    before: Status, expected: float | None, after: ObjectiveResult, interval: tuple[float, float] | None
) -> Outcome:
    """`expected`: the value of the run before, had it been the mission of the run after."""
    if after.status == "not_evaluated":
        return "unknown"
    if after.status == "ok":
        return "kept" if before == "ok" else "recovered"
    if before != "fault" or expected is None or after.value is None:
        return "broken"
    # Runs differ without a cause by about half the interval that was predicted for one.
    noise = (interval[1] - interval[0]) / 2 if interval is not None else 0.0
    moved = after.value - expected
    if abs(moved) <= noise or moved == 0:
        return "unchanged"
    wants_less = after.threshold is not None and after.threshold.op in ("<=", "<")
    return "better" if (moved < 0) == wants_less else "worse"


def _verdict(
    changes: Sequence[MadeChange],
    others: Sequence[OtherChange],
    checks: Sequence[ObjectiveCheck],
    diagnosis: Diagnosis,
    doubt: str,
) -> tuple[VerifyVerdict, str]:
    unmade = " and ".join(_unmade(changes))
    unseen = [change.option.name for change in changes if change.made == "unknown"]
    severities = {finding.severity for finding in diagnosis.health.findings}
    status = status_of({check.after.status for check in checks}, severities, diagnosis.profile.fit.verdict)
    if doubt == SAME_LOG or (status == "fault" and doubt.startswith(OTHER_VEHICLE)):
        return "cannot_tell", f"Cannot tell: {doubt}."
    if status == "fault" and unmade:
        return "change_not_made", f"{unmade[:1].upper()}{unmade[1:]}, and {_lost(checks, diagnosis)}."
    if status == "fault":
        if other := _lost_otherwise(checks, diagnosis):
            return "cannot_tell", f"Cannot tell: {other}."
        unsure = f"; whether {', '.join(unseen)} was changed is not in the log" if unseen else ""
        return "not_fixed", f"Not fixed: {_lost(checks, diagnosis)}{unsure}."
    if doubt or status == "not_evaluated":
        return "cannot_tell", f"Cannot tell: {doubt or _untold(checks, diagnosis)}."
    although = list(_although(unmade, unseen, others, checks))
    if although:
        return "fixed_although", f"Recovered: every objective is within its threshold, although {'; '.join(although)}."
    return "fixed_as_promised", "Fixed as promised: the change was made, and every objective is where it was predicted."


def _lost(checks: Sequence[ObjectiveCheck], diagnosis: Diagnosis) -> str:
    """What is wrong with the run, in a clause: objectives at fault, else what triage found."""
    broken = [check.variable.name for check in checks if check.after.status == "fault"]
    still = all(check.before.status == "fault" for check in checks if check.after.status == "fault")
    return f"{_are(broken)} {'still ' if still else ''}at fault" if broken else verdict_of(diagnosis).failed


def _lost_otherwise(checks: Sequence[ObjectiveCheck], diagnosis: Diagnosis) -> str:
    """What ended the run, no parameter, before anything could be judged that the report had at fault; empty where
    something of that could be, or nothing but parameters explains the failure."""
    faults = [check for check in checks if check.before.status == "fault"]
    lead = first_named(diagnosis.hypotheses)
    if not faults or any(check.outcome != "unknown" for check in faults):
        return ""
    if lead is None or lead.what not in ("hardware", "world") or not lead.name:
        return ""
    return f"{lead.name}, before {', '.join(check.variable.name for check in faults)} could be judged"


def _untold(checks: Sequence[ObjectiveCheck], diagnosis: Diagnosis) -> str:
    unknown = [check for check in checks if check.outcome == "unknown"]
    if not unknown:
        return verdict_of(diagnosis).failed
    names = ", ".join(check.variable.name for check in unknown)
    return f"{names} could not be evaluated ({unknown[0].after.reason})"


def _unmade(changes: Sequence[MadeChange]) -> Iterator[str]:
    """In clauses, what of the promised changes was not made, and of what another value was driven."""
    if kept := [change.option.name for change in changes if change.made == "not_made"]:
        yield f"the change was not made ({', '.join(kept)})"
    others = [change for change in changes if change.made == "other_value"]
    if told := [f"{one.option.name} {one.option.show(one.driven)} instead of {one.option.show(one.wanted)}"
                for one in others]:  # fmt: skip
        yield f"another value was driven than promised ({', '.join(told)})"


def _although(
    unmade: str, unseen: Sequence[str], others: Sequence[OtherChange], checks: Sequence[ObjectiveCheck]
) -> Iterator[str]:
    if unmade:
        yield unmade
    if unseen:
        yield f"the log does not show whether {', '.join(unseen)} was changed"
    if others:
        names = [other.option.name for other in others]
        shown = ", ".join(names[:5]) + (f" and {len(names) - 5} more" if len(names) > 5 else "")
        yield f"{shown} {'was' if len(names) == 1 else 'were'} changed too"
    missed = [check.variable.name for check in checks if check.inside is False]
    if missed:
        yield f"{', '.join(missed)} came out outside the predicted interval"


def _are(names: Sequence[str]) -> str:
    return f"{', '.join(names)} {'is' if len(names) == 1 else 'are'}"
