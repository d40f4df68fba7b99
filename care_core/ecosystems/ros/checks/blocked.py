"""Something stands where the laser saw free space before, and the robot gets no further."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.findings import Finding
from care_core.ecosystems.ros.checks import laser
from care_core.ecosystems.ros.recording import Floats, Odometry, Recording, Scans
from care_core.numbers import median

BEFORE_S, AT_MOST_S = 0.8, 3.0
"""Scans are compared with one so much earlier."""
FREE_M = 0.5
"""A return so much nearer than what every ray beside it measured before is new."""
AHEAD_M, ASIDE_M, WIDE_M = 5.0, 0.8, 0.4
"""How far ahead and aside of the robot something must appear, and how wide it must be, to be in its way."""
RAYS = 8
TURN_RAD = 0.1
"""Between the scans the robot must not have turned further: where its laser sits on it is not known."""
STUCK_S, STUCK_M = 10.0, 0.5
"""A robot that gets no further in this time, within a minute of it, was stopped by it."""


def check(recording: Recording) -> Iterator[Finding]:
    odometry = recording.odometry
    if odometry is None or not any(goal.failed for goal in recording.goals):
        return  # without a goal that failed nobody knows that the robot wanted to go on
    for scans in recording.scans:
        doubted_s = min((one.onset_s for one in laser.faults(recording, scans)), default=np.inf)
        if scans.ranges.shape[1] < 30 or scans.angles[0] == scans.angles[1]:
            continue
        for row, points in _appeared(scans, _poses(odometry, scans.t)):
            at = float(scans.t[row])
            if at >= doubted_s - 2 * BEFORE_S:
                return
            stuck_s = _stuck(odometry, at)
            if stuck_s is None or not any(goal.failed and goal.end_s >= at for goal in recording.goals):
                continue
            far, wide = float(median(points[:, 0])), float(np.ptp(points[:, 1]))
            yield Finding(
                "blocked", "something appeared in the robot's way", at, float(odometry.t[-1]),
                recording.severity(at), f"{wide:.1f} m wide, {far:.1f} m ahead, where the laser saw free space before;"
                f" the robot gets no further from {stuck_s:.0f} s on", f"{scans.topic} against {odometry.topic}",
                "world", 0.85,
            )  # fmt: skip
            return


def _appeared(scans: Scans, poses: Floats) -> Iterator[tuple[int, Floats]]:
    """Scans with something new ahead that is still there in the next, with its points."""
    before = np.searchsorted(scans.t, scans.t - BEFORE_S, "right") - 1
    for row in range(len(scans.t)):
        earlier = int(before[row])
        if earlier < 0 or scans.t[row] - scans.t[earlier] > AT_MOST_S:
            continue
        points = _new_points(scans, poses, row, earlier)
        if len(points) < RAYS:
            continue
        later = _new_points(scans, poses, min(row + 1, len(scans.t) - 1), earlier)
        if len(later) >= RAYS and np.ptp(later[:, 1]) >= WIDE_M:
            yield row, points


def _new_points(scans: Scans, poses: Floats, row: int, earlier: int) -> Floats:
    """Points of a scan ahead of the robot that lie in what an earlier scan saw as free; shape (n, 2), m."""
    (x, y, yaw), (x0, y0, yaw0) = poses[row], poses[earlier]
    if abs(yaw - yaw0) > TURN_RAD:
        return np.empty((0, 2))
    ranges = scans.ranges[row].astype(np.float64)
    ahead, aside = ranges * np.cos(scans.angles), ranges * np.sin(scans.angles)
    near = np.isfinite(ranges) & (ahead > 0) & (ahead < AHEAD_M) & (np.abs(aside) < ASIDE_M)
    ahead, aside = ahead[near], aside[near]
    world_x = x + ahead * np.cos(yaw) - aside * np.sin(yaw) - x0
    world_y = y + ahead * np.sin(yaw) + aside * np.cos(yaw) - y0
    angle = (np.arctan2(world_y, world_x) - yaw0 + np.pi) % (2 * np.pi) - np.pi
    ray = np.round((angle - scans.angles[0]) / (scans.angles[1] - scans.angles[0])).astype(int)
    inside = (ray >= 2) & (ray < len(scans.angles) - 2)
    around = scans.ranges[earlier][np.clip(ray, 2, len(scans.angles) - 3)[:, None] + np.arange(-2, 3)]
    # A ray that came back from nowhere says nothing: np.min keeps its nan, and the comparison fails.
    free = np.min(around, axis=1) > np.hypot(world_x, world_y) + FREE_M
    points: Floats = np.stack([ahead, aside], axis=1)[inside & free]
    return points


def _poses(odometry: Odometry, t: Floats) -> Floats:
    """Position and heading at some times, shape (n, 3)."""
    columns = (odometry.x, odometry.y, np.unwrap(odometry.yaw))
    poses: Floats = np.stack([np.interp(t, odometry.t, column) for column in columns], axis=1)
    return poses


def _stuck(odometry: Odometry, at: float) -> float | None:
    """When the robot began to get no further, within a minute; None where it went on."""
    t = odometry.t
    for row in np.flatnonzero((t >= at) & (t <= at + 60.0)).tolist():
        last = int(np.searchsorted(t, t[row] + STUCK_S))
        if last >= len(t):
            return None
        if np.hypot(odometry.x[row:last] - odometry.x[row], odometry.y[row:last] - odometry.y[row]).max() < STUCK_M:
            return float(t[row])
    return None
