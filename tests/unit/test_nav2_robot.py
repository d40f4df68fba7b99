"""The robot that Nav2 drives: its world, body, laser, battery, failures, clock and recording, without ROS 2."""

from __future__ import annotations

import ast
import json
import math
import subprocess
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from care_core.application.case import Request, open_case
from care_core.collect.campaign import read_campaign
from care_core.logs.opening import open_log
from nav2_robot import again, clock, laser, parameters
from nav2_robot.__main__ import main
from nav2_robot.battery import Battery
from nav2_robot.failures import KINDS, Failure
from nav2_robot.recorder import FEEDBACK, STATUS, Recorder
from nav2_robot.robot import RADIUS, STEP_S, Robot
from nav2_robot.servers import installed
from nav2_robot.standin import StandIn, plan
from nav2_robot.world import CELL_M, Conditions, Passage, World
from tests.whole import examples

START = Path(__file__).parents[2] / "samples" / "nav2_robot" / "start" / "dwb.yaml"
ROOM = World(
    walls=((-1.2, -2.2, 6.2, -2.0), (-1.2, 2.0, 6.2, 2.2), (-1.2, -2.0, -1.0, 2.0), (6.0, -2.0, 6.2, 2.0)),
    clutter=(),
    passages=(Passage(3.0, 0.0, 3.9),),
    start=(0.0, 0.0, 0.0),
    goals=((1.2, 0.0, 0.0),),
)


def robot(failure: str = "", slip: float = 0.0, skid: bool = False, world: World = ROOM) -> Robot:
    parsed = Failure.parse(failure) if failure else None
    return Robot(Conditions(world, slip, 0.0, 1.0, seed=3), parsed, skid)


def driven(body: Robot, speed: float, turn: float, time_s: float) -> Robot:
    for _ in range(round(time_s / STEP_S)):
        body.command(speed, turn)
        body.step()
    return body


def test_a_laser_in_a_room_measures_its_walls() -> None:
    ranges = laser.scan(ROOM, (0.0, 0.0, 0.0), 0.0, np.random.default_rng(1))
    middle, side = laser.RAYS // 2, round(math.radians(90) / (laser.ANGLE_MAX - laser.ANGLE_MIN) * (laser.RAYS - 1))
    assert ranges[middle] == pytest.approx(6.0 - laser.AHEAD_M)
    assert ranges[middle + side] == pytest.approx(2.0)
    assert ranges[middle - side] == pytest.approx(2.0)


def test_beyond_the_longest_range_there_is_no_return_and_nothing_is_nearer_than_the_shortest() -> None:
    assert laser.limited(np.array([0.001, 5.0, 40.0])).tolist() == [laser.RANGE_MIN, 5.0, math.inf]


@settings(max_examples=examples(40), deadline=None)
@given(st.floats(-0.9, 5.9), st.floats(-1.9, 1.9))
def test_a_body_touches_a_wall_that_is_nearer_than_its_radius(x: float, y: float) -> None:
    nearest = min(x + 1.0, 6.0 - x, y + 2.0, 2.0 - y)
    if abs(nearest - RADIUS) > 1e-6:
        assert ROOM.touches(x, y, RADIUS) == (nearest < RADIUS)


def test_the_map_holds_the_walls_and_not_the_clutter() -> None:
    cells, (x, y) = World(ROOM.walls, ((2.0, 0.0, 2.4, 0.4),), (), ROOM.start, ROOM.goals).map()
    assert cells.shape == (round(4.4 / CELL_M), round(7.4 / CELL_M))
    assert (x, y) == (-1.2, -2.2)
    assert int((cells == 100).sum()) == 2 * 4 * cells.shape[1] + 2 * 4 * (cells.shape[0] - 8)


