"""The dictionary of ROS messages: by type what is read of it, how much of it, in which units, and what is possible.

Topics of a stranger's recording are named anyhow, so a channel is known by its type. No camera and no point cloud is
read, and of sensors that send often as many messages as a look at them needs: an hour takes no longer than minutes.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from care_core.ecosystems.dictionary import Field, Message
from care_core.ecosystems.plausible import STAMP
from care_core.logs.base import Channel, Table, Wanted
from care_core.logs.ros_message import short_name
from care_core.numbers import Floats, median

ODOMETRY = "nav_msgs/Odometry"
TWIST, TWIST_STAMPED = "geometry_msgs/Twist", "geometry_msgs/TwistStamped"
SCAN = "sensor_msgs/LaserScan"
CLOUD = "sensor_msgs/PointCloud2"
BATTERY = "sensor_msgs/BatteryState"
IMU = "sensor_msgs/Imu"
VIEWER_LOG = ("foxglove.Log", "foxglove_msgs/Log")
"""Messages of nodes as viewers have them, with names and levels of their own."""
ROSOUT = ("rosgraph_msgs/Log", "rcl_interfaces/Log", *VIEWER_LOG)
DIAGNOSTICS = "diagnostic_msgs/DiagnosticArray"
FAULT_EVENT = "ros2_medkit_msgs/FaultEvent"
"""What ros2_medkit's fault manager says when a fault of the robot is confirmed, changes or is cleared."""
STATUS = "action_msgs/GoalStatusArray"
TREE = "nav2_msgs/BehaviorTreeLog"
RECOVERY = "move_base_msgs/RecoveryStatus"
TRANSITION = "lifecycle_msgs/TransitionEvent"
TF = ("tf2_msgs/TFMessage", "tf/tfMessage")
LOCALISED = "geometry_msgs/PoseWithCovarianceStamped"
FIX = "sensor_msgs/NavSatFix"
POSE, PATH = "geometry_msgs/PoseStamped", "nav_msgs/Path"
NAVIGATION = "nav2_msgs/NavigateToPose_FeedbackMessage"
ACTION_GOAL, ACTION_RESULT = "ActionGoal", "ActionResult"
"""How the types of a ROS 1 action's goals and results end."""

COMMANDS = (TWIST, TWIST_STAMPED)
GOALS = (ACTION_GOAL, ACTION_RESULT, STATUS)
"""What tells of goals, and so of how much a finding matters."""
ROBOT = (ODOMETRY, *COMMANDS, SCAN, BATTERY)
"""What a robot that drives publishes."""
STAMPED = (ODOMETRY, SCAN, IMU)
"""What carries the time at which the robot made it, by its own clock."""
WITHOUT_STREAM = (
    "rcl_interfaces/ParameterEvent", "rosbag2_interfaces/ReadSplitEvent", "rosbag2_interfaces/WriteSplitEvent",
    "bond/Status", *ROSOUT,
)  # fmt: skip
"""Types whose channels are empty, or stop, without anything being wrong."""

AT_TIMES = (
    *COMMANDS,
    *GOALS,
    *ROSOUT,
    LOCALISED,
    TREE,
    FAULT_EVENT,
    RECOVERY,
    TRANSITION,
    PATH,
    POSE,
)
"""Types that are sent only while there is something to say: commands while somebody commands, poses that were found."""

_OF_EVENTS = (PATH, "std_msgs/Empty")
_OF_EVENTS_BEGIN = ("visualization_msgs/InteractiveMarker",)
_EVENTS = re.compile(
    r"goal|clicked|initial_?pose|interactive|rviz|event|bumper|contact|collision|feedback$|teleop|keyboard",
    re.IGNORECASE,
)
"""In the names of topics that speak only when something happens, or somebody does something."""

FRAME = "header.frame_id"
"""The frame in which a message gives places: text, so read only where places are compared."""

_FAR_M, _FAST, _ELECTRIC, _HARDEST_MPS2, _UNIT = 1e7, 1e3, 1e4, 1e4, 2.0
"""Beyond these nothing is: positions (UTM northings reach 1e7 m), speeds in m/s and rad/s, volts, amperes and ampere
hours, accelerations. Parts of a unit quaternion lie within 1; one beyond 2 is damaged, not rounded."""


_UNIT_ERROR = 0.1
"""Error of the length of a unit quaternion: a driver without an orientation sends zeros."""


class RosMessage(Message):
    """A type of message: what the model of a drive reads of it, and how much."""

    reads: tuple[str, ...] = ()
    at_most: int = 0
    """Messages of a topic that health decodes; what comes seldom is read whole, 0."""
    label: str = ""
    """What a recording of it alone holds, in words."""


def _number(unit: str, label: str = "", most: float = math.inf) -> Field:
    return Field(unit, label, plausible=(-most, most))


