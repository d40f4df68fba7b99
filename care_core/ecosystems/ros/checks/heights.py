"""Heights of an odometry that run away, as another odometry of the same robot tells."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.ros.drive import STREAM_MESSAGES, Drive
from care_core.ecosystems.ros.messages import GOALS, HEIGHT, ODOMETRY, reading
from care_core.logs.base import Table

LIMITS = Limits()
RUNS_M = LIMITS.add(
    "height that an odometry went up and down", 10.0, "m", "a receiver's height wanders by less in a run"
)
TIMES = LIMITS.add("of what the other one did", 5.0, "", "a choice: scales and filters differ by less")


def find(drive: Drive) -> Iterator[Finding]:
    """The height that ranges farthest, where another one, that moves as well, stays."""
    ranges = {topic: by_m for topic, table in drive.of(ODOMETRY) if (by_m := _range(table)) > 0.0}
    if len(ranges) < 2:
        return
    worst, calmest = max(ranges, key=ranges.__getitem__), min(ranges, key=ranges.__getitem__)
    if ranges[worst] < max(RUNS_M, TIMES * ranges[calmest]):
        return
    yield Finding(
        kind="estimator",
        title=f"the height of {worst} runs away: it ranges over {ranges[worst]:.0f} m",
        onset_s=0.0,
        end_s=drive.duration_s,
        severity="warning",
        evidence=(
            f"{calmest} ranges over {ranges[calmest]:.1f} m: nothing holds the other's height. Fuse one, or set "
            "two_d_mode for a robot that stays on a plane"
        ),
        source=f"{worst}: {HEIGHT} against {calmest}",
        suspect="parameter",
        parameters=("two_d_mode",),
        probability=0.8,
    )


def _range(table: Table) -> float:
    """0 of one that tells no height, or always the same."""
    height = np.asarray(table.columns.get(HEIGHT, ()), np.float64)
    known = height[np.isfinite(height)]
    return float(np.ptp(known)) if len(known) >= STREAM_MESSAGES else 0.0


CHECK = Check("heights", "an odometry whose height runs away from another's", reading(ODOMETRY, *GOALS), LIMITS, find)
