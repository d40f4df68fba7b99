"""Which robot a recording is of, and whether it tells of its goals to the end."""

from __future__ import annotations

from pathlib import Path

import pytest

import care_core
from care_core.application.case import Case
from care_core.diagnose.verdict import verdict_of
from care_core.ecosystems.ros.namespaces import is_of, robot_namespaces
from care_core.errors import ExitCode
from care_core.files import bundled
from care_core.logs.base import Channel
from tests.mixed import in_namespace, mix, until

GOOD, FAILED = (bundled("samples") / f"nav2_{name}.mcap" for name in ("good", "failed"))
ODOMETRY, TWIST, SCAN = "nav_msgs/msg/Odometry", "geometry_msgs/msg/Twist", "sensor_msgs/msg/LaserScan"


def channels(**names: str) -> list[Channel]:
    kinds = {"odom": ODOMETRY, "cmd": TWIST, "scan": SCAN}
    return [Channel(name, kinds[kind], 9) for kind, listed in names.items() for name in listed.split()]


@pytest.mark.parametrize(
    ("there", "robots"),
    [
        (channels(odom="/odom", cmd="/cmd_vel", scan="/scan"), ()),
        (channels(odom="/odom /r2/odom", cmd="/cmd_vel /r2/cmd_vel"), ("", "/r2")),
        (channels(odom="/r1/odom /r2/odom", scan="/r1/scan /r2/scan"), ("/r1", "/r2")),
        (channels(odom="/fleet/r1/odom /fleet/r2/odom", cmd="/fleet/r1/cmd /fleet/r2/cmd"), ("/fleet/r1", "/fleet/r2")),
        (channels(odom="/a/base/odom /b/base/odom", scan="/a/scan /b/scan"), ("/a", "/b")),
        (channels(odom="/odom /odom_kf /odom_noisy", cmd="/cmd_vel /cmd_vel_smoothed"), ()),
        (channels(odom="/odom /diff_controller/odom", cmd="/cmd_vel /diff_controller/cmd_vel"), ()),
        (channels(odom="/odom /camera/odom", scan="/scan"), ()),
        (channels(odom="/odom", scan="/front/scan /rear/scan", cmd="/cmd_vel /mux/cmd_vel"), ()),
        ([*channels(odom="/odom", cmd="/c"), Channel("/r2/odom", ODOMETRY, 0), Channel("/r2/c", TWIST, 0)], ()),
    ],
)  # fmt: skip
def test_robots_are_told_apart_by_their_name_spaces(there: list[Channel], robots: tuple[str, ...]) -> None:
    assert robot_namespaces(there) == robots


def test_what_is_in_no_name_space_is_of_the_robot_that_has_none_else_of_all() -> None:
    assert is_of("/tf", "", ("", "/r2"))
    assert not is_of("/tf", "/r2", ("", "/r2"))
    assert is_of("/map", "/r2", ("/r1", "/r2"))
    assert not is_of("/r1/odom", "/r2", ("/r1", "/r2"))


def code(case: Case) -> ExitCode:
    return verdict_of(case.diagnosis).exit_code


def said(case: Case) -> str:
    return " ".join(case.report("text").split())


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> Case:
    path = tmp_path_factory.mktemp("two") / "two.mcap"
    return care_core.triage(mix(path, (GOOD, lambda topic, _: topic), (FAILED, in_namespace("/robot2"))))


def test_a_robot_that_failed_beside_the_one_that_did_well_is_no_ok(two: Case) -> None:
    assert code(two) is ExitCode.FAULT
    assert "robot /robot2, in the same recording: its goal was not reached" in said(two)
    assert "robot /robot2: goal 1 cancelled after 60 s" in said(two)
    assert {one.status for one in two.diagnosis.objectives} == {"ok"}


def test_what_another_robot_set_is_none_of_this_ones_parameters(two: Case) -> None:
    assert two.reading is not None
    assert two.reading.judged.run.config["xy_goal_tolerance"] == 0.25


def test_a_robot_that_failed_is_told_its_own_cause_beside_a_good_one(tmp_path: Path) -> None:
    case = care_core.triage(mix(tmp_path / "a.mcap", (FAILED, lambda topic, _: topic), (GOOD, in_namespace("/robot2"))))
    assert "Change xy_goal_tolerance 0.04 -> 0.25" in said(case)
    assert "robot /robot2 is in this recording, too: this answer is of the robot without a name space" in said(case)


def test_two_robots_in_name_spaces_are_both_told_without_a_profile(tmp_path: Path) -> None:
    case = care_core.triage(mix(tmp_path / "a.mcap", (GOOD, in_namespace("/r1")), (FAILED, in_namespace("/r2"))))
    assert code(case) is ExitCode.FAULT
    assert "robot /r2, in the same recording: its goal was not reached" in said(case)


@pytest.mark.parametrize(
    ("end_s", "parts"),
    [
        (39.0, ("status",)),
        (39.0, ("_action",)),
        (39.0, ("_action", "plan", "behavior", "rosout")),
        (42.0, ("_action",)),
    ],
    ids=["states", "all of the action", "all of navigation", "while a goal is under way"],
)
def test_goals_that_are_told_of_no_more_while_the_robot_drives_on_are_not_evaluated(
    tmp_path: Path, end_s: float, parts: tuple[str, ...]
) -> None:
    case = care_core.triage(mix(tmp_path / "a.mcap", (GOOD, until(end_s, *parts))))
    assert code(case) is ExitCode.NOT_EVALUATED
    assert "though the robot drives on" in said(case)
