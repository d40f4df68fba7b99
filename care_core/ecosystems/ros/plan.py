"""What to read of a stranger's recording: fields by message type, since its topics are named anyhow.

No camera and no point cloud is among them, and of sensors that send often as many messages are read as a look at them
needs, so that a recording of an hour takes no longer than one of minutes.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from care_core.logs.base import Channel, Wanted
from care_core.logs.ros_message import short_name

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
STATUS = "action_msgs/GoalStatusArray"
TREE = "nav2_msgs/BehaviorTreeLog"
RECOVERY = "move_base_msgs/RecoveryStatus"
TRANSITION = "lifecycle_msgs/TransitionEvent"
TF = ("tf2_msgs/TFMessage", "tf/tfMessage")
LOCALISED = "geometry_msgs/PoseWithCovarianceStamped"
ACTION_GOAL, ACTION_RESULT = "ActionGoal", "ActionResult"
"""How the types of a ROS 1 action's goals and results end."""

ROBOT = (ODOMETRY, TWIST, TWIST_STAMPED, SCAN, BATTERY)
"""What a robot that drives publishes."""

STAMPED = (ODOMETRY, SCAN, IMU)
"""What carries the time at which the robot made it, by its own clock."""

_PLANE = ("orientation.x", "orientation.y", "orientation.z", "orientation.w")
_TWIST = ("linear.x", "linear.y", "angular.z")
_SHIFT = "transforms.transform"

FIELDS: Mapping[str, tuple[str, ...]] = {
    ODOMETRY: (
        "header.stamp", "pose.pose.position.x", "pose.pose.position.y", *(f"pose.pose.{one}" for one in _PLANE),
        "twist.twist.linear.x", "twist.twist.linear.y", "twist.twist.angular.z",
    ),
    TWIST: _TWIST,
    TWIST_STAMPED: tuple(f"twist.{one}" for one in _TWIST),
    SCAN: ("header.stamp", "angle_min", "angle_increment", "range_min", "range_max", "ranges"),
    BATTERY: ("voltage", "current", "percentage"),
    IMU: ("header.stamp", *(f"linear_acceleration.{axis}" for axis in "xyz"), *_PLANE),
    **dict.fromkeys(ROSOUT, ("level", "name", "msg", "message")),
    DIAGNOSTICS: ("status.level", "status.name", "status.message"),
    STATUS: ("status_list.goal_info.goal_id.uuid", "status_list.status"),
    TREE: ("event_log.node_name", "event_log.previous_status", "event_log.current_status"),
    RECOVERY: ("recovery_behavior_name",),
    TRANSITION: ("start_state.label", "goal_state.label"),
    **dict.fromkeys(TF, (
        "transforms.header.frame_id", "transforms.child_frame_id", f"{_SHIFT}.translation.x", f"{_SHIFT}.translation.y",
    )),
    LOCALISED: ("pose.pose.position.x", "pose.pose.position.y", *(f"pose.pose.{one}" for one in _PLANE)),
    ACTION_GOAL: ("goal_id.id", "goal.target_pose.pose.position.x", "goal.target_pose.pose.position.y"),
    ACTION_RESULT: ("status.goal_id.id", "status.status", "status.text"),
}  # fmt: skip

_AT_MOST: Mapping[str, int] = {
    ODOMETRY: 20_000,
    TWIST: 20_000,
    TWIST_STAMPED: 20_000,
    SCAN: 2_500,
    BATTERY: 5_000,
    IMU: 30_000,
    **dict.fromkeys(TF, 10_000),
}
"""Messages of a topic that are decoded; what comes seldom is read whole."""


def kind_of(channel: Channel) -> str:
    """The key of `FIELDS` for a channel, its short type where there is none."""
    name = short_name(channel.type.partition(",")[0])
    for ending in (ACTION_GOAL, ACTION_RESULT):
        if name.endswith(ending):
            return ending
    return name


def needs(channels: Iterable[Channel]) -> Wanted:
    """The fields to read of the channels that are there."""
    return {one.name: FIELDS[kind_of(one)] for one in channels if one.count and kind_of(one) in FIELDS}


def limits(channels: Iterable[Channel]) -> Mapping[str, int]:
    """How many messages of a channel to decode at most; see `RosLog.read`."""
    return {one.name: _AT_MOST[kind_of(one)] for one in channels if kind_of(one) in _AT_MOST}
