"""A mission as a log: a ROS 1 bag with dynamic_reconfigure's topics, or an MCAP of ROS 2 with parameter events."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.typesys import Stores

from care_samples.robot.mission import DEFAULTS, Story
from care_samples.robot.planner import Point
from care_samples.robot.ranges import RANGES, is_whole
from care_samples.robot.world import GOALS
from care_samples.ros import DYNAMIC_RECONFIGURE, Entry, Maker, write_ros1, write_ros2

NODE = "courier"

_MOVE_BASE = {
    "move_base_msgs/msg/MoveBaseGoal": "geometry_msgs/PoseStamped target_pose",
    "move_base_msgs/msg/MoveBaseResult": "",
    "move_base_msgs/msg/MoveBaseActionGoal": "std_msgs/Header header\nactionlib_msgs/GoalID goal_id\nMoveBaseGoal goal",
    "move_base_msgs/msg/MoveBaseActionResult": (
        "std_msgs/Header header\nactionlib_msgs/GoalStatus status\nMoveBaseResult result"
    ),
    "move_base_msgs/msg/RecoveryStatus": (
        "geometry_msgs/PoseStamped pose_stamped\nuint16 current_recovery_number\nuint16 total_number_of_recoveries\n"
        "string recovery_behavior_name"
    ),
}
_BEHAVIOR_TREE = {
    "nav2_msgs/msg/BehaviorTreeStatusChange": (
        "builtin_interfaces/Time timestamp\nstring node_name\nstring previous_status\nstring current_status"
    ),
    "nav2_msgs/msg/BehaviorTreeLog": "builtin_interfaces/Time timestamp\nBehaviorTreeStatusChange[] event_log",
}


def write_bag(path: Path, story: Story, parameters: Mapping[str, float]) -> None:
    """A ROS 1 bag."""
    maker = _Drive(Stores.ROS1_NOETIC, {**_MOVE_BASE, **DYNAMIC_RECONFIGURE})
    write_ros1(path, maker, (*maker.shared(story), *_ros1(maker, story, parameters)))


def write_mcap(path: Path, story: Story, parameters: Mapping[str, float]) -> None:
    """An MCAP file as ROS 2 records it."""
    maker = _Drive(Stores.ROS2_HUMBLE, _BEHAVIOR_TREE)
    write_ros2(path, maker, (*maker.shared(story), *_ros2(maker, story, parameters)))


class _Drive(Maker):
    """Makes the messages of a drive that both kinds of ROS share."""

    def pose(self, x: float, y: float, yaw: float = 0.0) -> Any:
        turned = self.make("geometry_msgs/Quaternion", 0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))
        return self.make("geometry_msgs/Pose", self.make("geometry_msgs/Point", x, y, 0.0), turned)

    def stamped(self, time_s: float, point: Point) -> Any:
        return self.make("geometry_msgs/PoseStamped", self.header(time_s), self.pose(*point))

    def twist(self, speed: float, turn: float) -> Any:
        linear = self.make("geometry_msgs/Vector3", speed, 0.0, 0.0)
        return self.make("geometry_msgs/Twist", linear, self.make("geometry_msgs/Vector3", 0.0, 0.0, turn))

    def path(self, time_s: float, way: list[Point]) -> Any:
        return self.make("nav_msgs/Path", self.header(time_s), [self.stamped(time_s, point) for point in way])

    def shared(self, story: Story) -> Iterator[Entry]:
        """Odometry, commands, battery and what the robot says."""
        zeros = np.zeros(36)
        for t, x, y, yaw, speed, turn in story.odometry:
            pose = self.make("geometry_msgs/PoseWithCovariance", self.pose(x, y, yaw), zeros)
            twist = self.make("geometry_msgs/TwistWithCovariance", self.twist(speed, turn), zeros)
            yield "/odom", t, self.make("nav_msgs/Odometry", self.header(t), "base_link", pose, twist)
        for t, speed, turn in story.commands:
            yield "/cmd_vel", t, self.twist(speed, turn)
        for t, volts, amps in story.battery:
            yield "/battery_state", t, self.battery(t, volts, amps)
        for t, level, text in story.said:
            yield "/rosout", t, self.said(t, level, NODE, text)


def _ros1(maker: _Drive, story: Story, parameters: Mapping[str, float]) -> Iterator[Entry]:
    for space in sorted({name.partition("/")[0] for name in parameters}):
        own = {name.partition("/")[2]: name for name in parameters if name.startswith(f"{space}/")}
        whole = [short for short in own if is_whole(short)]
        ranges = {short: RANGES[name] for short, name in own.items()}
        usual = {short: DEFAULTS[name] for short, name in own.items()}
        driven = {short: parameters[name] for short, name in own.items()}
        yield f"/{NODE}/{space}/parameter_descriptions", 0.0, maker.described(ranges, usual, whole)
        yield f"/{NODE}/{space}/parameter_updates", 0.0, maker.config(driven, whole)
    for t, number in story.goals:
        goal = maker.make("move_base_msgs/MoveBaseGoal", maker.stamped(t, GOALS[number]))
        ident = maker.make("actionlib_msgs/GoalID", maker.stamp(t), f"goal-{number + 1}")
        yield f"/{NODE}/goal", t, maker.make("move_base_msgs/MoveBaseActionGoal", maker.header(t, ""), ident, goal)
    codes = {"succeeded": 3, "aborted": 4, "preempted": 2}
    for t, number, outcome, text in story.results:
        ident = maker.make("actionlib_msgs/GoalID", maker.stamp(t), f"goal-{number + 1}")
        status = maker.make("actionlib_msgs/GoalStatus", ident, codes[outcome], text)
        answer = maker.header(t, ""), status, maker.make("move_base_msgs/MoveBaseResult")
        yield f"/{NODE}/result", t, maker.make("move_base_msgs/MoveBaseActionResult", *answer)
    for number, (t, name) in enumerate(story.recoveries):
        where = maker.stamped(t, (0.0, 0.0))
        yield f"/{NODE}/recovery_status", t, maker.make("move_base_msgs/RecoveryStatus", where, number, 3, name)


def _ros2(maker: _Drive, story: Story, parameters: Mapping[str, float]) -> Iterator[Entry]:
    for t, way in story.plans:
        yield "/plan", t, maker.path(t, way)
    yield "/parameter_events", 0.0, _event(maker, parameters)
    codes = {"succeeded": 4, "aborted": 6, "preempted": 5}
    begun = [(t, number, 2) for t, number in story.goals]
    told: dict[int, int] = {}
    for t, number, code in sorted(begun + [(t, number, codes[how]) for t, number, how, _ in story.results]):
        told[number] = code
        if code == 2:
            yield "/goal_pose", t, maker.stamped(t, GOALS[number])
        yield "/navigate_to_pose/_action/status", t, _states(maker, t, told)
    for t, _ in story.recoveries:
        change = maker.make("nav2_msgs/BehaviorTreeStatusChange", maker.stamp(t), "BackUp", "IDLE", "RUNNING")
        yield "/behavior_tree_log", t, maker.make("nav2_msgs/BehaviorTreeLog", maker.stamp(t), [change])


def _event(maker: _Drive, parameters: Mapping[str, float]) -> Any:
    none: tuple[Any, ...] = np.empty(0, np.int64), np.empty(0, np.float64), []
    made = []
    for name, value in parameters.items():
        whole = is_whole(name.partition("/")[2])
        # bool, integer, double, string, bytes, bools, integers, doubles, strings behind the type's code
        one = maker.make(
            "rcl_interfaces/ParameterValue", 2 if whole else 3, False, int(value) if whole else 0,
            0.0 if whole else float(value), "", np.empty(0, np.uint8), np.empty(0, np.bool_), *none,
        )  # fmt: skip
        made.append(maker.make("rcl_interfaces/Parameter", name.replace("/", "."), one))
    return maker.make("rcl_interfaces/ParameterEvent", maker.stamp(0.0), f"/{NODE}", made, [], [])


def _states(maker: _Drive, t: float, told: Mapping[int, int]) -> Any:
    made = []
    for number, code in told.items():
        uuid = maker.make("unique_identifier_msgs/UUID", np.full(16, number + 1, np.uint8))
        info = maker.make("action_msgs/GoalInfo", uuid, maker.stamp(t))
        made.append(maker.make("action_msgs/GoalStatus", info, code))
    return maker.make("action_msgs/GoalStatusArray", made)
