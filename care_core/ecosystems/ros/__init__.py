"""ROS: what recordings say, the model of a drive, health checks and measures. Topics are told by their message type."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any, cast

from care_core.ecosystems.base import Check, Ecosystem, Recording, RunModel
from care_core.ecosystems.dialect import Dialect
from care_core.ecosystems.dictionary import Dictionary, Field, find_field
from care_core.ecosystems.findings import Event, Health
from care_core.ecosystems.ros.dialect import ROS1_YAML, ROS2_YAML
from care_core.logs.base import Channel, Log
from care_core.logs.formats import MCAP, ROS1_BAG, LogFormat
from care_core.run import Robot

if TYPE_CHECKING:
    from care_core.ecosystems.ros.drive import Drive
    from care_core.logs.ros_log import RosLog

_PATIENCE_S = 1e9
"""How long a goal may take where nobody gave it a time."""
_GOAL = "ActionGoal"
"""How the types of a ROS 1 action's goals end."""
_STATUS = "/_action/status"
"""How the topics end on which ROS 2 actions tell of their goals."""
_DRIVES = "move_base", "navigate", "nav", "goto"
"""Part of the name of an action that drives: of a robot with an arm as well, its drive is judged."""


_ALSO = (
    "/amcl_pose", "/battery_state", "/cmd_vel", "/diagnostics", "/imu", "/odom", "/rosout", "/scan", "/tf",
    "/tf_static",
)  # fmt: skip
"""What health checks read of most robots, under the names that most give them."""


class Ros(Ecosystem):
    """Robots on ROS 1 and ROS 2."""

    name = "ros"
    title = "ROS"
    dialects = (ROS1_YAML, ROS2_YAML)
    measures = (
        "care_core.ecosystems.ros.measures.actionlib",
        "care_core.ecosystems.ros.measures.battery",
        "care_core.ecosystems.ros.measures.laser",
        "care_core.ecosystems.ros.measures.nav2",
        "care_core.ecosystems.ros.measures.navigation",
        "care_core.ecosystems.ros.measures.posed",
        "care_core.ecosystems.ros.measures.requested",
    )

    def model(self, log: Log) -> RunModel:
        from care_core.ecosystems.ros.drive import Drive

        return Drive(cast("RosLog", log))

    def examine(self, model: RunModel) -> Health:
        from care_core.ecosystems.ros.examining import examine

        return examine(cast("Drive", model))

    def log_messages(self, model: RunModel) -> Iterator[Event]:
        from care_core.ecosystems.ros.node_messages import spoken

        return spoken(model)

    def checks(self) -> tuple[Check[Any], ...]:
        from care_core.ecosystems.ros.checks import CHECKS

        return CHECKS

    def missions(self, channels: tuple[Channel, ...]) -> Iterator[Mapping[str, Any]]:
        for action in _actions(channels):
            yield {"kind": "actionlib_goals", "action": action, "goal_timeout_s": _PATIENCE_S}
        if any(channel.count and channel.name.endswith(_STATUS) for channel in channels):
            yield {"kind": "nav2_goals", "goal_timeout_s": _PATIENCE_S}
        for action in _nav2_actions(channels):
            yield {"kind": "nav2_goals", "action": action, "goal_timeout_s": _PATIENCE_S}
        from care_core.ecosystems.ros.posed_goals import section_of

        posed = section_of(channels)
        if posed is not None:
            yield {**posed, "goal_timeout_s": _PATIENCE_S}

    def messages(self) -> Dictionary:
        from care_core.ecosystems.ros.messages import MESSAGES

        return MESSAGES

    def field(self, channel: Channel, name: str) -> Field | None:
        from care_core.ecosystems.ros.messages import type_of

        return find_field(self.messages(), type_of(channel), name)

    def speaks_at_times(self, log: Log, channel: str) -> bool:
        from care_core.ecosystems.ros.messages import speaks_at_times, type_of

        return any(speaks_at_times(type_of(one)) for one in log.channels() if one.name == channel)

    def dialect(self, format: LogFormat, parameters: Iterable[str]) -> Dialect:
        """An MCAP may be of either ROS: only in ROS 2 have names of parameters a dot, after the node."""
        names = list(parameters) if format is MCAP else []
        is_ros1 = format is ROS1_BAG or (names and not any("." in name for name in names))
        return ROS1_YAML if is_ros1 else ROS2_YAML

    def robots(self, log: Log) -> Iterator[Robot]:
        from care_core.ecosystems.ros.identity import robots

        return robots(log)

    def how_to_record(self, channel: str) -> str:
        if "/_" in channel:
            return f"ros2 bag record --include-hidden-topics {channel}"
        return f"record it: rosbag record {channel}, or ros2 bag record {channel}" if channel.startswith("/") else ""

    def to_record(self, channels: Collection[str], vehicle: str) -> Recording:
        return Recording(tuple(sorted({*channels, *_ALSO})))

    def stack(self, facts: Mapping[str, str]) -> str:
        return "ros1" if facts.get("ros") == "1" else "ros2"


def _actions(channels: tuple[Channel, ...]) -> list[str]:
    """Namespaces of the ROS 1 actions that were given goals, those that drive first."""
    goals = [channel for channel in channels if channel.count and channel.type.partition(",")[0].endswith(_GOAL)]
    names = [channel.name.rpartition("/")[0] for channel in goals]
    return sorted(names, key=lambda name: not any(word in name for word in _DRIVES))


def _nav2_actions(channels: tuple[Channel, ...]) -> list[str]:
    """Driving actions of ROS 2 in a name space, each robot's of its own."""
    names = [one.name.removesuffix(_STATUS) for one in channels if one.count and one.name.endswith(_STATUS)]
    return sorted(name for name in names if name.count("/") > 1 and any(word in name for word in _DRIVES))


ECOSYSTEM = Ros()
