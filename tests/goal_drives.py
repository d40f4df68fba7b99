"""Drives along goals under move_base on an open floor, as ROS 1 bags: 4 s a goal beside its way."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from tests.ros_samples import SECOND_NS, START_NS

STORE = get_typestore(Stores.ROS1_NOETIC)
_HEADER = "std_msgs/Header header\n"
_PARAMETERS = {"Bool": "bool", "Int": "int32", "Str": "string", "Double": "float64"}
_TYPES = {
    "move_base_msgs/msg/MoveBaseGoal": "geometry_msgs/PoseStamped target_pose",
    "move_base_msgs/msg/MoveBaseResult": "",
    "move_base_msgs/msg/MoveBaseActionGoal": _HEADER
    + "actionlib_msgs/GoalID goal_id\nmove_base_msgs/MoveBaseGoal goal",
    "move_base_msgs/msg/MoveBaseActionResult": (
        _HEADER + "actionlib_msgs/GoalStatus status\nmove_base_msgs/MoveBaseResult result"
    ),
    **{f"dynamic_reconfigure/msg/{one}Parameter": f"string name\n{kind} value" for one, kind in _PARAMETERS.items()},
    "dynamic_reconfigure/msg/GroupState": "string name\nbool state\nint32 id\nint32 parent",
    "dynamic_reconfigure/msg/Config": (
        "BoolParameter[] bools\nIntParameter[] ints\nStrParameter[] strs\n"
        "DoubleParameter[] doubles\nGroupState[] groups"
    ),
}
for _name, _text in _TYPES.items():
    STORE.register(get_types_from_msg(_text, _name))

PLANNER = "/move_base/DWAPlannerROS/parameter_updates"
GOAL_S, WATT, STEP_S = 4.0, 80.0, 0.2
SUCCEEDED = 3

Goal = tuple[float, float]
Message = tuple[float, str, str, Any]
"""Time in s, topic, type and message."""


def drive(
    path: Path,
    goals: Sequence[Goal],
    speed: float = 0.5,
    *,
    without: Sequence[str] = (),
    silent: Mapping[str, tuple[float, float]] | None = None,
    **options: float,
) -> Path:
    """Write the bag of a robot that starts at the origin and reaches every goal in `GOAL_S` and its way at `speed`;
    topics are `silent` between two times."""
    pauses = silent or {}
    messages = sorted(_messages(goals, speed, {"max_vel_trans": speed, **options}), key=lambda one: one[0])
    writer = Writer(path)
    with writer:
        connections: dict[str, Any] = {}
        for time_s, topic, kind, message in messages:
            start_s, end_s = pauses.get(topic, (0.0, 0.0))
            if topic in without or start_s < time_s < end_s:
                continue
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=STORE)
            writer.write(connections[topic], START_NS + round(time_s * SECOND_NS), STORE.serialize_ros1(message, kind))
    return path


def _make(name: str, *values: Any) -> Any:
    package, _, kind = name.partition("/")
    return STORE.types[f"{package}/msg/{kind}"](*values)


def _header(time_s: float, frame: str = "odom") -> Any:
    time_ns = START_NS + round(time_s * SECOND_NS)
    stamp = STORE.types["builtin_interfaces/msg/Time"](time_ns // SECOND_NS, time_ns % SECOND_NS)
    return _make("std_msgs/Header", 0, stamp, frame)


def _pose(x: float, y: float, yaw: float) -> Any:
    turned = _make("geometry_msgs/Quaternion", 0.0, 0.0, math.sin(yaw / 2), math.cos(yaw / 2))
    return _make("geometry_msgs/Pose", _make("geometry_msgs/Point", x, y, 0.0), turned)


def _messages(goals: Sequence[Goal], speed: float, options: Mapping[str, float]) -> Iterator[Message]:
    numbers = [_make("dynamic_reconfigure/DoubleParameter", name, value) for name, value in options.items()]
    yield 0.0, PLANNER, "dynamic_reconfigure/msg/Config", _make("dynamic_reconfigure/Config", [], [], [], numbers, [])
    time_s, here = 2.0, (0.0, 0.0)
    for number, goal in enumerate(goals):
        yaw = math.atan2(goal[1] - here[1], goal[0] - here[0])
        takes_s = GOAL_S + math.dist(here, goal) / speed
        yield from _goal(number, goal, yaw, time_s, takes_s)
        for step in range(int(takes_s / STEP_S)):
            share = min(1.0, step * STEP_S * speed / math.dist(here, goal))
            at = (here[0] + share * (goal[0] - here[0]), here[1] + share * (goal[1] - here[1]))
            yield from _moving(time_s + step * STEP_S, at, yaw, speed if share < 1 else 0.0)
        time_s, here = time_s + takes_s + 0.2, goal
    for step in range(20):
        yield from _moving(time_s + step * STEP_S, here, 0.0, 0.0)


def _goal(number: int, goal: Goal, yaw: float, sent_s: float, takes_s: float) -> Iterator[Message]:
    identity = _make("actionlib_msgs/GoalID", _header(sent_s).stamp, f"goal-{number}")
    target = _make("geometry_msgs/PoseStamped", _header(sent_s), _pose(*goal, yaw))
    sent = _make(
        "move_base_msgs/MoveBaseActionGoal", _header(sent_s), identity, _make("move_base_msgs/MoveBaseGoal", target)
    )
    yield sent_s, "/move_base/goal", "move_base_msgs/msg/MoveBaseActionGoal", sent
    status = _make("actionlib_msgs/GoalStatus", identity, SUCCEEDED, "Goal reached.")
    done_s = sent_s + takes_s
    result = _make("move_base_msgs/MoveBaseResult", 0)  # rosbags gives an empty message a member
    answer = _make("move_base_msgs/MoveBaseActionResult", _header(done_s), status, result)
    yield done_s, "/move_base/result", "move_base_msgs/msg/MoveBaseActionResult", answer


def _moving(time_s: float, at: Goal, yaw: float, speed: float) -> Iterator[Message]:
    none = _make("geometry_msgs/Vector3", 0.0, 0.0, 0.0)
    twist = _make("geometry_msgs/Twist", _make("geometry_msgs/Vector3", speed, 0.0, 0.0), none)
    covariance = np.zeros(36)
    odometry = _make(
        "nav_msgs/Odometry", _header(time_s), "base_link",
        _make("geometry_msgs/PoseWithCovariance", _pose(*at, yaw), covariance),
        _make("geometry_msgs/TwistWithCovariance", twist, covariance),
    )  # fmt: skip
    yield time_s, "/odom", "nav_msgs/msg/Odometry", odometry
    yield time_s, "/cmd_vel", "geometry_msgs/msg/Twist", twist
    amps = -WATT / 25.9 - 0.01 * math.sin(time_s)
    cells = np.zeros(0, dtype=np.float32)
    battery = _make(
        "sensor_msgs/BatteryState", _header(time_s), 25.95 - 0.001 * time_s, math.nan, amps, math.nan, math.nan,
        math.nan, 0.9, 2, 1, 2, True, cells, cells, "", "",
    )  # fmt: skip
    yield time_s, "/battery_state", "sensor_msgs/msg/BatteryState", battery
