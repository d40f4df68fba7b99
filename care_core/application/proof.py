"""Which signals show a finding, a cause or an objective: one choice for the plots of the app and of pages."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence

from care_core.application.open_run import OpenRun, log_of
from care_core.application.signals import Signal, as_read, signals_of
from care_core.diagnose.records import Cause, ObjectiveResult
from care_core.ecosystems.dictionary import Field
from care_core.ecosystems.findings import Finding, FindingKind, every_finding
from care_core.ecosystems.registry import ecosystem_of
from care_core.records import Record, replace

AROUND = 0.1
"""Share of a mission that is drawn before and behind the time of a finding, at least."""

Subject = Finding | Cause | ObjectiveResult
Meaning = Callable[[str, str], Field]

_POSITION = re.compile(r"position\.|(^|\.)(latitude|longitude|altitude)$")
"""Fields of ROS messages that say where a robot was, of whatever type."""
_WORD = re.compile(r"/[\w/]+|\w+")
_AXES = {"roll": "_RLL_", "pitch": "_PIT_", "yaw": "_YAW_"}
"""How the gains of an axis are named that ArduPilot has."""
_MOTOR = re.compile(r"motor (\d+)")
_SHOWN_BY: Mapping[FindingKind, str] = {
    "motor": "motor",
    "thrust": "throttle height",
    "vibration": "vibration",
    "gps": "satellites",
    "compass": "magnetic",
    "estimator": "estimator",
    "barometer": "barometer",
    "battery": "battery",
    "airspeed": "airspeed",
    "surface": "roll pitch",
    "attitude": "roll pitch",
    "tuning": "roll pitch",
    "takeoff": "height",
    "crash": "height",
    "localisation": "position",
    "drive": "speed",
    "blocked": "speed",
    "planner": "speed",
    "clearance": "speed",
    "control": "speed",
    "commands": "height speed",
}
"""Words of a signal's label that a kind of finding is seen in, where its source names no signal."""
_ALIKE = {
    "landing": "height",
    "descent": "height",
    "climb": "height",
    "down": "height",
    "altitude": "height",
    "path": "north",
    "energy": "current",
    "power": "current",
    "heading": "yaw",
    "acceleration": "speed",
    "stall": "speed",
    "standstill": "speed",
    "success": "goal",
    "progress": "goal",
    "stuck": "goal",
    "goals": "goal",
}
"""Words of findings and metrics, and the word that the label of the signal has for it."""


_GOAL = "distance to the goal"
_MEASURED_ON = {
    "time": (_GOAL, "speed", "speed forward", "height above home", "position down", "height"),
    "energy": ("battery current", "energy drawn", "battery voltage"),
    "success": (_GOAL,),
}
"""Words of objectives, and the labels of the signals that say most of what took so long, or so much; only those of
robots on the ground are called speed alone."""
_WAY = {"path", "corner"}
"""Words of objectives and metrics that where the robot went shows better than any signal over time."""


class Proof(Record):
    """What of a log shows something: signals, the most telling first, and the time that it is about, if it has one."""

    signals: tuple[Signal, ...]
    start_s: float | None = None
    end_s: float | None = None
    is_way: bool = False
    """Whether where the robot went shows it better than any signal over time."""

    def around(self, whole: tuple[float, float]) -> tuple[float, float]:
        """The time that it is about with as much before and behind, a tenth of the whole at least; else the whole."""
        if self.start_s is None or self.end_s is None:
            return whole
        beside = max(self.end_s - self.start_s, AROUND * (whole[1] - whole[0]))
        return max(self.start_s - beside, whole[0]), min(self.end_s + beside, whole[1])


def meanings(case: OpenRun) -> Meaning:
    """What a signal of a run's log means, by channel and field, in the unit in which it is shown; what a dictionary
    lacks is judged by its name."""
    log = log_of(case)
    ecosystem, channels = ecosystem_of(log.format), {channel.name: channel for channel in log.channels()}

    def meaning(name: str, field: str) -> Field:
        found = (ecosystem.field(channels[name], field) if name in channels else None) or Field()
        return replace(
            found,
            unit=as_read(log, found.unit)[0],
            is_position=found.is_position or _POSITION.search(field) is not None,
        )

    return meaning


def proof_of(case: OpenRun, subject: Subject, signals: Sequence[Signal] | None = None) -> Proof:
    """The signals that show it; a cause that a finding names is shown by what shows the finding.

    Args:
        signals: those of the log, where they were looked up before.
    """
    signals, meaning = signals_of(case) if signals is None else signals, meanings(case)
    found = _finding_of(case, subject) if isinstance(subject, Cause) else subject
    scores = [(_score(found, one, meaning(one.channel, one.field)), one) for one in signals]
    ranked = tuple(one for score, one in sorted(scores, key=lambda pair: -pair[0]) if score > 0)
    if isinstance(found, Finding):
        ranked = _compared(found, ranked)
    if isinstance(found, Finding):
        span = (found.onset_s, found.end_s) if found.end_s > found.onset_s else (None, None)
        return Proof(ranked, *span)
    return Proof(ranked, is_way=_is_way(found, meaning(ranked[0].channel, ranked[0].field) if ranked else Field()))


