"""What the robot itself publishes, as messages of the recording (without ROS 2)."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from care_samples.ros import Maker
from nav2_robot import laser
from nav2_robot.robot import STEP_S, Robot

ODOMETRY_STEPS = 1
SCAN_STEPS = round(laser.PERIOD_S / STEP_S)
BATTERY_STEPS = round(0.5 / STEP_S)


def sensed(maker: Maker, robot: Robot, step: int) -> Iterator[tuple[str, Any]]:
    """What the sensors tell after a step, by topic."""
    if step % ODOMETRY_STEPS == 0:
        yield "/odom", _odometry(maker, robot)
    if step % BATTERY_STEPS == 0:
        yield "/battery_state", maker.battery(robot.now_s, robot.battery.volts, -robot.battery.amps)
    if step % SCAN_STEPS == 0:
        ranges = robot.scan()
        if ranges is not None:
            yield "/scan", _scan(maker, robot.now_s, ranges.astype(np.float32))


def twist(maker: Maker, speed: float, turn: float) -> Any:
    linear = maker.make("geometry_msgs/Vector3", speed, 0.0, 0.0)
    return maker.make("geometry_msgs/Twist", linear, maker.make("geometry_msgs/Vector3", 0.0, 0.0, turn))


def path(maker: Maker, time_s: float, way: Sequence[tuple[float, float]], last_yaw: float) -> Any:
    """A plan; its last pose has the heading of the goal."""
    yaws = [0.0] * (len(way) - 1) + [last_yaw]
    poses = [
        maker.make("geometry_msgs/PoseStamped", maker.header(time_s, "map"), _pose(maker, x, y, yaw))
        for (x, y), yaw in zip(way, yaws, strict=True)
    ]
    return maker.make("nav_msgs/Path", maker.header(time_s, "map"), poses)


def states(maker: Maker, time_s: float, codes: Sequence[int]) -> Any:
    """The states of all goals, the newest last."""
    made = []
    for number, code in enumerate(codes):
        uuid = maker.make("unique_identifier_msgs/UUID", np.full(16, number + 1, np.uint8))
        info = maker.make("action_msgs/GoalInfo", uuid, maker.stamp(time_s))
        made.append(maker.make("action_msgs/GoalStatus", info, code))
    return maker.make("action_msgs/GoalStatusArray", made)


def _odometry(maker: Maker, robot: Robot) -> Any:
    zeros = np.zeros(36)
    pose = maker.make("geometry_msgs/PoseWithCovariance", _pose(maker, *robot.odometry), zeros)
    speeds = maker.make("geometry_msgs/TwistWithCovariance", twist(maker, *robot.measured), zeros)
    return maker.make("nav_msgs/Odometry", maker.header(robot.now_s), "base_link", pose, speeds)


def _scan(maker: Maker, time_s: float, ranges: Any) -> Any:
    step = (laser.ANGLE_MAX - laser.ANGLE_MIN) / (laser.RAYS - 1)
    shape = laser.ANGLE_MIN, laser.ANGLE_MAX, step, 0.0, laser.PERIOD_S, laser.RANGE_MIN, laser.RANGE_MAX
    return maker.make("sensor_msgs/LaserScan", maker.header(time_s, "laser"), *shape, ranges, np.empty(0, np.float32))


def _pose(maker: Maker, x: float, y: float, yaw: float) -> Any:
    turned = maker.make("geometry_msgs/Quaternion", 0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))
    return maker.make("geometry_msgs/Pose", maker.make("geometry_msgs/Point", x, y, 0.0), turned)