def _position(axis: str) -> Field:
    return Field("m", f"position {axis}", plausible=(-_FAR_M, _FAR_M), is_position=True)


_PARTS = tuple(f"orientation.{axis}" for axis in "xyzw")
HEIGHT = "pose.pose.position.z"
_ORIENTATION = {part: _number("", most=_UNIT) for part in _PARTS}
_POSE = {
    "pose.pose.position.x": _position("x"),
    "pose.pose.position.y": _position("y"),
    **{f"pose.pose.{part}": field for part, field in _ORIENTATION.items()},
}
_COMMAND = {
    "linear.x": _number("m/s", "commanded speed", _FAST),
    "linear.y": _number("m/s", "commanded speed to the left", _FAST),
    "angular.z": _number("rad/s", "commanded turn rate", _FAST),
}
_STAMPED_COMMAND = {f"twist.{name}": field for name, field in _COMMAND.items()}
_VELOCITY = {
    "twist.twist.linear.x": _number("m/s", "speed forward", _FAST),
    "twist.twist.linear.y": _number("m/s", "speed to the left", _FAST),
    "twist.twist.angular.z": _number("rad/s", "turn rate", _FAST),
}
_ACCELERATION = {
    "linear_acceleration.x": _number("m/s2", "forward acceleration", _HARDEST_MPS2),
    "linear_acceleration.y": _number("m/s2", "sideways acceleration", _HARDEST_MPS2),
    "linear_acceleration.z": _number("m/s2", "vertical acceleration", _HARDEST_MPS2),
}
_BATTERY = {
    "voltage": _number("V", "battery voltage", _ELECTRIC),
    "current": _number("A", "battery current", _ELECTRIC),
    "percentage": Field("", "charge left, 0 to 1"),
    "charge": _number("Ah", "charge left", _ELECTRIC),
}
_ANGLES = {"angle_min": _number("rad", most=_FAST), "angle_increment": _number("rad", most=_FAST)}
_TARGET = "goal.target_pose"
_TRANSFORM = "transforms.transform.translation"
PLACED = ("transforms.header.frame_id", "transforms.child_frame_id", f"{_TRANSFORM}.x", f"{_TRANSFORM}.y")
"""What of transforms says where a frame is."""


def _reads(*fields: str, at_most: int = 0, label: str = "") -> RosMessage:
    return RosMessage({}, reads=fields, at_most=at_most, label=label)


MESSAGES: Mapping[str, RosMessage] = {
    ODOMETRY: RosMessage(
        {**_VELOCITY, **_POSE, HEIGHT: _position("z")}, reads=(STAMP, *_POSE, HEIGHT, *_VELOCITY), at_most=20_000
    ),
    TWIST: RosMessage(_COMMAND, reads=tuple(_COMMAND), at_most=20_000),
    TWIST_STAMPED: RosMessage(_STAMPED_COMMAND, reads=tuple(_STAMPED_COMMAND), at_most=20_000),
    SCAN: RosMessage(_ANGLES, reads=(STAMP, *_ANGLES, "range_min", "range_max", "ranges"), at_most=2_500),
    BATTERY: RosMessage(_BATTERY, reads=tuple(_BATTERY), at_most=5_000),
    IMU: RosMessage(
        {**_ACCELERATION, **_ORIENTATION, "angular_velocity.z": Field("rad/s", "turn rate of the gyro")},
        reads=(STAMP, *_ACCELERATION, *_ORIENTATION), at_most=30_000, label="inertial data",
    ),
    **dict.fromkeys(ROSOUT, _reads("level", "name", "msg", "message")),
    DIAGNOSTICS: _reads("status.level", "status.name", "status.message"),
    FAULT_EVENT: _reads(
        "event_type", "fault.fault_code", "fault.severity", "fault.description", "fault.reporting_sources"
    ),
    STATUS: _reads("status_list.goal_info.goal_id.uuid", "status_list.status"),
    TREE: _reads("event_log.node_name", "event_log.previous_status", "event_log.current_status"),
    RECOVERY: _reads("recovery_behavior_name"),
    TRANSITION: _reads("start_state.label", "goal_state.label"),
    **dict.fromkeys(TF, _reads(
        *PLACED, *(f"transforms.transform.rotation.{axis}" for axis in "xyzw"),
        at_most=10_000, label="transforms",
    )),
    ACTION_GOAL: _reads(
        "goal_id.id", f"{_TARGET}.header.frame_id", *(f"{_TARGET}.pose.position.{axis}" for axis in "xy"),
        *(f"{_TARGET}.pose.{part}" for part in _PARTS),
    ),
    NAVIGATION: RosMessage({"feedback.distance_remaining": _number("m", "distance to the goal", _FAR_M)}),
    ACTION_RESULT: _reads("status.goal_id.id", "status.status", "status.text"),
    LOCALISED: RosMessage(_POSE, reads=(*_POSE, HEIGHT), at_most=20_000, label="poses"),
    **dict.fromkeys((POSE, "geometry_msgs/TransformStamped"), _reads(label="poses")),
    FIX: _reads("status.status", "latitude", "longitude", at_most=20_000, label="satellite positions"),
    **dict.fromkeys(("sensor_msgs/Image", "sensor_msgs/CompressedImage"), _reads(label="images")),
    CLOUD: _reads(label="point clouds"),
    "sensor_msgs/JointState": _reads(label="joint states"),
    "sensor_msgs/Range": _reads(label="ranges"),
}  # fmt: skip
"""By short type; of the goals and results of ROS 1 actions, by how the type ends."""


