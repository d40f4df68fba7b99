"""What changed since a good run: the parameters of two logs side by side, as evidence beside the ranking."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from care_core.configs.driven import readable, same_value
from care_core.diagnose.judging import Judged, read_and_judge
from care_core.diagnose.records import Cause, Diagnosis, Note, ParameterChange, Since
from care_core.diagnose.reference import reference_as_driven
from care_core.ecosystems.registry import ecosystem_of, run_model
from care_core.ecosystems.vehicles import vehicle_of
from care_core.ecosystems.vehicles.self_written import is_self_written
from care_core.errors import CareError, UsageError
from care_core.extract.read import log_info
from care_core.logs.base import Log
from care_core.logs.digest import log_digest
from care_core.profile.store import Profile
from care_core.records import replace
from care_core.run import LogInfo, Run, Setting
from care_core.variables import Variable


def compare(judged: Judged, good: Log, profile: Profile) -> Since:
    """The parameters that differ between a run and the last mission of a good log.

    Parameters that the vehicle writes itself are left out, unless they are options of the profile; those of options
    come first. A good log without a mission is compared by its last values; one with a mission is judged by the same
    thresholds.
    """
    run = judged.run
    try:
        other = read_and_judge(run_model(good), profile, thresholds=judged.own)
    except CareError as err:
        info = log_info(run_model(good), log_digest(good.path))
        before = {name: history[-1] for name, history in good.settings().items()}
        return Since(
            str(good.path),
            changed_parameters(before, run.settings, profile.schema.options),
            (*_strange(run, info, before), err.message),
        )
    before = dict(other.run.settings)
    return Since(
        log=str(good.path),
        changes=changed_parameters(before, run.settings, profile.schema.options),
        warnings=(*_strange(run, other.run.log, before), *_not_good(other)),
        is_reference=judged.reference.source == reference_as_driven(good.path),
    )


def is_good(good: Log, log: Log, profile: Profile, thresholds: Mapping[str, float] | None) -> bool:
    """Whether the log of a run that is said to be good holds a run that missed nothing: only then is its configuration
    one to judge by. Raises UsageError where it is of another kind of robot."""
    refuse_another_robot(good, log, "Name a good run of the same robot.")
    try:
        other = read_and_judge(run_model(good), profile, thresholds=thresholds)
    except CareError:
        return True  # no mission, as of a log that was written on the bench: its parameters are what was vouched for
    return not any(result.status == "fault" for result in (*other.results, *other.checks))


def refuse_another_robot(other: Log, log: Log, hint: str) -> None:
    """Raise UsageError where another log is of another kind of robot: nothing of the two can be put side by side."""
    kind, other_kind = _kind(log), _kind(other)
    if kind != other_kind:
        what = f"That is the log of a {other_kind}, and this one is of a {kind}."
        raise UsageError(what, hint=hint, where=str(other.path))


def _kind(log: Log) -> str:
    """What kind of robot wrote a log: a copter under ArduPilot shares no name of a parameter with one under PX4."""
    ecosystem = ecosystem_of(log.format)
    vehicle = "" if ecosystem.name == "ros" else vehicle_of(log.facts, log.settings()).kind
    return f"{vehicle or 'robot'} under {ecosystem.title}"


def with_evidence(diagnosis: Diagnosis, since: Since) -> Diagnosis:
    """The diagnosis with the comparison, and a note on each cause whose option was changed."""
    faults = tuple(
        replace(fault, causes=tuple(_noted(cause, since) for cause in fault.causes)) for fault in diagnosis.faults
    )
    return replace(diagnosis, faults=faults, since=since)


def _noted(cause: Cause, since: Since) -> Cause:
    name = Path(since.log).name
    notes = [f"changed since {name}: {change.text}" for change in since.changes if change.option is cause.option]
    return replace(cause, notes=(*cause.notes, *map(Note, dict.fromkeys(notes))))


def changed_parameters(
    before: Mapping[str, Setting], after: Mapping[str, Setting], options: Iterable[Variable]
) -> tuple[ParameterChange, ...]:
    """The parameters that differ between two configurations as driven, those of options first; what a vehicle writes
    itself is left out, unless it is one."""
    by_parameter = {parameter: option for option in options for parameter in readable(option)}
    names = sorted({*after, *before})
    first = [name for name in by_parameter if name in names]
    rest = [name for name in names if name not in by_parameter and not is_self_written(name)]
    return tuple(_differences([*first, *rest], before, after, by_parameter))


def _differences(
    names: list[str], before: Mapping[str, Setting], after: Mapping[str, Setting], options: Mapping[str, Variable]
) -> Iterator[ParameterChange]:
    for name in names:
        old = before[name].value if name in before else None
        new = after[name].value if name in after else None
        if not same_value(old, new):
            yield ParameterChange(name, options.get(name), old, new)


def different_facts(one: LogInfo, other: LogInfo) -> Iterator[tuple[str, str, str]]:
    """What two logs say otherwise of their robot: which fact, and what each says."""
    for fact, text in other.facts.items():
        if fact in one.facts and one.facts[fact] != text:
            yield fact, one.facts[fact], text


def _strange(run: Run, other: LogInfo, before: Mapping[str, Setting]) -> Iterator[str]:
    """Why the good log may not be comparable at all."""
    if other.sha256 == run.log.sha256:
        yield "it is the same log"
    if other.format != run.log.format:
        yield f"its format is {other.format}, this log's is {run.log.format}"
    for fact, its, text in different_facts(other, run.log):
        yield f"its {fact} is {its}, this log's is {text}"
    if not before:
        yield "it holds no parameters"
    elif not before.keys() & run.settings.keys():
        yield "it has no parameter in common with this log"


def _not_good(good: Judged) -> Iterator[str]:
    """Which objectives the good run misses itself, or else which nobody can judge."""
    for result in good.broken:
        yield f"it has a fault itself: {result.variable.name} = {result.value:.4g}, wanted {result.wanted}"
    for result in good.results:
        if not good.broken and result.status == "not_evaluated":
            yield f"its {result.variable.name} could not be evaluated: {result.reason}"
