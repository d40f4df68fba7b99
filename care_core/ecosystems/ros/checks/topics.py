"""Topics: nothing recorded, an outage of link or recorder, streams that end early."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.findings import Finding, FindingKind
from care_core.ecosystems.ros import plan
from care_core.ecosystems.ros.recording import WARN, Floats, Recording
from care_core.ecosystems.ros.silence import ends_early
from care_core.logs.recording import RENAMED
from care_core.numbers import median

OUTAGE_S, OUTAGE_PERIODS = 5.0, 10.0
"""A pause this long, and so many periods long, in several streams at once is an outage. Of 301 healthy missions, some
recorded by a computer at its limit, the longest pause of odometry was 4.5 s."""
TOGETHER_S = 4.0
_QOS = re.compile(r"incompatible qos", re.IGNORECASE)
_TOPIC = re.compile(r"topic '?\"?([\w/~]+)")
_KINDS: dict[str, FindingKind] = {plan.ODOMETRY: "localisation", plan.IMU: "imu", plan.BATTERY: "battery"}
_CONTACT = re.compile(r"contact|collision|bumper", re.IGNORECASE)
"""Topics that speak only while something touches (gazebo_ros bumpers and their like)."""
_LASERS = (plan.SCAN, plan.CLOUD)


def check(recording: Recording) -> Iterator[Finding]:
    yield from _qos(recording)
    outages = list(_outage(recording))
    yield from outages
    yield from _ended(recording)
    yield from _renamed(recording)


def _qos(recording: Recording) -> Iterator[Finding]:
    counts = {one.name: one.count for one in recording.channels}
    told: dict[str, tuple[float, str, str]] = {}
    for one in recording.said:
        if one.level >= WARN and _QOS.search(one.text):
            found = _TOPIC.search(one.text)
            told.setdefault(found.group(1) if found else "a topic", (one.time_s, one.node, one.text))
    for topic, (at, node, text) in told.items():
        empty = counts.get(topic) == 0
        what = "nothing of it was recorded" if empty else f"{counts.get(topic, 0)} messages were recorded"
        yield Finding(
            "topics", f"{topic}: quality of service of its publisher and a reader do not fit", at, at,
            "warning" if empty else "info", f'{what}; {node}: "{text[:160]}"',
            "/rosout; a reader that asks for reliable gets nothing from a best-effort publisher (ROS 2, About QoS)",
            "operation", 0.95,
        )  # fmt: skip


def _outage(recording: Recording) -> Iterator[Finding]:
    """Streams that pause together, as when the link or the recorder fails while the robot goes on."""
    gaps: list[tuple[float, float, str]] = []
    for topic, times in recording.times.items():
        if topic in recording.streams:
            pauses = np.diff(times)
            row = int(np.argmax(pauses))
            if pauses[row] >= max(OUTAGE_S, OUTAGE_PERIODS * recording.streams[topic]):
                gaps.append((float(times[row]), float(times[row + 1]), topic))
    for start, _, topic in sorted(gaps):
        together = [one for one in gaps if abs(one[0] - start) <= TOGETHER_S and one[1] > start + OUTAGE_S]
        silent = [
            one
            for one in recording.times
            if (over := ends_early(recording, one)) and abs(over[0] - start) <= TOGETHER_S
        ]
        if len(together) + len(silent) < 2 or topic in silent:
            continue
        names = sorted({one[2] for one in together} | set(silent))
        last = max(one[1] for one in together)
        burst = [one for one in names if _comes_in_a_burst(recording.times[one], last)]
        drove = recording.moved_between(start, last)
        words = "; what was sent meanwhile came in a burst" if burst else ""
        words += f"; the robot drove {drove:.1f} m meanwhile" if np.isfinite(drove) and drove > 0.5 else ""
        words += f"; {', '.join(silent)} never came back" if silent else ""
        yield Finding(
            "radio", "outage of link or recorder: several topics stall at once", start, last, recording.severity(start),
            f"{', '.join(names)} pause for {min(one[1] - one[0] for one in together):.0f} to"
            f" {max(one[1] - one[0] for one in together):.0f} s{words}", "times of recording", "operation", 0.8,
        )  # fmt: skip
        return


def _comes_in_a_burst(times: Floats, after_s: float) -> bool:
    """Whether messages come much faster than usual when a topic returns."""
    back = times[(times >= after_s - OUTAGE_S) & (times <= after_s + OUTAGE_S)]
    usual = float(median(np.diff(times)))
    return int(np.count_nonzero(np.diff(back) < 0.2 * usual)) >= 5


def _ended(recording: Recording) -> Iterator[Finding]:
    for channel in recording.channels:
        kind = plan.kind_of(channel)
        if kind in (*_LASERS, plan.TWIST, plan.TWIST_STAMPED, plan.STATUS) or _CONTACT.search(channel.name):
            continue
        over = ends_early(recording, channel.name)
        if over is None or recording.duration_s - over[0] < 0.1 * recording.duration_s:
            continue
        at, period_s = over
        yield Finding(
            _KINDS.get(kind, "topics"), f"{channel.name} ends early", at, recording.duration_s,
            recording.severity(at) if kind in _KINDS else "info",
            f"nothing for the last {recording.duration_s - at:.0f} s, one every {period_s:.2g} s before",
            "times of recording", probability=0.6,
        )  # fmt: skip


def _renamed(recording: Recording) -> Iterator[Finding]:
    if RENAMED in recording.facts:
        yield Finding(
            "log", "metadata.yaml names other files than those beside it", 0.0, 0.0, "info",
            f"{RENAMED}: {recording.facts[RENAMED]}; 'ros2 bag' does not open it so", "metadata.yaml", "operation",
        )  # fmt: skip
