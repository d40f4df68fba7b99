"""A look at a ROS recording: its timeline and its findings, in one reading."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from care_core.ecosystems.explains import EXPLAINS
from care_core.ecosystems.findings import NO_TASK, Finding, Health
from care_core.ecosystems.ranking import SLACK_S, rank_findings
from care_core.ecosystems.ros.checks import CHECKS
from care_core.ecosystems.ros.drive import STREAM_MESSAGES, Drive
from care_core.ecosystems.ros.falls import Fall
from care_core.ecosystems.ros.messages import (
    BATTERY,
    COMMANDS,
    DIAGNOSTICS,
    FAULT_EVENT,
    MESSAGES,
    ODOMETRY,
    ROBOT,
    SCAN,
    type_of,
)
from care_core.ecosystems.ros.other_robots import other_robots
from care_core.ecosystems.ros.timeline import READS, timeline
from care_core.logs.base import merge_needs
from care_core.records import replace
from care_core.text import listed

SHORT_S = 5.0
"""Nothing can be said of how a robot drives in less."""
_AFTER_S = 1e-3
"""How long after a fall begins what is seen with it."""
_UNREAD = "not decoded "
"""How the facts about encodings begin that no reader knows."""
_STREAMS = {ODOMETRY: "odometry", **dict.fromkeys(COMMANDS, "commands"), SCAN: "laser", BATTERY: "battery"}
"""What counts where there is more than a little of it, and plausible."""
_TELLING = ("odometry", "goals", "commands", "laser", "battery", "messages")
"""What tells how a robot did."""
_FEW = 3
"""Types of messages that are told by name."""
_STACKS = {"move_base": "move_base", "nav2": "Nav2"}


def examine(drive: Drive) -> Health:
    """What happened in the recording of a drive."""
    others = [(other, _findings_of(other)) for other in drive.others]
    found = (*_with_fall(_findings_of(drive), drive.fall), *other_robots(drive, others))
    findings = rank_findings(found, None if drive.fall is None else drive.fall.start_s)
    return Health(_robot(drive), timeline(drive), findings, _too_little(drive))


def _findings_of(drive: Drive) -> tuple[Finding, ...]:
    drive.look_at(merge_needs((READS, *(check.reads for check in CHECKS))))
    return tuple(finding for check in CHECKS for finding in check.find(drive))


def _with_fall(found: Iterable[Finding], fall: Fall | None) -> Iterator[Finding]:
    """The findings, of which what a fall brings about begins after it: samples do not tell which was first."""
    for one in found:
        is_with = fall is not None and one.kind in EXPLAINS["crash"] and 0 <= fall.start_s - one.onset_s <= SLACK_S
        yield replace(one, onset_s=fall.start_s + _AFTER_S) if is_with and fall is not None else one


def _robot(drive: Drive) -> str:
    ros = drive.facts.get("ros")
    if ros is None:
        return "robot without messages of ROS"
    stack = _STACKS.get(drive.facts.get("stack", ""), "")
    distro = drive.facts.get("distro", "")
    return f"ROS {ros}{f' {distro}' if distro else ''} robot{f' with {stack}' if stack else ''}"


def _too_little(drive: Drive) -> str:
    """Why nothing can be judged, empty where something can."""
    if not any(len(times) for times in drive.times.values()):
        return "an empty recording: nothing can be said of the robot"
    drives = drive.odometry is not None or drive.commands is not None
    senses = bool(drive.scans or drive.batteries)
    longest = max(len(table) for _, table in drive.of(*ROBOT)) if drives or senses else 0
    is_watched = any(True for type in (DIAGNOSTICS, FAULT_EVENT) for _ in drive.of(type))
    speaks = bool(drive.log_messages or drive.goals) or is_watched
    unread = [fact.removeprefix(_UNREAD) for fact in drive.facts if fact.startswith(_UNREAD)]
    if longest < STREAM_MESSAGES and not speaks and unread:
        return f"its messages are {' and '.join(unread)}, not ROS 1, CDR or JSON: only when they came is known"
    if longest < STREAM_MESSAGES and not speaks:
        return _nothing_of_a_robot(drive)
    if drive.duration_s < SHORT_S:
        return f"{drive.duration_s:.1f} s are too short to judge a robot by"
    if not speaks:
        return NO_TASK
    return ""


def _nothing_of_a_robot(drive: Drive) -> str:
    """What is there, so that its reader sees that it was read, and what would be needed."""
    there = {type_of(channel) for channel in drive.channels if channel.count}
    labels = list(dict.fromkeys(row.label for type, row in MESSAGES.items() if type in there and row.label))
    poor = list(dict.fromkeys(word for type, word in _STREAMS.items() if type in there))
    lacks = f"no {listed([word for word in _TELLING if word not in poor], 'or')}"
    if poor:
        lacks += f", and too little or nothing plausible of {listed(poor, 'and')}"
    if not labels:
        kinds = sorted(there)
        more = f" and {len(kinds) - _FEW} types more" if len(kinds) > _FEW else ""
        unread = f"{', '.join(kinds[:_FEW])}{more}, which {'is' if len(kinds) == 1 else 'are'} not read"
        return f"it holds {unread}, and nothing that tells how a robot did: {lacks}"
    return f"it holds {listed(labels, 'and')}, and nothing that tells how a robot did: {lacks}"
