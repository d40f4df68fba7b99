"""A mission as a log: a ROS 1 bag with dynamic_reconfigure's topics, or an MCAP of ROS 2 with parameter events."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from care_samples.robot.mission import DEFAULTS, Story
from care_samples.robot.planner import Point
from care_samples.robot.ranges import RANGES, is_whole
from care_samples.robot.world import GOALS

NODE = "courier"
_SECOND_NS = 1_000_000_000
_START_S = 10.0
"""A simulated clock begins near zero."""

_TEXTS = {
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
    "dynamic_reconfigure/msg/BoolParameter": "string name\nbool value",
    "dynamic_reconfigure/msg/IntParameter": "string name\nint32 value",
    "dynamic_reconfigure/msg/StrParameter": "string name\nstring value",
    "dynamic_reconfigure/msg/DoubleParameter": "string name\nfloat64 value",
    "dynamic_reconfigure/msg/GroupState": "string name\nbool state\nint32 id\nint32 parent",
    "dynamic_reconfigure/msg/ParamDescription": (
        "string name\nstring type\nuint32 level\nstring description\nstring edit_method"
    ),
    "dynamic_reconfigure/msg/Group": "string name\nstring type\nParamDescription[] parameters\nint32 parent\nint32 id",
    "dynamic_reconfigure/msg/Config": (
        "BoolParameter[] bools\nIntParameter[] ints\nStrParameter[] strs\nDoubleParameter[] doubles\n"
        "GroupState[] groups"
    ),
    "dynamic_reconfigure/msg/ConfigDescription": "Group[] groups\nConfig max\nConfig min\nConfig dflt",
}
"""The message types that ROS's core packages lack, by their fields."""
_BEHAVIOR_TREE = {
    "nav2_msgs/msg/BehaviorTreeStatusChange": (
        "builtin_interfaces/Time timestamp\nstring node_name\nstring previous_status\nstring current_status"
    ),
    "nav2_msgs/msg/BehaviorTreeLog": "builtin_interfaces/Time timestamp\nBehaviorTreeStatusChange[] event_log",
}

_Entry = tuple[str, float, Any]
_Store = Any


def write_bag(path: Path, story: Story, parameters: Mapping[str, float]) -> None:
    """A ROS 1 bag."""
    from rosbags.rosbag1 import Writer

    store = _store(Stores.ROS1_NOETIC, _TEXTS)
    with Writer(path) as writer:
        connections: dict[str, Any] = {}
        for topic, time_s, message in sorted(_ros1(store, story, parameters), key=lambda entry: entry[1]):
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], _ns(time_s), store.serialize_ros1(message, kind))


def write_mcap(path: Path, story: Story, parameters: Mapping[str, float]) -> None:
    """An MCAP file as ROS 2 records it."""
    from mcap.writer import Writer

    store = _store(Stores.ROS2_HUMBLE, _BEHAVIOR_TREE)
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2", library="courier")
        channels: dict[str, int] = {}
        for topic, time_s, message in sorted(_ros2(store, story, parameters), key=lambda entry: entry[1]):
            kind = message.__msgtype__
            if topic not in channels:
                text, _ = store.generate_msgdef(kind, ros_version=2)
                schema = writer.register_schema(kind, "ros2msg", text.encode())
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            data = bytes(store.serialize_cdr(message, kind))
            writer.add_message(channels[topic], _ns(time_s), data, _ns(time_s))
        writer.finish()  # type: ignore[no-untyped-call]


def _store(stores: Stores, texts: Mapping[str, str]) -> _Store:
    store = get_typestore(stores)
    types: dict[str, Any] = {}
    for name, text in texts.items():
        types.update(get_types_from_msg(text, name))
    store.register(types)
    return store


def _ns(time_s: float) -> int:
    return round((_START_S + time_s) * _SECOND_NS)


class _Maker:
    """Makes messages that both kinds of ROS share."""

    def __init__(self, store: _Store) -> None:
        self.store = store
        self.is_ros1 = "seq" in store.types["std_msgs/msg/Header"].__dataclass_fields__

    def make(self, kind: str, *values: Any) -> Any:
        package, name = kind.split("/")
        return self.store.types[f"{package}/msg/{name}"](*values)

    def stamp(self, time_s: float) -> Any:
        return self.make("builtin_interfaces/Time", *divmod(_ns(time_s), _SECOND_NS))

    def header(self, time_s: float, frame: str = "odom") -> Any:
        return self.make("std_msgs/Header", *((0,) if self.is_ros1 else ()), self.stamp(time_s), frame)

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

    def shared(self, story: Story) -> Iterator[_Entry]:
        """Odometry, commands, battery and plans."""
        zeros = np.zeros(36)
        for t, x, y, yaw, speed, turn in story.odometry:
            pose = self.make("geometry_msgs/PoseWithCovariance", self.pose(x, y, yaw), zeros)
            twist = self.make("geometry_msgs/TwistWithCovariance", self.twist(speed, turn), zeros)
            yield "/odom", t, self.make("nav_msgs/Odometry", self.header(t), "base_link", pose, twist)
        for t, speed, turn in story.commands:
            yield "/cmd_vel", t, self.twist(speed, turn)
        for t, volts, amps in story.battery:
            yield "/battery_state", t, self._battery(t, volts, amps)

    def _battery(self, t: float, volts: float, amps: float) -> Any:
        nan, none = math.nan, np.empty(0, np.float32)
        values: dict[str, Any] = {
            "header": self.header(t, "base_link"), "voltage": volts, "current": amps, "charge": nan, "capacity": nan,
            "temperature": nan, "design_capacity": nan, "percentage": nan, "power_supply_status": 2,
            "power_supply_health": 1, "power_supply_technology": 2, "present": True, "cell_voltage": none,
            "cell_temperature": none, "location": "", "serial_number": "",
        }  # fmt: skip
        kind = self.store.types["sensor_msgs/msg/BatteryState"]
        return kind(**{name: values[name] for name in kind.__dataclass_fields__ if name in values})


