"""What `care lint` finds wrong with the parameters of a run that failed, as findings: each a hypothesis with its line.

Judged are the values that the log holds, and of the files that the operator named those that it does not. A robot that
did what it was to do is set well enough, so nothing is said of one.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from care_core.configs.driven import as_number, same_value
from care_core.configs.loading import ConfigFile as NamedFile
from care_core.ecosystems.findings import Finding, Health, every_finding
from care_core.ecosystems.ros.drive import Drive
from care_core.ecosystems.ros.ros2_yaml import PARAMETERS
from care_core.lint import navigation
from care_core.lint.linting import lint
from care_core.lint.problems import Problem, Severity
from care_core.lint.scopes import Place, Scoped, as_file, scoped
from care_core.metadata.navigation import COSTMAPS, known
from care_core.records import replace
from care_core.run import Setting
from care_core.text import clean

WEIGHTS: Mapping[str, tuple[float, float]] = {
    "cannot-work": (0.9, 0.95),
    "clearance": (0.8, 0.85),
    "contradiction": (0.8, 0.85),
    "hinders": (0.6, 0.6),
    "wrong-unit": (0.5, 0.6),
    "not-in-values": (0.4, 0.5),
    "out-of-range": (0.4, 0.5),
    "wrong-type": (0.3, 0.6),
    "unknown-key": (0.3, 0.4),
    "misplaced-key": (0.3, 0.4),
    "dead-key": (0.3, 0.4),
}
"""By rule, how likely the value is what was wrong, and how likely a mission fails with it: choices, by whether the
sources leave it a way to work."""
SURE = frozenset({"cannot-work", "clearance", "contradiction"})
"""Rules that count for options of the profile as well, of which training knows more than the others."""
ALSO_DEFAULTS = frozenset({"cannot-work", "hinders"})
"""Rules that no default keeps: what a node has without being told does not fit every robot."""
_NEAR, _FAR = 0.5, 2.0
"""A value is near its default that is off it by less than half of what another is, on logarithms; from 7 times all are
far."""
_OF_FILES = WEIGHTS.keys() - {*SURE, "hinders"}
"""Rules about how a file is written; the others are asked of the values as driven."""
_NO_NODE = frozenset({"ros", "costmap", *COSTMAPS})

Usual = Callable[[str, Setting], bool]


def with_lint(
    health: Health,
    drive: Drive,
    files: Iterable[NamedFile],
    names: Mapping[str, str],
    usual: Usual,
    *,
    is_asked: bool,
) -> Health:
    """What happened in a log, with what is wrong with its parameters before what is only worth knowing.

    Args:
        files: the configuration files that the operator named.
        names: the options of the profile, by their parameters: findings speak of those.
        usual: whether a parameter's value is the one of a run that went well.
        is_asked: whether training is asked about the options, which tells more than rules that are not sure.
    """
    shown = [_renamed(one, names) for one in health.findings]
    seen = {name for one in every_finding(shown) for name in one.parameters}
    known_to = names if is_asked else {}
    found = [
        _finding(drive, problem, off, names)
        for problem, off in _wrong(drive, files, usual)
        if problem.rule in SURE or not any(one.name in known_to for one in off)
    ]
    found.sort(key=lambda one: -one.probability)
    told = [one for one in shown if one.severity != "info"]
    less = [one for one in shown if one.severity == "info"]
    return replace(health, findings=(*_driven_into(told, list(_each_once(found, seen))), *less))


def _driven_into(told: Sequence[Finding], found: Sequence[Finding]) -> Iterator[Finding]:
    """What happened, and then what is wrong with the parameters: where plans may touch obstacles, what the robot was
    caught on is what that led to."""
    root = next((one for one in found if one.kind == "clearance"), None)
    held = [one for one in told if root is not None and one.kind == "blocked" and one.onset_s >= root.onset_s]
    if root is not None and held:
        yield replace(root, severity=held[0].severity, consequences=tuple(every_finding(held)))
    yield from (one for one in told if one not in held)
    yield from (one for one in found if one is not root or not held)


def _renamed(finding: Finding, names: Mapping[str, str]) -> Finding:
    """A finding with the options that its parameters are."""
    if not any(name in names for name in finding.parameters):
        return finding
    wanted = tuple((names.get(name, name), value) for name, value in finding.wanted)
    return replace(finding, parameters=_options(finding.parameters, names), wanted=wanted)


def _options(parameters: Iterable[str], names: Mapping[str, str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(names.get(name, name) for name in parameters))


def _each_once(findings: Iterable[Finding], seen: set[str]) -> Iterator[Finding]:
    """Of several findings about the same parameters the surest: they come first."""
    for one in findings:
        if not seen & set(one.parameters):
            seen |= set(one.parameters)
            yield one


def _wrong(drive: Drive, files: Iterable[NamedFile], usual: Usual) -> Iterator[tuple[Problem, list[Setting]]]:
    """Each problem with the parameters whose values it takes to be wrong."""
    settings = {_path(name): one for name, one in drive.parameters.items()}
    for problem, result in _problems(drive, files):
        owners = {place.entry.name: place for place in result.places}
        held = [
            (name, settings[_path(name)]) for name in (problem.parameter, *problem.others) if _path(name) in settings
        ]
        if problem.path != Path(drive.log.path):
            held = [(name, one) for name, one in held if one.source == f"{problem.path}:{problem.line}"]
        odd = [(name, one) for name, one in held if not usual(one.name, one)]
        defaults = {name: _default(one, result, owners.get(name)) for name, one in odd}
        off = _farthest([(one, defaults[name]) for name, one in odd])
        if not off and problem.rule in ALSO_DEFAULTS:
            off = [one for name, one in held[:1] if problem.rule == "cannot-work" or odd[:1] == held[:1]]
        if off:
            yield problem, off


def _default(setting: Setting, result: Scoped, place: Place | None) -> float | str | None:
    """The value that a parameter's reader has without being told; None where nothing tells."""
    if setting.default is not None or place is None:
        return setting.default
    facts = (fact for owner in place.owners for fact in known(result.ros, owner, place.name))
    return next((fact.default for fact in facts if fact.default), None)


