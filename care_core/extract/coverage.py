"""What a profile has of a log, and what it would miss: for people who decide what to record next time."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence

from care_core.configs.driven import readable
from care_core.ecosystems.measures import find_extractor
from care_core.ecosystems.registry import run_model
from care_core.ecosystems.vehicles import Vehicle, vehicle_of
from care_core.errors import CareError
from care_core.extract.parameter_aliases import with_logged_names
from care_core.extract.read import mission_kind, read_runs, reading_plan
from care_core.logs.base import Log
from care_core.profile.schema import Schema
from care_core.records import Record
from care_core.run import MissionInfo, Run, Unavailable
from care_core.text import first_of, listed
from care_core.variables import Role, Variable

_VEHICLES = {"px4": "a PX4 vehicle", "sub": "a submarine", "heli": "a helicopter", "tracker": "an antenna tracker"}


class Missed(Record):
    """A variable that the log cannot give, why, and how to have it next time."""

    variable: Variable
    reason: str
    hint: str


class Coverage(Record):
    """How much of a profile a log holds: options with a parameter, sources among its channels, matched names."""

    schema: Schema
    options: int
    sources: int
    sources_wanted: int
    names: int

    @property
    def found(self) -> int:
        return self.options + self.sources

    def __str__(self) -> str:
        return (
            f"{self.options} of {len(self.schema.options)} parameters and {self.sources} of {self.sources_wanted}"
            " sources are in the log"
        )


class Trial(Record):
    """A profile tried on a log. `obstacle` says why the profile cannot use it, empty when it can."""

    coverage: Coverage
    obstacle: str
    missed: tuple[Missed, ...] = ()
    missions: tuple[MissionInfo, ...] = ()

    @property
    def is_usable(self) -> bool:
        return not self.obstacle


def to_have(missed: Sequence[Missed]) -> list[str]:
    """What to do so that nothing is missed, each thing once with what it gives, what gives most first."""
    gives: dict[str, list[str]] = {}
    for one in missed:
        if one.hint:
            gives.setdefault(one.hint, []).append(one.variable.name)
    ranked = sorted(gives.items(), key=lambda item: -len(item[1]))
    return [f"{hint} (gives {first_of(names, 2)})" for hint, names in ranked]


def cover(log: Log, schema: Schema) -> Coverage:
    """Count what a log holds of a profile. A profile of another format, or of a published table, has nothing."""
    if wrong_kind(log, schema):
        return Coverage(schema, 0, 0, 0, 0)
    settings, plan = log.settings(), reading_plan(schema)
    return Coverage(
        schema,
        options=sum(any(name in settings for name in readable(option)) for option in schema.options),
        sources=len(_channels(log) & plan.keys()),
        sources_wanted=len(plan),
        names=sum(text.casefold() in log.facts.get(key, "").casefold() for key, text in schema.match.items()),
    )


def try_on(log: Log, schema: Schema) -> Trial:
    """Try a profile on a log without judging anything."""
    schema = with_logged_names(schema, log)
    coverage = cover(log, schema)
    obstacle = wrong_kind(log, schema) or wrong_vehicle(schema, vehicle_of(log.facts, log.settings()))
    if obstacle:
        return Trial(coverage, obstacle)
    channels = _channels(log)
    runs: Sequence[Run] = ()
    if not coverage.found:
        obstacle = "none of its parameters or sources are in the log"
    else:
        try:
            runs = read_runs(run_model(log), schema)
        except CareError as err:
            obstacle = _no_mission(schema, channels) or err.message
    lost = _missed_values(schema, reading_plan(schema).keys() - channels, runs[-1] if runs else None)
    missed = (*_missed_options(log, schema), *lost)
    return Trial(coverage, obstacle, missed, tuple(run.mission for run in runs))


def _channels(log: Log) -> set[str]:
    """The channels that hold anything."""
    return {channel.name for channel in run_model(log).log.channels() if channel.count}


def wrong_kind(log: Log, schema: Schema) -> str:
    """Why a profile cannot read logs of this kind; '' when it can."""
    if not schema.logs:
        return "it comes from a table of runs and reads no log"
    if log.format.name not in schema.logs:
        return f"it reads {' or '.join(schema.logs)}, this is {log.format.name}"
    return ""


def a_vehicle(kind: str) -> str:
    """A kind of vehicle in a sentence."""
    return _VEHICLES.get(kind, f"a {kind}")


def wrong_vehicle(schema: Schema, vehicle: Vehicle) -> str:
    """Why a profile was made for another kind of vehicle; '' when it was not."""
    kind = schema.match.get("vehicle", "")
    return (
        f"it is for {a_vehicle(kind)}, this is {a_vehicle(vehicle.kind)}"
        if kind and vehicle.kind not in (kind, "unknown")
        else ""
    )


def _no_mission(schema: Schema, channels: Collection[str]) -> str:
    """Which of the messages that missions are found by are not in the log; '' when all are."""
    absent = [name for name in mission_kind(schema).needs(schema.mission) if name not in channels]
    lacking = f"of what tells of missions {listed(absent)} {'are' if len(absent) > 1 else 'is'} not in the log"
    return f"no whole mission was found; {lacking}" if absent else ""


def lacking_of_missions(log: Log, schema: Schema) -> str:
    """What is missing of a mission that the log shows in part, in a clause."""
    return _no_mission(schema, _channels(log)) or "no whole mission was found: the log begins or ends within one"


def _missed_options(log: Log, schema: Schema) -> list[Missed]:
    settings = log.settings()
    return [
        Missed(option, "its parameter is not in the log", _how_to_have(option))
        for option in schema.options
        if not any(name in settings for name in readable(option))
    ]


def _how_to_have(option: Variable) -> str:
    names = readable(option)
    if not names:
        return "the profile names no parameter for it"
    namespace = names[0].rpartition("/")[0]
    # On ROS 2 all nodes tell their parameters on one topic, on ROS 1 each that can be reconfigured on its own.
    topic = "/parameter_events" if "." in names[0].rpartition("/")[2] else f"{namespace}/parameter_updates"
    recorded = f"record {topic}, or " if namespace else ""
    return f"{recorded}give the file that sets it with --config"


def _missed_values(schema: Schema, absent: Collection[str], run: Run | None) -> Iterator[Missed]:
    """Contexts, metrics and objectives without a value for want of a message that the profile reads; where the log
    holds no run, those whose extractor asks for one."""
    for variable in schema.variables.values():
        if variable.role is Role.OPTION or variable.extract is None:
            continue
        needs = find_extractor(variable.extract.kind).needs(variable.extract.args)
        lacking = [name for name in needs if name in absent]
        if run is None and lacking:
            yield Missed(variable, f"no {' or '.join(lacking)} in the log", f"record {', '.join(lacking)}")
        value = None if run is None else run.value(variable.name)
        if isinstance(value, Unavailable) and (lacking or value.channel in absent):
            yield Missed(variable, value.reason, value.hint or f"record {', '.join(lacking)}")