@pytest.mark.parametrize("seed", [1, 2, 6])
def test_each_seed_has_a_world_with_a_way_to_every_goal(seed: int) -> None:
    conditions = Conditions.of(seed)
    assert conditions == Conditions.of(seed)
    here = conditions.world.start[:2]
    assert not conditions.world.touches(*conditions.world.start[:2], RADIUS)
    goal = conditions.world.goals[-1]
    way = list(plan(conditions.world, here, goal))
    assert math.dist(way[-1], goal[:2]) < 0.3


def test_the_body_obeys_within_its_acceleration_and_stops_without_commands() -> None:
    body = driven(robot(), 0.5, 0.0, 2.0)
    assert body.odometry[0] == pytest.approx(2.0 * 0.5 - 0.5 * 0.5**2 / 1.5, abs=0.02)
    for _ in range(round(1.2 / STEP_S)):
        body.step()
    assert body.speed == 0.0


def test_slip_parts_odometry_from_the_truth_and_none_keeps_them_together() -> None:
    still, slipping = driven(robot(), 0.5, 0.1, 4.0), driven(robot(slip=0.1), 0.5, 0.1, 4.0)
    assert math.dist(still.pose[:2], still.odometry[:2]) < 0.01
    assert math.dist(slipping.pose[:2], slipping.odometry[:2]) > 0.01


def test_skid_steering_loses_part_of_each_turn_and_the_gyroscope_sees_it() -> None:
    wheels, skid = driven(robot(), 0.0, 1.0, 3.0), driven(robot(skid=True), 0.0, 1.0, 3.0)
    assert skid.pose[2] < 0.9 * wheels.pose[2]
    assert skid.odometry[2] == pytest.approx(skid.pose[2], abs=0.05)


def test_a_wall_stops_the_body_and_is_one_collision() -> None:
    body = driven(robot(), 1.0, 0.0, 8.0)
    assert body.collisions == 1
    assert body.pose[0] == pytest.approx(6.0 - RADIUS, abs=0.03)
    assert body.passed == 1


def test_what_is_no_number_is_no_command() -> None:
    body = robot()
    body.command(math.nan, 0.3)
    body.step()
    assert (body.speed, body.turn) == (0.0, 0.0)


def test_driving_draws_more_than_standing() -> None:
    stands, drives = driven(robot(), 0.0, 0.0, 2.0), driven(robot(), 0.5, 0.0, 2.0)
    assert drives.battery.drawn_j > 1.5 * stands.battery.drawn_j
    assert drives.battery.volts < stands.battery.volts


def test_a_battery_below_its_limit_cuts_out() -> None:
    assert Battery(1.0, lost_v=6.0).is_out
    assert not Battery(0.5).is_out


@pytest.mark.parametrize("kind", sorted(KINDS))
def test_each_failure_begins_when_it_says_and_shows(kind: str) -> None:
    size = {"stall": 30.0, "battery": 6.0}.get(kind, sum(KINDS[kind]) / 2)
    body, sound = robot(f"{kind}:1:{size}"), robot()
    driven(body, 0.5, 0.0, 0.9)
    driven(sound, 0.5, 0.0, 0.9)
    assert body.failing.began_s is None
    assert body.odometry == sound.odometry
    driven(body, 0.5, 0.0, 2.5)
    driven(sound, 0.5, 0.0, 2.5)
    assert body.failing.began_s is not None
    scans = [body.scan() for _ in range(2)]
    told = scans[1]
    shows = {
        "laser_dead": told is None,
        "laser_noise": told is not None and float(np.abs(np.diff(told[60:120])).mean()) > 0.1,
        "laser_stuck": scans[0] is scans[1],
        "odom_jump": math.dist(body.odometry[:2], body.pose[:2]) > 0.3,
        "odom_drift": math.dist(body.odometry[:2], body.pose[:2]) > 0.05,
        "drive_weak": body.distance < 0.7 * sound.distance,
        "drive_one_side": abs(body.pose[2]) > 0.2,
        "stall": body.speed == 0.0,
        "blocked": len(body.world.clutter) == 1,
        "battery": body.battery.is_out and body.speed == 0.0,
        "command_loss": body.distance < 0.9 * sound.distance,
    }
    assert shows[kind]


