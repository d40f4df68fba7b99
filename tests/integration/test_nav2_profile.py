"""The nav2 profile: Nav2's own names, the reference that was driven, and what it says of robots that it was not."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from care_core.configs.driven import option_value, readable
from care_core.configs.loading import read_configs, resolve
from care_core.ecosystems.registry import run_model
from care_core.extract.read import read_run
from care_core.logs.opening import open_log
from care_core.profile.store import load_profile
from nav2_robot import parameters
from tests.conftest import Care
from tests.courier import TOLERANCE, USUAL, deliver

SAMPLES = Path(__file__).parents[2] / "samples"
STARTS = SAMPLES / "nav2_robot" / "start"
PROFILES = [("nav2", "dwb"), ("nav2-mppi", "mppi"), ("nav2-rpp", "rpp")]
"""With the controller that each was driven with."""
FOLLOW, CHECKER = "/controller_server.FollowPath.", "/controller_server.general_goal_checker."
WAIT = "/bt_navigator.default_server_timeout"
SHIPPED = {
    f"{FOLLOW}max_vel_x": 0.26, f"{FOLLOW}max_speed_xy": 0.26, f"{FOLLOW}max_vel_theta": 1.0, f"{FOLLOW}acc_lim_x": 2.5,
    f"{FOLLOW}min_vel_x": 0.0, f"{FOLLOW}sim_time": 1.7, f"{FOLLOW}vx_samples": 20, f"{FOLLOW}vtheta_samples": 20,
    f"{FOLLOW}PathDist.scale": 32.0, f"{FOLLOW}PathAlign.scale": 32.0, f"{FOLLOW}GoalDist.scale": 24.0,
    f"{FOLLOW}GoalAlign.scale": 24.0, f"{FOLLOW}BaseObstacle.scale": 0.02, f"{CHECKER}xy_goal_tolerance": 0.25,
    f"{CHECKER}yaw_goal_tolerance": 0.25, "/controller_server.controller_frequency": 20.0,
}  # fmt: skip
"""What Nav2's own parameters (humble) say of the controller."""


def drive(path: Path, *, arrives: bool = True, **changed: float) -> Path:
    """A drive of the courier under Nav2's own parameters; the goal is aborted where it does not arrive."""
    own = {**SHIPPED, **{f"{FOLLOW}{name.replace('__', '.')}": value for name, value in changed.items()}}
    return deliver(path, {**USUAL, TOLERANCE: 0.25 if arrives else 0.05, **own}, np.random.default_rng(3))


def test_a_drive_is_read_under_the_names_of_nav2(tmp_path: Path) -> None:
    run = read_run(run_model(open_log(drive(tmp_path / "a.mcap"))), load_profile("nav2").schema)
    assert run.config["path_dist_scale"] == 32.0
    assert run.config["controller_frequency"] == 20.0
    assert len(run.config) == 13
    assert run.objectives["mission_success"] == 1.0
    assert run.value("top_speed") == pytest.approx(0.26, abs=0.03)


@pytest.mark.parametrize(("name", "controller"), PROFILES)
def test_defaults_are_those_that_the_reference_was_driven_with(name: str, controller: str) -> None:
    schema, start = load_profile(name).schema, STARTS / f"{controller}.yaml"
    driven = resolve(read_configs([str(start)]), {one for option in schema.options for one in readable(option)})
    for option in schema.options:
        assert {option_value(option, driven[one]) for one in readable(option)} == {option.default}, option.name


@pytest.mark.parametrize(("name", "controller"), PROFILES)
def test_each_profile_is_of_one_controller_and_planner(name: str, controller: str) -> None:
    driven = parameters.read(STARTS / f"{controller}.yaml")
    for key, (text, *_others) in load_profile(name).schema.plugins.items():
        node, _, parameter = key.partition(".")
        assert text in str(driven[node][parameter])


def test_a_drive_of_which_little_is_recorded_fits_in_part(care: Care, tmp_path: Path) -> None:
    log = drive(tmp_path / "a.mcap", arrives=False, BaseObstacle__scale=1.0)
    report = json.loads(care("triage", log, "--profile", "nav2", "--json").stdout)
    assert report["fit"]["verdict"] == "partly"
    assert report["fix"] is None
    assert {cause["confidence"] for fault in report["faults"] for cause in fault["causes"]} <= {"low"}
    judged = {one["name"]: one["status"] for one in report["objectives"]}
    assert judged == {"mission_success": "fault", "mission_time": "not_evaluated", "energy": "not_evaluated"}


def test_nav2_is_read_by_its_own_profile_unasked(care: Care, tmp_path: Path) -> None:
    answer = care("triage", drive(tmp_path / "a.mcap", arrives=False), "--json")
    assert json.loads(answer.stdout)["profile"]["name"] == "nav2"


