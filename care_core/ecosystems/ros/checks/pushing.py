"""A robot that is told to drive on while its laser sees something right before it.

What a laser always sees of its own robot is nothing of this kind: it has seen farther in that direction before.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator

import numpy as np

from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.ros.drive import Drive
from care_core.ecosystems.ros.messages import COMMANDS, SCAN, reading
from care_core.ecosystems.ros.sensors import Scans
from care_core.ecosystems.spans import runs
from care_core.numbers import Floats, median

LIMITS = Limits()
NEAR_M = LIMITS.add("what stands right before it", 0.2, "m", "a choice: half of a small robot's length")
FAR_M = LIMITS.add("how far it saw that way before", 0.6, "m", "a choice: what it sees of itself never goes away")
AHEAD_RAD = LIMITS.add("to either side of ahead", 0.35, "rad", "20 degrees: a robot's width at its own length")
LASTS_S = LIMITS.add("shortest time before it", 5.0, "s", "a choice: who turns away or stops takes less")
WAY_M = LIMITS.add("way that it is told to go on meanwhile", 0.2, "m", "a choice: as far as it stands away")
_BREAK_S, _RAYS = 1.5, 3


def find(drive: Drive) -> Iterator[Finding]:
    """The first time that it stood so, by each laser that tells."""
    commands = drive.commands
    if commands is None:
        return
    for scans in drive.scans:
        ahead = _ahead(scans)
        if ahead is None:
            continue
        seen_far = np.maximum.accumulate(np.nan_to_num(ahead, nan=0.0)) > FAR_M
        for start, end in runs(scans.t, (ahead < NEAR_M) & seen_far, gap_s=_BREAK_S):
            told = (commands.t >= start) & (commands.t <= end) & (commands.speed > 0.0)
            way_m = float((commands.speed * np.minimum(np.diff(commands.t, append=end), 1.0))[told].sum())
            if end - start < LASTS_S or way_m < WAY_M:
                continue
            inside = (scans.t >= start) & (scans.t <= end) & np.isfinite(ahead)
            yield Finding(
                kind="blocked",
                title="it is told to drive on against what stands before it",
                onset_s=start,
                end_s=end,
                severity=drive.severity(start),
                evidence=(
                    f"{float(median(ahead[inside])):.2f} m ahead for {end - start:.0f} s, in which it was told to go "
                    f"on by {way_m:.1f} m"
                ),
                source=f"{scans.topic} against {commands.topic}",
                suspect="world",
                probability=0.7,
            )
            return


def _ahead(scans: Scans) -> Floats | None:
    """The nearest return ahead of each scan, m, nan where none came back; None where it does not look there."""
    rays = np.abs((scans.angles + np.pi) % (2 * np.pi) - np.pi) < AHEAD_RAD
    if rays.sum() < _RAYS:
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of scans without any return
        nearest: Floats = np.nanmin(scans.ranges[:, rays].astype(np.float64), axis=1)
    return nearest


READS = reading(SCAN, *COMMANDS)
CHECK = Check("pushing", "a robot that drives on against what stands before it", READS, LIMITS, find)
