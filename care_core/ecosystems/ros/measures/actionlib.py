"""Goals of a ROS 1 action server such as move_base: sent on `goal`, answered on `result`."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from care_core.ecosystems.measures import MISSION_KINDS, Args, Mission, missing
from care_core.ecosystems.ros.measures.drive import GOAL_SERVERS, GoalServer, Leg, Recoveries, has, heading
from care_core.ecosystems.ros.measures.goals import GoalMissions
from care_core.logs.base import Table, Wanted
from care_core.run import Unavailable

KIND = "actionlib_goals"

_POSITION = "goal.target_pose.pose.position"
_ORIENTATION = "goal.target_pose.pose.orientation"
GOAL_FIELDS = (
    "goal_id.id",
    "goal.target_pose.header.frame_id",
    f"{_POSITION}.x",
    f"{_POSITION}.y",
    *(f"{_ORIENTATION}.{axis}" for axis in "xyzw"),
)
RESULT_FIELDS = ("status.goal_id.id", "status.status", "status.text")
RECOVERY_FIELDS = ("recovery_behavior_name",)


def _action(spec: Args) -> str:
    return str(spec.get("action", "/move_base"))


def _needs(spec: Args) -> Wanted:
    action = _action(spec)
    return {
        f"{action}/goal": GOAL_FIELDS,
        f"{action}/result": RESULT_FIELDS,
        f"{action}/recovery_status": RECOVERY_FIELDS,
    }


def find_legs(tables: Mapping[str, Table], spec: Args, duration_s: float) -> tuple[Leg, ...]:
    """Every goal of a log, in the order they were sent. A goal sent twice under one id counts once."""
    action = _action(spec)
    goals, results = tables.get(f"{action}/goal"), tables.get(f"{action}/result")
    if goals is None or not has(goals, GOAL_FIELDS):
        return ()
    ids = goals["goal_id.id"].tolist()
    first_rows = [row for row, one in enumerate(ids) if not one or one not in ids[:row]]
    yaws = heading(goals, _ORIENTATION)
    legs = []
    for place, row in enumerate(first_rows):
        sent_s = float(goals.t[row])
        next_sent_s = float(goals.t[first_rows[place + 1]]) if place + 1 < len(first_rows) else duration_s
        answer = _answer(results, ids[row], sent_s, next_sent_s)
        legs.append(
            Leg(
                x=float(goals[f"{_POSITION}.x"][row]),
                y=float(goals[f"{_POSITION}.y"][row]),
                yaw=float(yaws[row]),
                frame=str(goals["goal.target_pose.header.frame_id"][row]),
                sent_s=sent_s,
                # A goal that another one replaces is over when that one is sent, whenever its answer comes.
                end_s=next_sent_s if answer is None else min(float(answer[0]), max(next_sent_s, sent_s)),
                status=None if answer is None else answer[1],
                text="" if answer is None else answer[2],
            )
        )
    return tuple(legs)


def _answer(results: Table | None, goal_id: str, sent_s: float, next_sent_s: float) -> tuple[float, int, str] | None:
    """Time, status and text of a goal's result: the one of its id, or without an id the next in time."""
    if results is None or not has(results, RESULT_FIELDS):
        return None
    for row in np.flatnonzero(results.t >= sent_s):
        same = results["status.goal_id.id"][row] == goal_id if goal_id else results.t[row] <= next_sent_s
        if same:
            return float(results.t[row]), int(results["status.status"][row]), str(results["status.text"][row])
    return None


def recoveries(mission: Mission) -> Recoveries | Unavailable:
    """move_base tells of each recovery behavior that it begins."""
    channel = f"{_action(mission.spec)}/recovery_status"
    table = mission.table(channel)
    if table is None or not set(RECOVERY_FIELDS) <= table.columns.keys():
        return missing(channel)
    return tuple((float(t), str(name)) for t, name in zip(table.t, table["recovery_behavior_name"], strict=True))


GOAL_SERVERS[KIND] = GoalServer(_needs, find_legs, recoveries)
MISSION_KINDS[KIND] = GoalMissions(KIND, {"action": "namespace of the goal server, /move_base unless given"})