def test_a_failure_that_is_none_is_refused() -> None:
    for text in ("laser_lost:1:2", "stall:soon:3", "stall:1:2:3", "stall:nan:1"):
        with pytest.raises(ValueError, match=r"."):
            Failure.parse(text)


def test_a_parameter_file_is_read_by_node_and_name(tmp_path: Path) -> None:
    found = parameters.read(START)
    assert found["/controller_server"]["FollowPath.PathDist.scale"] == 32.0
    assert found["/local_costmap/local_costmap"]["inflation_layer.inflation_radius"] == 0.55
    assert parameters.number(found, "/controller_server", "controller_frequency", 1.0) == 10.0
    for text in ("a: [", "a: {b: 1}", "- 1"):
        (tmp_path / "bad.yaml").write_text(text)
        with pytest.raises(ValueError, match=r"."):
            parameters.read(tmp_path / "bad.yaml")


def test_a_drive_is_recorded_as_the_program_reads_nav2(tmp_path: Path) -> None:
    path = tmp_path / "drive.mcap"
    with Recorder(path) as recorder:
        assert StandIn(robot(slip=0.01), parameters.read(START), recorder).run() == 1
    log = open_log(path)
    counts = {channel.name: channel.count for channel in log.channels()}
    assert {STATUS, "/odom", "/cmd_vel", "/battery_state", "/plan", "/scan", "/rosout"} <= counts.keys()
    assert counts["/scan"] <= math.ceil(log.duration_s) + 1
    assert log.settings()["/controller_server.FollowPath.PathDist.scale"][0].value == 32.0
    assert not log.damage
    run = open_case(Request(path, profile="nav2"), lambda step, share: None).diagnosis.run
    assert run is not None
    assert run.metrics["goals_reached"] == 1.0
    assert run.objectives["mission_success"] == 1.0
    assert "inflation_radius_global" in run.config


def test_feedback_is_declared_with_all_that_it_is_made_of(tmp_path: Path) -> None:
    path = tmp_path / "feedback.mcap"
    with Recorder(path) as recorder:
        made = recorder.maker
        pose = made.make("geometry_msgs/Pose", made.make("geometry_msgs/Point", 1.0, 2.0, 0.0),
                         made.make("geometry_msgs/Quaternion", 0.0, 0.0, 0.0, 1.0))  # fmt: skip
        here = made.make("geometry_msgs/PoseStamped", made.header(0.0), pose)
        took = made.make("builtin_interfaces/Duration", 3, 0)
        types = made.store.types
        told = types["nav2_msgs/action/NavigateToPose_Feedback"](here, took, took, 2, 1.5)
        uuid = made.make("unique_identifier_msgs/UUID", np.full(16, 7, np.uint8))
        whole = types["nav2_msgs/action/NavigateToPose_FeedbackMessage"](uuid, told)
        for time_s in (0.0, 0.2, 0.5):
            recorder.record(FEEDBACK, time_s, whole)
    fields = ("feedback.number_of_recoveries", "feedback.current_pose.pose.position.y")
    table = open_log(path).read({FEEDBACK: fields})[FEEDBACK]
    assert [table[name].tolist() for name in fields] == [[2, 2], [2.0, 2.0]]


