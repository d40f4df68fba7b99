"""Logs of a robot -> the text of its first `profile.yaml`, and what of the logs went into it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from care_core.ecosystems.vehicles import vehicle_of
from care_core.errors import LogError, UsageError
from care_core.extract.read import reading_plan
from care_core.metadata.navigation import is_ros
from care_core.profile.reading import parse_schema
from care_core.profile.schema import Schema
from care_core.records import Record, replace
from care_core.scaffold.inputs import InputLog
from care_core.scaffold.measures import Measure, Measures, find_measures
from care_core.scaffold.mentioned import mentioned_parameters
from care_core.scaffold.missions import Missions, find_missions
from care_core.scaffold.options import Options, find_options
from care_core.scaffold.thresholds import ProposedThreshold, good_runs, proposed_thresholds
from care_core.scaffold.writing import comment, scalar, variable_lines
from care_core.text import first_of
from care_core.variables import Role, Variable

_ONLY_SAID = "only said in /rosout (record parameter_updates or /parameter_events, or give their file with --config)"


class Scaffold(Record, eq=False):
    """A profile that was written from logs, and what it was made of."""

    text: str
    schema: Schema
    logs: tuple[InputLog, ...]
    options: Options
    measures: Measures
    missions: Missions
    good: tuple[int, ...]
    limits: Mapping[str, ProposedThreshold]


def scaffold(logs: Sequence[InputLog], name: str, bundled: Sequence[Schema]) -> Scaffold:
    """Write a profile from the logs of one robot.

    Args:
        logs: at least one, all of one ecosystem.
        name: of the new profile.
        bundled: the profiles whose measures are tried, and whose options lend ranges.

    Raises:
        UsageError: the logs are of different ecosystems.
        LogError: the logs hold neither parameters nor anything that can be measured.
    """
    _refuse_mixed(logs)
    readers = [one for one in bundled if logs[0].opened.format.name in one.logs and not one.carried_over]
    missions = find_missions(logs, readers)
    measures = find_measures(logs, missions.spec, readers)
    taken = {one.variable.name for one in measures.kept}
    options = find_options(logs, _known_options(logs, readers), taken)
    if not options.chosen and not measures.kept:
        raise LogError("The logs hold no parameters and no mission.", hint="Look at one with 'care inspect'.")
    for named in mentioned_parameters(logs, {name for log in logs for name in log.settings}):
        options.leave(named, _ONLY_SAID)
    good = good_runs(measures)
    bounds = proposed_thresholds(measures.of(Role.OBJECTIVE), good, alike=missions.alike)
    text = "\n".join(_lines(name, logs, missions, measures, options, good, bounds)) + "\n"
    schema = parse_schema(text, Path(name) / "profile.yaml")
    reading_plan(schema)
    return Scaffold(text, schema, tuple(logs), options, measures, missions, good, bounds)


def _refuse_mixed(logs: Sequence[InputLog]) -> None:
    others = [log for log in logs if log.stack != logs[0].stack]
    if others:
        raise UsageError(
            f"The logs are of different robots: {logs[0].path.name} is of {logs[0].stack}, "
            f"{others[0].path.name} of {others[0].stack}.",
            hint="Name logs of one robot.",
        )


def _known_options(logs: Sequence[InputLog], bundled: Sequence[Schema]) -> dict[str, Variable]:
    """Options of bundled profiles by parameter; where two have it, of the one that the logs hold more of."""
    held = {name for log in logs for name in log.settings}
    shares = {s.name: sum(bool(held & set(option.parameters)) for option in s.options) for s in bundled}
    known: dict[str, Variable] = {}
    for schema in sorted(bundled, key=lambda one: -shares[one.name]):
        for option in schema.options:
            for parameter in option.parameters:
                known.setdefault(parameter, option)
    return known


def _lines(
    name: str,
    logs: Sequence[InputLog],
    missions: Missions,
    measures: Measures,
    options: Options,
    good: Sequence[int],
    bounds: Mapping[str, ProposedThreshold],
) -> Iterator[str]:
    yield from _head(name, logs, measures, good)
    yield from _mission(missions)
    yield "variables:"
    yield from _options(options)
    for role, title in _TITLES.items():
        yield from _measured(measures.of(role), title)
    yield from _objectives(measures.of(Role.OBJECTIVE), bounds)
    yield from _left_out(options, measures)


def _head(name: str, logs: Sequence[InputLog], measures: Measures, good: Sequence[int]) -> Iterator[str]:
    first = logs[0]
    yield from comment(
        f"A first profile, written from {_count(len(logs), 'log')} with {_count(len(measures.runs), 'mission')}, "
        f"{len(good)} of them good (accomplished, no critical finding). Nothing in it was learned yet. Read every "
        "comment, correct ranges that are guesses, then record missions under varied options and train it."
    )
    yield "schema_version: 1"
    yield f"name: {scalar(name)}"
    yield 'version: "1"'
    yield f"platform: {scalar(_platform(first))}"
    yield f"doc: {scalar(f'Written from logs of {_platform(first)}; not reviewed yet.')}"
    match = _match(logs)
    if match:
        yield "# What a log must say to be of this platform."
        yield f"match: {scalar(match)}"
    formats = list(dict.fromkeys(log.opened.format.name for log in logs))
    yield f"logs: {scalar(formats)}"
    yield ""


def _platform(log: InputLog) -> str:
    facts = log.opened.facts
    named = [facts[key] for key in ("firmware", "stack", "vehicle", "frame") if facts.get(key)]
    ros = f"ROS {facts['ros']}" if "ros" in facts else ""
    return " ".join(part for part in (ros, *dict.fromkeys(named)) if part) or log.opened.format.name


def _match(logs: Sequence[InputLog]) -> dict[str, str]:
    """What all logs say alike: the firmware's name, the stack, the kind of vehicle."""
    match = {}
    for key in ("firmware", "stack"):
        words = {log.opened.facts.get(key, "").partition(" ")[0] for log in logs}
        if len(words) == 1 and (word := words.pop()):
            match[key] = word
    kinds = {vehicle_of(log.opened.facts, log.settings).kind for log in logs}
    if len(kinds) == 1 and not is_ros(logs[0].stack) and (kind := kinds.pop()) != "unknown":
        match["vehicle"] = kind
    return match


