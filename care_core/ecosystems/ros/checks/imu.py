"""What an accelerometer on a ground robot feels: shocks, and a robot that tips."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.findings import Finding
from care_core.ecosystems.ros import plan
from care_core.ecosystems.ros.recording import Floats, Recording, believable
from care_core.logs.base import Table
from care_core.numbers import median

SHOCK_MPS2 = 25.0
"""Beyond gravity. Kerbs and rough ground give a wheeled robot 5 to 15 m/s^2; a collision gives tens."""
HARDEST_MPS2 = 1e4
TIP_DEG = 30.0
"""Slope that wheeled robots are built to climb at most (Husky A200: 45 deg at most, 30 deg across)."""
_GRAVITY = (7.8, 11.8)


def check(recording: Recording) -> Iterator[Finding]:
    if recording.odometry is None or recording.commands is None:
        return
    for topic, table in recording.of(plan.IMU):
        if set(plan.FIELDS[plan.IMU]) <= set(table.columns) and len(table) >= 50:
            yield from _felt(recording, topic, table)
            return


def _felt(recording: Recording, topic: str, table: Table) -> Iterator[Finding]:
    felt = np.sqrt(sum(believable(table[f"linear_acceleration.{axis}"], HARDEST_MPS2) ** 2 for axis in "xyz"))
    good = np.isfinite(felt)
    if not good.any() or not _GRAVITY[0] <= float(median(felt[good])) <= _GRAVITY[1]:
        return
    t, tilt = table.t, _tilt(table)
    hits = np.flatnonzero(good & (np.abs(felt - median(felt[good])) > SHOCK_MPS2))
    tips = np.flatnonzero(tilt > TIP_DEG)
    if not len(hits) and not len(tips):
        return
    at = float(t[min(hits[:1].tolist() + tips[:1].tolist())])
    words = [f"{len(hits)} shocks up to {felt[hits].max():.0f} m/s^2"] if len(hits) else []
    words += [f"tilted by up to {tilt[tips].max():.0f} deg from {t[tips[0]]:.1f} s on"] if len(tips) else []
    title = "the robot tips over" if not len(hits) else "the robot hits something" + (" and tips" if len(tips) else "")
    end = float(max(t[hits[-1]] if len(hits) else 0.0, t[tips[-1]] if len(tips) else 0.0))
    yield Finding(
        "crash", title, at, end, recording.severity(at, "critical" if len(tips) else "warning"), ", ".join(words),
        topic, "operation", 0.7,
    )  # fmt: skip


def _tilt(table: Table) -> Floats:
    """Angle of the robot's upward axis to what it was at first, deg, shape (n,); zero without an orientation."""
    x, y, z, w = (believable(table[f"orientation.{axis}"], 2.0) for axis in "xyzw")
    length = x * x + y * y + z * z + w * w
    if not np.all(np.abs(length[np.isfinite(length)] - 1) < 0.1) or not np.isfinite(length).all():
        return np.zeros(len(table))
    up = np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=1)
    first = median(up[: max(5, len(up) // 50)], axis=0)
    angle: Floats = np.degrees(np.arccos(np.clip(up @ (first / np.linalg.norm(first)), -1, 1)))
    return angle