def test_a_good_drive_whose_goals_lie_nowhere_is_given_no_limits(care: Care, tmp_path: Path) -> None:
    answer = care("triage", drive(tmp_path / "a.mcap"), "--profile", "nav2", "--json")
    report = json.loads(answer.stdout)
    assert report["faults"] == []
    time = next(one for one in report["objectives"] if one["name"] == "mission_time")
    assert time["status"] == "not_evaluated"
    assert care("triage", drive(tmp_path / "b.mcap"), "--profile", "nav2", "--threshold", "mission_time=5").code == 1


def test_the_good_sample_keeps_limits_that_nobody_gave(care: Care) -> None:
    answer = care("triage", SAMPLES / "nav2_good.mcap", "--json")
    report = json.loads(answer.stdout)
    assert answer.code == 0
    assert report["fit"]["verdict"] == "fits"
    assert {one["status"] for one in report["objectives"]} == {"ok"}


def test_the_failed_sample_is_led_back_to_its_tolerance(care: Care) -> None:
    report = json.loads(care("triage", SAMPLES / "nav2_failed.mcap", "--json").stdout)
    assert report["faults"][0]["causes"][0]["option"] == "xy_goal_tolerance"
    assert [(change["option"], change["to"]) for change in report["fix"]["changes"]] == [("xy_goal_tolerance", 0.25)]


def test_the_sample_whose_drive_stalled_is_given_no_parameter(care: Care) -> None:
    answer = care("triage", SAMPLES / "nav2_stall.mcap", "--json")
    report = json.loads(answer.stdout)
    assert answer.code == 1
    assert report["fix"] is None
    assert "drive" in report["abstained"]


def test_nav2_configuration_files_are_read_under_the_same_names(recorded: Path) -> None:
    schema = load_profile("nav2").schema
    wanted = {parameter for option in schema.options for parameter in readable(option)}
    files = read_configs([str(recorded / "logs/configs/nav2/linorobot2_navigation.yaml")])
    held = resolve(files, wanted)
    assert held["/local_costmap/local_costmap.inflation_layer.inflation_radius"].value == 0.55
    assert held[f"{CHECKER}xy_goal_tolerance"].value == 0.25
    assert len(held) >= 15


def test_a_mission_that_mppi_lost_is_led_back_to_the_weight_of_its_goal(care: Care) -> None:
    report = json.loads(care("triage", SAMPLES / "nav2_mppi_failed.mcap", "--json").stdout)
    assert (report["profile"]["name"], report["fit"]["verdict"]) == ("nav2-mppi", "fits")
    assert report["hypotheses"][0]["name"] == "goal_weight"
    assert ("goal_weight", 5.0) in [(change["option"], change["to"]) for change in report["fix"]["changes"]]


def test_a_pursuit_that_does_not_turn_on_the_spot_is_told_to(care: Care) -> None:
    report = json.loads(care("triage", SAMPLES / "nav2_rpp_failed.mcap", "--json").stdout)
    assert (report["profile"]["name"], report["fit"]["verdict"]) == ("nav2-rpp", "fits")
    assert report["hypotheses"][0]["name"] == "use_rotate_to_heading"
    assert [(change["option"], change["to"]) for change in report["fix"]["changes"]] == [("use_rotate_to_heading", 1.0)]


def test_a_goal_that_was_given_up_for_want_of_an_answer_is_repaired_in_the_file(care: Care, tmp_path: Path) -> None:
    """Nav2's own file of Jazzy on a busy computer: no option of the profile, and the change that the log shows."""
    answer = care("triage", SAMPLES / "nav2_stock_failed.mcap", "--json", "--out", tmp_path / "report.json")
    (change,) = json.loads((tmp_path / "report.json").read_text())["fix"]["changes"]
    assert answer.code == 1
    assert (change["option"], change["from"], change["to"]) == (WAIT, 20, 1000)
    file = tmp_path / "nav2.yaml"
    file.write_text("bt_navigator:\n  ros__parameters:\n    default_server_timeout: 20  # ms\n")
    assert care("apply", tmp_path / "report.json", file, "-o", tmp_path / "fixed.yaml").code == 0
    assert "default_server_timeout: 1000  # ms" in (tmp_path / "fixed.yaml").read_text()


def test_no_report_sets_another_parameter_of_a_ros_robot(care: Care, tmp_path: Path) -> None:
    care("triage", SAMPLES / "nav2_stock_failed.mcap", "--out", tmp_path / "report.json")
    text = (tmp_path / "report.json").read_text().replace(WAIT, "/bt_navigator.plugin_lib_names")
    (tmp_path / "report.json").write_text(text)
    (tmp_path / "nav2.yaml").write_text("bt_navigator:\n  ros__parameters:\n    plugin_lib_names: 20\n")
    refused = care("apply", tmp_path / "report.json", tmp_path / "nav2.yaml", "-o", tmp_path / "fixed.yaml")
    assert refused.code > 1
    assert "has no parameter '/bt_navigator.plugin_lib_names'" in refused.stderr