def _ros1(store: _Store, story: Story, parameters: Mapping[str, float]) -> Iterator[_Entry]:
    maker = _Maker(store)
    yield from maker.shared(story)
    for space in sorted({name.partition("/")[0] for name in parameters}):
        own = {name.partition("/")[2]: name for name in parameters if name.startswith(f"{space}/")}
        driven = _config(maker, {short: parameters[name] for short, name in own.items()})
        bounds = (_config(maker, {short: RANGES[name][side] for short, name in own.items()}) for side in (1, 0))
        usual = _config(maker, {short: DEFAULTS[name] for short, name in own.items()})
        described = maker.make("dynamic_reconfigure/ConfigDescription", [], *bounds, usual)
        yield f"/{NODE}/{space}/parameter_descriptions", 0.0, described
        yield f"/{NODE}/{space}/parameter_updates", 0.0, driven
    for t, number in story.goals:
        goal = maker.make("move_base_msgs/MoveBaseGoal", maker.stamped(t, GOALS[number]))
        ident = maker.make("actionlib_msgs/GoalID", maker.stamp(t), f"goal-{number + 1}")
        yield f"/{NODE}/goal", t, maker.make("move_base_msgs/MoveBaseActionGoal", maker.header(t, ""), ident, goal)
    codes = {"succeeded": 3, "aborted": 4, "preempted": 2}
    for t, number, outcome, text in story.results:
        ident = maker.make("actionlib_msgs/GoalID", maker.stamp(t), f"goal-{number + 1}")
        status = maker.make("actionlib_msgs/GoalStatus", ident, codes[outcome], text)
        empty = maker.make("move_base_msgs/MoveBaseResult")
        yield (
            f"/{NODE}/result",
            t,
            maker.make("move_base_msgs/MoveBaseActionResult", maker.header(t, ""), status, empty),
        )
    for number, (t, name) in enumerate(story.recoveries):
        where = maker.stamped(t, (0.0, 0.0))
        yield f"/{NODE}/recovery_status", t, maker.make("move_base_msgs/RecoveryStatus", where, number, 3, name)
    for t, level, text in story.said:
        yield "/rosout", t, maker.make("rosgraph_msgs/Log", maker.header(t, ""), level, f"/{NODE}", text, "", "", 0, [])


def _config(maker: _Maker, values: Mapping[str, float]) -> Any:
    def made(kind: str, names: list[str], cast: type) -> list[Any]:
        return [maker.make(f"dynamic_reconfigure/{kind}", name, cast(values[name])) for name in names]

    whole = [name for name in values if is_whole(name)]
    others = [name for name in values if not is_whole(name)]
    ints, doubles = made("IntParameter", whole, int), made("DoubleParameter", others, float)
    return maker.make("dynamic_reconfigure/Config", [], ints, [], doubles, [])


def _ros2(store: _Store, story: Story, parameters: Mapping[str, float]) -> Iterator[_Entry]:
    maker = _Maker(store)
    yield from maker.shared(story)
    for t, way in story.plans:
        yield "/plan", t, maker.path(t, way)
    yield "/parameter_events", 0.0, _event(maker, parameters)
    ends = {number: (t, {"succeeded": 4, "aborted": 6, "preempted": 5}[how]) for t, number, how, _ in story.results}
    told: dict[int, int] = {}
    for t, number, code in sorted(
        [(t, number, 2) for t, number in story.goals] + [(t, number, code) for number, (t, code) in ends.items()]
    ):
        told[number] = code
        if code == 2:
            yield "/goal_pose", t, maker.stamped(t, GOALS[number])
        yield "/navigate_to_pose/_action/status", t, _states(maker, t, told)
    for t, _ in story.recoveries:
        change = maker.make("nav2_msgs/BehaviorTreeStatusChange", maker.stamp(t), "BackUp", "IDLE", "RUNNING")
        yield "/behavior_tree_log", t, maker.make("nav2_msgs/BehaviorTreeLog", maker.stamp(t), [change])
    levels = {2: 20, 4: 30, 8: 40}
    for t, level, text in story.said:
        yield "/rosout", t, maker.make("rcl_interfaces/Log", maker.stamp(t), levels[level], NODE, text, "", "", 0)


def _event(maker: _Maker, parameters: Mapping[str, float]) -> Any:
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


def _states(maker: _Maker, t: float, told: Mapping[int, int]) -> Any:
    made = []
    for number, code in told.items():
        uuid = maker.make("unique_identifier_msgs/UUID", np.full(16, number + 1, np.uint8))
        info = maker.make("action_msgs/GoalInfo", uuid, maker.stamp(t))
        made.append(maker.make("action_msgs/GoalStatus", info, code))
    return maker.make("action_msgs/GoalStatusArray", made)
