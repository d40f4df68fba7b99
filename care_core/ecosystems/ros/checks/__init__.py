"""The health checks of ROS recordings, one module each: `check(recording)` yields findings.

Probabilities: in `benchmarks.ros_health` all 29 findings of failed hardware were right, on few missions of one
simulated robot; 0.9 is the 95 % lower bound of that. What it does not show (tf, imu, topics, messages) is judged.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from care_core.ecosystems.findings import Finding
from care_core.ecosystems.ros.checks import (
    battery,
    blocked,
    drive,
    imu,
    laser,
    messages,
    odometry,
    planner,
    timing,
    topics,
)
from care_core.ecosystems.ros.recording import Recording

CHECKS: tuple[Callable[[Recording], Iterator[Finding]], ...] = (
    battery.check,
    laser.check,
    odometry.check,
    drive.check,
    blocked.check,
    imu.check,
    topics.check,
    planner.check,
    timing.check,
    messages.check,
)
