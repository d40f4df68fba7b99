"""Goals that are poses on a topic, where no action topic is recorded: judged by where the robot is."""

from __future__ import annotations

from care_core.ecosystems.measures import MISSION_KINDS, Args, Mission
from care_core.ecosystems.ros.drive import Drive
from care_core.ecosystems.ros.goals import Goal
from care_core.ecosystems.ros.measures.goals import GoalMissions
from care_core.ecosystems.ros.measures.window import GOAL_SERVERS, GoalServer, window
from care_core.ecosystems.ros.posed_goals import ARRIVED_M, KIND, needs, posed_goals
from care_core.ecosystems.ros.recoveries import Recoveries
from care_core.records import replace
from care_core.run import Check, Unavailable

_HINT = "ros2 bag record --include-hidden-topics --all, or rosbag record --all"


def goals(drive: Drive, spec: Args) -> tuple[Goal, ...]:
    return posed_goals(drive, spec)


def recoveries(mission: Mission) -> Recoveries | Unavailable:
    """Only an action tells of them."""
    return Unavailable("no action topic is recorded", _HINT)


class PosedMissions(GoalMissions):
    """Goals that were sent as poses, where the recording holds no topic of an action: a robot that stood at one has
    reached it."""

    def outcome(self, mission: Mission) -> tuple[Check, ...]:
        """By where the robot is, and that it says so."""
        sent = mission.shared(window).goals
        words = f"judged by where it stood, {ARRIVED_M} m around a goal: no action topic is recorded"
        checks = super().outcome(mission)
        if sent and sent[-1].status is None:
            why = sent[-1].text or "the recording ends while the robot is on its way to its last goal"
            unknown = Unavailable(f"no action topic is recorded, and {why}", _HINT)
            return tuple(replace(one, value=unknown) for one in checks)
        return tuple(replace(one, doc=f"{one.doc}; {words}", otherwise=f"{one.otherwise}; {words}") for one in checks)


GOAL_SERVERS[KIND] = GoalServer(needs, goals, recoveries)
MISSION_KINDS[KIND] = PosedMissions(
    KIND,
    {
        "topic": "topic of geometry_msgs/PoseStamped, or of nav_msgs/Path that ends at goals; /goal_pose unless given",
        "poses": "topic of geometry_msgs/PoseWithCovarianceStamped on which a localisation says where the robot is",
    },
)
