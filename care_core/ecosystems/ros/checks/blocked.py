"""Something stands where the laser saw free space before, and the robot gets no further."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.ros.checks.laser import faults
from care_core.ecosystems.ros.drive import Drive
from care_core.ecosystems.ros.messages import GOALS, ODOMETRY, SCAN, reading
from care_core.ecosystems.ros.motion import Odometry
from care_core.ecosystems.ros.sensors import Scans
from care_core.numbers import Floats, median
from care_core.text import log_time

LIMITS = Limits()
_WAY = "what a robot's width and a few seconds of driving take up"
BEFORE_S = LIMITS.add("age of the scan that is compared", 0.8, "s", "long enough for somebody to step in the way")
AT_MOST_S = LIMITS.add("oldest scan that is compared", 3.0, "s", "an older one saw another place")
FREE_M = LIMITS.add("how much nearer a new return is", 0.5, "m", "ten times the noise of scanners (0.03 to 0.05 m)")
AHEAD_M = LIMITS.add("how far ahead it appears at most", 5.0, "m", _WAY)
ASIDE_M = LIMITS.add("how far aside it appears at most", 0.8, "m", _WAY)
WIDE_M = LIMITS.add("how wide it is at least", 0.4, "m", "a leg or a box; less is noise or a pole")
RAYS = LIMITS.add("rays that see it", 8, "", "fewer are stray returns")
FEWEST_RAYS = LIMITS.add("rays of a scan", 30, "", "fewer do not show a thing's width")
BESIDE = int(LIMITS.add("rays beside each that must have seen further", 2, "", "edges of what stood there before"))
TURN_RAD = LIMITS.add("turn between the scans", 0.6, "rad", "what was ahead is still in sight of most scanners")
LEVER_M = LIMITS.add("how far off the middle of the turn the laser sits", 0.4, "m", "where is not known: half a robot")
LEAPS_M = LIMITS.add("way beyond that of its speeds", 0.25, "m", "odometry that leaps moves all that stands")
LEAPS_RAD = LIMITS.add("turn beyond that of its speeds", 0.2, "rad", "the same, and what thin records leave out")
LOOKS_S = LIMITS.add("how long after it is looked for", 10.0, "s", "a robot that turns looks back by then")
STAYS = LIMITS.add("share of it that is still there", 0.5, "", "less is somebody who walked by")
STUCK_S = LIMITS.add("time without getting further", 10.0, "s", "as Nav2's progress checker: movement_time_allowance")
STUCK_M = LIMITS.add("way in that time", 0.5, "m", "as Nav2's progress checker: required_movement_radius")
SOON_S = LIMITS.add("how soon the robot is stuck", 60.0, "s", "later something else has stopped it")


def find(drive: Drive) -> Iterator[Finding]:
    """Something that appeared ahead and stopped the robot. Without a failed goal nobody knows that it wanted on."""
    odometry = drive.odometry
    if odometry is None or not any(goal.failed for goal in drive.goals):
        return
    for scans in drive.scans:
        doubted_s = min((finding.onset_s for finding in faults(drive, scans)), default=np.inf)
        if scans.ranges.shape[1] < FEWEST_RAYS or scans.angles[0] == scans.angles[1]:
            continue
        for row, points in _appeared(scans, _poses(odometry, scans.t), _driven(odometry, scans.t)):
            at = float(scans.t[row])
            if at >= doubted_s - 2 * BEFORE_S:
                return
            stuck_s = _stuck(odometry, at)
            if stuck_s is None or not any(goal.failed and goal.end_s >= at for goal in drive.goals):
                continue
            far, wide = float(median(points[:, 0])), _width(scans, points)
            yield Finding(
                kind="blocked",
                title="something appeared in the robot's way",
                onset_s=at,
                end_s=float(odometry.t[-1]),
                severity=drive.severity(at),
                evidence=f"{wide:.1f} m wide, {far:.1f} m ahead, where the laser saw free space before; the robot gets"
                f" no further from {log_time(stuck_s, 0)} on",
                source=f"{scans.topic} against {odometry.topic}",
                suspect="world",
                probability=0.85,
            )
            return


def _appeared(scans: Scans, poses: Floats, driven: Floats) -> Iterator[tuple[int, Floats]]:
    """Scans with something new ahead that is still there when it is looked at next, with its points."""
    before = np.searchsorted(scans.t, scans.t - BEFORE_S, "right") - 1
    for row in range(len(scans.t)):
        earlier = int(before[row])
        if earlier < 0 or scans.t[row] - scans.t[earlier] > AT_MOST_S:
            continue
        went = np.abs(poses[row] - poses[earlier])
        way, turn = np.abs(driven[row] - driven[earlier])
        if np.hypot(went[0], went[1]) > way + LEAPS_M or abs(went[2] - turn) > LEAPS_RAD:
            continue  # a position that leaps moves all that stands
        points = _new_points(scans, poses, row, earlier)
        is_wide = len(points) >= RAYS and _width(scans, points) >= WIDE_M
        if is_wide and _stays(scans, poses, row, points):
            yield row, points


def _stays(scans: Scans, poses: Floats, row: int, points: Floats) -> bool:
    """Whether the next scan that looks there still sees something where points of a scan were."""
    there_x, there_y = _placed(poses[row], points[:, 0], points[:, 1])
    for later in range(row + 1, len(scans.t)):
        if scans.t[later] - scans.t[row] > LOOKS_S:
            break
        away_x, away_y = there_x - poses[later, 0], there_y - poses[later, 1]
        ray, _ = _rays(scans, np.arctan2(away_y, away_x) - poses[later, 2])
        seen = (ray >= 0) & (ray < len(scans.angles))
        if seen.sum() >= RAYS:
            off = np.abs(scans.ranges[later][ray[seen]] - np.hypot(away_x, away_y)[seen])
            return bool(np.mean(off < FREE_M) > STAYS)
    return False


def _placed(pose: Floats, ahead: Floats, aside: Floats) -> tuple[Floats, Floats]:
    """Where points that lie so from a robot lie in the frame of its pose, m."""
    x, y, yaw = pose
    return x + ahead * np.cos(yaw) - aside * np.sin(yaw), y + ahead * np.sin(yaw) + aside * np.cos(yaw)


def _rays(scans: Scans, bearing: Floats) -> tuple[NDArray[np.intp], float]:
    """The ray that looks each way, outside of 0 to n - 1 where none does, and the angle from ray to ray."""
    step = float(scans.angles[1] - scans.angles[0])
    angle = (bearing + np.pi) % (2 * np.pi) - np.pi
    return np.round((angle - scans.angles[0]) / step).astype(np.intp), step


def _new_points(scans: Scans, poses: Floats, row: int, earlier: int) -> Floats:
    """Points of a scan ahead of the robot that lie in what an earlier scan saw as free; shape (n, 2), m."""
    x0, y0, yaw0 = poses[earlier]
    turn = abs(poses[row, 2] - yaw0)
    if turn > TURN_RAD:
        return np.empty((0, 2))
    ranges = scans.ranges[row].astype(np.float64)
    ahead, aside = ranges * np.cos(scans.angles), ranges * np.sin(scans.angles)
    near = np.isfinite(ranges) & (ahead > 0) & (ahead < AHEAD_M) & (np.abs(aside) < ASIDE_M)
    ahead, aside = ahead[near], aside[near]
    there_x, there_y = _placed(poses[row], ahead, aside)
    ray, step = _rays(scans, np.arctan2(there_y - y0, there_x - x0) - yaw0)
    far = np.hypot(there_x - x0, there_y - y0)
    beside = BESIDE + np.ceil(LEVER_M * turn / np.maximum(far, LEVER_M) / abs(step)).astype(int)
    inside = (ray >= beside) & (ray < len(scans.angles) - beside)
    free = np.array([
        is_inside and bool(np.min(scans.ranges[earlier][at - wide : at + wide + 1]) > away)
        for at, wide, away, is_inside in zip(ray, beside, far + FREE_M, inside, strict=True)
    ], dtype=bool)  # fmt: skip
    # A ray that came back from nowhere says nothing: np.min keeps its nan, and the comparison fails.
    points: Floats = np.stack([ahead, aside], axis=1)[free]
    return points


def _width(scans: Scans, points: Floats) -> float:
    """How wide what was seen is, across the sight: as many rays as it stopped, where it is; m."""
    step = abs(float(scans.angles[1] - scans.angles[0]))
    return len(points) * step * float(median(np.hypot(points[:, 0], points[:, 1])))


def _poses(odometry: Odometry, t: Floats) -> Floats:
    """Position and heading at some times, shape (n, 3)."""
    columns = (odometry.x, odometry.y, np.unwrap(odometry.yaw))
    poses: Floats = np.stack([np.interp(t, odometry.t, column) for column in columns], axis=1)
    return poses


def _driven(odometry: Odometry, t: Floats) -> Floats:
    """Way and turn by odometry's own speeds until some times, shape (n, 2), m and rad."""
    dt = np.diff(odometry.t, prepend=odometry.t[0])
    sums = (np.cumsum(np.hypot(odometry.speed, odometry.sideways) * dt), np.cumsum(odometry.turn * dt))
    driven: Floats = np.stack([np.interp(t, odometry.t, one) for one in sums], axis=1)
    return driven


def _stuck(odometry: Odometry, at: float) -> float | None:
    """When the robot began to get no further, soon after; None where it went on."""
    t = odometry.t
    for row in np.flatnonzero((t >= at) & (t <= at + SOON_S)).tolist():
        last = int(np.searchsorted(t, t[row] + STUCK_S))
        if last >= len(t):
            return None
        if np.hypot(odometry.x[row:last] - odometry.x[row], odometry.y[row:last] - odometry.y[row]).max() < STUCK_M:
            return float(t[row])
    return None


READS = reading(SCAN, ODOMETRY, *GOALS)
CHECK = Check("blocked", "something that appears ahead and stops the robot", READS, LIMITS, find)
