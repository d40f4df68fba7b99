"""Nav2's parameters under the names of another release or layer, and a controller behind the rotation shim."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from care_core.ecosystems.ros.plugin_names import is_named_alike, named_here
from care_core.errors import ProfileError
from care_core.extract.coverage import cover
from care_core.extract.fit import fit_of
from care_core.extract.parameter_aliases import with_logged_names
from care_core.extract.select import choose_profile
from care_core.files import bundled
from care_core.logs.opening import open_log
from care_core.profile.schema_file import parsed
from care_core.profile.store import load_profile
from care_core.run import Setting
from tests.courier import TOLERANCE, USUAL, deliver

LOCAL = "/local_costmap/local_costmap."
FOLLOW = "/controller_server.FollowPath."
RPP = "nav2_regulated_pure_pursuit_controller::RegulatedPurePursuitController"


def logged(path: Path, **parameters: Any) -> Path:
    return deliver(path, {**USUAL, TOLERANCE: 0.25, **parameters}, np.random.default_rng(3))


@pytest.mark.parametrize("name", ["/controller_server.PathHandler.prune_distance", f"{FOLLOW}prune_distance"])
def test_an_option_is_read_under_the_name_that_the_release_has_for_it(tmp_path: Path, name: str) -> None:
    log = open_log(logged(tmp_path / "a.mcap", **{name: 1.5}))
    schema = with_logged_names(load_profile("nav2-mppi").schema, log)
    assert schema.variables["prune_distance"].parameters == (name,)


def set_to(**values: Any) -> dict[str, tuple[Setting, ...]]:
    return {name: (Setting(name, value, "a log"),) for name, value in values.items()}


LAYERED = set_to(**{
    f"{LOCAL}plugins": "['static', 'seen', 'grown']", f"{LOCAL}static.plugin": "nav2_costmap_2d::StaticLayer",
    f"{LOCAL}seen.plugin": "nav2_costmap_2d::ObstacleLayer", f"{LOCAL}seen.observation_sources": "lidar",
    f"{LOCAL}grown.plugin": "nav2_costmap_2d::InflationLayer", "/planner_server.planner_plugins": "['A', 'B']",
    "/controller_server.goal_checker_plugins": "['goal_checker']",
})  # fmt: skip


@pytest.mark.parametrize(
    ("usual", "own"),
    [
        (f"{LOCAL}voxel_layer.scan.obstacle_max_range", f"{LOCAL}seen.lidar.obstacle_max_range"),
        (f"{LOCAL}voxel_layer.combination_method", f"{LOCAL}seen.combination_method"),
        (f"{LOCAL}inflation_layer.inflation_radius", f"{LOCAL}grown.inflation_radius"),
        ("/controller_server.general_goal_checker.plugin", "/controller_server.goal_checker.plugin"),
        ("/planner_server.GridBased.tolerance", "/planner_server.GridBased.tolerance"),
        ("/controller_server.controller_frequency", "/controller_server.controller_frequency"),
        (f"{FOLLOW}vx_max", f"{FOLLOW}vx_max"),
    ],
)
def test_plugins_are_called_as_one_likes(usual: str, own: str) -> None:
    assert named_here(usual, LAYERED) == own
    assert is_named_alike(usual, own)


@pytest.mark.parametrize(
    "other",
    [
        "/controller_server.Fast.vx_min", "/planner_server.Fast.vx_max", "/controller_server.vx_max",
        "/controller_server.a.b.vx_max", "/controller_server.Fast.vx_max.x", "/controller_server.a b.vx_max",
    ],
)  # fmt: skip
def test_what_is_not_a_plugin_keeps_its_name(other: str) -> None:
    assert not is_named_alike(f"{FOLLOW}vx_max", other)
    assert is_named_alike(f"{FOLLOW}vx_max", "/controller_server.Fast.vx_max")
    assert not is_named_alike("/controller_server.controller_frequency", "/controller_server.other")


def test_a_controller_under_a_name_of_its_own_has_its_profile(tmp_path: Path) -> None:
    names = {"/controller_server.controller_plugins": "Fast", "/controller_server.Fast.vx_max": 0.4,
             "/controller_server.Fast.plugin": "nav2_mppi_controller::MPPIController"}  # fmt: skip
    log = open_log(logged(tmp_path / "a.mcap", **names))
    schema = with_logged_names(load_profile("nav2-mppi").schema, log)
    assert schema.variables["vx_max"].parameters == ("/controller_server.Fast.vx_max",)
    assert fit_of(log, cover(log, schema)).verdict != "no"
    other = with_logged_names(load_profile("nav2").schema, log)
    assert fit_of(log, cover(log, other)).verdict == "no"


def test_each_controller_has_its_profile(tmp_path: Path) -> None:
    profiles = [load_profile(name) for name in ("nav2", "nav2-mppi", "nav2-rpp")]
    chosen = {}
    for plugin in ("dwb_core::DWBLocalPlanner", "nav2_mppi_controller::MPPIController", RPP):
        log = open_log(logged(tmp_path / f"{plugin[:4]}.mcap", **{f"{FOLLOW}plugin": plugin}))
        found, _ = choose_profile(log, profiles)
        chosen[plugin] = "" if found is None else found.schema.name
    assert list(chosen.values()) == ["nav2", "nav2-mppi", "nav2-rpp"]


@pytest.mark.parametrize(("behind", "fits"), [(RPP, True), ("dwb_core::DWBLocalPlanner", False)])
def test_the_controller_behind_a_rotation_shim_is_the_one_that_counts(tmp_path: Path, behind: str, fits: bool) -> None:
    shim = "nav2_rotation_shim_controller::RotationShimController"
    names = {f"{FOLLOW}plugin": shim, f"{FOLLOW}primary_controller": behind}
    log = open_log(logged(tmp_path / "a.mcap", **names))
    assert (fit_of(log, cover(log, load_profile("nav2-rpp").schema)).verdict != "no") is fits


def test_no_suggestion_for_mppi_has_a_step_shorter_than_that_of_control() -> None:
    schema = load_profile("nav2-mppi").schema
    config = {option.name: option.default or 0.0 for option in schema.options}
    (kept,) = schema.constraints
    assert kept.holds({**config, "model_dt": 0.1, "controller_frequency": 10.0})
    assert not kept.holds({**config, "controller_frequency": 10.0})


@pytest.mark.parametrize("text", ["vx_max >= nothing", "import os", "vx_max"])
def test_a_limit_that_is_none_is_said(text: str) -> None:
    whole = (bundled("profiles", "nav2-mppi") / "profile.yaml").read_text()
    wrong = whole.replace("controller_frequency * model_dt >= 1", text)
    with pytest.raises(ProfileError, match="Under 'limits'"):
        parsed(wrong, Path("profile.yaml"))
