"""Runs of a log that no profile fits: found and read by the kinds of mission that its format can hold.

What such a run is judged by are the `outcome` checks of its kind. It has no options, metrics or objectives.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from care_core.ecosystems.ardupilot.measures.mission import ArduPilotFlight
from care_core.ecosystems.px4.missions import Px4Flight
from care_core.ecosystems.ros.measures import actionlib, nav2
from care_core.errors import NoMissionError
from care_core.extract.read import read_runs
from care_core.logs.base import Channel, Log, LogFormat
from care_core.logs.digest import Sha256
from care_core.profile.schema import Schema
from care_core.run import Run

_PATIENCE_S = 1e9
"""How long a goal may take where nobody gave it a time."""
_GOAL = "ActionGoal"
"""How the types of a ROS 1 action's goals end."""
_STATUS = "/_action/status"
"""How the topics end on which ROS 2 actions tell of their goals."""
_DRIVES = "move_base", "navigate", "nav", "goto"
"""Part of the name of an action that drives: of a robot with an arm as well, its drive is judged."""


def read_plain_runs(log: Log, sha256: Sha256 | None = None) -> tuple[Run, ...]:
    """Every run of a log in time order, without any profile; empty where the log holds none."""
    for spec in _missions(log):
        try:
            return read_runs(log, _bare(log, spec), sha256=sha256)
        except NoMissionError:
            continue
    return ()


def _missions(log: Log) -> Iterator[Mapping[str, Any]]:
    """The mission sections to try, the likeliest first."""
    if log.format in (LogFormat.DATAFLASH_BIN, LogFormat.DATAFLASH_TEXT, LogFormat.MAVLINK_TLOG):
        yield {"kind": ArduPilotFlight.name}
    elif log.format is LogFormat.PX4_ULG:
        yield {"kind": Px4Flight.name}
    else:
        for action in _actions(log.channels()):
            yield {"kind": actionlib.KIND, "action": action, "goal_timeout_s": _PATIENCE_S}
        if any(one.count and one.name.endswith(_STATUS) for one in log.channels()):
            yield {"kind": nav2.KIND, "goal_timeout_s": _PATIENCE_S}


def _actions(channels: tuple[Channel, ...]) -> list[str]:
    """Namespaces of the ROS 1 actions that were given goals, those that drive first."""
    goals = [one for one in channels if one.count and one.type.partition(",")[0].endswith(_GOAL)]
    names = [one.name.rpartition("/")[0] for one in goals]
    return sorted(names, key=lambda name: not any(word in name for word in _DRIVES))


def _bare(log: Log, mission: Mapping[str, Any]) -> Schema:
    return Schema("", "", "", "", {}, (log.format.value,), False, mission, (), {})
