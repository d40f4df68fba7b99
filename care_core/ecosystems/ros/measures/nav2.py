"""Goals of Nav2 on ROS 2: their states on the hidden status topic of the action, recoveries in the behavior tree's log.

The goal itself goes through a service, which is not recorded: where it lies is taken from `/goal_pose`, which RViz
publishes, else from the end of the first plan towards it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import numpy as np

from care_core.ecosystems.measures import MISSION_KINDS, Args, Mission, extractor, missing, one_of
from care_core.ecosystems.ros.measures.drive import (
    GOAL_SERVERS,
    GoalServer,
    Leg,
    Poses,
    Recoveries,
    Status,
    has,
    heading,
)
from care_core.ecosystems.ros.measures.goals import ROSOUT, GoalMissions
from care_core.ecosystems.ros.measures.requested import PER_GOAL, PER_METRE, divided
from care_core.logs.base import Table, Wanted
from care_core.records import Record, Struct
from care_core.run import Unavailable, Value

KIND = "nav2_goals"
ACTIONS = ("/navigate_to_pose", "/navigate_through_poses")

STATUS_FIELDS = ("status_list.goal_info.goal_id.uuid", "status_list.status")
TREE_FIELDS = ("event_log.node_name", "event_log.previous_status", "event_log.current_status")
POSE_FIELDS = (
    "header.frame_id",
    "pose.position.x",
    "pose.position.y",
    *(f"pose.orientation.{axis}" for axis in "xyzw"),
)
_POSES = "poses.pose"
PLAN_FIELDS = (
    "header.frame_id",
    f"{_POSES}.position.x",
    f"{_POSES}.position.y",
    f"{_POSES}.orientation.z",
    f"{_POSES}.orientation.w",
)

_PLACE = "feedback.current_pose"
FEEDBACK_FIELDS = (
    f"{_PLACE}.header.frame_id",
    f"{_PLACE}.pose.position.x",
    f"{_PLACE}.pose.position.y",
    *(f"{_PLACE}.pose.orientation.{axis}" for axis in "xyzw"),
)

_ENDS = {4: Status.SUCCEEDED, 5: Status.PREEMPTED, 6: Status.ABORTED}
"""Final codes of action_msgs/GoalStatus (1 accepted, 2 executing, 3 canceling)."""

_RECOVERIES = ("spin", "backup", "wait", "driveonheading", "assistedteleop", "clearlocalcostmap", "clearglobalcostmap",
               "clearentirecostmap", "clearcostmap")  # fmt: skip
"""How the names of tree nodes that repair something begin."""

_SAME_MOMENT_S = 1.0
"""RViz publishes the goal about when the action server accepts it."""


class _Place(Record):
    """Where a goal lies: m, rad, and the frame."""

    x: float = math.nan
    y: float = math.nan
    yaw: float = math.nan
    frame: str = ""


class _Goal(Struct, eq=False):
    """A goal as its states tell it."""

    sent_s: float
    ended_s: float | None = None
    status: int | None = None


def _actions(spec: Args) -> tuple[str, ...]:
    given = spec.get("action", ACTIONS)
    return (given,) if isinstance(given, str) else tuple(given)


def _status_topic(action: str) -> str:
    return f"{action}/_action/status"


def _feedback_topic(action: str) -> str:
    return f"{action}/_action/feedback"


def _pose_topic(spec: Args) -> str:
    return str(spec.get("goal_pose", "/goal_pose"))


def _plan_topic(spec: Args) -> str:
    return str(spec.get("plan", "/plan"))


def _tree_topic(spec: Args) -> str:
    return str(spec.get("behavior_tree", "/behavior_tree_log"))


def _needs(spec: Args) -> Wanted:
    return {
        **{_status_topic(action): STATUS_FIELDS for action in _actions(spec)},
        _feedback_topic(_actions(spec)[0]): FEEDBACK_FIELDS,
        _pose_topic(spec): POSE_FIELDS,
        _plan_topic(spec): PLAN_FIELDS,
        _tree_topic(spec): TREE_FIELDS,
    }


def find_legs(tables: Mapping[str, Table], spec: Args, duration_s: float) -> tuple[Leg, ...]:
    """Every goal of a log, in the order they were accepted.

    A goal that was over before the log began (its last state is repeated to every new listener) is none of them. One
    that another replaces is over when that one is accepted; Nav2 calls it aborted then, though nobody gave up.
    """
    found = [goal for action in _actions(spec) for goal in _goals(tables.get(_status_topic(action)))]
    found.sort(key=lambda goal: goal.sent_s)
    legs = []
    for number, goal in enumerate(found):
        next_s = found[number + 1].sent_s if number + 1 < len(found) else duration_s
        ended_s, status = goal.ended_s, goal.status
        if ended_s is not None and ended_s >= next_s and number + 1 < len(found):
            ended_s, status = next_s, Status.PREEMPTED
        place = _place(tables, spec, goal.sent_s, next_s if ended_s is None else ended_s)
        end_s = next_s if ended_s is None else ended_s
        legs.append(Leg(place.x, place.y, place.yaw, place.frame, goal.sent_s, end_s, status))
    return tuple(legs)


def _goals(table: Table | None) -> list[_Goal]:
    """Goals by their id: when a state was first told, and the final one."""
    goals: dict[bytes, _Goal] = {}
    if table is None or not has(table, STATUS_FIELDS):
        return []
    over_before: set[bytes] = set()
    for time_s, ids, codes in zip(table.t.tolist(), *(table[name] for name in STATUS_FIELDS), strict=True):
        for uuid, code in zip(ids, codes, strict=True):
            key, end = bytes(bytearray(uuid)), _ENDS.get(int(code))
            if key not in goals and (end is not None or key in over_before):
                over_before.add(key)
                continue
            goal = goals.setdefault(key, _Goal(time_s))
            if end is not None and goal.status is None:
                goal.ended_s, goal.status = time_s, end
    return list(goals.values())


def _place(tables: Mapping[str, Table], spec: Args, sent_s: float, end_s: float) -> _Place:
    poses = tables.get(_pose_topic(spec))
    if poses is not None and has(poses, POSE_FIELDS):
        rows = np.flatnonzero(np.abs(poses.t - sent_s) <= _SAME_MOMENT_S)
        if len(rows):
            row = rows[-1]
            x, y = (float(poses[f"pose.position.{axis}"][row]) for axis in "xy")
            return _Place(x, y, float(heading(poses, "pose.orientation")[row]), str(poses["header.frame_id"][row]))
    plans = tables.get(_plan_topic(spec))
    if plans is None or not has(plans, PLAN_FIELDS):
        return _Place()
    towards = np.flatnonzero((plans.t >= sent_s) & (plans.t <= end_s)).tolist()
    first = next((row for row in towards if len(plans[f"{_POSES}.position.x"][row])), None)
    return _Place() if first is None else _plan_end(plans, first)


def _plan_end(plans: Table, row: int) -> _Place:
    x, y, z, w = (float(plans[name][row][-1]) for name in PLAN_FIELDS[1:])
    return _Place(x, y, 2 * math.atan2(z, w), str(plans["header.frame_id"][row]))


def recoveries(mission: Mission) -> Recoveries | Unavailable:
    """Nodes of the behavior tree that repair something, each time one leaves IDLE."""
    changes = _tree_changes(mission)
    if isinstance(changes, Unavailable):
        return changes
    return tuple((t, name) for t, name, before, _ in changes if before == "IDLE" and _repairs(name))


def _repairs(name: str) -> bool:
    return name.replace("_", "").casefold().startswith(_RECOVERIES)


def _tree_changes(mission: Mission) -> list[tuple[float, str, str, str]] | Unavailable:
    """Time, node, state before and state after of each change in the behavior tree."""
    topic = _tree_topic(mission.spec)
    table = mission.table(topic)
    if table is None or not set(TREE_FIELDS) <= table.columns.keys():
        return missing(topic)
    return list(_changes(table))


def _changes(table: Table) -> Iterator[tuple[float, str, str, str]]:
    for time_s, *lists in zip(table.t.tolist(), *(table[name] for name in TREE_FIELDS), strict=True):
        for name, before, after in zip(*lists, strict=True):
            yield time_s, str(name), str(before).upper(), str(after).upper()


@extractor("tree_count", needs={}, unit="", parts=("behavior_tree",), args={
    "node": "text in the node's name, such as ComputePathToPose or FollowPath",
    "status": one_of(
        "state that it comes to: RUNNING, SUCCESS or FAILURE; FAILURE unless given", "RUNNING", "SUCCESS", "FAILURE"
    ),
    **PER_GOAL,
})  # fmt: skip
@divided
def tree_count(mission: Mission, args: Args) -> Value:
    """How often a node of the behavior tree came to a state: what the planner or the controller failed at."""
    changes = _tree_changes(mission)
    if isinstance(changes, Unavailable):
        return changes
    wanted, status = str(args.get("node", "")).casefold(), str(args.get("status", "FAILURE")).upper()
    return float(sum(after == status and wanted in name.casefold() for _, name, _, after in changes))


@extractor("plans", needs={}, unit="", parts=("plan",))
def plans(mission: Mission, args: Args) -> Value:
    """Number of plans that were made, the first of each goal and every later one."""
    topic = _plan_topic(mission.spec)
    table = mission.table(topic)
    return missing(topic) if table is None else float(len(table))


@extractor("plan_length", needs={}, unit="m", parts=("goals", "plan"), args=PER_METRE)
@divided
def plan_length(mission: Mission, args: Args) -> Value:
    """Length of the first plan of each goal, summed over the goals: the way that was meant."""
    topic = _plan_topic(mission.spec)
    table = mission.table(topic)
    if table is None or not has(table, PLAN_FIELDS):
        return missing(topic)
    legs = find_legs(mission.tables, mission.spec, mission.end_s)
    rows = [np.flatnonzero((table.t >= leg.sent_s) & (table.t <= leg.end_s)) for leg in legs]
    firsts = [own[0] for own in rows if len(own)]
    if not firsts:
        return Unavailable("no plan was made for a goal", "was there a way to it?")
    return float(sum(_length(table, row) for row in firsts))


def _length(table: Table, row: int) -> float:
    x, y = (np.asarray(table[f"{_POSES}.position.{axis}"][row], np.float64) for axis in "xy")
    return float(np.hypot(np.diff(x), np.diff(y)).sum())


def poses(mission: Mission) -> Poses | None:
    """Where the navigator said that the robot was, while it was on its way to a goal."""
    table = mission.table(_feedback_topic(_actions(mission.spec)[0]))
    if table is None or not has(table, FEEDBACK_FIELDS):
        return None
    x, y = (np.asarray(table[f"{_PLACE}.pose.position.{axis}"], np.float64) for axis in "xy")
    yaw = heading(table, f"{_PLACE}.pose.orientation")
    told = np.isfinite(x + y + yaw)
    frames = table[f"{_PLACE}.header.frame_id"][told]
    if not len(frames) or not (frames == frames[0]).all():
        return None
    return Poses(table.t[told], x[told], y[told], yaw[told], str(frames[0]))


GOAL_SERVERS[KIND] = GoalServer(_needs, find_legs, recoveries, poses)
MISSION_KINDS[KIND] = GoalMissions(
    KIND,
    {
        "action": "name of the action, or a list of them; /navigate_to_pose and /navigate_through_poses unless given",
        "goal_pose": "topic of geometry_msgs/PoseStamped, /goal_pose unless given",
        "plan": "topic of nav_msgs/Path, /plan unless given",
        "behavior_tree": "topic of nav2_msgs/BehaviorTreeLog, /behavior_tree_log unless given",
    },
    ROSOUT[:1],  # ROS 2 has no /rosout_agg
)
