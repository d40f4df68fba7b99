"""Satellite receivers of ROS robots: without a position, that lose it, and that leap."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from care_core.ecosystems.findings import Finding
from care_core.ecosystems.registry import run_model
from care_core.ecosystems.ros import ECOSYSTEM
from care_core.logs.opening import open_log
from tests.ros_drives import Drive
from tests.ros_samples import ROS2, SECOND_NS, START_NS, make, stamp

FIX = "sensor_msgs/msg/NavSatFix"
DEGREES = 1 / 111_320.0
"""Of a metre of latitude."""


class Receiving(Drive):
    """A drive with a receiver: north, m, and status by time."""

    def messages(self) -> Iterator[tuple[str, str, float, Any]]:
        yield from super().messages()
        rng = np.random.default_rng(1)
        for tick in range(160):
            t = tick / 4
            header = make(ROS2, "std_msgs/msg/Header", stamp(ROS2, START_NS + round(t * SECOND_NS)), "gps")
            status = make(ROS2, "sensor_msgs/msg/NavSatStatus", self.status(t), 1)
            north = 50.0 + (self.north_m(t) + 0.1 * rng.normal()) * DEGREES
            yield "/fix", FIX, t, make(ROS2, FIX, header, status, north, 8.0, 100.0, np.zeros(9), 0)

    def status(self, t: float) -> int:
        return 0

    def north_m(self, t: float) -> float:
        return 0.5 * t


class Without(Receiving):
    def status(self, t: float) -> int:
        return -1


class Losing(Receiving):
    def status(self, t: float) -> int:
        return -1 if 20.0 <= t < 28.0 else 0


class Leaping(Receiving):
    def north_m(self, t: float) -> float:
        return 0.5 * t + (40.0 if 20.0 <= t < 25.0 else 0.0)


class Settling(Receiving):
    def north_m(self, t: float) -> float:
        return 0.5 * t + (40.0 if t < 5.0 else 0.0)


class Racing(Receiving):
    """A car that brakes as hard as tyres do."""

    def north_m(self, t: float) -> float:
        return 20.0 * t if t < 20.0 else 400.0 + 20.0 * min(t - 20.0, 2.0) - 5.0 * min(t - 20.0, 2.0) ** 2


def found(drive: Drive, tmp_path: Path) -> list[Finding]:
    health = ECOSYSTEM.examine(run_model(open_log(drive.write(tmp_path / "drive.mcap"))))
    return [one for one in health.findings if one.kind == "gps"]


@pytest.mark.parametrize(
    ("drive", "title", "severity", "onset_s"),
    [
        (Without(), "the satellite receiver has no position", "info", 0.0),
        (Losing(), "the satellite receiver loses its position", "warning", 20.0),
        (Leaping(), "satellite positions leap by up to 40 m", "warning", 20.0),
    ],
)
def test_receivers_that_fail(drive: Drive, title: str, severity: str, onset_s: float, tmp_path: Path) -> None:
    (finding,) = found(drive, tmp_path)
    assert (finding.title, finding.severity) == (title, severity)
    assert finding.onset_s == pytest.approx(onset_s, abs=0.3)


@pytest.mark.parametrize("drive", [Receiving(), Settling(), Racing()])
def test_receivers_that_do_well(drive: Drive, tmp_path: Path) -> None:
    assert found(drive, tmp_path) == []
