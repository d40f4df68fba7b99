"""The health checks of ROS recordings, one module each.

Probabilities: in `benchmarks.ros_health` all 29 findings of failed hardware were right, on few missions of one
simulated robot; 0.9 is the 95% lower bound of that. What it does not show (tf, imu, topics, messages) is judged.
"""

from __future__ import annotations

from care_core.ecosystems.base import Check
from care_core.ecosystems.ros.checks import (
    battery,
    blocked,
    contacts,
    drive,
    falls,
    heights,
    imu,
    laser,
    late,
    messages,
    odometry,
    parameters,
    planner,
    pushing,
    recorded,
    satellites,
    timing,
    topics,
)
from care_core.ecosystems.ros.drive import Drive

CHECKS: tuple[Check[Drive], ...] = (
    battery.CHECK,
    falls.CHECK,
    laser.CHECK,
    odometry.CHECK,
    heights.CHECK,
    recorded.CHECK,
    drive.CHECK,
    blocked.CHECK,
    pushing.CHECK,
    contacts.CHECK,
    imu.CHECK,
    satellites.CHECK,
    topics.CHECK,
    late.CHECK,
    planner.CHECK,
    timing.CHECK,
    messages.CHECK,
    parameters.CHECK,
)