def reading(*types: str) -> Wanted:
    """What is read of these types."""
    return {type: MESSAGES[type].reads for type in types}


NO_PLACE = f"{ODOMETRY} of what is no place of the robot"
_NO_PLACE = re.compile(r"(?:^|[/_])(?:ref|reference|set_?point|desired|error|disturbances?|wrench)(?:$|[/_])")
"""What is asked for, and errors and forces, in a message for where a robot is."""


def type_of(channel: Channel) -> str:
    """The key of `MESSAGES` for a channel, its short type where there is none."""
    name = short_name(channel.type.partition(",")[0])
    if name == ODOMETRY and _NO_PLACE.search(channel.name):
        return NO_PLACE
    return next((ending for ending in (ACTION_GOAL, ACTION_RESULT) if name.endswith(ending)), name)


def plainness(topic: str, name: str) -> tuple[bool, int, str]:
    """Ranks topics: `/odom` before `/robot/odom` before `/odometry/filtered`."""
    return topic.rpartition("/")[2] != name, topic.count("/"), topic


def speaks_at_times(type: str) -> bool:
    """Whether a type's silence is no hole."""
    return type in AT_TIMES or type in WITHOUT_STREAM


def tells_events(channel: Channel) -> bool:
    """Whether a topic speaks when something happens: how often it does, and that it stops, says nothing of a fault."""
    type = type_of(channel)
    is_such = type in _OF_EVENTS or type in WITHOUT_STREAM or type.startswith(_OF_EVENTS_BEGIN)
    return (
        is_such or (type in AT_TIMES and type not in (*COMMANDS, POSE, LOCALISED)) or bool(_EVENTS.search(channel.name))
    )


def holds(table: Table, type: str) -> bool:
    """Whether a table has every field that is read of messages of a type."""
    return all(field in table.columns for field in MESSAGES[type].reads)


def believable(table: Table, type: str, field: str) -> Floats:
    """A column of numbers with nan for what nothing of its kind can be: a damaged one."""
    low, high = MESSAGES[type].fields[field].plausible or (-math.inf, math.inf)
    return _within(table[field], low, high)


def yaw_of(table: Table, prefix: str) -> Floats:
    """Heading of a unit quaternion, rad."""
    columns = (_within(table[f"{prefix}.{axis}"], -_UNIT, _UNIT) for axis in "xyzw")
    x, y, z, w = (np.clip(column, -1.0, 1.0) for column in columns)
    yaw: Floats = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return yaw


def tilt_of(table: Table, type: str, prefix: str) -> Floats:
    """Angle of the robot's upward axis to what it was at first, deg, shape (n,); zero without an orientation."""
    tilt = lean(*(believable(table, type, f"{prefix}.{axis}") for axis in "xyzw"))
    return np.zeros(len(table)) if tilt is None else tilt


def lean(x: Floats, y: Floats, z: Floats, w: Floats) -> Floats | None:
    """The same of unit quaternions, each part of shape (n,); None where one is none."""
    length = x * x + y * y + z * z + w * w
    if not np.isfinite(length).all() or not np.all(np.abs(length - 1) < _UNIT_ERROR):
        return None
    up = np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=1)
    first = median(up[: max(5, len(up) // 50)], axis=0)
    angle: Floats = np.degrees(np.arccos(np.clip(up @ (first / np.linalg.norm(first)), -1, 1)))
    return angle


def _within(column: NDArray[Any], low: float, high: float) -> Floats:
    values = np.asarray(column, np.float64)
    with np.errstate(invalid="ignore"):
        return np.where((values >= low) & (values <= high), values, np.nan)


def topics(channels: Iterable[Channel], types: Iterable[str]) -> Wanted:
    """The fields to read of the channels of these types that have messages."""
    wanted = frozenset(types)
    return {one.name: MESSAGES[type_of(one)].reads for one in channels if one.count and type_of(one) in wanted}
