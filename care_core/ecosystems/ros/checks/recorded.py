"""Sources that were recorded in part, or only repeat themselves while the robot drives."""

from __future__ import annotations

from collections.abc import Iterator

from care_core.ecosystems import liveness
from care_core.ecosystems.base import Check, Limits
from care_core.ecosystems.findings import Finding
from care_core.ecosystems.ros import sources
from care_core.ecosystems.ros.drive import Drive
from care_core.ecosystems.ros.messages import BATTERY, IMU, ODOMETRY, SCAN, reading, type_of

_STEADY = (ODOMETRY, SCAN, IMU, BATTERY)
"""What a robot sends all the time."""


def find(drive: Drive) -> Iterator[Finding]:
    """What froze, and what was recorded in part."""
    yield from liveness.findings(drive.frozen, drive.severity)
    recorded = {
        channel.name: drive.times[channel.name]
        for channel in drive.channels
        if type_of(channel) in _STEADY and channel.name in drive.streams and not drive.ends_early(channel.name)
    }
    yield from liveness.recorded_in_part(recorded, [(0.0, drive.duration_s)])


CHECK = Check(
    "recorded", "sources that were recorded in part, or repeat themselves while the robot drives",
    reading(*sources.TYPES),
    Limits([*liveness.LIMITS, *sources.LIMITS]), find,
)  # fmt: skip
