"""Goals that are poses on a topic, of recordings without an action topic: whether the robot is there is judged by where
it stands."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from care_core.application.case import Request, open_case
from care_core.ecosystems.registry import run_model
from care_core.ecosystems.ros import ECOSYSTEM
from care_core.ecosystems.ros.drive import Drive as Model
from care_core.ecosystems.ros.posed_goals import section_of
from care_core.logs.base import Channel
from care_core.logs.opening import open_log
from care_core.report.terminal import to_text
from tests.ros_drives import ODOMETRY, STATUS, TWIST, Drive
from tests.ros_samples import ROS2, START_NS, make, stamp

POSE, COVERED = "geometry_msgs/msg/PoseStamped", "geometry_msgs/msg/PoseWithCovarianceStamped"
PATH, TF = "nav_msgs/msg/Path", "tf2_msgs/msg/TFMessage"
STOPS_AT_S = 20.0
OFF_M = 5.0
"""How far the frame of the map lies beside that of the odometry."""


class ToPose(Drive):
    """Goes straight on for 20 s at 0.5 m/s, to x = 10 m, and stands; its goal is a pose on the map."""

    goal_m: float = 10.0
    told_by: str = "/goal_pose"
    placed_by: str = "poses"
    """What tells where it is on the map: poses, tf, or nothing."""
    stops_at_s: float = STOPS_AT_S
    frame: str = "map"

    def messages(self) -> Iterator[tuple[str, str, float, Any]]:
        for topic, name, time_s, message in super().messages():
            if name == STATUS or (name == TWIST and time_s > self.stops_at_s):
                continue
            if name == TWIST:
                message.angular.z = 0.0
            yield topic, name, time_s, message
            if name == ODOMETRY and self.placed_by == "poses" and round(time_s * 5) % 10 == 0:
                yield "/amcl_pose", COVERED, time_s, self._on_map(time_s, message)
            if name == ODOMETRY and self.placed_by == "tf":
                yield "/tf", TF, time_s, self._transform(time_s)
        for number in range(3):
            yield self.told_by, PATH if self.told_by == "/plan" else POSE, 1.0 + number, self._goal(1.0 + number)

    def _driven(self, t: float, speed: float, turn: float) -> tuple[float, float]:
        return (0.5, 0.0) if t < self.stops_at_s else (0.0, 0.0)

    def _move(self, speed: float, turn: float, *, onset: bool, failing: bool) -> None:
        super()._move(speed, turn if failing else 0.0, onset=onset, failing=failing)

    def _odometry(self, t: float, speed: float, turn: float) -> Any:
        return super()._odometry(t, speed, turn if t > STOPS_AT_S else 0.0)

    def _on_map(self, t: float, odometry: Any) -> Any:
        place = odometry.pose.pose.position
        pose = make(ROS2, "geometry_msgs/msg/Pose", _point(place.x, place.y + OFF_M), odometry.pose.pose.orientation)
        covered = make(ROS2, "geometry_msgs/msg/PoseWithCovariance", pose, np.zeros(36))
        return make(ROS2, COVERED, _header(t, "map"), covered)

    def _transform(self, t: float) -> Any:
        moved = make(ROS2, "geometry_msgs/msg/Vector3", 0.0, OFF_M, 0.0)
        transform = make(ROS2, "geometry_msgs/msg/Transform", moved, _ahead())
        stamped = make(ROS2, "geometry_msgs/msg/TransformStamped", _header(t, "map"), "odom", transform)
        return make(ROS2, TF, [stamped])

    def _goal(self, t: float) -> Any:
        aside = OFF_M if self.frame == "map" else 0.0
        pose = make(ROS2, "geometry_msgs/msg/Pose", _point(self.goal_m, aside), _ahead())
        posed = make(ROS2, POSE, _header(t, self.frame), pose)
        return make(ROS2, PATH, _header(t, self.frame), [posed]) if self.told_by == "/plan" else posed


def _point(x: float, y: float) -> Any:
    return make(ROS2, "geometry_msgs/msg/Point", x, y, 0.0)


def _ahead() -> Any:
    return make(ROS2, "geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0)


def _header(t: float, frame: str) -> Any:
    return make(ROS2, "std_msgs/msg/Header", stamp(ROS2, START_NS + round(t * 1e9)), frame)


def model_of(drive: Drive, tmp_path: Path) -> Model:
    model = run_model(open_log(drive.write(tmp_path / "drive.mcap")))
    assert isinstance(model, Model)
    ECOSYSTEM.examine(model)
    return model


def page_of(drive: Drive, tmp_path: Path) -> str:
    case = open_case(Request(drive.write(tmp_path / "drive.mcap")), lambda _step, _share: None)
    return " ".join(to_text(case.diagnosis).split())


@pytest.mark.parametrize("told_by", ["/goal_pose", "/move_base_simple/goal", "/plan"])
@pytest.mark.parametrize(("placed_by", "frame"), [("poses", "map"), ("tf", "map"), ("", "odom")])
def test_a_robot_that_stands_at_its_goal_has_reached_it(
    told_by: str, placed_by: str, frame: str, tmp_path: Path
) -> None:
    (goal,) = model_of(ToPose(told_by=told_by, placed_by=placed_by, frame=frame), tmp_path).goals
    assert (goal.outcome, goal.sent_s) == ("reached", 1.0)
    assert goal.end_s == pytest.approx(STOPS_AT_S, abs=0.5)


@pytest.mark.parametrize(
    ("goal_m", "stops_at_s", "outcome"),
    [(10.4, 20.0, "reached"), (12.0, 20.0, "not reached"), (30.0, 99.0, "")],
)
def test_one_that_stands_elsewhere_has_not_and_one_under_way_may(
    goal_m: float, stops_at_s: float, outcome: str, tmp_path: Path
) -> None:
    (goal,) = model_of(ToPose(goal_m=goal_m, stops_at_s=stops_at_s), tmp_path).goals
    assert goal.outcome == outcome
    assert goal.failed is (outcome == "not reached")


def test_the_verdict_says_that_no_action_tells_how_the_goal_ended(tmp_path: Path) -> None:
    text = page_of(ToPose(goal_m=12.0), tmp_path)
    assert "FAULT: 0 of 1 goals were reached" in text
    assert "no action topic is recorded" in text
    assert "not reached after 39 s: 2.0 m from it at the end, less than 0.5 m of way in the last 10 s" in text
    assert "goals are told by /goal_pose alone: how they ended is judged by where the robot is" in text


@pytest.mark.parametrize(
    ("drive", "why"),
    [
        (ToPose(placed_by=""), "goals are in frame map, and where the robot is in it is not recorded"),
        (ToPose(goal_m=30.0, stops_at_s=99.0), "the recording ends while the robot is on its way to its last goal"),
    ],
)
def test_where_nothing_tells_whether_it_is_there_the_reason_is_given(drive: ToPose, why: str, tmp_path: Path) -> None:
    text = page_of(drive, tmp_path)
    assert text.startswith("NOT EVALUATED")
    assert f"no action topic is recorded, and {why}" in text


def test_an_action_tells_of_goals_itself() -> None:
    pose, status = Channel("/goal_pose", POSE, 3), Channel("/navigate_to_pose/_action/status", STATUS, 3)
    assert section_of([pose]) is not None
    assert section_of([pose, status]) is None
    assert section_of([Channel("/camera/pose", POSE, 100)]) is None


def test_a_target_that_moves_is_no_goal(tmp_path: Path) -> None:
    class Chasing(ToPose):
        def messages(self) -> Iterator[tuple[str, str, float, Any]]:
            yield from super().messages()
            for number in range(60):
                self.goal_m = 0.2 * number
                yield self.told_by, POSE, 5.0 + 0.5 * number, self._goal(5.0 + 0.5 * number)

    assert model_of(Chasing(), tmp_path).goals == ()