def test_the_command_drives_and_says_what_it_cannot(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--start", str(tmp_path)]) == 0
    assert (tmp_path / "nav2.yaml").read_text() == START.read_text()
    assert main(["--params", str(tmp_path / "none.yaml"), "--logs", str(tmp_path)]) == 2
    with pytest.raises(SystemExit):
        main(["--params", str(START), "--logs", str(tmp_path), "--fail", "nothing:1:2"])
    assert "none.yaml" in capsys.readouterr().err


def test_a_mission_with_a_failing_part_is_driven_again_whole(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The stand-in drives; what `care` says is made up."""
    known = tmp_path / "known.json"
    failing = ["--stand-in", "--fail", "stall:5:500", "--params", str(START), "--logs", str(tmp_path), "--seed", "2"]
    assert main([*failing, "--truth", str(known)]) == 0
    said = {"findings": [{"severity": "critical", "kind": "drive", "title": "it stalls"}], "fix": None}

    def run(words: Sequence[str], **_: object) -> subprocess.CompletedProcess[str]:
        if words[0] == "drive":
            main(["--stand-in", *words[1:]])
        return subprocess.CompletedProcess(words, 0, json.dumps(said))

    monkeypatch.setattr(subprocess, "run", run)
    assert again.main([str(known), "-o", str(tmp_path / "whole"), "--drive", "drive"]) == 0
    told = capsys.readouterr().out
    assert "missed   reached  it stalls" in told
    assert "missed a goal: 1, with a finding 1, the part named 1, advised a parameter 0" in told
    assert "driven again whole: 1, reached all 1" in told


def test_where_nav2_is_not_the_command_says_so_and_leaves_no_log(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    monkeypatch.setenv("ROS_DOMAIN_ID", "0")
    assert main(["--params", str(START), "--logs", str(tmp_path)]) == 2
    assert "no nav2_controller controller_server" in capsys.readouterr().err
    assert not list(tmp_path.glob("*.mcap"))


def test_a_server_is_found_in_the_first_prefix_that_has_it(tmp_path: Path) -> None:
    program = tmp_path / "b" / "lib" / "nav2_planner" / "planner_server"
    program.parent.mkdir(parents=True)
    program.touch()
    assert installed(f"{tmp_path / 'a'}:{tmp_path / 'b'}", "nav2_planner", "planner_server") == program


def test_the_clock_waits_for_a_command_that_is_due_and_no_longer_than_its_limit(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    answers, reminded = clock.Answers(0.1), [0]

    def remind() -> None:
        reminded[0] += 1

    def listen() -> None:
        if reminded[0]:
            answers.commanded(5.1)

    answers.wait(5.0, lambda: None, remind)
    answers.driving(True)
    answers.commanded(5.0)
    answers.wait(5.05, lambda: None, remind)
    assert reminded == [0]
    answers.wait(5.1, listen, remind)
    assert reminded[0] > 0
    assert answers.late == 0
    monkeypatch.setattr(clock, "LIMIT_S", 0.05)
    answers.wait(5.3, lambda: None, remind)
    assert answers.late == 1


def test_a_planner_that_waits_for_the_clock_is_not_waited_for_long(monkeypatch: pytest.MonkeyPatch) -> None:
    answers = clock.Answers(0.1)
    monkeypatch.setattr(clock, "PLAN_LIMIT_S", 0.05)
    answers.planning(True)
    answers.wait(5.0, lambda: None, lambda: None)
    assert answers.late == 0
    assert answers.waited_s > 0.0


def test_the_robot_is_a_stranger_to_the_program_and_only_its_node_needs_ros() -> None:
    for path in START.parents[1].glob("*.py"):
        for line in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            named = [line.module or ""] if isinstance(line, ast.ImportFrom) else []
            named += [one.name for one in line.names] if isinstance(line, ast.Import) else []
            strange = {"care_core", "care_tui"} | ({"rclpy"} if path.name != "node.py" else set())
            assert not {name.partition(".")[0] for name in named} & strange, path


@pytest.mark.parametrize(("controller", "profile"), [("dwb", "nav2"), ("mppi", "nav2-mppi"), ("rpp", "nav2-rpp")])
def test_each_controller_has_a_campaign_that_begins(tmp_path: Path, controller: str, profile: str) -> None:
    assert main(["--start", str(tmp_path), "--controller", controller]) == 0
    campaign = read_campaign(tmp_path / "campaign.yaml")
    assert campaign.schema.name == profile
    assert campaign.space.allows(campaign.space.reference)
