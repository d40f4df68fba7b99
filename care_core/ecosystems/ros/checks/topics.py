"""Topics: nothing recorded, an outage of link or recorder, streams that end early."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding, FindingKind
from care_core.ecosystems.ros.drive import CONTACT, SILENT_PERIODS, SILENT_S, Drive
from care_core.ecosystems.ros.messages import (
    BATTERY,
    CLOUD,
    COMMANDS,
    GOALS,
    IMU,
    LOCALISED,
    ODOMETRY,
    ROSOUT,
    SCAN,
    STATUS,
    WITHOUT_STREAM,
    reading,
    type_of,
)
from care_core.ecosystems.ros.node_messages import Level
from care_core.logs.recording import RENAMED
from care_core.numbers import Floats, median
from care_core.text import shortened

LIMITS = Limits()
_LOADED = "of 301 healthy missions, some recorded by a computer at its limit, the longest pause of odometry was 4.5 s"
OUTAGE_S = LIMITS.add("pause of a stream", 5.0, "s", _LOADED)
OUTAGE_PERIODS = LIMITS.add("pause of a stream in its periods", 10.0, "", _LOADED)
TOGETHER_S = LIMITS.add("how far apart pauses begin that are one", 4.0, "s", "a link fails for all within its time-out")
TOPICS = LIMITS.add("streams that pause together", 2, "", "one alone is its sensor")
BURST = LIMITS.add("share of the usual period in a burst", 0.2, "", "what a link held back comes at once")
BURST_MESSAGES = LIMITS.add("messages in a burst", 5, "", "fewer are chance")
DROVE_M = LIMITS.add("way during an outage", 0.5, "m", "less is noise of odometry")
ENDED = LIMITS.add("share of the recording without a stream", 0.1, "", "recorders do not stop all topics at once")
LIMITS.add("silence of a stream that has ended", SILENT_S, "s", _LOADED)
LIMITS.add("silence of a stream in its periods", SILENT_PERIODS, "", _LOADED)
_QOS = re.compile(r"incompatible qos", re.IGNORECASE)
_TOPIC = re.compile(r"topic '?\"?([\w/~]+)")
_KINDS: dict[str, FindingKind] = {ODOMETRY: "topics", IMU: "imu", BATTERY: "battery"}
_JUDGED_ELSEWHERE = (SCAN, CLOUD, *COMMANDS, STATUS)


def find(drive: Drive) -> Iterator[Finding]:
    """Incompatible QoS, outages, streams that end early, and files that were renamed."""
    yield from _qos(drive)
    yield from _outage(drive)
    yield from _ended(drive)
    yield from _renamed(drive)


def _qos(drive: Drive) -> Iterator[Finding]:
    counts = {channel.name: channel.count for channel in drive.channels}
    complaints: dict[str, tuple[float, str, str]] = {}
    for message in drive.log_messages:
        if message.level >= Level.WARN and _QOS.search(message.text):
            topic = _TOPIC.search(message.text)
            complaints.setdefault(topic.group(1) if topic else "a topic", (message.time_s, message.node, message.text))
    for name, (at, node, text) in complaints.items():
        empty = counts.get(name) == 0
        what = "nothing of it was recorded" if empty else f"{counts.get(name, 0)} messages were recorded"
        yield Finding(
            kind="topics",
            title=f"{name}: incompatible QoS between publisher and subscriber",
            onset_s=at,
            end_s=at,
            severity="warning" if empty else "info",
            evidence=f'{what}; {node}: "{shortened(text, 160)}"',
            source="/rosout; a subscriber that asks for reliable gets nothing from a best-effort publisher (ROS 2,"
            " About QoS)",
            suspect="operation",
            probability=0.95,
        )


def _outage(drive: Drive) -> Iterator[Finding]:
    """Streams that pause together, as when the link or the recorder fails while the robot goes on."""
    gaps: list[tuple[float, float, str]] = []
    for topic, times in drive.times.items():
        if topic in drive.streams:
            pauses = np.diff(times)
            row = int(np.argmax(pauses))
            if pauses[row] >= max(OUTAGE_S, OUTAGE_PERIODS * drive.streams[topic]):
                gaps.append((float(times[row]), float(times[row + 1]), topic))
    for start, _, topic in sorted(gaps):
        together = [gap for gap in gaps if abs(gap[0] - start) <= TOGETHER_S and gap[1] > start + OUTAGE_S]
        silent = [
            name for name in drive.times if (over := drive.ends_early(name)) and abs(over[0] - start) <= TOGETHER_S
        ]
        if len(together) + len(silent) < TOPICS or topic in silent:
            continue
        names = sorted({gap[2] for gap in together} | set(silent))
        lasted_s = [end - begin for begin, end, _ in together]
        last = max(gap[1] for gap in together)
        words = _meanwhile(drive, names, silent, start, last)
        yield Finding(
            kind="radio",
            title="outage of link or recorder: several topics stall at once",
            onset_s=start,
            end_s=last,
            severity=drive.severity(start),
            evidence=f"{', '.join(names)} pause for {min(lasted_s):.0f} to {max(lasted_s):.0f} s{words}",
            source="times of recording",
            suspect="operation",
            probability=0.8,
        )
        return


def _meanwhile(drive: Drive, names: list[str], silent: list[str], start: float, last: float) -> str:
    """What else is known of an outage, in words."""
    burst = any(_comes_in_a_burst(drive.times[name], last) for name in names)
    drove = drive.moved_between(start, last)
    words = "; what was sent meanwhile came in a burst" if burst else ""
    words += f"; the robot drove {drove:.1f} m meanwhile" if np.isfinite(drove) and drove > DROVE_M else ""
    return words + (f"; {', '.join(silent)} never came back" if silent else "")


def _comes_in_a_burst(times: Floats, after_s: float) -> bool:
    """Whether messages come much faster than usual when a topic returns."""
    back = times[(times >= after_s - OUTAGE_S) & (times <= after_s + OUTAGE_S)]
    usual = float(median(np.diff(times)))
    return int(np.count_nonzero(np.diff(back) < BURST * usual)) >= BURST_MESSAGES


def _ended(drive: Drive) -> Iterator[Finding]:
    for channel in drive.channels:
        type = type_of(channel)
        if type in (*_JUDGED_ELSEWHERE, *WITHOUT_STREAM) or CONTACT.search(channel.name):
            continue
        over = drive.ends_early(channel.name)
        if over is None or drive.duration_s - over[0] < ENDED * drive.duration_s:
            continue
        at, period_s = over
        if type == LOCALISED and drive.moved_between(at, drive.duration_s) < DROVE_M:
            continue  # a localisation tells a pose where the robot has moved
        yield Finding(
            kind=_KINDS.get(type, "topics"),
            title=f"{channel.name} ends early",
            onset_s=at,
            end_s=drive.duration_s,
            severity=drive.severity(at) if type in _KINDS else "info",
            evidence=f"nothing for the last {drive.duration_s - at:.0f} s, one every {period_s:.2g} s before",
            source="times of recording",
            probability=0.6,
        )


def _renamed(drive: Drive) -> Iterator[Finding]:
    if RENAMED in drive.facts:
        yield Finding(
            kind="log",
            title="metadata.yaml names other files than those beside it",
            onset_s=0.0,
            end_s=0.0,
            severity="info",
            evidence=f"{RENAMED}: {drive.facts[RENAMED]}; 'ros2 bag' does not open it so",
            source="metadata.yaml",
            suspect="operation",
        )


CHECK = Check(
    "topics", "incompatible QoS, outages, streams that end early", reading(*ROSOUT, ODOMETRY, *GOALS), LIMITS, find
)
