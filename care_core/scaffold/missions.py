"""How missions are found in a robot's logs: the section `mission` of its profile, from what was recorded."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from care_core.ecosystems.measures import MISSION_KINDS
from care_core.ecosystems.registry import ecosystem_of, register_measures, run_model
from care_core.ecosystems.ros.goals import Goal, Status
from care_core.ecosystems.ros.measures.window import GOAL_TIMEOUT_S, TOLERANCE_M, window
from care_core.ecosystems.vehicles import vehicle_of
from care_core.metadata.navigation import is_ros
from care_core.profile.schema import Schema
from care_core.records import Record
from care_core.scaffold.inputs import InputLog

_TYPES = {"odometry": ("Odometry",), "commands": ("Twist", "TwistStamped"), "battery": ("BatteryState",)}
_USUAL = {"odometry": "/odom", "commands": "/cmd_vel", "battery": "/battery_state"}
_FLYING = ("copter", "heli", "plane", "quadplane", "px4", "unknown")
_SLACK = 2.0
"""A goal may take this times the longest that was reached."""


class Missions(Record):
    """The section, with what is said of its keys, and whether all logs hold the same mission."""

    spec: Mapping[str, Any]
    remarks: Mapping[str, str]
    alike: bool


def find_missions(logs: Sequence[InputLog], bundled: Sequence[Schema]) -> Missions:
    """The mission section that fits these logs best; the whole recording where they tell of no mission.

    Args:
        bundled: profiles that read such logs; one for the same kind of vehicle says how its missions are found.
    """
    first = logs[0]
    if not is_ros(first.stack):
        kind = _vehicle_kind(first, bundled)
        if kind and any(_missions_in(log, {"kind": kind}) for log in logs):
            return Missions({"kind": kind}, {"kind": "arming to disarming"}, False)
        return _whole("no log holds a mission from arming to disarming that is known how to judge")
    spec, remarks = _goals(logs)
    if not spec:
        return _whole("no goals of move_base or Nav2 are in the logs")
    goals = _goal_lists(logs, spec)
    if not any(goals):
        return _whole(f"the topics of {spec['kind']} hold no goal")
    return _with_goals(spec, remarks, goals)


def _whole(why: str) -> Missions:
    return Missions({"kind": "recording"}, {"kind": f"the whole recording is the mission: {why}"}, False)


def _vehicle_kind(first: InputLog, bundled: Sequence[Schema]) -> str:
    """The mission kind of a vehicle: of a profile for its like, of its ecosystem for what flies, else none."""
    vehicle = vehicle_of(first.opened.facts, first.settings).kind
    kinds = (str(one.mission.get("kind", "")) for one in bundled if one.match.get("vehicle") == vehicle)
    usual = (str(spec["kind"]) for spec in ecosystem_of(first.opened.format).missions(first.opened.channels()))
    return next(kinds, next(usual, "") if vehicle in _FLYING else "")


def _missions_in(log: InputLog, spec: Mapping[str, Any]) -> tuple[Any, ...]:
    register_measures()
    kind, model = MISSION_KINDS[str(spec["kind"])], run_model(log.opened)
    return kind.missions(model, model.tables(kind.needs(spec)), spec)


def _goals(logs: Sequence[InputLog]) -> tuple[dict[str, Any], dict[str, str]]:
    """Kind, action and topics of a robot that drives to goals; nothing where the logs name no goal server."""
    types = {name: kind for log in logs for name, kind in log.channels.items()}
    spec: dict[str, Any] = {}
    ros1 = sorted(name for name, kind in types.items() if kind.endswith("MoveBaseActionGoal"))
    nav2 = sorted(name for name in types if name.endswith("/_action/status") and "/navigate" in name)
    if ros1:
        spec = {"kind": "actionlib_goals", "action": ros1[0].rpartition("/")[0]}
    elif nav2:
        spec = {"kind": "nav2_goals", "action": [name.removesuffix("/_action/status") for name in nav2]}
    else:
        return {}, {}
    remarks = {}
    for part, kinds in _TYPES.items():
        topics = [name for name, kind in types.items() if kind.rpartition("/")[2] in kinds]
        if topics and _USUAL[part] not in topics:
            spec[part] = min(topics, key=lambda name: (len(name), name))
            others = ", ".join(sorted(set(topics) - {spec[part]}))
            remarks[part] = f"not {others}" if others else "the only one of its type"
    return spec, remarks


def _goal_lists(logs: Sequence[InputLog], spec: Mapping[str, Any]) -> list[tuple[Goal, ...]]:
    """The goals of every mission."""
    return [mission.shared(window).goals for log in logs for mission in _missions_in(log, spec)]


def _with_goals(spec: dict[str, Any], remarks: dict[str, str], goals: Sequence[tuple[Goal, ...]]) -> Missions:
    longest = max(goals, key=len)
    placed = all(math.isfinite(goal.x) for goal in longest)
    alike = placed and all(
        goal.offset(other.x, other.y) <= TOLERANCE_M
        for mission in goals
        for goal, other in zip(mission, longest, strict=False)
    )
    if alike:
        spec["goals"] = [[round(goal.x, 3), round(goal.y, 3)] for goal in longest]
        remarks["goals"] = f"the same in all {len(goals)} missions; limits belong to them"
    reached = [goal.time_s for mission in goals for goal in mission if goal.status == Status.SUCCEEDED]
    patience = max(GOAL_TIMEOUT_S, math.ceil(_SLACK * max(reached, default=0.0)))
    spec["goal_timeout_s"] = patience
    spec["tolerance_m"] = TOLERANCE_M
    slowest = f"the slowest that was reached took {max(reached):.0f} s" if reached else "no goal was reached"
    remarks["goal_timeout_s"] = f"{slowest}; a goal reached later counts as missed"
    return Missions(spec, remarks, alike)
