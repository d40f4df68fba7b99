"""What a profile has of a log, and what it would miss: for people who decide what to record next time."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from care_core.errors import CareError
from care_core.extract.read import mission_kind, read_runs, reading_plan
from care_core.extract.registry import find_extractor
from care_core.extract.settings import readable
from care_core.logs.base import Log
from care_core.profile.schema import Schema
from care_core.run import MissionInfo, Run, Unavailable
from care_core.variables import Role, Variable


@dataclass(frozen=True, slots=True)
class Missed:
    """A variable that the log cannot give, why, and how to have it next time."""

    variable: Variable
    reason: str
    hint: str


@dataclass(frozen=True, slots=True)
class Coverage:
    """A profile and a log. `obstacle` says why the profile cannot use it, empty when it can."""

    schema: Schema
    obstacle: str
    options: int
    sources: int
    sources_wanted: int
    missed: tuple[Missed, ...]
    missions: tuple[MissionInfo, ...]

    @property
    def is_usable(self) -> bool:
        return not self.obstacle


def cover(log: Log, schema: Schema) -> Coverage:
    """Try a profile on a log without judging anything."""
    obstacle = _wrong_kind(log, schema)
    if obstacle:
        return Coverage(schema, obstacle, 0, 0, 0, (), ())
    channels = {channel.name for channel in log.channels() if channel.count}
    plan = reading_plan(schema)
    lost_options = _missed_options(log, schema)
    found, sources = len(schema.options) - len(lost_options), len(channels & plan.keys())
    runs: Sequence[Run] = ()
    if not found and not sources:
        obstacle = "none of its parameters or sources are in the log"
    else:
        try:
            runs = read_runs(log, schema)
        except CareError as err:
            obstacle = _no_mission(schema, channels) or err.message
    missed = (*lost_options, *_missed_values(schema, channels, runs[-1] if runs else None))
    return Coverage(schema, obstacle, found, sources, len(plan), missed, tuple(run.mission for run in runs))


def _wrong_kind(log: Log, schema: Schema) -> str:
    if not schema.logs:
        return "it comes from a table of runs and reads no log"
    if log.format.value not in schema.logs:
        return f"it reads {' or '.join(schema.logs)}, this is {log.format.value}"
    return ""


def _no_mission(schema: Schema, channels: Collection[str]) -> str:
    """Which of the messages that missions are found by are not in the log; '' when all are."""
    absent = [name for name in mission_kind(schema).needs(schema.mission) if name not in channels]
    return f"no mission was found; of what tells of missions {', '.join(absent)} are not in the log" if absent else ""


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
    recorded = f"record {namespace}/parameter_updates, or " if namespace else ""
    return f"{recorded}give the file that sets {names[0]} with --config"


def _missed_values(schema: Schema, channels: Collection[str], run: Run | None) -> list[Missed]:
    """Contexts, metrics and objectives for which a message is not there: those of a run that it leaves without value,
    without a run all of them."""
    missed = []
    for variable in schema.variables.values():
        if variable.role is Role.OPTION or variable.extract is None:
            continue
        needs = find_extractor(variable.extract.kind).needs(variable.extract.args)
        absent = [name for name in needs if name not in channels]
        value = None if run is None else run.value(variable.name)
        if not absent or (run is not None and not isinstance(value, Unavailable)):
            continue
        told = value if isinstance(value, Unavailable) else Unavailable(f"no {' or '.join(absent)} in the log")
        missed.append(Missed(variable, told.reason, told.hint or f"record {', '.join(absent)}"))
    return missed
