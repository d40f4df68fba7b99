"""Laser scanners: silent, frozen, noisy, blind."""

from __future__ import annotations

import re
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from care_core.ecosystems.findings import Finding
from care_core.ecosystems.ros import plan
from care_core.ecosystems.ros.recording import Recording, Scans, stretches
from care_core.ecosystems.ros.silence import ends_early
from care_core.numbers import median, quantile

NOISE_M, NOISE_RISES = 0.1, 4.0
"""Noise between neighbouring rays, and how much higher it must be than before. Data sheets: 0.03 to 0.05 m (UST-10LX,
LMS1xx, RPLIDAR A2 at 5 m); healthy missions of a simulated one with 0.01 m: at most 0.014."""
FROZEN_SCANS, FROZEN_M, FROZEN_RAD = 3, 0.15, 0.15
"""So many scans in a row alike to the last bit while the robot moved: a laser's noise never repeats."""
BLIND, SEEING, BLIND_S = 0.02, 0.2, 3.0
"""Share of rays that return at most, at least before, and for how long."""
_BUFFER = re.compile(r"observation buffer has not been updated for ([\d.]+) seconds", re.IGNORECASE)
_SECOND_DIFFERENCE = 0.6745 * np.sqrt(6)
"""Median of |second difference| of rays with noise of 1: normal quantile times sqrt(1 + 4 + 1)."""


def check(recording: Recording) -> Iterator[Finding]:
    for channel in recording.channels:
        if plan.kind_of(channel) in (plan.SCAN, plan.CLOUD):
            silent = ends_early(recording, channel.name)
            if silent is not None:
                yield _dead(recording, channel.name, *silent)
    for scans in recording.scans:
        yield from faults(recording, scans)


def faults(recording: Recording, scans: Scans) -> Iterator[Finding]:
    """What is wrong with the scans that came: from then on they are not to be believed."""
    yield from _frozen(recording, scans)
    yield from _noisy(recording, scans)
    yield from _blind(recording, scans)


def _dead(recording: Recording, topic: str, last_s: float, period_s: float) -> Finding:
    said = next((one for one in recording.said if _BUFFER.search(one.text)), None)
    words = f'; {said.node}: "{said.text[:80]}"' if said is not None else ""
    return Finding(
        "laser", f"the laser falls silent: {topic} ends", last_s, recording.duration_s, recording.severity(last_s),
        f"no scan for the last {recording.duration_s - last_s:.0f} s, one every {period_s:.2g} s before{words}", topic,
        probability=0.9,
    )  # fmt: skip


def _frozen(recording: Recording, scans: Scans) -> Iterator[Finding]:
    same = np.array([a.tobytes() == b.tobytes() for a, b in pairwise(scans.raw)], bool)
    for start, end in stretches(scans.t[1:], same, 2.5 * _period(scans)):
        rows = (scans.t >= start) & (scans.t <= end)
        if np.count_nonzero(rows) < FROZEN_SCANS or not _moved(recording, start, end):
            continue
        yield Finding(
            "laser", "the laser is stuck: it repeats the same scan", start, end, recording.severity(start),
            f"{np.count_nonzero(rows) + 1} scans alike to the last bit while the robot moved"
            f" {recording.moved_between(start, end):.1f} m", scans.topic, probability=0.9,
        )  # fmt: skip
        return


def _moved(recording: Recording, start: float, end: float) -> bool:
    odometry = recording.odometry
    if odometry is None:
        return False
    inside = (odometry.t >= start) & (odometry.t <= end)
    turned = float(np.sum(np.abs(np.diff(np.unwrap(odometry.yaw[inside])))))
    return recording.moved_between(start, end) > FROZEN_M or turned > FROZEN_RAD


def _noisy(recording: Recording, scans: Scans) -> Iterator[Finding]:
    if scans.ranges.shape[1] < 30 or len(scans.t) < 8:
        return
    ranges = scans.ranges.astype(np.float64)
    bent = np.abs(ranges[:, :-2] - 2 * ranges[:, 1:-1] + ranges[:, 2:])
    known = np.count_nonzero(np.isfinite(bent), axis=1) >= 30
    if np.count_nonzero(known) < 8:
        return
    t, noise = scans.t[known], _medians(bent[known]) / _SECOND_DIFFERENCE
    quiet = quantile(noise, 0.1) if noise[0] > NOISE_M else float(median(noise[:5]))
    loud = noise > max(NOISE_M, NOISE_RISES * quiet)
    found = [
        one for one in stretches(t, loud, 3.5 * _period(scans)) if np.count_nonzero((t >= one[0]) & (t <= one[1])) >= 5
    ]
    if found:
        start, end = found[0][0], found[-1][1]
        level = float(median(noise[loud]))
        yield Finding(
            "laser", "the laser is noisy", start, end, recording.severity(start),
            f"ranges scatter by {level:.2f} m from ray to ray, {quiet:.3f} m before",
            f"{scans.topic}; data sheets of scanners: 0.03 to 0.05 m", probability=0.9,
        )  # fmt: skip


def _medians(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """The median of what is known in each row, which is sorted; numpy's own takes five times as long."""
    rows.sort(axis=1)  # unknown values last
    count = np.count_nonzero(~np.isnan(rows), axis=1)[:, None]
    middle = np.take_along_axis(rows, np.hstack([(count - 1) // 2, count // 2]), axis=1)
    medians: NDArray[np.float64] = middle.mean(axis=1)
    return medians


def _blind(recording: Recording, scans: Scans) -> Iterator[Finding]:
    seen = np.isfinite(scans.ranges).mean(axis=1)
    if float(median(seen[: max(5, len(seen) // 10)])) < SEEING:
        return
    for start, end in stretches(scans.t, seen <= BLIND, 2.5 * _period(scans)):
        if end - start >= BLIND_S:
            yield Finding(
                "laser", "the laser sees nothing", start, end, recording.severity(start),
                f"{median(seen):.0%} of its rays return usually, at most {BLIND:.0%} for {end - start:.0f} s",
                scans.topic, probability=0.7,
            )  # fmt: skip
            return


def _period(scans: Scans) -> float:
    return float(median(np.diff(scans.t))) if len(scans.t) > 1 else 1.0
