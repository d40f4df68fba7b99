"""Two runs side by side: what was set otherwise, what differs first, and what came of it. Nothing is judged here."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import zip_longest

from care_core.causal.model import Summary
from care_core.diagnose.records import Diagnosis, ObjectiveResult, ParameterChange
from care_core.diagnose.since import changed_parameters, different_facts
from care_core.ecosystems.findings import Event, Finding, Severity, every_finding
from care_core.records import Record
from care_core.run import Run, is_known
from care_core.variables import Role, Variable, asks_alike

LATE_S, LATE_SHARE = 2.0, 0.05
"""An event comes at another time where it is later or earlier by so many seconds and this share of its time."""
_UNTIMED = frozenset(("vehicle", "recording", "damage", "parameter", "gps", "battery"))
"""Kinds of events that say what was there, not what was done."""
_SAID = frozenset(("error", "warning", "message"))
_NUMBERS = re.compile(r"-?\d+(?:\.\d+)?")
_HEAD = re.compile(r"(?:[^,(:]|\([^)]*\)|,(?! )|:(?! \d))+")
"""Of an event its words before the first remark or number."""
_CAME_TO = re.compile(r", (\w+) after [\d.]+ s")
"""What a goal came to."""
_UNTIL = re.compile(r" until [\d.]+ s$| \((?:\d+ times|until)[^)]*\)")


class ObjectivePair(Record):
    """An objective in both runs; a run that has no such objective is None."""

    variable: Variable
    a: ObjectiveResult | None
    b: ObjectiveResult | None


class MeasurePair(Record):
    """A measure or a condition that differs between the runs."""

    variable: Variable
    a: float
    b: float
    distance: float | None
    """How far, in standard deviations of the training runs; None where there are none."""


class EventPair(Record):
    """Something that happened in one run or in both, in seconds from the start of each run's mission."""

    what: str
    a_s: float | None
    b_s: float | None
    is_said: bool = False
    """Whether it is a line of the robot's software, which says it now or later."""

    @property
    def at_s(self) -> float:
        """When it, or its absence, shows first."""
        return min(at_s for at_s in (self.a_s, self.b_s) if at_s is not None)

    @property
    def differs(self) -> bool:
        if self.a_s is None or self.b_s is None:
            return True
        return not self.is_said and abs(self.b_s - self.a_s) > max(LATE_S, LATE_SHARE * min(self.a_s, self.b_s))


class FindingPair(Record):
    """A finding of one run or of both, in seconds from the start of each run's mission."""

    title: str
    severity: Severity
    a_s: float | None
    b_s: float | None


class Departure(Record):
    """A signal that goes apart: when, in seconds from the start of the missions, and what both read then."""

    signal: str
    time_s: float
    a: float
    b: float
    unit: str = ""


class Comparison(Record):
    """Two runs, `a` the one to compare with."""

    a: Diagnosis
    b: Diagnosis
    warnings: tuple[str, ...]
    """Why they may not be comparable."""
    parameters: tuple[ParameterChange, ...]
    """Those with another value in B, options of the profile first."""
    objectives: tuple[ObjectivePair, ...]
    measures: tuple[MeasurePair, ...]
    """What was met and measured, the most different first."""
    events: tuple[EventPair, ...]
    """In order of time."""
    findings: tuple[FindingPair, ...]
    departures: tuple[Departure, ...] = ()
    """Signals that diverge, in order of time."""


def compare_runs(
    a: Diagnosis,
    b: Diagnosis,
    variables: Iterable[Variable] = (),
    summaries: Mapping[str, Summary] | None = None,
    departures: Sequence[Departure] = (),
) -> Comparison:
    """Put two diagnoses side by side.

    Args:
        variables: of the profile that judged both; none where no profile did.
        summaries: what its training runs held of each variable.
        departures: signals that go apart, in order of time.
    """
    options = [one for one in variables if one.role is Role.OPTION]
    return Comparison(
        a,
        b,
        tuple(_doubts(a, b)),
        changed_parameters(a.run.settings, b.run.settings, options),
        tuple(_objectives(a, b)),
        tuple(_measures(a.run, b.run, variables, summaries or {})),
        tuple(_events(a, b)),
        tuple(_findings(a, b)),
        tuple(departures),
    )


def start_s(run: Run) -> float:
    """What the seconds of a comparison count from: the start of the mission, or of a log without one."""
    return run.mission.start_s if run.mission.end_s > run.mission.start_s else 0.0


