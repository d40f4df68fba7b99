"""Topics: nothing recorded, an outage of link or recorder, a robot that is heard no more, streams that end early."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

import numpy as np

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding, FindingKind
from care_core.ecosystems.plausible import STAMP, set_forward
from care_core.ecosystems.ros.drive import SILENT_PERIODS, SILENT_S, STREAM_MESSAGES, Drive
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
    STAMPED,
    STATUS,
    reading,
    tells_events,
    type_of,
)
from care_core.ecosystems.ros.node_messages import Level
from care_core.ecosystems.spans import Span, seconds_in
from care_core.ecosystems.timeline import counted
from care_core.logs.base import Channel
from care_core.logs.recording import RENAMED
from care_core.numbers import Floats, median, quantile
from care_core.text import log_time, shortened

LIMITS = Limits()
_LOADED = "of 301 healthy missions, some recorded by a computer at its limit, the longest pause of odometry was 4.5 s"
OUTAGE_S = LIMITS.add("pause of a stream", 5.0, "s", _LOADED)
OUTAGE_PERIODS = LIMITS.add("pause of a stream in its periods", 10.0, "", _LOADED)
TOGETHER_S = LIMITS.add("how far apart pauses begin that are one", 4.0, "s", "a link fails for all within its time-out")
TOPICS = LIMITS.add("streams that pause together", 2, "", "one alone is its sensor")
ENDS_TOGETHER_S = LIMITS.add("how far apart topics end that end together", 2.0, "s", "a node is shut down in less")
SILENCE_S = LIMITS.add("time in which nothing is recorded", 4.0, "s", "a choice: a robot of 0.5 m/s goes two metres")
SAID = LIMITS.add("share of an outage in which nothing at all comes", 0.7, "", "then that is told instead")
SELDOM_S = LIMITS.add("period of a topic whose pauses are judged", 2.0, "s", "a choice: a hand sends more seldom")
NAMED = int(LIMITS.add("topics that are named", 5, "", "a choice: more hide which they are"))
BURST = LIMITS.add("share of the usual period in a burst", 0.2, "", "what a link held back comes at once")
BURST_MESSAGES = LIMITS.add("messages in a burst", 5, "", "fewer are chance")
DROVE_M = LIMITS.add("way during an outage", 0.5, "m", "less is noise of odometry")
ENDED = LIMITS.add("share of the recording without a stream", 0.1, "", "recorders do not stop all topics at once")
LIMITS.add("silence of a stream that has ended", SILENT_S, "s", _LOADED)
LIMITS.add("silence of a stream in its periods", SILENT_PERIODS, "", _LOADED)
BEFORE_S = 1e-3
"""A silence begins after the last message of what ends with it."""
_QOS = re.compile(r"incompatible qos", re.IGNORECASE)
_TOPIC = re.compile(r"topic '?\"?([\w/~]+)")
_KINDS: dict[str, FindingKind] = {ODOMETRY: "topics", IMU: "imu", BATTERY: "battery"}
_RECORDER = "rosbag2"
"""What the names of recorders hold."""
_JUDGED_ELSEWHERE = (SCAN, CLOUD, *COMMANDS, STATUS)


def find(drive: Drive) -> Iterator[Finding]:
    """Incompatible QoS, a lost link, silence, outages, streams that end early, and files that were renamed."""
    yield from _qos(drive)
    yield from _lost(drive)
    silence = _silence(drive)
    yield from _silent(drive, silence)
    yield from _outage(drive, silence)
    yield from _ended(drive)
    yield from _renamed(drive)


def stalls(drive: Drive) -> bool:
    """Whether several topics, or all, paused at once."""
    silence = _silence(drive)
    return bool(silence) or any(True for _ in _outage(drive, silence))


_RECORD_AS_SENT = (
    "that concerns the recording alone: give 'ros2 bag record' what the publisher has by --qos-profile-overrides-path"
)
_ASK_AS_SENT = "let the subscriber ask for what the publisher offers (best effort for most sensors)"


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
        is_recorders = _RECORDER in node  # who else subscribes gets its messages, as far as this tells
        yield Finding(
            kind="topics",
            title=f"{name}: incompatible QoS between publisher and subscriber",
            onset_s=at,
            end_s=at,
            severity="warning" if empty else "info",
            evidence=f'{what}; {node}: "{shortened(text, 160)}"'
            + (f"; {_RECORD_AS_SENT}" if is_recorders else f"; {_ASK_AS_SENT}"),
            source="/rosout; a subscriber that asks for reliable gets nothing from a best-effort publisher (ROS 2,"
            " About QoS)",
            suspect="operation",
            probability=0.95,
            mission_lost=0.0 if is_recorders else None,
        )


def _lost(drive: Drive) -> Iterator[Finding]:
    """All that the robot sends ends while commands to it go on."""
    lost = drive.lost
    if lost is not None:
        yield Finding(
            kind="radio",
            title="the link to the robot is lost: all that it sends ends",
            onset_s=lost.at_s,
            end_s=drive.duration_s,
            severity=drive.severity(lost.at_s),
            evidence=f"{_named(lost.topics)} end at {log_time(lost.at_s)}; {lost.commands} commands follow, for"
            f" {lost.until_s - lost.at_s:.1f} s",
            source="times of recording",
            suspect="operation",
            probability=0.8,
        )


def _silence(drive: Drive) -> list[Span]:
    """When nothing at all was recorded, though what is sent by itself comes often before and after."""
    every = np.sort(np.concatenate([np.empty(0), *drive.log.times().values()]))  # those of other robots, too
    sent = [drive.times[one.name] for one in drive.channels if not tells_events(one) and type_of(one) not in COMMANDS]
    by_itself = np.sort(np.concatenate([np.empty(0), *sent]))
    steps = np.diff(by_itself)
    if len(steps) <= STREAM_MESSAGES or (usual := quantile(steps, 0.9)) > SELDOM_S:
        return []
    rows = np.flatnonzero(np.diff(every) > max(SILENCE_S, OUTAGE_PERIODS * usual))
    spans = [(float(every[row]), float(every[row + 1])) for row in rows]
    begun_s = by_itself[STREAM_MESSAGES]  # what is kept for a recorder comes at once, the rest when it is started
    set_s = _clock_set_s(drive)
    return [
        (start, end)
        for start, end in spans
        if begun_s <= start and by_itself[-1] >= end and not any(start <= at <= end for at in set_s)
    ]


def _clock_set_s(drive: Drive) -> list[float]:
    """When the recorder's clock was set forward, as the robot's own tells: that is no silence."""
    stamped = (table for _, table in drive.of(*STAMPED) if STAMP in table.columns)
    found = (set_forward(table.t, np.asarray(table[STAMP], np.float64)) for table in stamped)
    return [one[0] for one in found if one is not None]


def _silent(drive: Drive, spans: list[Span]) -> Iterator[Finding]:
    """Times in which no topic of the recording says anything: which part failed nothing tells."""
    if not spans:
        return
    start, end = max(spans, key=lambda span: span[1] - span[0])
    times = f"{len(spans)} such times, {seconds_in(spans):.0f} s in all; " if len(spans) > 1 else ""
    gone = _gone(drive, start)
    words = _meanwhile(drive, list(drive.regular), gone, start, end)
    yield Finding(
        kind="radio",
        title=f"nothing at all is recorded for {end - start:.1f} s",
        onset_s=min([start, *(float(drive.times[topic][-1]) for topic in gone)]) - BEFORE_S,
        end_s=end,
        severity=drive.severity(start),
        evidence=f"{times}every topic pauses: the recorder, the link to it, or the node that sends all of them{words}",
        source="times of recording",
        suspect="operation",
        probability=0.8,
    )


def _gone(drive: Drive, start: float) -> list[str]:
    """What ends for good at about a time."""
    return [name for name in drive.regular if (over := drive.ends_early(name)) and abs(over[0] - start) <= TOGETHER_S]


def _pauses(drive: Drive) -> list[tuple[float, float, str]]:
    """Every long pause of what comes regularly: from, to, topic."""
    found, set_s = [], _clock_set_s(drive)
    for topic, period_s in drive.regular.items():
        times = drive.times[topic]
        long = max(OUTAGE_S, OUTAGE_PERIODS * period_s) if period_s <= SELDOM_S else np.inf
        for row in np.flatnonzero(np.diff(times) >= long):
            if not any(times[row] <= at <= times[row + 1] for at in set_s):
                found.append((float(times[row]), float(times[row + 1]), topic))
    return sorted(found)


def _outage(drive: Drive, told: list[Span]) -> Iterator[Finding]:
    """Streams of several nodes that pause together, as when the link or the recorder fails while the robot goes on.

    Args:
        told: when nothing at all was recorded, which says more.
    """
    gaps = _pauses(drive)
    for start, _, topic in gaps:
        together = [gap for gap in gaps if abs(gap[0] - start) <= TOGETHER_S and gap[1] > start + OUTAGE_S]
        silent = _gone(drive, start)
        names = sorted({gap[2] for gap in together} | set(silent))
        if len(names) < TOPICS or topic in silent or not drive.have_several_sources(names):
            continue
        lasted_s = [end - begin for begin, end, _ in together]
        last = max(gap[1] for gap in together)
        if any(min(last, end) - max(start, begin) > SAID * (last - start) for begin, end in told):
            continue
        words = _meanwhile(drive, names, silent, start, last)
        again = [gap for gap in gaps if gap[2] == topic and gap[0] > last - TOGETHER_S]
        words += f"; {topic} pauses {counted(len(again), 'more time')}" if again else ""
        yield Finding(
            kind="radio",
            title="outage of link or recorder: several topics stall at once",
            onset_s=start,
            end_s=last,
            severity=drive.severity(start),
            evidence=f"{_named(names)} pause for {min(lasted_s):.0f} to {max(lasted_s):.0f} s{words}",
            source="times of recording",
            suspect="operation",
            probability=0.8,
        )
        return


def _named(topics: Sequence[str]) -> str:
    more = len(topics) - NAMED
    return ", ".join(topics[:NAMED]) + (f" and {more} more" if more > 0 else "")


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
    """Topics that end; those that do together are one event, as of a node that ends."""
    found: list[list[tuple[float, float, Channel]]] = []
    for at, period_s, channel in sorted(_ends(drive), key=lambda one: (one[0], one[2].name)):
        if not found or at - found[-1][-1][0] > ENDS_TOGETHER_S:
            found.append([])
        found[-1].append((at, period_s, channel))
    for own in found:
        at, period_s, _ = own[0]
        types = [type_of(channel) for _, _, channel in own]
        kinds = {_KINDS.get(type, "topics") for type in types}
        names = sorted((channel.name for _, _, channel in own), key=lambda name: (name.count("/"), name))
        every = f", one every {period_s:.2g} s before" if len(own) == 1 else f" of {counted(len(own), 'topic')}"
        yield Finding(
            kind=min(kinds) if len(kinds) == 1 else "topics",
            title=f"{_named(names)} {'end' if len(own) > 1 else 'ends'} early",
            onset_s=at,
            end_s=drive.duration_s,
            severity=drive.severity(at) if any(type in _KINDS for type in types) else "info",
            evidence=f"nothing for the last {drive.duration_s - at:.0f} s{every}",
            source="times of recording",
            probability=0.6,
        )


def _ends(drive: Drive) -> Iterator[tuple[float, float, Channel]]:
    """When each topic ends that nobody else judges, and its period."""
    lost = () if drive.lost is None else drive.lost.topics
    for channel in drive.channels:
        type = type_of(channel)
        if type in _JUDGED_ELSEWHERE or channel.name not in drive.regular or channel.name in lost:
            continue
        over = drive.ends_early(channel.name)
        if over is None or drive.duration_s - over[0] < ENDED * drive.duration_s:
            continue
        if type == LOCALISED and drive.moved_between(over[0], drive.duration_s) < DROVE_M:
            continue  # a localisation tells a pose where the robot has moved
        yield *over, channel


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
    "topics",
    "incompatible QoS, outages, streams that end early",
    reading(*ROSOUT, *STAMPED, *COMMANDS, *GOALS),
    LIMITS,
    find,
)
