"""ROS: what recordings say, the model of a drive, health checks and measures. Topics are told by their message type."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from care_core.ecosystems.base import Check, Ecosystem, RunModel
from care_core.ecosystems.findings import Health
from care_core.logs.base import Channel, Log, LogFormat

_PATIENCE_S = 1e9
"""How long a goal may take where nobody gave it a time."""
_GOAL = "ActionGoal"
"""How the types of a ROS 1 action's goals end."""
_STATUS = "/_action/status"
"""How the topics end on which ROS 2 actions tell of their goals."""
_DRIVES = "move_base", "navigate", "nav", "goto"
"""Part of the name of an action that drives: of a robot with an arm as well, its drive is judged."""


class Ros(Ecosystem):
    """Robots on ROS 1 and ROS 2."""

    name = "ros"
    title = "ROS"
    formats = (LogFormat.ROS1_BAG, LogFormat.ROS2_DB3, LogFormat.MCAP)
    measures = (
        "care_core.ecosystems.ros.measures.actionlib",
        "care_core.ecosystems.ros.measures.battery",
        "care_core.ecosystems.ros.measures.laser",
        "care_core.ecosystems.ros.measures.nav2",
        "care_core.ecosystems.ros.measures.navigation",
        "care_core.ecosystems.ros.measures.requested",
    )

    def model(self, log: Log) -> RunModel:
        return RunModel(log)

    def examine(self, model: RunModel) -> Health:
        from care_core.ecosystems.ros.examining import examine

        return examine(model)

    def checks(self) -> tuple[Check[Any], ...]:
        return ()

    def missions(self, channels: tuple[Channel, ...]) -> Iterator[Mapping[str, Any]]:
        for action in _actions(channels):
            yield {"kind": "actionlib_goals", "action": action, "goal_timeout_s": _PATIENCE_S}
        if any(channel.count and channel.name.endswith(_STATUS) for channel in channels):
            yield {"kind": "nav2_goals", "goal_timeout_s": _PATIENCE_S}


def _actions(channels: tuple[Channel, ...]) -> list[str]:
    """Namespaces of the ROS 1 actions that were given goals, those that drive first."""
    goals = [channel for channel in channels if channel.count and channel.type.partition(",")[0].endswith(_GOAL)]
    names = [channel.name.rpartition("/")[0] for channel in goals]
    return sorted(names, key=lambda name: not any(word in name for word in _DRIVES))


ECOSYSTEM = Ros()