def _mission(missions: Missions) -> Iterator[str]:
    yield "# How missions are found. Every key: docs/extractors.md."
    yield "mission:"
    for key, value in missions.spec.items():
        remark = missions.remarks.get(key)
        yield from comment(remark, 2) if remark else ()
        yield f"  {key}: {scalar(value)}"
    yield ""


_NAMED = 60
"""Names in a comment of a profile; of more the first."""
_TITLES = {
    Role.CONTEXT: "Contexts: what was asked and met, never suggested.",
    Role.METRIC: "Metrics: what options move before they move an objective.",
}


def _options(options: Options) -> Iterator[str]:
    yield from comment(
        "Options: parameters that somebody set, or that a bundled profile knows. range: what may be suggested;"
        " default: the reference that runs are judged against. A range that is a guess is yours to correct.",
        2,
    )
    for option in options.chosen:
        yield from variable_lines(option.variable, option.remark)
    if not options.chosen:
        yield "  # None: no log holds a parameter that anybody set. Record parameters, or see what was left out below."


def _measured(measures: Sequence[Measure], title: str) -> Iterator[str]:
    if measures:
        yield ""
        yield from comment(title, 2)
    for measure in measures:
        yield from variable_lines(measure.variable, _seen(measure))


def _seen(measure: Measure) -> str:
    known = measure.known
    span = f"{min(known):.4g}" if min(known) == max(known) else f"{min(known):.4g} to {max(known):.4g}"
    missing = len(measure.values) - len(known)
    gaps = f", no value in {missing} of {len(measure.values)} missions" if missing else ""
    return f"seen: {span}{gaps}"


def _objectives(objectives: Sequence[Measure], bounds: Mapping[str, ProposedThreshold]) -> Iterator[str]:
    yield ""
    yield from comment("Objectives: what a mission is judged by.", 2)
    for measure in objectives:
        limit = bounds[measure.variable.name]
        variable = replace(measure.variable, threshold=limit.bound)
        yield from variable_lines(variable, f"{_seen(measure)}; threshold: {limit.remark}")
    if not objectives:
        yield "  # None: nothing in these logs tells how a mission came out. Add one that names an extractor."


def _left_out(options: Options, measures: Measures) -> Iterator[str]:
    yield ""
    yield "# Left out, and why."
    for reason, names in options.left.items():
        yield from comment(f"{_count(len(names), 'parameter')}, {reason}: {first_of(names, _NAMED)}")
    reasons: dict[str, list[str]] = {}
    for name, why in measures.left.items():
        reasons.setdefault(why, []).append(name)
    for why, names in reasons.items():
        yield from comment(f"measures without a value, {why}: {first_of(names, _NAMED)}")
    for path, why in measures.without.items():
        yield from comment(f"{Path(path).name}: {why}")


def _count(count: int, what: str) -> str:
    return f"{count} {what}" if count == 1 else f"{count} {what}s"
