"""What nodes and diagnostics say of themselves: errors that no other check reads."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding, FindingKind, Severity
from care_core.ecosystems.ros.checks.planner import FAILS
from care_core.ecosystems.ros.checks.timing import is_late
from care_core.ecosystems.ros.drive import Drive
from care_core.ecosystems.ros.messages import DIAGNOSTICS, FAULT_EVENT, GOALS, ROSOUT, reading
from care_core.ecosystems.ros.node_messages import Level, LogMessage, Report
from care_core.text import shortened

LIMITS = Limits()
MOST = int(LIMITS.add("kinds of error that are reported", 3, "", "what fails first brings about the rest"))
AGAIN = int(LIMITS.add("times that a warning comes", 20, "", "a choice: a node that starts warns now and then"))
BAD = LIMITS.add("level of diagnostics", 2, "", "diagnostic_msgs/DiagnosticStatus: 2 is ERROR, 3 is STALE")
_HARMLESS = re.compile(
    r"transition callback on a goal handle that we're not tracking|rotate recovery can't rotate", re.IGNORECASE
)
"""Known of actionlib (a client that sends goals fast), and of the recovery behaviours, whose failing others tell."""
_TOOL = re.compile(r"(^|/)(rviz|rqt_|plotjuggler|foxglove)", re.IGNORECASE)
"""Nodes that show an operator what a robot does: what fails in them fails nothing of the robot."""
_ABOUT: tuple[tuple[re.Pattern[str], FindingKind], ...] = (
    (re.compile(r"lidar|laser|scan|velodyne|hokuyo|sick|ouster|rplidar", re.IGNORECASE), "laser"),
    (re.compile(r"battery|voltage|charg", re.IGNORECASE), "battery"),
    (re.compile(r"motor|wheel|drive|esc\b", re.IGNORECASE), "drive"),
    (re.compile(r"\bimu\b|gyro|accelerometer", re.IGNORECASE), "imu"),
    (re.compile(r"\bgps\b|gnss", re.IGNORECASE), "gps"),
    (re.compile(r"locali[sz]ation|odom|amcl", re.IGNORECASE), "localisation"),
    (re.compile(r"\bcpu\b|memory|temperature|load", re.IGNORECASE), "cpu"),
    (re.compile(r"camera|topic|frequency|rate", re.IGNORECASE), "topics"),
)
_OF_TOPIC = re.compile(r"(?P<node>.+?): (?P<topic>\S+) topic status")
_NOTHING = "No events recorded"
"""How diagnostic_updater names what it watches of a topic, and what it says where that was never published."""
_NO_RECEIVER = re.compile(r"mavros: (GPS: no (satellites|fix)|System: sensor health)", re.IGNORECASE)
"""What MAVROS reports from first to last where no receiver is connected, or none sees the sky: that leads nowhere."""
_MISSION_FAILED = re.compile(r"\bmission (has )?failed\b", re.IGNORECASE)
"""How a node of missions says that it did not do what the robot was sent for."""
_TRACEBACK = "Traceback (most recent call last)"
_RAISED = re.compile(r'File "(?:.*/)?([^/"]+)", line (\d+), in (\w+)')
_NUMBER = re.compile(r"-?\d+(\.\d+)?")


def find(drive: Drive) -> Iterator[Finding]:
    """Errors of diagnostics and of nodes, and what a node warns of again and again."""
    yield from _diagnostics(drive)
    yield from _errors(drive)
    yield from _warnings(drive)


def about(text: str) -> FindingKind:
    """What part of the robot a text speaks of."""
    return next((kind for pattern, kind in _ABOUT if pattern.search(text)), "software")


def _diagnostics(drive: Drive) -> Iterator[Finding]:
    worst: dict[str, list[Report]] = {}
    last: dict[str, Report] = {}
    for report in drive.reports:
        last[report.name] = report
        if report.level >= BAD:
            worst.setdefault(report.name, []).append(report)
    bad_all_along = worst.keys() - {report.name for report in drive.reports if report.level < BAD}
    for name, bad in sorted(worst.items(), key=lambda item: item[1][0].time_s)[:MOST]:
        first, stays = bad[0], last[name].level >= BAD
        aside = _leads_nowhere(first, bad_all_along) or _another_works(name, last)
        again = (f", {len(bad)} times" if len(bad) > 1 else "") + (", and so to the end" if stays else "")
        yield Finding(
            kind=about(f"{name} {first.message}"),
            title=reported(first),
            onset_s=first.time_s,
            end_s=drive.duration_s if stays else last[name].time_s,
            severity=aside or drive.severity(first.time_s, "critical" if first.level == BAD else "warning"),
            evidence=f'{first.word} "{first.message}"{again}',
            source=first.topic,
            probability=0.7,
        )


def _leads_nowhere(report: Report, bad_all_along: Collection[str]) -> Severity | None:
    is_absent = report.name in bad_all_along and _NO_RECEIVER.match(f"{report.name}: {report.message}")
    return "info" if is_absent else None


def _another_works(name: str, last: Mapping[str, Report]) -> Severity | None:
    """A second node for one device cannot open what the first holds: the device is there."""
    _, parted, device = name.partition(": ")
    alike = (report for other, report in last.items() if parted and other != name and other.endswith(f": {device}"))
    return "warning" if any(report.level == 0 for report in alike) else None


def reported(report: Report) -> str:
    """What diagnostics say of a part; of what nothing was ever published, in those words."""
    topic = _OF_TOPIC.fullmatch(report.name)
    if topic is not None and report.message.startswith(_NOTHING):
        return f"{report.by}: {topic['node']} publishes nothing on {topic['topic']}"
    return f"{report.by}: {report.name}: {report.message.rstrip('. ') or 'error'}"


def _kinds(messages: Iterable[LogMessage]) -> dict[tuple[str, str], list[LogMessage]]:
    """Messages of a node that differ in numbers alone, without those that other checks read."""
    kinds: dict[tuple[str, str], list[LogMessage]] = {}
    for message in messages:
        text = message.text
        if not (FAILS.search(text) or is_late(text) or _HARMLESS.search(text)):
            kinds.setdefault((message.node, _NUMBER.sub("#", text)), []).append(message)
    return kinds


def _warnings(drive: Drive) -> Iterator[Finding]:
    """A note of the warning that came most often, where it came often."""
    warned = (one for one in drive.log_messages if one.level == Level.WARN and not _TOOL.search(one.node))
    alike = max(_kinds(warned).values(), key=len, default=[])
    if len(alike) >= AGAIN:
        yield Finding(
            kind=about(f"{alike[0].node} {alike[0].text}"),
            title=": ".join(filter(None, (alike[0].node, gist(alike[0].text)))),
            onset_s=alike[0].time_s,
            end_s=alike[-1].time_s,
            severity="info",
            evidence=f"a warning that came {len(alike)} times",
            source="/rosout",
            suspect="operation",
        )


def _errors(drive: Drive) -> Iterator[Finding]:
    messages = [message for message in drive.log_messages if not _TOOL.search(message.node)]
    kinds = _kinds(message for message in messages if message.level >= Level.ERROR)
    fatal_s = max((message.time_s for message in messages if message.level >= Level.FATAL), default=None)
    ranked = sorted(
        kinds.values(), key=lambda alike: (not _MISSION_FAILED.search(alike[0].text), -alike[0].level, alike[0].time_s)
    )
    for alike in ranked[:MOST]:
        first = alike[0]
        times = f", {len(alike)} times" if len(alike) > 1 else ""
        yield Finding(
            kind=about(f"{first.node} {first.text}"),
            title=": ".join(filter(None, (first.node, gist(first.text)))),
            onset_s=first.time_s,
            end_s=alike[-1].time_s,
            severity=_severity(drive, first, fatal_s),
            evidence=f'{"FATAL" if first.level >= Level.FATAL else "ERROR"} "{gist(first.text, 160)}"{times}',
            source="/rosout",
            probability=0.5,
        )


def _severity(drive: Drive, first: LogMessage, fatal_s: float | None) -> Severity:
    """An error that a fatal one follows led to it, as far as anybody can say."""
    is_fatal = first.level >= Level.FATAL or (fatal_s is not None and first.time_s <= fatal_s)
    if is_fatal or _MISSION_FAILED.search(first.text):
        return drive.severity(first.time_s, "critical")
    return "info" if drive.goals else "warning"


def gist(text: str, most: int = 80) -> str:
    """What an error says in a line: of a Python traceback the exception and where its own code raised it."""
    if _TRACEBACK not in text:
        return shortened(" ".join(text.split()), most)
    lines = [line.strip() for line in text.strip().splitlines() if line.strip()]
    raised = [match for line in lines if (match := _RAISED.match(line))]
    place = f" ({raised[-1][1]} line {raised[-1][2]}, {raised[-1][3]})" if raised else ""
    return f"{shortened(lines[-1], most)}{place}"


_READS = reading(DIAGNOSTICS, FAULT_EVENT, *ROSOUT, *GOALS)
CHECK = Check("messages", "errors of nodes and of diagnostics, warnings that come often", _READS, LIMITS, find)