def _farthest(settings: Iterable[tuple[Setting, float | str | None]]) -> list[Setting]:
    """Of values that contradict each other those that are far from their defaults, where others are near theirs."""
    off = [(_distance(one.value, default), one) for one, default in settings if not same_value(one.value, default)]
    most = max((far for far, _ in off), default=0.0)
    return [one for far, one in off if far >= min(most, _FAR) * _NEAR]


def _distance(value: float | str, default: float | str | None) -> float:
    """How many times a value is larger or smaller than its default, as a logarithm; endless where nothing tells."""
    numbers = [None if one is None else as_number(one) for one in (value, default)]
    here, there = numbers
    if here is None or there is None or here * there <= 0:
        return math.inf
    return abs(math.log(here / there))


def _problems(drive: Drive, files: Iterable[NamedFile]) -> Iterator[tuple[Problem, Scoped]]:
    """Problems of the values as driven, then of how the files are written, for nodes that were running."""
    file = as_file(drive.parameters, Path(drive.log.path), is_ros2=drive.facts.get("ros") == "2")
    result = scoped(file)
    for problem in navigation.values(file, result):
        yield problem, result
    nodes = _nodes(drive)
    for named in files:
        if not named.format.is_yaml:
            continue
        for linted in lint([named.path]):
            held = scoped(linted.file)
            for problem in linted.problems:
                is_meant = problem.rule in _OF_FILES and problem.severity is not Severity.NOTE
                if is_meant and _ran(problem.parameter, nodes):
                    yield problem, held


def _path(name: str) -> tuple[str, ...]:
    """The parts of a parameter's name, whether a file, a log or a rule writes it."""
    return tuple(part for part in re.split(r"[/.]", name) if part and part != PARAMETERS)


def _nodes(drive: Drive) -> frozenset[str]:
    """Names of the nodes of which the log tells, without their name spaces."""
    said = {re.split(r"[/.]", one.node)[-1] for one in drive.log_messages}
    spoke = {part for channel in drive.channels for part in channel.name.split("/")[1:-1]}
    return frozenset(said | spoke | {part for name in drive.settings for part in _path(name)[:-1]})


def _ran(parameter: str, nodes: frozenset[str]) -> bool:
    """Whether the node of a file's parameter ran; one without a node in its name may belong to any."""
    keys = _path(parameter)[:-1]
    return not nodes or not keys or keys[0] in _NO_NODE or any(key in nodes for key in keys)


def _finding(drive: Drive, problem: Problem, suspects: list[Setting], names: Mapping[str, str]) -> Finding:
    rule = problem.rule
    if rule == "cannot-work" and any(one.outcome == "reached" for one in drive.goals):
        rule = "hinders"  # it worked for a goal of this very run
    probability, lost = WEIGHTS[rule]
    values = "; ".join(f"{one.name} = {one.value} ({one.source})" for one in suspects)
    return Finding(
        kind="clearance" if rule == "clearance" else "control",
        title=clean(problem.text.removesuffix(".")),
        onset_s=drive.missed_s,
        end_s=drive.duration_s,
        severity="warning",
        evidence=clean(f"{values}; care lint [{problem.rule}]: {problem.hint}".rstrip(": ")),
        source=problem.source,
        suspect="parameter",
        probability=probability,
        mission_lost=lost,
        parameters=_options((one.name for one in suspects), names),
    )
