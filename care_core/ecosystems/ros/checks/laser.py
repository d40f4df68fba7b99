"""Laser scanners: silent, dropping out, frozen, noisy, blind."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.ros.drive import Drive
from care_core.ecosystems.ros.messages import CLOUD, GOALS, ODOMETRY, ROSOUT, SCAN, reading, type_of
from care_core.ecosystems.ros.motion import STANDS_MPS, STANDS_RADPS
from care_core.ecosystems.ros.sensors import Scans
from care_core.ecosystems.spans import stretches, unbroken
from care_core.numbers import Floats, median, quantile
from care_core.records import replace
from care_core.text import shortened

LIMITS = Limits()
_FROZEN = "a laser's noise never repeats while the robot moves"
NOISE_M = LIMITS.add(
    "noise between neighbouring rays", 0.1, "m",
    "data sheets: 0.03 to 0.05 m (UST-10LX, LMS1xx, RPLIDAR A2 at 5 m); healthy simulated ones: at most 0.014 m",
)  # fmt: skip
NOISE_RISES = LIMITS.add("noise against that before", 4.0, "", "a room that scatters more does not do so")
NOISE_SCANS = LIMITS.add("noisy scans", 5, "", "fewer are somebody who walks by")
SCANS = LIMITS.add("scans of a laser", 8, "", "fewer do not tell what is usual")
RAYS = LIMITS.add("rays of a scan", 30, "", "fewer do not tell noise from corners")
RETURNS = LIMITS.add("rays that hit something in a scan that tells", 5, "", "an empty world sends none back")
FROZEN_SCANS = LIMITS.add("scans alike to the last bit", 3, "", _FROZEN)
FROZEN_M = LIMITS.add("way while they are alike", 0.15, "m", _FROZEN)
FROZEN_RAD = LIMITS.add("turn while they are alike", 0.15, "rad", _FROZEN)
TWICE = LIMITS.add(
    "share of scans like the one before of a driver that sends each again", 0.1, "",
    "a choice: healthy lasers repeat none while the robot moves",
)  # fmt: skip
STUCK_TIMES = LIMITS.add("scans alike against those that a driver repeats", 4.0, "", "a choice: beyond any such run")
DROPS = LIMITS.add("pauses of the scans alone", 3, "", "one or two are chance")
DROPS_S = LIMITS.add("such a pause", 1.0, "s", "a choice: a robot of 0.5 m/s goes half a metre blind")
DROPS_PERIODS = LIMITS.add("such a pause, in periods", 6.0, "", "a choice: of recordings that are thinned")
HEARD = LIMITS.add("share of the odometry that came in it", 0.6, "", "else the link or the recorder paused")
BREAK_PERIODS = LIMITS.add("break in a fault, in periods", 2.5, "", "one scan may be lost")
NOISE_BREAK_PERIODS = LIMITS.add("break in noise, in periods", 3.5, "", "two scans may see a smooth wall")
BLIND = LIMITS.add("share of rays that return to a blind laser", 0.02, "", "stray returns")
SEEING = LIMITS.add("share of rays that return before", 0.2, "", "in the open hardly any does")
BLIND_S = LIMITS.add("time without returns", 3.0, "s", "turning away from a wall takes less")
_BUFFER = re.compile(r"observation buffer has not been updated for ([\d.]+) seconds", re.IGNORECASE)
_SECOND_DIFFERENCE = 0.6745 * np.sqrt(6)
"""Median of |second difference| of rays with noise of 1: normal quantile times sqrt(1 + 4 + 1)."""


def find(drive: Drive) -> Iterator[Finding]:
    """Lasers that fall silent, and what is wrong with the scans of the others."""
    for channel in drive.channels:
        if type_of(channel) in (SCAN, CLOUD):
            silent = drive.ends_early(channel.name)
            if drive.lost is not None and channel.name in drive.lost.topics:
                continue
            if silent is not None:
                yield _dead(drive, channel.name, *silent)
            else:
                yield from _dropping(drive, channel.name)
    noted: set[str] = set()
    for scans in drive.scans:
        for one in faults(drive, scans):
            if one.severity != "info" or one.title not in noted:  # of several lasers a note is told once
                yield one
            noted.add(one.title)


def faults(drive: Drive, scans: Scans) -> Iterator[Finding]:
    """What is wrong with the scans that came: from then on they are not to be believed."""
    yield from _frozen(drive, scans)
    yield from _noisy(drive, scans)
    yield from _blind(drive, scans)


def _finding(
    drive: Drive, title: str, span: tuple[float, float], evidence: str, source: str, probability: float = 0.9
) -> Finding:
    return Finding(
        kind="laser",
        title=title,
        onset_s=span[0],
        end_s=span[1],
        severity=drive.severity(span[0]),
        evidence=evidence,
        source=source,
        probability=probability,
    )


def _dead(drive: Drive, topic: str, last_s: float, period_s: float) -> Finding:
    complaint = next((message for message in drive.log_messages if _BUFFER.search(message.text)), None)
    words = f'; {complaint.node}: "{shortened(complaint.text, 80)}"' if complaint is not None else ""
    evidence = f"no scan for the last {drive.duration_s - last_s:.0f} s, one every {period_s:.2g} s before{words}"
    return _finding(drive, f"the laser falls silent: {topic} ends", (last_s, drive.duration_s), evidence, topic)


def _dropping(drive: Drive, topic: str) -> Iterator[Finding]:
    """Scans that fail to come again and again while the odometry goes on: no link and no recorder lost those."""
    odometry, period_s, times = drive.odometry, drive.streams.get(topic), drive.times[topic]
    if odometry is None or period_s is None:
        return
    rows = np.flatnonzero(np.diff(times) > max(DROPS_S, DROPS_PERIODS * period_s))
    spans = [(float(times[row]), float(times[row + 1])) for row in rows]
    beside = odometry.recorded_s
    usual_s = float(median(np.diff(beside)))
    alone = [(a, b) for a, b in spans if _heard(beside, a, b) * usual_s > HEARD * (b - a)]
    if len(alone) < DROPS:
        return
    most = max(b - a for a, b in alone)
    evidence = (
        f"{len(alone)} pauses of up to {most:.1f} s, one scan every {period_s:.2g} s else; {odometry.topic} went on"
    )
    yield _finding(drive, f"the laser drops out: {topic} pauses", (alone[0][0], alone[-1][1]), evidence, topic, 0.7)


def _heard(times: Floats, start: float, end: float) -> int:
    return int(np.count_nonzero((times > start) & (times < end)))


def _frozen(drive: Drive, scans: Scans) -> Iterator[Finding]:
    same = np.array([a.tobytes() == b.tobytes() for a, b in pairwise(scans.raw)], bool)
    same &= np.isfinite(scans.ranges[1:]).sum(axis=1) >= RETURNS  # where nothing is near, every scan is alike
    runs = [(first, last + 1) for first, last in unbroken(same)]
    again = [last - first for first, last in runs if _moves(drive, scans.t[first], scans.t[last])]
    for first, last in runs:
        start, end, count = float(scans.t[first]), float(scans.t[last]), last - first
        if count < FROZEN_SCANS or not _moved(drive, start, end) or _sent_again(again, count, len(same)):
            continue
        evidence = f"{count + 1} scans alike to the last bit while the robot {_way(drive, start, end)}"
        yield _finding(drive, "the laser is stuck: it repeats the same scan", (start, end), evidence, scans.topic)
        return


def _sent_again(runs: Sequence[int], count: int, steps: int) -> bool:
    """Whether so many scans alike are what its driver does: faster than the laser turns, it sends each scan again.

    Args:
        runs: how many in a row were like the one before, each time that they were while the robot moved.
    """
    short = [one for one in runs if one < count]
    return sum(short) >= TWICE * steps and count < STUCK_TIMES * float(median(short))


def _moves(drive: Drive, start: float, end: float) -> bool:
    """Whether the robot is under way in a time, however short."""
    odometry = drive.odometry
    if odometry is None:
        return False
    first, last = np.searchsorted(odometry.t, (start, end))
    rows = slice(max(int(first) - 1, 0), int(last) + 1)
    return bool(np.any(np.abs(odometry.speed[rows]) > STANDS_MPS) or np.any(np.abs(odometry.turn[rows]) > STANDS_RADPS))


def _way(drive: Drive, start: float, end: float) -> str:
    """How far it moved, or turned where it hardly moved."""
    went, turned = drive.moved_between(start, end), _turned(drive, start, end)
    return f"moved {went:.1f} m" if went > FROZEN_M else f"turned by {np.degrees(turned):.0f} deg"


def _moved(drive: Drive, start: float, end: float) -> bool:
    if drive.odometry is None:
        return False
    return drive.moved_between(start, end) > FROZEN_M or _turned(drive, start, end) > FROZEN_RAD


def _turned(drive: Drive, start: float, end: float) -> float:
    """How far the robot turned in a time, rad."""
    odometry = drive.odometry
    assert odometry is not None
    inside = (odometry.t >= start) & (odometry.t <= end)
    return float(np.sum(np.abs(np.diff(np.unwrap(odometry.yaw[inside])))))


def _noisy(drive: Drive, scans: Scans) -> Iterator[Finding]:
    if scans.ranges.shape[1] < RAYS or len(scans.t) < SCANS:
        return
    ranges = scans.ranges.astype(np.float64)
    bent = np.abs(ranges[:, :-2] - 2 * ranges[:, 1:-1] + ranges[:, 2:])
    known = np.count_nonzero(np.isfinite(bent), axis=1) >= RAYS
    if np.count_nonzero(known) < SCANS:
        return
    t, noise = scans.t[known], _medians(bent[known]) / _SECOND_DIFFERENCE
    quiet = quantile(noise, 0.1) if noise[0] > NOISE_M else float(median(noise[:5]))
    loud = noise > max(NOISE_M, NOISE_RISES * quiet)
    found = [
        (start, end)
        for start, end in stretches(t, loud, NOISE_BREAK_PERIODS * _period(scans))
        if np.count_nonzero((t >= start) & (t <= end)) >= NOISE_SCANS
    ]
    if found:
        evidence = f"ranges scatter by {median(noise[loud]):.2f} m from ray to ray, {quiet:.3f} m before"
        source = f"{scans.topic}; data sheets of scanners: 0.03 to 0.05 m"
        yield _finding(drive, "the laser is noisy", (found[0][0], found[-1][1]), evidence, source)


def _medians(rows: Floats) -> Floats:
    """The median of what is known in each row, which is sorted; numpy's own takes five times as long."""
    rows.sort(axis=1)  # unknown values last
    count = np.count_nonzero(~np.isnan(rows), axis=1)[:, None]
    middle = np.take_along_axis(rows, np.hstack([(count - 1) // 2, count // 2]), axis=1)
    medians: Floats = middle.mean(axis=1)
    return medians


def _blind(drive: Drive, scans: Scans) -> Iterator[Finding]:
    seen = np.isfinite(scans.ranges).mean(axis=1)
    if not seen.any() and len(seen) >= SCANS and _moved(drive, float(scans.t[0]), float(scans.t[-1])):
        yield _sees_nothing_ever(drive, scans)
    if float(median(seen[: max(5, len(seen) // 10)])) < SEEING:
        return
    for start, end in stretches(scans.t, seen <= BLIND, BREAK_PERIODS * _period(scans)):
        if end - start >= BLIND_S:
            evidence = f"{median(seen):.0%} of its rays return usually, at most {BLIND:.0%} for {end - start:.0f} s"
            yield _finding(drive, "the laser sees nothing", (start, end), evidence, scans.topic, 0.7)
            return


def _sees_nothing_ever(drive: Drive, scans: Scans) -> Finding:
    """A note: an empty world sends nothing back either."""
    span = float(scans.t[0]), float(scans.t[-1])
    evidence = f"no ray of any of its {len(scans.t)} scans came back: it stands in the open, or sees nothing"
    return replace(_finding(drive, "the laser saw nothing in any scan", span, evidence, scans.topic), severity="info")


def _period(scans: Scans) -> float:
    return float(median(np.diff(scans.t))) if len(scans.t) > 1 else 1.0


READS = reading(SCAN, ODOMETRY, *ROSOUT, *GOALS)
CHECK = Check("laser", "scanners that fall silent, drop out, freeze, scatter or see nothing", READS, LIMITS, find)
