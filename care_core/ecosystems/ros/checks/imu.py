"""What an accelerometer on a ground robot feels: shocks, and a robot that tips."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.ros.drive import Drive
from care_core.ecosystems.ros.messages import COMMANDS, GOALS, IMU, ODOMETRY, believable, holds, reading, tilt_of
from care_core.geodesy import GRAVITY
from care_core.logs.base import Table
from care_core.numbers import median
from care_core.text import log_time

LIMITS = Limits()
SHOCK_MPS2 = LIMITS.add(
    "shock beyond gravity", 25.0, "m/s2",
    "kerbs and rough ground give a wheeled robot 5 to 15 m/s2; a collision gives tens",
)  # fmt: skip
TIP_DEG = LIMITS.add(
    "tilt", 30.0, "deg", "slope that wheeled robots are built to climb at most (Husky A200: 45 deg, 30 deg across)"
)
LEAST_MPS2 = LIMITS.add("least usual acceleration", 7.8, "m/s2", "gravity, 9.8, less a badly scaled sensor's error")
MOST_MPS2 = LIMITS.add("greatest usual acceleration", 11.8, "m/s2", "gravity and a badly scaled sensor's error")
BEFORE_S = LIMITS.add("shocks that belong to a fall come so long before", 3.0, "s", "a choice: a robot tips in one")
_ASIDE_P = LIMITS.add(
    "probability that an acceleration in other units costs the mission", 0.05, "", "few filters fuse it"
)
MESSAGES_FELT = LIMITS.add("messages of an IMU", 50, "", "fewer do not tell what is usual")


def find(drive: Drive) -> Iterator[Finding]:
    """Shocks and tilt, of a robot that drives, and an acceleration in other units than the standard's."""
    yield from _in_g(drive)
    if drive.odometry is None or drive.commands is None:
        return
    for topic, table in drive.of(IMU):
        if holds(table, IMU) and len(table) >= MESSAGES_FELT:
            yield from _felt(drive, topic, table)
            return


def _in_g(drive: Drive) -> Iterator[Finding]:
    """An IMU that says 1 where gravity is 9.8 m/s^2. Where gravity is taken off, the mean of each axis is near 0."""
    for topic, table in drive.of(IMU):
        if not holds(table, IMU) or len(table) < MESSAGES_FELT:
            continue
        axes = [believable(table, IMU, f"linear_acceleration.{axis}") for axis in "xyz"]
        if not np.isfinite(axes).any(axis=1).all():
            continue
        size = float(np.linalg.norm([float(np.nanmean(axis)) for axis in axes]))
        if LEAST_MPS2 <= size * GRAVITY <= MOST_MPS2:
            yield Finding(
                kind="imu",
                title="the IMU tells its acceleration in g, not in m/s^2",
                onset_s=0.0,
                end_s=drive.duration_s,
                severity="info",
                evidence=f"{topic} says {size:.2f} on average, where gravity is {GRAVITY:g} m/s^2",
                source=f"{topic}; REP 103: SI units",
                suspect="parameter",
                probability=0.9,
                mission_lost=_ASIDE_P,
            )
            return


def _felt(drive: Drive, topic: str, table: Table) -> Iterator[Finding]:
    felt = np.sqrt(sum(believable(table, IMU, f"linear_acceleration.{axis}") ** 2 for axis in "xyz"))
    good = np.isfinite(felt)
    if not good.any() or not LEAST_MPS2 <= float(median(felt[good])) <= MOST_MPS2:
        return
    t, tilt = table.t, tilt_of(table, IMU, "orientation")
    over_s = math.inf if drive.fall is None else drive.fall.start_s - BEFORE_S
    hits = np.flatnonzero(good & (np.abs(felt - median(felt[good])) > SHOCK_MPS2) & (t < over_s))
    tips = np.flatnonzero((tilt > TIP_DEG) & math.isinf(over_s))  # a fall is told by what shows it best
    if not len(hits) and not len(tips):
        return
    at = float(t[min(hits[:1].tolist() + tips[:1].tolist())])
    words = [f"{len(hits)} shocks up to {felt[hits].max():.0f} m/s^2"] if len(hits) else []
    words += [f"tilted by up to {tilt[tips].max():.0f} deg from {log_time(t[tips[0]])} on"] if len(tips) else []
    yield Finding(
        kind="crash",
        title="the robot tips over" if not len(hits) else "the robot hits something" + " and tips" * bool(len(tips)),
        onset_s=at,
        end_s=float(max(t[rows[-1]] for rows in (hits, tips) if len(rows))),
        severity=drive.severity(at, "critical" if len(tips) else "warning"),
        evidence=", ".join(words),
        source=topic,
        suspect="operation",
        probability=0.7,
    )


READS = reading(IMU, ODOMETRY, *COMMANDS, *GOALS)
CHECK = Check("imu", "shocks, and a robot that tips", READS, LIMITS, find)
