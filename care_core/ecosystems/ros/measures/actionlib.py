"""Goals of a ROS 1 action server such as move_base: sent on `goal`, answered on `result`."""

from __future__ import annotations

from care_core.ecosystems.measures import MISSION_KINDS, Args, Mission, has, missing
from care_core.ecosystems.ros.drive import Drive
from care_core.ecosystems.ros.goals import Goal, actionlib_goals, sent_again
from care_core.ecosystems.ros.measures.goals import GoalMissions
from care_core.ecosystems.ros.measures.window import GOAL_SERVERS, GoalServer
from care_core.ecosystems.ros.messages import ACTION_GOAL, ACTION_RESULT, MESSAGES, RECOVERY
from care_core.ecosystems.ros.recoveries import Recoveries, announced
from care_core.logs.base import Wanted
from care_core.run import Unavailable

KIND = "actionlib_goals"


def _action(spec: Args) -> str:
    return str(spec.get("action", "/move_base"))


def _needs(spec: Args) -> Wanted:
    parts = {"goal": ACTION_GOAL, "result": ACTION_RESULT, "recovery_status": RECOVERY}
    return {f"{_action(spec)}/{part}": MESSAGES[type].reads for part, type in parts.items()}


def goals(drive: Drive, spec: Args) -> tuple[Goal, ...]:
    """Every goal that is a place, in the order they were sent."""
    action, tables = _action(spec), drive.tables(_needs(spec))
    sent = tables.get(f"{action}/goal")
    if not has(sent, *MESSAGES[ACTION_GOAL].reads):
        return ()
    return sent_again(actionlib_goals(action, sent, tables.get(f"{action}/result"), drive.duration_s))


def recoveries(mission: Mission) -> Recoveries | Unavailable:
    """move_base tells of each recovery behavior that it begins."""
    channel = f"{_action(mission.spec)}/recovery_status"
    table = mission.table(channel)
    ran = None if table is None else announced(table)
    return missing(channel) if ran is None else ran


GOAL_SERVERS[KIND] = GoalServer(_needs, goals, recoveries)
MISSION_KINDS[KIND] = GoalMissions(KIND, {"action": "namespace of the goal server, /move_base unless given"})