def _doubts(a: Diagnosis, b: Diagnosis) -> Iterator[str]:
    one, other = a.run, b.run
    if one.log.identity == other.log.identity and one.mission.index == other.mission.index:
        yield "both are the same run"
    if one.log.format != other.log.format:
        yield f"A is a {one.log.format} log, B a {other.log.format} log"
    for fact, before, after in different_facts(one.log, other.log):
        yield f"the {fact} is {before} in A, {after} in B"
    if a.profile.name != b.profile.name:
        yield f"A was judged by {a.profile.name or 'no profile'}, B by {b.profile.name or 'no profile'}"
    asked = dict(one.mission.asked)
    for name, wanted in other.mission.asked:
        if name in asked and not asks_alike(asked[name], wanted):
            yield f"the missions differ: {name} {asked[name]:.4g} in A, {wanted:.4g} in B"
    for name, run in (("A", one), ("B", other)):
        if not run.settings:
            yield f"{name} holds no parameters"
        if run.mission.count and not run.mission.ended:
            yield f"{name} ends before its {run.noun} does"


def _objectives(a: Diagnosis, b: Diagnosis) -> Iterator[ObjectivePair]:
    one, other = ({result.name: result for result in run.objectives} for run in (a, b))
    for name in dict.fromkeys((*other, *one)):
        yield ObjectivePair((other.get(name) or one[name]).variable, one.get(name), other.get(name))


def _measures(a: Run, b: Run, variables: Iterable[Variable], summaries: Mapping[str, Summary]) -> Iterator[MeasurePair]:
    found = []
    for variable in variables:
        if variable.role not in (Role.CONTEXT, Role.METRIC):
            continue
        one, other = a.value(variable.name), b.value(variable.name)
        if is_known(one) and is_known(other) and f"{one:.4g}" != f"{other:.4g}":
            summary = summaries.get(variable.name)
            apart = abs(other - one) / summary.sd if summary is not None and summary.sd > 0 else None
            found.append(MeasurePair(variable, one, other, apart))
    return iter(sorted(found, key=lambda pair: -(pair.distance or 0.0)))


def _events(a: Diagnosis, b: Diagnosis) -> Iterator[EventPair]:
    """The events of both, those that say the same paired."""
    one, other = _by_key(a), _by_key(b)
    pairs = []
    for key in dict.fromkeys((*one, *other)):
        for early, late in zip_longest(one.get(key, ()), other.get(key, ())):
            event = late or early
            times = (None if early is None else _at(early, a)), (None if late is None else _at(late, b))
            pairs.append(EventPair(_what(event) + _came_to(early, late), *times, is_said=event.kind in _SAID))
    return iter(sorted(pairs, key=lambda pair: pair.at_s))


def _by_key(diagnosis: Diagnosis) -> dict[str, list[Event]]:
    """The events of a run by what they say, whatever its numbers: the second goal is that of the other run."""
    found: dict[str, list[Event]] = {}
    for event in _timed(diagnosis):
        found.setdefault(f"{event.kind} {_NUMBERS.sub('N', _what(event))}", []).append(event)
    return found


def _timed(diagnosis: Diagnosis) -> Iterator[Event]:
    """What was done from the start of the run to its end."""
    mission = diagnosis.run.mission
    end_s = mission.end_s if mission.end_s > mission.start_s else math.inf
    for event in diagnosis.health.timeline:
        is_inside = start_s(diagnosis.run) - 0.05 <= event.time_s <= end_s + 0.05
        if event.kind not in _UNTIMED and is_inside:
            yield event


def _what(event: Event) -> str:
    """What happened, without what it came to."""
    head = _HEAD.match(event.text)
    text = _UNTIL.sub("", (head[0] if head else event.text).rstrip())
    return text if text.endswith("...") else text.rstrip(".")


def _came_to(early: Event | None, late: Event | None) -> str:
    """What a goal of both runs came to, where that is not the same."""
    ends = [None if one is None else _CAME_TO.search(one.text) for one in (early, late)]
    one, other = ("" if end is None else end[1] for end in ends)
    return f", {one} in A, {other} in B" if one and other and one != other else ""


def _at(event: Event, diagnosis: Diagnosis) -> float:
    return event.time_s - start_s(diagnosis.run)


def _findings(a: Diagnosis, b: Diagnosis) -> Iterator[FindingPair]:
    """The findings of both by what they say, whatever its numbers."""
    one, other = (_by_title(diagnosis) for diagnosis in (a, b))
    for key in dict.fromkeys((*other, *one)):
        early, late = one.get(key), other.get(key)
        found = late or early
        assert found is not None
        a_s = None if early is None else early.onset_s - start_s(a.run)
        b_s = None if late is None else late.onset_s - start_s(b.run)
        yield FindingPair(found.title, found.severity, a_s, b_s)


def _by_title(diagnosis: Diagnosis) -> dict[str, Finding]:
    """The findings in the order told, of several that say the same the first."""
    found: dict[str, Finding] = {}
    for one in every_finding(diagnosis.health.findings):
        found.setdefault(f"{one.kind} {_NUMBERS.sub('N', one.title)}", one)
    return found
