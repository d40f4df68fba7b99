"""Messages of ROS 1 and ROS 2 for the simulated robots, and bags of them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

Entry = tuple[str, float, Any]
"""Topic, time in s, message."""

SECOND_NS = 1_000_000_000
_START_S = 10.0
"""A simulated clock begins near zero."""

DYNAMIC_RECONFIGURE = {
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
"""Message types that ROS's core packages lack, by their fields."""


def ns(time_s: float) -> int:
    """A time of a mission on the clock of its log."""
    return round((_START_S + time_s) * SECOND_NS)


class Maker:
    """Makes messages; `texts` are types that the core packages lack."""

    def __init__(self, stores: Stores, texts: Mapping[str, str]) -> None:
        self.store: Any = get_typestore(stores)
        types: dict[str, Any] = {}
        for name, text in texts.items():
            types.update(get_types_from_msg(text, name))
        self.store.register(types)
        self.is_ros1 = stores is Stores.ROS1_NOETIC

    def make(self, kind: str, *values: Any) -> Any:
        package, name = kind.split("/")
        return self.store.types[f"{package}/msg/{name}"](*values)

    def stamp(self, time_s: float) -> Any:
        return self.make("builtin_interfaces/Time", *divmod(ns(time_s), SECOND_NS))

    def header(self, time_s: float, frame: str = "odom") -> Any:
        return self.make("std_msgs/Header", *((0,) if self.is_ros1 else ()), self.stamp(time_s), frame)

    def battery(self, t: float, volts: float, amps: float) -> Any:
        nan, none = math.nan, np.empty(0, np.float32)
        values: dict[str, Any] = {
            "header": self.header(t, "base_link"), "voltage": volts, "current": amps, "charge": nan, "capacity": nan,
            "temperature": nan, "design_capacity": nan, "percentage": nan, "power_supply_status": 2,
            "power_supply_health": 1, "power_supply_technology": 2, "present": True, "cell_voltage": none,
            "cell_temperature": none, "location": "", "serial_number": "",
        }  # fmt: skip
        kind = self.store.types["sensor_msgs/msg/BatteryState"]
        return kind(**{name: values[name] for name in kind.__dataclass_fields__ if name in values})

    def said(self, t: float, level: int, node: str, text: str) -> Any:
        """What a node says; levels as ROS 1 counts them."""
        if self.is_ros1:
            return self.make("rosgraph_msgs/Log", self.header(t, ""), level, f"/{node}", text, "", "", 0, [])
        return self.make("rcl_interfaces/Log", self.stamp(t), {2: 20, 4: 30, 8: 40}[level], node, text, "", "", 0)

    def config(self, values: Mapping[str, float], whole: Iterable[str]) -> Any:
        """A dynamic_reconfigure configuration; `whole` are integers."""

        def made(kind: str, names: Iterable[str], cast: type) -> list[Any]:
            return [self.make(f"dynamic_reconfigure/{kind}", name, cast(values[name])) for name in names]

        ints = made("IntParameter", [name for name in values if name in set(whole)], int)
        doubles = made("DoubleParameter", [name for name in values if name not in set(whole)], float)
        return self.make("dynamic_reconfigure/Config", [], ints, [], doubles, [])

    def described(
        self, ranges: Mapping[str, tuple[float, float]], usual: Mapping[str, float], whole: Iterable[str]
    ) -> Any:
        """The ranges and defaults of a configuration, as dynamic_reconfigure describes them."""
        high, low = ({name: bounds[side] for name, bounds in ranges.items()} for side in (1, 0))
        configs = (self.config(values, whole) for values in (high, low, usual))
        return self.make("dynamic_reconfigure/ConfigDescription", [], *configs)


def write_ros1(path: Path, maker: Maker, entries: Iterable[Entry]) -> None:
    """A ROS 1 bag of messages in any order."""
    from rosbags.rosbag1 import Writer

    with Writer(path) as writer:
        connections: dict[str, Any] = {}
        for topic, time_s, message in sorted(entries, key=lambda entry: entry[1]):
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=maker.store)
            writer.write(connections[topic], ns(time_s), maker.store.serialize_ros1(message, kind))


def write_ros2(path: Path, maker: Maker, entries: Iterable[Entry]) -> None:
    """An MCAP file as ROS 2 records it, of messages in any order."""
    from mcap.writer import Writer

    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2", library="care_samples")
        channels: dict[str, int] = {}
        for topic, time_s, message in sorted(entries, key=lambda entry: entry[1]):
            kind = message.__msgtype__
            if topic not in channels:
                text, _ = maker.store.generate_msgdef(kind, ros_version=2)
                schema = writer.register_schema(kind, "ros2msg", text.encode())
                channels[topic] = writer.register_channel(topic, "cdr", schema)
            data = bytes(maker.store.serialize_cdr(message, kind))
            writer.add_message(channels[topic], ns(time_s), data, ns(time_s))
        writer.finish()  # type: ignore[no-untyped-call]
