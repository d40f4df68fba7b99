"""Log + schema -> Run: cuts the mission out, reads the configuration as driven, and runs the extractors.

Everything a profile asks of a log is merged into one reading plan, so the log is decoded once.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from care_core.configs.driven import changes_between, configuration, prevailing, readable
from care_core.ecosystems.base import RunModel
from care_core.ecosystems.measures import MISSION_KINDS, Mission, MissionKind, check_args, find_extractor
from care_core.ecosystems.plausible import clock_doubt, dead_sources
from care_core.ecosystems.registry import ecosystem_of, register_measures
from care_core.errors import NoMissionError, ProfileError, UsageError, nearest
from care_core.logs.base import Log, merge_needs
from care_core.logs.digest import Sha256, hashing
from care_core.logs.formats import format_named
from care_core.logs.identity import recording_of
from care_core.profile.schema import Schema
from care_core.records import Record, replace
from care_core.run import LogInfo, MissionInfo, OutcomeCheck, Run, Setting, Unavailable, Value, is_known
from care_core.variables import Role, Variable


def read_run(
    model: RunModel,
    schema: Schema,
    *,
    overrides: Mapping[str, Setting] | None = None,
    mission: int | None = None,
    sha256: Sha256 | None = None,
) -> Run:
    """Read one mission of a log: the last one, or number `mission` (from 1).

    `overrides` are settings of configuration files by the name of the parameter in the log, used only for options
    that the log does not hold.
    `sha256` gives the log's digest where the caller has begun to work it out.

    Raises:
        ProfileError: the profile reads no logs.
        NoMissionError: the log holds no mission of its kind.
        UsageError: there is no mission of that number.
    """
    source = _Source.read(model, schema, sha256)
    return source.run(mission_number(mission, len(source.missions)) - 1, overrides or {})


def mission_number(requested: int | None, count: int) -> int:
    """The mission that is meant of so many: the last where none is requested. Raises UsageError."""
    if requested is not None and not 1 <= requested <= count:
        missions = "holds one mission" if count == 1 else f"holds missions 1 to {count}"
        raise UsageError(
            f"There is no mission {requested}: the log {missions}.", hint="Name one of them.", where="--mission"
        )
    return requested or count


def read_runs(
    model: RunModel, schema: Schema, *, overrides: Mapping[str, Setting] | None = None, sha256: Sha256 | None = None
) -> tuple[Run, ...]:
    """Read every mission of a log, in time order; arguments and errors are those of `read_run`."""
    source = _Source.read(model, schema, sha256)
    return tuple(source.run(index, overrides or {}) for index in range(len(source.missions)))


def mission_kind(schema: Schema) -> MissionKind:
    """How this profile finds missions. Raises ProfileError when it does not say, or says what no kind knows."""
    kind = schema.mission.get("kind")
    if not schema.logs or kind is None:
        raise ProfileError(
            f"Profile '{schema.name}' describes a table of runs and reads no logs.",
            hint="Name the profile of the robot with --profile.",
            where=schema.name,
        )
    register_measures(schema.logs)
    if kind not in MISSION_KINDS:
        raise ProfileError(f"There is no mission kind '{kind}'.", hint=nearest(str(kind), MISSION_KINDS))
    found = MISSION_KINDS[str(kind)]
    spec = {name: value for name, value in schema.mission.items() if name != "kind"}
    check_args(spec, found.args, f"The mission kind '{kind}'", f"{schema.name}: mission")
    return found


def reading_plan(schema: Schema) -> dict[str, tuple[str, ...]]:
    """The channels and fields that a profile reads from a log.

    Raises:
        ProfileError: an extractor, mission kind, argument or value that is not known, with the nearest that is.
    """
    needs = [mission_kind(schema).needs(schema.mission)]
    for variable in schema.variables.values():
        if variable.extract is not None:
            where = f"{schema.name}: {variable.name}"
            found = find_extractor(variable.extract.kind, where)
            check_args(variable.extract.args, found.args, f"The extractor '{found.name}'", where)
            needs.append(found.needs(variable.extract.args))
    return merge_needs(needs)


def log_info(model: RunModel, sha256: str) -> LogInfo:
    """The record of where a run came from."""
    log = model.log
    return LogInfo(
        path=str(log.path),
        format=log.format.name,
        start=log.start,
        duration_s=log.duration_s,
        sha256=sha256,
        damage=tuple(log.damage),
        facts=dict(log.facts),
        recording=recording_of(log, model.tables),
    )


class _Source(Record, eq=False):
    """A log read once by a profile's plan, and the missions found in it."""

    schema: Schema
    kind: MissionKind
    log: LogInfo
    settings: Mapping[str, tuple[Setting, ...]]
    missions: tuple[Mission, ...]
    dead: Mapping[str, str]
    """Channels that measure nothing, and why."""
    doubts: tuple[Unavailable | None, ...]
    """Per mission why nothing of it can be told: its times cannot be right, or it is of two vehicles."""

    @classmethod
    def read(cls, model: RunModel, schema: Schema, sha256: Sha256 | None = None) -> _Source:
        log = model.log
        if sha256 is None:
            with hashing(log.path) as digest:
                return cls.read(model, schema, digest)
        kind = mission_kind(schema)
        if log.format.name not in schema.logs:
            raise NoMissionError(
                f"Profile '{schema.name}' reads {', '.join(schema.logs)}, this is {log.format.name}.",
                hint="Leave --profile out to have one chosen.",
                where=str(log.path),
            )
        tables = model.tables(reading_plan(schema))
        settings = log.settings()
        found = kind.missions(model, tables, schema.mission)
        missions = tuple(one for one in found if math.isfinite(one.start_s) and math.isfinite(one.end_s))
        if not missions:
            reader = f"profile '{schema.name}'" if schema.name else "care"
            nothing = f"The log holds no mission that {reader} can read."
            has_stamps = not tables or any(math.isfinite(t) for table in tables.values() for t in table.t)
            raise NoMissionError(
                nothing if has_stamps else "No message of the log has a time stamp, so no mission of it can be judged.",
                hint="Look at what was recorded with 'care inspect'.",
                where=str(log.path),
            )
        dictionary = ecosystem_of(log.format).messages()
        doubts = tuple(_doubt(log, clock_doubt(dictionary, tables, one.start_s, one.end_s)) for one in missions)
        return cls(
            schema, kind, log_info(model, sha256()), settings, missions, dead_sources(dictionary, tables), doubts
        )

    def run(self, index: int, overrides: Mapping[str, Setting]) -> Run:
        found = self.missions[index]
        found = replace(found, ended=found.ended and not _cut_short(found, self.log))
        driven = self._driven(found)
        config, sources, settings = configuration(self.schema.options, driven, overrides)
        mission = self._with_settings(found, driven)
        mismatch = self.schema.learned_elsewhere or self.kind.mismatch(mission)
        context = self._values(Role.CONTEXT, mission, self.doubts[index])
        return Run(
            config=config,
            sources=sources,
            context=context,
            metrics=self._values(Role.METRIC, mission, self.doubts[index]),
            objectives=self._values(Role.OBJECTIVE, mission, self.doubts[index]),
            settings=settings,
            log=self.log,
            mission=MissionInfo(
                index=index + 1,
                count=len(self.missions),
                start_s=mission.start_s,
                end_s=mission.end_s,
                ended=self.kind.is_decided(mission),
                left_s=self.kind.left_s(mission),
                fits=not mismatch,
                mismatch=mismatch,
                asked=tuple(
                    (name, value) for name, value in context.items() if is_known(value) and self._is_requested(name)
                ),
            ),
            evidence=tuple(self.schema.pointed(evidence, config) for evidence in self.kind.evidence(mission)),
            changes=_changes(self.settings, mission),
            checks=() if self.doubts[index] else self._checks(mission),
            modes=self.kind.modes(mission),
            shortfall=() if self.doubts[index] else self.kind.shortfall(mission),
        )

    def _with_settings(self, found: Mission, driven: Mapping[str, Setting]) -> Mission:
        return replace(found, facts=self.log.facts, settings={name: one.value for name, one in driven.items()})

    def _driven(self, found: Mission) -> dict[str, Setting]:
        """The configuration as driven: where a parameter was changed on the way, its value for most of the part of the
        mission that reads it."""
        driven = {name: prevailing(history, found.start_s, found.end_s) for name, history in self.settings.items()}
        changed = [
            (option.phase, name)
            for option in self.schema.options
            for name in readable(option)
            if option.phase and changes_between(self.settings.get(name, ()), found.start_s, found.end_s)
        ]
        for phase, name in changed:
            if span := self.kind.span(self._with_settings(found, driven), phase):
                driven[name] = prevailing(self.settings[name], *span)
        return driven

    def _is_requested(self, context: str) -> bool:
        extract = self.schema.variables[context].extract
        return extract is not None and extract.kind in _REQUESTED

    def _checks(self, mission: Mission) -> tuple[OutcomeCheck, ...]:
        checks = self.kind.checks(mission) if self.schema.objectives else self.kind.outcome(mission)
        return tuple(replace(check, value=self._explained(check.value)) for check in checks)

    def _values(self, role: Role, mission: Mission, doubt: Unavailable | None) -> dict[str, Value]:
        if doubt is not None:
            return dict.fromkeys((v.name for v in self.schema.of(role)), doubt)
        values = {variable.name: _extract(variable, mission) for variable in self.schema.of(role)}
        return {name: self._explained(value) for name, value in values.items()}

    def _explained(self, value: Value) -> Value:
        """The value, where it is a number; else why there is none: a dead source, or a kind of log that lacks much."""
        if not isinstance(value, Unavailable):
            return value if math.isfinite(value) else Unavailable("its value in the log is not a number", _LOOK)
        if value.channel in self.dead:
            return Unavailable(self.dead[value.channel], "check the sensor and its driver", never_varied=True)
        hint = format_named(self.log.format).missing_hint
        return replace(value, hint=hint) if hint and value.channel else value


