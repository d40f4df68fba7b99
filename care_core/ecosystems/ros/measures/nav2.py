"""Goals of Nav2 on ROS 2: their states on the hidden status topic of the action, recoveries in the behavior tree's log.

The goal itself goes through a service, which is not recorded: where it lies is taken from `/goal_pose`, which RViz
publishes, else from the end of the first plan towards it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from care_core.ecosystems.measures import MISSION_KINDS, Args, Mission, extractor, has, missing, one_of
from care_core.ecosystems.ros.drive import Drive
from care_core.ecosystems.ros.goals import STATUS_TOPIC, Goal, nav2_goals, sent_again
from care_core.ecosystems.ros.measures.goals import GoalMissions
from care_core.ecosystems.ros.measures.requested import PER_GOAL, PER_METRE, divided
from care_core.ecosystems.ros.measures.window import GOAL_SERVERS, GoalServer, window
from care_core.ecosystems.ros.messages import FRAME, MESSAGES, STATUS, TREE, holds, yaw_of
from care_core.ecosystems.ros.motion import Poses
from care_core.ecosystems.ros.node_messages import ROSOUT_TOPICS
from care_core.ecosystems.ros.posed_goals import PLAN_FIELDS, POSE_FIELDS
from care_core.ecosystems.ros.recoveries import Recoveries, changes, repairs
from care_core.logs.base import Table, Wanted
from care_core.records import replace
from care_core.run import Unavailable, Value

KIND = "nav2_goals"
ACTIONS = ("/navigate_to_pose", "/navigate_through_poses")

_POSES = "poses.pose"
_PLACE = "feedback.current_pose"
FEEDBACK_FIELDS = tuple(f"{_PLACE}.{field}" for field in POSE_FIELDS)

_SAME_MOMENT_S = 1.0
"""RViz publishes the goal about when the action server accepts it."""


def _actions(spec: Args) -> tuple[str, ...]:
    given = spec.get("action", ACTIONS)
    return (given,) if isinstance(given, str) else tuple(given)


def _status_topic(action: str) -> str:
    return f"{action}{STATUS_TOPIC}"


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
        **{_status_topic(action): MESSAGES[STATUS].reads for action in _actions(spec)},
        _feedback_topic(_actions(spec)[0]): FEEDBACK_FIELDS,
        _pose_topic(spec): POSE_FIELDS,
        _plan_topic(spec): PLAN_FIELDS,
        _tree_topic(spec): MESSAGES[TREE].reads,
    }


def goals(drive: Drive, spec: Args) -> tuple[Goal, ...]:
    """Every goal of a log, in the order they were accepted, where it lies."""
    tables = drive.tables(_needs(spec))
    topics = {action: _status_topic(action) for action in _actions(spec)}
    states = {action: tables[topic] for action, topic in topics.items() if topic in tables}
    return sent_again([_placed(goal, tables, spec) for goal in nav2_goals(states, drive.duration_s)])


def _placed(goal: Goal, tables: Mapping[str, Table], spec: Args) -> Goal:
    poses, plans = tables.get(_pose_topic(spec)), tables.get(_plan_topic(spec))
    if has(poses, *POSE_FIELDS):
        rows = np.flatnonzero(np.abs(poses.t - goal.sent_s) <= _SAME_MOMENT_S)
        if len(rows):
            row = rows[-1]
            x, y = (float(poses[f"pose.position.{axis}"][row]) for axis in "xy")
            return replace(
                goal, x=x, y=y, yaw=float(yaw_of(poses, "pose.orientation")[row]), frame=str(poses[FRAME][row])
            )
    if not has(plans, *PLAN_FIELDS):
        return goal
    towards = np.flatnonzero((plans.t >= goal.sent_s) & (plans.t <= goal.end_s)).tolist()
    first = next((row for row in towards if len(plans[f"{_POSES}.position.x"][row])), None)
    if first is None:
        return goal
    x, y, z, w = (float(plans[name][first][-1]) for name in PLAN_FIELDS[1:])
    return replace(goal, x=x, y=y, yaw=2 * math.atan2(z, w), frame=str(plans[FRAME][first]))


def recoveries(mission: Mission) -> Recoveries | Unavailable:
    """Nodes of the behavior tree that repair something, each time one leaves IDLE."""
    table = _tree(mission)
    return table if isinstance(table, Unavailable) else repairs(table) or ()


def _tree(mission: Mission) -> Table | Unavailable:
    topic = _tree_topic(mission.spec)
    table = mission.table(topic)
    return missing(topic) if table is None or not holds(table, TREE) else table


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
    table = _tree(mission)
    if isinstance(table, Unavailable):
        return table
    wanted, status = str(args.get("node", "")).casefold(), str(args.get("status", "FAILURE")).upper()
    return float(sum(after == status and wanted in name.casefold() for _, name, _, after in changes(table)))


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
    if not has(table, *PLAN_FIELDS):
        return missing(topic)
    sent = mission.shared(window).goals
    rows = [np.flatnonzero((table.t >= goal.sent_s) & (table.t <= goal.end_s)) for goal in sent]
    firsts = [planned[0] for planned in rows if len(planned)]
    if not firsts:
        return Unavailable("no plan was made for a goal", "was there a way to it?")
    return float(sum(_length(table, row) for row in firsts))


def _length(table: Table, row: int) -> float:
    x, y = (np.asarray(table[f"{_POSES}.position.{axis}"][row], np.float64) for axis in "xy")
    return float(np.hypot(np.diff(x), np.diff(y)).sum())


def poses(mission: Mission) -> Poses | None:
    """Where the navigator said that the robot was, while it was on its way to a goal."""
    table = mission.table(_feedback_topic(_actions(mission.spec)[0]))
    if not has(table, *FEEDBACK_FIELDS):
        return None
    x, y = (np.asarray(table[f"{_PLACE}.pose.position.{axis}"], np.float64) for axis in "xy")
    yaw = yaw_of(table, f"{_PLACE}.pose.orientation")
    known = np.isfinite(x + y + yaw)
    frames = table[f"{_PLACE}.{FRAME}"][known]
    if not len(frames) or not (frames == frames[0]).all():
        return None
    return Poses(table.t[known], x[known], y[known], yaw[known], str(frames[0]))


GOAL_SERVERS[KIND] = GoalServer(_needs, goals, recoveries, poses)
MISSION_KINDS[KIND] = GoalMissions(
    KIND,
    {
        "action": "name of the action, or a list of them; /navigate_to_pose and /navigate_through_poses unless given",
        "goal_pose": "topic of geometry_msgs/PoseStamped, /goal_pose unless given",
        "plan": "topic of nav_msgs/Path, /plan unless given",
        "behavior_tree": "topic of nav2_msgs/BehaviorTreeLog, /behavior_tree_log unless given",
    },
    ROSOUT_TOPICS[:1],  # ROS 2 has no /rosout_agg
)