def _is_way(subject: Cause | ObjectiveResult, first: Field) -> bool:
    """Whether the way shows a cause or an objective better than its first signal: how far a mission got is seen there,
    too, unless the log says how far it was to the goal."""
    words = {word for name in _nodes(subject)[:2] for word in name.split("_")}
    is_place = isinstance(subject, Cause) and first.is_position
    return bool(words & _WAY) or is_place or ("success" in words and first.label != _GOAL)


def _nodes(subject: Cause | ObjectiveResult) -> list[str]:
    """The names on the path of a cause, or that of an objective."""
    return [node.name for node in subject.path] if isinstance(subject, Cause) else [subject.name]


def _compared(finding: Finding, ranked: tuple[Signal, ...]) -> tuple[Signal, ...]:
    """The signals, of a motor the first beside another motor: that it was driven harder shows where both are drawn."""
    first, *others = ranked or (None,)
    if first is None or first.wanted is not None or not _MOTOR.search(finding.title):
        return ranked
    other = next((one for one in others if one.channel == first.channel), None)
    return (replace(first, wanted=(other.channel, other.field), is_beside=True), *others) if other else ranked


def _finding_of(case: OpenRun, cause: Cause) -> Finding | Cause:
    """The finding that names the cause's option, or of a gain that its axis swings, else the cause."""
    names = {cause.option.name, *cause.option.parameters}
    findings = tuple(every_finding(case.diagnosis.health.findings))
    axes = {axis for axis, part in _AXES.items() if any(part in name for name in names)}
    swings = (one for one in findings if one.kind == "tuning" and axes & set(_WORD.findall(one.title.casefold())))
    return next((one for one in findings if names & set(one.parameters)), next(swings, cause))


def _score(subject: Subject, signal: Signal, field: Field) -> float:
    if isinstance(subject, Finding):
        return finding_score(subject, signal, field)
    nodes = _nodes(subject)
    # What stands right behind the parameter tells most of it; the objective itself has many signals.
    weights = {name: 1.0 / max(place, 1) for place, name in enumerate(nodes)}
    used = [weights[name] for name in signal.used_by if name in weights]
    words = _with_alike(word for name in nodes[:2] for word in name.split("_"))
    told = _told_of(nodes[0], field) if isinstance(subject, ObjectiveResult) else 0.0
    if not used:
        return told or 0.5 * _overlap(field, words & {"goal"})
    share = len(used) / len(signal.used_by)
    return told + max(used) + share + 2.0 * _overlap(field, words) - (0.9 if field.is_position else 0.0)


def _told_of(objective: str, field: Field) -> float:
    """How much the label of a signal promises to tell of an objective: more than any use of it where it is listed."""
    labels = next((_MEASURED_ON[word] for word in objective.split("_") if word in _MEASURED_ON), ())
    return 20.0 - 2.0 * labels.index(field.label) if field.label in labels else 0.0


def finding_score(finding: Finding, signal: Signal, field: Field) -> float:
    """How much a signal shows of a finding; 0 where it has nothing to do with it."""
    named = [word.casefold() for word in _WORD.findall(finding.source)]
    fields = {signal.field.casefold(), *((signal.wanted[1].casefold(),) if signal.wanted else ())}
    title = _with_alike(_WORD.findall(finding.title.casefold()))
    motor = _MOTOR.search(finding.title)
    told = 2.0 * _overlap(field, title) + 1.0 * bool(fields & set(named))
    told += 3.0 if motor and re.fullmatch(rf"\D*{motor[1]}(_raw)?", signal.field) else 0.0
    if signal.channel.casefold() in named:
        return 5.0 - 0.2 * named.index(signal.channel.casefold()) + told - 1.5 * field.is_position
    seen_in = _overlap(field, set(_SHOWN_BY.get(finding.kind, "").split()))
    # Where turning is the matter, the speed ahead shows nothing of it; where the goal is, the way left to it does.
    seen_in += 2 * _overlap(field, title & {"turn", "goal"})
    return 0.5 * seen_in if seen_in and not field.is_position else 0.0


def _with_alike(words: Iterable[str]) -> set[str]:
    found = set(words)
    return found | {_ALIKE[word] for word in found if word in _ALIKE}


def _overlap(field: Field, words: set[str]) -> int:
    return len(set(re.findall(r"\w+", field.label.casefold())) & words)