_REQUESTED = ("mission_asked", "goals_asked")
"""Extractors of what a mission asks for."""
_LOOK = "look at its source with 'care inspect'"


def _doubt(log: Log, clock: str) -> Unavailable | None:
    """Why nothing of a mission can be told, None where it can."""
    if shared := log.facts.get("shared id"):
        hint = "give each vehicle a system id of its own, and record again"
        return Unavailable(f"two vehicles speak under one system id: {shared}", hint)
    return Unavailable(clock, log.format.clock_hint) if clock else None


def _changes(settings: Mapping[str, tuple[Setting, ...]], mission: Mission) -> dict[str, tuple[Setting, ...]]:
    changes = {
        name: changes_between(history, mission.start_s, mission.end_s)
        for name, history in settings.items()
        if len(history) > 1
    }
    return {name: history for name, history in changes.items() if history}


def _extract(variable: Variable, mission: Mission) -> Value:
    if variable.extract is None:
        return Unavailable("the profile does not say how to read it from a log", f"add 'extract' to {variable.name}")
    return find_extractor(variable.extract.kind).compute(mission, variable.extract.args)


def _cut_short(mission: Mission, log: LogInfo) -> bool:
    """Whether the log breaks off while the mission lasts: an arming refused so far may be granted later."""
    runs_out = mission.end_s >= log.duration_s - 1e-3
    return runs_out and any(d.time_s is None or d.time_s >= mission.end_s - 1.0 for d in log.damage)
