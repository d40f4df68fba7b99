"""Goals that are poses on a topic, where no action topic is recorded: judged by where the robot is."""

from __future__ import annotations

from collections.abc import Sequence

from care_core.ecosystems.measures import MISSION_KINDS, Mission
from care_core.ecosystems.ros.goals import Goal
from care_core.ecosystems.ros.measures.goals import GoalMissions
from care_core.ecosystems.ros.measures.window import GOAL_SERVERS, GoalServer
from care_core.ecosystems.ros.posed_goals import ARRIVED_M, KIND, needs, posed_goals
from care_core.ecosystems.ros.recoveries import Recoveries
from care_core.records import replace
from care_core.run import OutcomeCheck, Unavailable

_HINT = "ros2 bag record --include-hidden-topics --all, or rosbag record --all"


def recoveries(mission: Mission) -> Recoveries | Unavailable:
    """Only an action tells of them."""
    return Unavailable("no action topic is recorded", _HINT)


def judged(sent: Sequence[Goal], check: OutcomeCheck) -> OutcomeCheck:
    """By where the robot is, and that it says so."""
    words = f"judged by where it stood, {ARRIVED_M} m around a goal: no action topic is recorded"
    if sent and sent[-1].status is None:
        why = sent[-1].text or "the recording ends while the robot is on its way to its last goal"
        return replace(check, value=Unavailable(f"no action topic is recorded, and {why}", _HINT))
    return replace(check, doc=f"{check.doc}; {words}", otherwise=f"{check.otherwise}; {words}")


GOAL_SERVERS[KIND] = GoalServer(needs, posed_goals, recoveries, judged=judged)
MISSION_KINDS[KIND] = GoalMissions(
    KIND,
    {
        "topic": "topic of geometry_msgs/PoseStamped, or of nav_msgs/Path that ends at goals; /goal_pose unless given",
        "poses": "topic of geometry_msgs/PoseWithCovarianceStamped on which a localisation says where the robot is",
    },
)
