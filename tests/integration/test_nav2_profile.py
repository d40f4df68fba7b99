"""The nav2 profile: Nav2's own names and defaults, what it says of where it was learned, and what it never does."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from benchmarks.nav2_names import WEIGHTS, on_move_base
from care_core.configs.driven import option_value, readable
from care_core.configs.loading import read_configs, resolve
from care_core.extract.read import read_run
from care_core.logs.opening import open_log
from care_core.profile.store import load_profile
from care_core.run import Setting
from care_core.variables import Role
from tests.conftest import Care
from tests.courier import TOLERANCE, USUAL, deliver

FOLLOW, CHECKER = "/controller_server.FollowPath.", "/controller_server.general_goal_checker."
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
    run = read_run(open_log(drive(tmp_path / "a.mcap")), load_profile("nav2").schema)
    assert run.config["path_dist_scale"] == 32.0
    assert run.config["controller_frequency"] == 20.0
    assert len(run.config) == 13
    assert run.objectives["mission_success"] == 1.0
    assert run.value("traveled_distance") == pytest.approx(7.9, abs=0.3)


def test_defaults_are_those_that_nav2_ships() -> None:
    shipped = {name: Setting(name, value, "shipped") for name, value in SHIPPED.items()}
    for option in load_profile("nav2").schema.options:
        for parameter in readable(option):
            if parameter in shipped:
                assert option_value(option, shipped[parameter]) == option.default, option.name


def test_a_failed_drive_says_where_the_profile_was_learned(care: Care, tmp_path: Path) -> None:
    log = drive(tmp_path / "a.mcap", arrives=False, BaseObstacle__scale=1.0)
    for form in ((), ("--markdown",), ("--yaml",)):
        text = " ".join(care("triage", log, "--profile", "nav2", *form).stdout.replace("\\_", "_").split())
        assert "learned from 301 missions of move_base on ROS 1, another stack" in text
    report = json.loads(care("triage", log, "--profile", "nav2", "--json").stdout)
    assert report["fit"]["verdict"] == "partly"
    assert {cause["confidence"] for fault in report["faults"] for cause in fault["causes"]} <= {"low"}
    judged = {one["name"]: one["status"] for one in report["objectives"]}
    assert judged == {"mission_success": "fault", "mission_time": "not_evaluated", "energy": "not_evaluated"}


def test_nav2_is_read_by_its_own_profile_unasked(care: Care, tmp_path: Path) -> None:
    answer = care("triage", drive(tmp_path / "a.mcap", arrives=False), "--json")
    assert json.loads(answer.stdout)["profile"]["name"] == "nav2"


def test_a_good_drive_is_given_no_limits_of_another_stack(care: Care, tmp_path: Path) -> None:
    answer = care("triage", drive(tmp_path / "a.mcap"), "--profile", "nav2", "--json")
    report = json.loads(answer.stdout)
    assert report["faults"] == []
    time = next(one for one in report["objectives"] if one["name"] == "mission_time")
    assert time["status"] == "not_evaluated"
    assert "another stack" in time["reason"]
    assert care("triage", drive(tmp_path / "b.mcap"), "--profile", "nav2", "--threshold", "mission_time=5").code == 1


def test_what_another_stack_taught_names_a_suspect_and_advises_no_change(care: Care, tmp_path: Path) -> None:
    log = drive(tmp_path / "a.mcap", arrives=False, BaseObstacle__scale=1.0)
    report = json.loads(care("triage", log, "--profile", "nav2", "--json").stdout)
    assert report["fix"] is None
    assert "no change is advised; look at base_obstacle_scale" in report["abstained"]
    assert report["faults"][0]["causes"][0]["option"] == "base_obstacle_scale"


def test_nav2_configuration_files_are_read_under_the_same_names(recorded: Path) -> None:
    schema = load_profile("nav2").schema
    wanted = {parameter for option in schema.options for parameter in readable(option)}
    files = read_configs([str(recorded / "logs/configs/nav2/linorobot2_navigation.yaml")])
    held = resolve(files, wanted)
    assert held["/local_costmap/local_costmap.inflation_layer.inflation_radius"].value == 0.55
    assert held[f"{CHECKER}xy_goal_tolerance"].value == 0.25
    assert len(held) >= 15


def test_the_names_lead_back_to_move_base() -> None:
    nav2 = load_profile("nav2").schema
    behind = on_move_base(nav2)
    base = {parameter for option in load_profile("move_base").schema.options for parameter in option.parameters}
    assert {parameter for option in behind.options for parameter in option.parameters} <= base
    weight = behind.variables["goal_dist_scale"]
    assert option_value(weight, Setting(weight.parameters[0], 1.0, "a bag")) == pytest.approx(WEIGHTS)
    assert weight.parameters == ("/move_base/DWAPlannerROS/goal_distance_bias",)
    assert behind.digest != ""
    assert {v.name for v in behind.of(Role.METRIC)} == {v.name for v in nav2.metrics}
