"""A Nav2 drive as a ROS 2 bag, and the schema of a profile that reads it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from care_core.profile.schema import Schema
from care_core.variables import Extract, Role, Threshold, Variable

START_S = 1_700_000_000
TREE = """
builtin_interfaces/Time timestamp
BehaviorTreeStatusChange[] event_log
"""
CHANGE = """
builtin_interfaces/Time timestamp
string node_name
string previous_status
string current_status
"""
MAX_VEL = "/controller_server.FollowPath.max_vel_x"


def _store() -> Any:
    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg(CHANGE, "nav2_msgs/msg/BehaviorTreeStatusChange"))
    store.register(get_types_from_msg(TREE, "nav2_msgs/msg/BehaviorTreeLog"))
    return store


class Bag:
    """Writes messages by the second."""

    def __init__(self, path: Path, plugin: StoragePlugin) -> None:
        self.store = _store()
        self.writer = Writer(path, version=9, storage_plugin=plugin)
        self.connections: dict[str, Any] = {}

    def make(self, kind: str, **fields: Any) -> Any:
        return self.store.types[kind](**fields)

    def stamp(self, time_s: float) -> Any:
        return self.make("builtin_interfaces/msg/Time", sec=START_S + int(time_s), nanosec=0)

    def header(self, time_s: float) -> Any:
        return self.make("std_msgs/msg/Header", stamp=self.stamp(time_s), frame_id="odom")

    def pose(self, x: float) -> Any:
        position = self.make("geometry_msgs/msg/Point", x=x, y=0.0, z=0.0)
        orientation = self.make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
        return self.make("geometry_msgs/msg/Pose", position=position, orientation=orientation)

    def write(self, time_s: float, topic: str, message: Any) -> None:
        kind = message.__msgtype__
        if topic not in self.connections:
            self.connections[topic] = self.writer.add_connection(topic, kind, typestore=self.store)
        raw = self.store.serialize_cdr(message, kind)
        self.writer.write(self.connections[topic], int((START_S + time_s) * 1e9), raw)


def _states(bag: Bag, *goals: tuple[int, int]) -> Any:
    made = []
    for number, code in goals:
        uuid = bag.make("unique_identifier_msgs/msg/UUID", uuid=np.full(16, number, np.uint8))
        info = bag.make("action_msgs/msg/GoalInfo", goal_id=uuid, stamp=bag.stamp(0))
        made.append(bag.make("action_msgs/msg/GoalStatus", goal_info=info, status=code))
    return bag.make("action_msgs/msg/GoalStatusArray", status_list=made)


def _odometry(bag: Bag, time_s: float, x: float) -> Any:
    zero = bag.make("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0)
    forward = bag.make("geometry_msgs/msg/Vector3", x=0.2, y=0.0, z=0.0)
    pose = bag.make("geometry_msgs/msg/PoseWithCovariance", pose=bag.pose(x), covariance=np.zeros(36))
    twist = bag.make("geometry_msgs/msg/Twist", linear=forward, angular=zero)
    twist = bag.make("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=np.zeros(36))
    return bag.make("nav_msgs/msg/Odometry", header=bag.header(time_s), child_frame_id="base", pose=pose, twist=twist)


def _plan(bag: Bag, time_s: float, *xs: float) -> Any:
    header = bag.header(time_s)
    poses = [bag.make("geometry_msgs/msg/PoseStamped", header=header, pose=bag.pose(x)) for x in xs]
    return bag.make("nav_msgs/msg/Path", header=header, poses=poses)


def _said(bag: Bag, time_s: float, level: int, name: str, text: str) -> Any:
    return bag.make(
        "rcl_interfaces/msg/Log",
        stamp=bag.stamp(time_s),
        level=level,
        name=name,
        msg=text,
        file="",
        function="",
        line=0,
    )


def recorded(path: Path, plugin: StoragePlugin) -> Path:
    """Two goals of 2 m each; the second is reached after a recovery."""
    bag = Bag(path, plugin)
    status = "/navigate_to_pose/_action/status"
    with bag.writer:
        bag.write(0, status, _states(bag))
        bag.write(1, status, _states(bag, (1, 2)))
        bag.write(1.2, "/plan", _plan(bag, 1, 0.0, 1.0, 2.0))
        for tick in range(100, 2200, 10):
            bag.write(tick / 100, "/odom", _odometry(bag, tick / 100, min(4.0, (tick / 100 - 1) * 0.2)))
        bag.write(11, status, _states(bag, (1, 4)))
        bag.write(11.5, status, _states(bag, (1, 4), (2, 2)))
        bag.write(12, "/plan", _plan(bag, 12, 2.0, 3.0, 4.0))
        change = bag.make(
            "nav2_msgs/msg/BehaviorTreeStatusChange",
            timestamp=bag.stamp(13), node_name="Spin", previous_status="IDLE", current_status="RUNNING",
        )  # fmt: skip
        tree = bag.make("nav2_msgs/msg/BehaviorTreeLog", timestamp=bag.stamp(13), event_log=[change])
        bag.write(13, "/behavior_tree_log", tree)
        bag.write(14, "/rosout", _said(bag, 14, 40, "controller_server", "Failed to make progress"))
        bag.write(21, status, _states(bag, (1, 4), (2, 4)))
        bag.write(22, status, _states(bag, (1, 4), (2, 4)))
    return path


def schema() -> Schema:
    variables = (
        Variable("max_vel_x", Role.OPTION, range=(0.1, 1.0), parameters=(MAX_VEL,)),
        Variable("recoveries", Role.METRIC, extract=Extract("recoveries")),
        Variable("controller_errors", Role.METRIC, extract=Extract("rosout_count", {"node": "controller", "level": 8})),
        Variable("planned", Role.METRIC, extract=Extract("plan_length")),
        Variable("driven", Role.METRIC, extract=Extract("path_length")),
        Variable("left", Role.METRIC, extract=Extract("distance_left")),
        Variable(
            "success",
            Role.OBJECTIVE,
            kind="functional",
            threshold=Threshold("==", 1.0),
            extract=Extract("goals_success"),
        ),
    )
    return Schema(
        name="nav2",
        version="1",
        platform="a made robot",
        doc="",
        match={},
        logs=("ros2-db3", "mcap"),
        observational=False,
        mission={"kind": "nav2_goals", "goals": [[2.0, 0.0], [4.0, 0.0]]},
        evidence=(),
        variables={variable.name: variable for variable in variables},
    )
