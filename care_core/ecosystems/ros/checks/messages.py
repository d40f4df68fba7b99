"""What nodes and diagnostics say of themselves: errors that no other check reads."""

from __future__ import annotations

import re
from collections.abc import Iterator

from care_core.ecosystems.findings import Finding, FindingKind, Severity
from care_core.ecosystems.ros.checks import planner, timing
from care_core.ecosystems.ros.diagnostics import Report, reports
from care_core.ecosystems.ros.recording import ERROR, FATAL, Recording, Said

MOST = 3
"""So many kinds of error are told, the first of them first."""
_HARMLESS = re.compile(
    r"transition callback on a goal handle that we're not tracking|rotate recovery can't rotate", re.IGNORECASE
)
"""Known of actionlib (a client that sends goals fast), and of the recovery behaviours, whose failing others tell."""
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
_TRACEBACK = "Traceback (most recent call last)"
_RAISED = re.compile(r'File "(?:.*/)?([^/"]+)", line (\d+), in (\w+)')
NUMBERS = re.compile(r"-?\d+(\.\d+)?")


def check(recording: Recording) -> Iterator[Finding]:
    yield from _diagnostics(recording)
    yield from _errors(recording)


def about(text: str) -> FindingKind:
    """What part of the robot a text speaks of."""
    return next((kind for pattern, kind in _ABOUT if pattern.search(text)), "software")


def _diagnostics(recording: Recording) -> Iterator[Finding]:
    worst: dict[str, list[Report]] = {}
    last: dict[str, Report] = {}
    for one in reports(recording):
        last[one.name] = one
        if one.level >= 2:  # ERROR or STALE
            worst.setdefault(one.name, []).append(one)
    for name, own in sorted(worst.items(), key=lambda one: one[1][0].time_s)[:MOST]:
        first = own[0]
        stays = last[name].level >= 2
        until_s = recording.duration_s if stays else last[name].time_s
        again = (f", {len(own)} times" if len(own) > 1 else "") + (", and so to the end" if stays else "")
        severity: Severity = recording.severity(first.time_s, "critical" if first.level == 2 else "warning")
        yield Finding(
            about(f"{name} {first.message}"), f"diagnostics: {name}: {first.message or 'error'}", first.time_s,
            until_s, severity, f'{first.word} "{first.message}"{again}', first.topic,
            probability=0.7,
        )  # fmt: skip


def _errors(recording: Recording) -> Iterator[Finding]:
    kinds: dict[tuple[str, str], list[Said]] = {}
    for one in recording.said:
        known = planner.FAILS.search(one.text) or timing.known(one.text) or _HARMLESS.search(one.text)
        if one.level >= ERROR and not known:
            kinds.setdefault((one.node, NUMBERS.sub("#", one.text)), []).append(one)
    fatal_s = max((one.time_s for one in recording.said if one.level >= FATAL), default=None)
    ranked = sorted(kinds.values(), key=lambda own: (-own[0].level, own[0].time_s))
    for own in ranked[:MOST]:
        first = own[0]
        is_fatal = first.level >= FATAL
        # An error that a fatal one follows led to it, as far as anybody can say.
        downed = is_fatal or (fatal_s is not None and first.time_s <= fatal_s)
        otherwise: Severity = "critical" if downed else "warning"
        times = f", {len(own)} times" if len(own) > 1 else ""
        yield Finding(
            about(f"{first.node} {first.text}"), ": ".join(filter(None, (first.node, gist(first.text)))), first.time_s,
            own[-1].time_s,
            recording.severity(first.time_s, otherwise) if downed else "warning" if not recording.goals else "info",
            f'{"FATAL" if is_fatal else "ERROR"} "{gist(first.text, 160)}"{times}', "/rosout", "hardware", 0.5,
        )  # fmt: skip


def gist(text: str, most: int = 80) -> str:
    """What an error says in a line: of a Python traceback the exception and where its own code raised it."""
    if _TRACEBACK not in text:
        return text[:most]
    lines = [line.strip() for line in text.strip().splitlines() if line.strip()]
    raised = [match for line in lines if (match := _RAISED.match(line))]
    place = f" ({raised[-1][1]} line {raised[-1][2]}, {raised[-1][3]})" if raised else ""
    return f"{lines[-1][:most]}{place}"
