"""What is wrong with parameter files of Nav2: limits and their signs, lists, plugins by release, what Nav2 ships."""

from __future__ import annotations

from pathlib import Path

import pytest

from care_core.lint.linting import lint
from care_core.lint.problems import Severity
from care_core.metadata import plugins
from tests.nav2_files import DWB, MPPI, RPP, controller, findings, node, told


def test_a_class_in_braces_needs_no_quotes(tmp_path: Path) -> None:
    line = "GridBased: {plugin: nav2_navfn_planner::NavfnPlanner, use_astar: no, tolerance: 0.5}"
    assert told(tmp_path, node("planner_server", "planner_plugins: [GridBased]", line)) == []
    assert told(tmp_path, "a: {b: c::d\n")[0][:2] == ("syntax", "error")


@pytest.mark.parametrize("word", ["no", "No", "NO", "off", "Off", "n", "N", "false", "yes", "On", "y", "Y", "TRUE"])
def test_the_words_that_rcl_takes_for_a_switch_are_one(tmp_path: Path, word: str) -> None:
    planner = node("planner_server", "planner_plugins: [GridBased]", "GridBased:",
                   "  plugin: nav2_navfn_planner::NavfnPlanner", f"  use_astar: {word}")  # fmt: skip
    assert told(tmp_path, planner) == []


@pytest.mark.parametrize("word", ["nO", "oFf", "'no'", '"off"', "!!str no", "nope"])
def test_words_that_rcl_takes_for_texts_are_no_switch(tmp_path: Path, word: str) -> None:
    planner = node("planner_server", "planner_plugins: [GridBased]", "GridBased:",
                   "  plugin: nav2_navfn_planner::NavfnPlanner", f"  use_astar: {word}")  # fmt: skip
    assert told(tmp_path, planner) == [("wrong-type", "error", "use_astar")]


def test_ros_1_takes_no_and_off_for_a_switch_and_not_the_letter(tmp_path: Path) -> None:
    assert told(tmp_path, "DWAPlannerROS:\n  sim_time: 1.7\n  max_vel_x: 0.5\n  prune_plan: off\n") == []
    assert told(tmp_path, "DWAPlannerROS:\n  sim_time: 1.7\n  max_vel_x: 0.5\n  prune_plan: n\n")[0][0] == "wrong-type"


@pytest.mark.parametrize(
    ("plugin", "line", "rule"),
    [
        (DWB, "min_vel_x: 0.1", "hinders"),
        (DWB, "min_vel_x: -0.1", ""),
        (DWB, "max_vel_x: -0.1", "cannot-work"),
        (DWB, "max_vel_y: -0.2", "hinders"),
        (DWB, "min_vel_y: 0.2", "hinders"),
        (DWB, "acc_lim_x: -2.5", "cannot-work"),
        (DWB, "acc_lim_y: 0.0", ""),
        (DWB, "acc_lim_y: -1.0", "cannot-work"),
        (DWB, "decel_lim_x: 2.5", "cannot-work"),
        (DWB, "decel_lim_y: 2.5", "cannot-work"),
        (DWB, "decel_lim_theta: 3.2", "cannot-work"),
        (DWB, "max_speed_xy: -1.0", ""),
        (MPPI, "vx_min: 0.1", "hinders"),
        (MPPI, "vx_min: -0.35", ""),
        (MPPI, "vx_max: -0.5", "cannot-work"),
        (MPPI, "vy_max: -0.5", "cannot-work"),
        (MPPI, "wz_max: -1.9", "cannot-work"),
        (MPPI, "ax_max: -3.0", "cannot-work"),
        (MPPI, "ax_min: 3.0", "contradiction"),
        (MPPI, "ay_min: 3.0", "contradiction"),
        (RPP, "desired_linear_vel: -0.5", "cannot-work"),
        (RPP, "rotate_to_heading_angular_vel: -1.8", "cannot-work"),
        (RPP, "max_angular_accel: 0.0", "cannot-work"),
        (RPP, "lookahead_time: -1.5", "cannot-work"),
        (RPP, "min_approach_linear_velocity: -0.05", "contradiction"),
        (RPP, "min_approach_linear_velocity: 0.05", ""),
    ],
)
def test_limits_with_the_wrong_sign_are_found(tmp_path: Path, plugin: str, line: str, rule: str) -> None:
    found = told(tmp_path, controller(plugin, line))
    assert found == ([(rule, "warning", line.partition(":")[0])] if rule else [])


def test_a_speed_of_turning_counts_where_the_controller_turns(tmp_path: Path) -> None:
    lines = ("rotate_to_heading_angular_vel: 0.0", "use_rotate_to_heading: {}")
    assert told(tmp_path, controller(RPP, lines[0], lines[1].format("true"))) != []
    assert told(tmp_path, controller(RPP, lines[0], lines[1].format("false"))) == []


def test_a_top_speed_above_the_speed_that_dwb_allows(tmp_path: Path) -> None:
    assert told(tmp_path, controller(DWB, "max_vel_x: 0.5", "max_speed_xy: 0.3")) == [
        ("contradiction", "warning", "max_vel_x")
    ]
    for allowed in ("0.5", "-1.0"):
        assert told(tmp_path, controller(DWB, "max_vel_x: 0.5", f"max_speed_xy: {allowed}")) == []


SMOOTHER = {
    "max_velocity": "[0.5, 0.0, 2.5]", "min_velocity": "[-0.5, 0.0, -2.5]", "max_accel": "[0.3, 0.0, 3.2]",
    "max_decel": "[-0.5, 0.0, -3.2]", "deadband_velocity": "[0.0, 0.0, 0.0]",
}  # fmt: skip


@pytest.mark.parametrize(
    ("changed", "wrong"),
    [
        ({}, []),
        ({"max_velocity": "[0.5, 2.5]"}, ["max_velocity"]),
        ({"deadband_velocity": "[0.0, 0.0, 0.0, 0.0]"}, ["deadband_velocity"]),
        ({"max_accel": "[-0.3, 0.0, 3.2]"}, ["max_accel"]),
        ({"max_decel": "[0.5, 0.0, 3.2]"}, ["max_decel"]),
        ({"min_velocity": "[0.5, 0.0, -2.5]"}, ["min_velocity"]),
        ({"max_velocity": "[0.5, -0.1, 2.5]"}, ["max_velocity"]),
        ({name: f"[{', '.join(['0.0' if name[:2] != 'ma' else '-0.5' if 'dec' in name else '0.5'] * 6)}]"
          for name in SMOOTHER}, []),
        ({"max_velocity": "[0.5, 0.0, 0.0, 0.0, 0.0, 2.5]"}, ["max_velocity"]),
    ],
)  # fmt: skip
def test_lists_of_the_velocity_smoother_that_it_refuses(
    tmp_path: Path, changed: dict[str, str], wrong: list[str]
) -> None:
    lines = [f"{name}: {value}" for name, value in {**SMOOTHER, **changed}.items()]
    found = told(tmp_path, node("velocity_smoother", *lines))
    assert found == [("cannot-work", "error", name) for name in wrong]


def costmap(*lines: str, name: str = "global_costmap") -> str:
    return "\n".join([f"{name}:", *(f"  {line}" for line in node(name, *lines).splitlines()), ""])


FOOTPRINT = 'footprint: "[[0.3, 0.2], [0.3, -0.2], [-0.3, -0.2], [-0.3, 0.2]]"'


@pytest.mark.parametrize(
    ("lines", "severity"),
    [
        (("robot_radius: 0.22", FOOTPRINT), "note"),
        (("robot_radius: 0.1", FOOTPRINT), "warning"),
        (("robot_radius: 0.22", 'footprint: "[]"'), ""),
        (("robot_radius: 0.22",), ""),
        ((FOOTPRINT,), ""),
    ],
)
def test_a_radius_beside_a_footprint_is_not_used(tmp_path: Path, lines: tuple[str, ...], severity: str) -> None:
    found = told(tmp_path, costmap(*lines))
    assert found == ([("dead-key", severity, "robot_radius")] if severity else [])


@pytest.mark.parametrize(
    ("source", "key"),
    [
        ("clearing: true, raytrace_max_range: 2.0", "raytrace_max_range"),
        ("clearing: true, obstacle_max_range: 4.0", "obstacle_max_range"),
        ("clearing: true, obstacle_max_range: 4.0, raytrace_max_range: 3.5", "raytrace_max_range"),
        ("clearing: true, obstacle_max_range: 4.0, raytrace_max_range: 5.0", ""),
        ("clearing: true, marking: false, obstacle_max_range: 4.0", ""),
        ("clearing: true, raytrace_max_range: 2.5", ""),
    ],
)
def test_what_is_marked_farther_than_it_is_cleared(tmp_path: Path, source: str, key: str) -> None:
    layer = ("plugins: [obstacle_layer]", "obstacle_layer:", "  plugin: nav2_costmap_2d::ObstacleLayer",
             "  observation_sources: scan", f"  scan: {{topic: /scan, {source}}}")  # fmt: skip
    found = [
        one
        for one in told(tmp_path, costmap(*layer))
        if one[:2] == ("hinders", "warning") and one[2].endswith("max_range")
    ]
    assert found == ([("hinders", "warning", key)] if key else [])


LAUNCH = """{}
  bt_navigator:
    app: bt_navigator
    params: [replanning]
  amcl:
    app: amcl
    params: [amcl_diff]
  map_server: {{app: map_server, params: [map_server], dead: 1}}
"""


@pytest.mark.parametrize("above", ["nodes:", "containers:\n one:", "robot1:"])
def test_a_file_that_launches_nodes_is_no_parameter_file_and_nothing_else(tmp_path: Path, above: str) -> None:
    (found,) = findings(tmp_path, LAUNCH.format(above))
    assert (found.rule, found.severity) == ("no-parameters", Severity.NOTE)
    assert found.text.startswith("This is no parameter file of ROS 2: it names bt_navigator")


def test_the_modes_of_nodes_are_no_parameters(tmp_path: Path) -> None:
    modes = ("type: node", "modes:", "  __DEFAULT__:", "    ros__parameters: {FollowPath.max_vel_x: 0.6}", "  SLOW:",
             "    ros__parameters: {FollowPath.max_vel_x: -0.3}")  # fmt: skip
    (found,) = findings(tmp_path, node("pilot", "type: system") + node("controller_server", *modes))
    assert (found.rule, found.severity) == ("no-parameters", Severity.NOTE)
    assert "system_modes" in found.text


def test_values_of_a_node_without_the_key_that_ros_2_asks_for(tmp_path: Path) -> None:
    text = "controller_server:\n  controller_frequency: 20.0\namcl:\n  alfa1: 0.2\n"
    assert told(tmp_path, text) == [("no-parameters", "warning", "controller_frequency")]
    assert told(tmp_path, "amcl:\n  odom_alpha1: 0.2\n  bt_navigator: 1\n")[0][0] == "unknown-key"


@pytest.mark.parametrize(
    ("above", "is_read"),
    [
        ("local_costmap:", False),
        ("/local_costmap:", False),
        ("robot1/local_costmap:", False),
        ("local_costmap/local_costmap:", True),
        ("/robot1/local_costmap/local_costmap:", True),
        ("/**/local_costmap:", True),
        ("/*/local_costmap:", True),
    ],
)
def test_a_costmap_stands_in_a_namespace_of_its_own_name(tmp_path: Path, above: str, is_read: bool) -> None:
    found = findings(tmp_path, f"{above}\n  ros__parameters:\n    width: 3.0\n")
    assert [one.rule for one in found] == (["wrong-type"] if is_read else ["misplaced-key"])
    name = above.strip("/:")
    assert (
        is_read
        or found[0].text == f"Nothing reads this part: the costmap is the node /{name}/local_costmap, not /{name}."
    )


def test_a_namespace_that_a_file_is_loaded_into_counts(tmp_path: Path) -> None:
    path = tmp_path / "nav2.yaml"
    path.write_text("local_costmap:\n  ros__parameters:\n    width: 3.0\n")
    (linted,) = lint([f"/robot1/local_costmap={path}"])
    assert [one.rule for one in linted.problems] == ["wrong-type"]


def planner(plugin: str) -> str:
    return node("planner_server", "planner_plugins: [GridBased]", "GridBased:", f"  plugin: {plugin}")


@pytest.mark.parametrize(
    ("plugin", "target", "hint"),
    [
        ("nav2_navfn_planner/NavfnPlanner", "humble", ""),
        ("nav2_navfn_planner/NavfnPlanner", "iron", ""),
        ("nav2_navfn_planner::NavfnPlanner", "jazzy", ""),
        ("nav2_navfn_planner/NavfnPlanner", "", ""),
        ("nav2_navfn_planner/NavfnPlanner", "jazzy", "Write nav2_navfn_planner::NavfnPlanner."),
        ("nav2_navfn_planner::NavfnPlanner", "humble", "Write nav2_navfn_planner/NavfnPlanner."),
        ("nav2_smac_planner::SmacPlannerHybrid", "iron", "Write nav2_smac_planner/SmacPlannerHybrid."),
        ("nav2_smac_planner/SmacPlannerLattice", "galactic", "Is the file for this distribution?"),
        ("my_planner/NavfnPlanner", "jazzy", ""),
    ],
)
def test_plugins_have_the_name_of_their_release(tmp_path: Path, plugin: str, target: str, hint: str) -> None:
    found = findings(tmp_path, planner(plugin), target)
    assert [(one.rule, one.severity, one.hint) for one in found] == (
        [("plugin-name", Severity.ERROR, hint)] if hint else []
    )


def test_a_plugin_of_a_kind_that_the_release_does_not_load_stops_no_node(tmp_path: Path) -> None:
    text = node("bt_navigator", "navigators: [to_pose]", "to_pose:",
                "  plugin: nav2_bt_navigator/NavigateToPoseNavigator")  # fmt: skip
    assert told(tmp_path, text, "iron") == []
    assert ("plugin-name", "warning", "plugin") in told(tmp_path, text, "humble")
    assert ("plugin-name", "error", "plugin") in told(tmp_path, text, "jazzy")


@pytest.mark.parametrize(
    ("text", "lacking"),
    [
        (costmap("plugins: [voxel_layer, inflation_layer]", "voxel_layer: {enabled: true}",
                 "inflation_layer.plugin: 'nav2_costmap_2d::InflationLayer'"), "voxel_layer"),
        (costmap("plugins: [voxel_layer, inflation_layer]"), "voxel_layer, inflation_layer"),
        (costmap("plugins: [static_layer, obstacle_layer, inflation_layer]"), ""),
        (costmap("plugins: [static_layer, inflation_layer]"), "static_layer, inflation_layer"),
        (costmap("plugins: []", "filters: [keepout]"), "keepout"),
        (costmap("plugins: $(var layers)"), ""),
        (costmap("plugins: [voxel]") + node("/**", "voxel: {plugin: 'nav2_costmap_2d::VoxelLayer'}"), ""),
        (node("controller_server", "controller_plugins: [FollowPath]"), ""),
        (node("controller_server", "controller_plugins: [FollowPath, Other]", "FollowPath.plugin: my::Own"), "Other"),
        (node("controller_server", "goal_checker_plugins: [general_goal_checker]"), "general_goal_checker"),
        (node("behavior_server", "behavior_plugins: [spin, backup, drive_on_heading, wait]"), ""),
        (node("behavior_server", "behavior_plugins: [spin]", "spin: {plugin: 'nav2_behaviors::Spin'}"), ""),
        (node("my_server", "controller_plugins: [Other]"), ""),
    ],
)  # fmt: skip
def test_a_plugin_of_which_nothing_says_the_class_is_refused(tmp_path: Path, text: str, lacking: str) -> None:
    found = findings(tmp_path, text)
    assert [one.rule for one in found] == (["cannot-work"] if lacking else [])
    assert all(f" names {lacking}, and nothing here says " in one.text for one in found)


def test_a_list_that_the_release_does_not_read_refuses_nothing(tmp_path: Path) -> None:
    text = node("controller_server", "progress_checker_plugins: [stuck]")
    assert told(tmp_path, text, "jazzy") == [("cannot-work", "warning", "progress_checker_plugins")]
    assert ("cannot-work", "warning", "progress_checker_plugins") not in told(tmp_path, text, "humble")


@pytest.mark.parametrize(
    ("plugin", "hint"),
    [
        ("nav2_mppi_controller/MPPIController", "Did you mean nav2_mppi_controller::MPPIController?"),
        ("nav2_mppi_controller::MPPIControler", "Did you mean nav2_mppi_controller::MPPIController?"),
        ("dwb_core/DWBLocalPlanner", "Did you mean dwb_core::DWBLocalPlanner?"),
        ("nav2_controller_of_mine::Controller", ""),
    ],
)
def test_a_plugin_that_no_release_loads(tmp_path: Path, plugin: str, hint: str) -> None:
    found = [one for one in findings(tmp_path, controller(plugin)) if one.rule == "plugin-name"]
    assert [(one.severity, one.hint) for one in found] == ([(Severity.ERROR, hint)] if hint else [])


def test_plugins_of_two_releases_in_one_file(tmp_path: Path) -> None:
    behaviors = node("behavior_server", "behavior_plugins: [spin, wait]", "spin:", "  plugin: nav2_behaviors::Spin",
                     "wait:", "  plugin: nav2_behaviors::Wait")  # fmt: skip
    (found,) = findings(tmp_path, planner("nav2_navfn_planner/NavfnPlanner") + behaviors)
    assert (found.rule, found.severity, found.line) == ("plugin-name", Severity.WARNING, 5)
    assert found.hint == "Write nav2_navfn_planner::NavfnPlanner."
    assert len(found.others) == 2
    assert findings(tmp_path, planner("nav2_navfn_planner::NavfnPlanner") + behaviors) == ()


RECOVERIES = node("recoveries_server", "recovery_plugins: [spin, wait]", "spin:", "  plugin: nav2_recoveries/Spin",
                  "wait:", "  plugin: nav2_recoveries/Wait")  # fmt: skip


@pytest.mark.parametrize(
    ("plugin", "target", "rules"),
    [
        ("nav2_navfn_planner/NavfnPlanner", "", [("renamed", "note")]),
        ("nav2_navfn_planner/NavfnPlanner", "galactic", []),
        ("nav2_navfn_planner/NavfnPlanner", "humble", [("renamed", "warning")]),
        ("nav2_smac_planner/SmacPlannerLattice", "", [("renamed", "warning")]),
        ("nav2_navfn_planner::NavfnPlanner", "", [("renamed", "warning")]),
        ("nav2_smac_planner/SmacPlannerLattice", "galactic", [("plugin-name", "error")]),
    ],
)
def test_plugins_of_a_node_that_the_release_does_not_have_show_nothing(
    tmp_path: Path, plugin: str, target: str, rules: list[tuple[str, str]]
) -> None:
    found = findings(tmp_path, planner(plugin) + RECOVERIES, target)
    assert [(one.rule, one.severity.value) for one in found] == rules
    assert all("nav2_behaviors" in one.hint for one in found if one.rule == "renamed")


def test_a_file_with_the_node_by_both_names_is_for_releases_before_and_after(tmp_path: Path) -> None:
    both = planner("nav2_navfn_planner::NavfnPlanner") + RECOVERIES
    behaviors = node("behavior_server", "behavior_plugins: [spin]", "spin:", "  plugin: nav2_behaviors::Spin")
    assert told(tmp_path, both + behaviors) == [("renamed", "note", "recovery_plugins")]


def test_of_plugins_that_are_read_the_odd_one_out_is_blamed(tmp_path: Path) -> None:
    smac = planner("nav2_smac_planner/SmacPlannerHybrid").replace("[GridBased]", "[GridBased, Other, Third]")
    smac += "    Other: {plugin: nav2_smac_planner/SmacPlannerLattice}\n"
    smac += "    Third: {plugin: nav2_navfn_planner::NavfnPlanner}\n"
    (found,) = [one for one in findings(tmp_path, smac + RECOVERIES) if one.rule == "plugin-name"]
    assert found.text.startswith(
        "nav2_navfn_planner::NavfnPlanner is loaded in jazzy to rolling, and the other plugins"
    )


@pytest.mark.parametrize(
    ("plugin", "lines", "wanted"),
    [
        (MPPI, ("critics: [ConstraintCritic, CostCritic]", "CostCritic: {cost_weight: 3.81}"), []),
        (DWB, ("critics: [RotateToGoal, BaseObstacle, PathAlign]", "PathAlign.scale: 32.0"), []),
        (DWB, ("critics: [PathAlignCritic, BaseObstacleCritic]", "PathAlignCritic.scale: 32.0"), []),
        (MPPI, ("critics: [RotateToGoal]",), [("plugin-name", "error", "critics")]),
        (DWB, ("critics: [CostCritic]",), [("plugin-name", "error", "critics")]),
        (MPPI, ("BaseObstacle.scale: 0.02", "BaseObstacle.sum_scores: false"),
         [("misplaced-key", "warning", "BaseObstacle.scale")]),
        (DWB, ("ConstraintCritic: {cost_weight: 4.0, cost_power: 1}",), [("misplaced-key", "warning", "cost_weight")]),
        (RPP, ("RotateToGoal.scale: 32.0",), [("misplaced-key", "warning", "RotateToGoal.scale")]),
        (MPPI, ("max_vel_x: 0.5",), [("misplaced-key", "warning", "max_vel_x")]),
        (DWB, ("vx_max: 0.5",), [("misplaced-key", "warning", "vx_max")]),
    ],
)  # fmt: skip
def test_keys_and_critics_of_another_controller(
    tmp_path: Path, plugin: str, lines: tuple[str, ...], wanted: list[tuple[str, str, str]]
) -> None:
    assert told(tmp_path, controller(plugin, *lines)) == wanted


def checked(stateful: str, checker: str = "") -> str:
    inner = [f"  {line}" for line in (f"plugin: {DWB}", f"stateful: {stateful}")]
    goal = ["  plugin: nav2_controller::SimpleGoalChecker", *([f"  stateful: {checker}"] if checker else [])]
    return node("controller_server", "goal_checker_plugins: [general_goal_checker]", "general_goal_checker:", *goal,
                "controller_plugins: [FollowPath]", "FollowPath:", *inner)  # fmt: skip


@pytest.mark.parametrize(
    ("stateful", "checker", "is_wrong"),
    [
        ("true", "true", False),
        ("true", "", False),
        ("false", "false", False),
        ("false", "", True),
        ("true", "no", True),
    ],
)
def test_stateful_of_a_controller_is_said_to_be_the_goal_checkers(
    tmp_path: Path, stateful: str, checker: str, is_wrong: bool
) -> None:
    found = findings(tmp_path, checked(stateful, checker))
    assert [(one.rule, one.hint) for one in found] == (
        [("misplaced-key", f"Write stateful: {stateful} under general_goal_checker, or leave it out.")]
        if is_wrong
        else []
    )


def test_what_nav2_ships_and_nothing_reads_is_told_once_it_is_changed(tmp_path: Path) -> None:
    docking = ("controller:", "  simulation_step: {}")
    assert told(tmp_path, node("docking_server", docking[0], docking[1].format("0.1"))) == []
    (found,) = findings(tmp_path, node("docking_server", docking[0], docking[1].format("0.05")))
    assert (found.rule, found.hint) == ("unknown-key", "Did you mean simulation_time_step?")
    spare = ("plugins: [inflation]", "inflation: {plugin: 'nav2_costmap_2d::InflationLayer'}", "static_layer:",
             "  plugin: nav2_costmap_2d::StaticLayer")  # fmt: skip
    assert told(tmp_path, costmap(*spare, name="local_costmap")) == []
    assert told(tmp_path, costmap(*spare)) == [("not-loaded", "note", "plugin")]


@pytest.mark.parametrize("target", ["", "lyrical", "rolling"])
def test_the_file_that_nav2_brings_has_no_finding(recorded: Path, target: str) -> None:
    (linted,) = lint([str(recorded / "logs" / "configs" / "nav2" / "nav2_bringup_nav2_params.yaml")], target)
    assert linted.problems == ()


def test_distributions_with_a_gap_are_told_with_it(tmp_path: Path) -> None:
    (found,) = findings(tmp_path, controller("nav2_graceful_controller::GracefulController"), "iron")
    assert (
        found.text
        == "nav2_graceful_controller::GracefulController is a plugin of humble, jazzy to rolling, not of iron."
    )


def test_every_plugin_of_the_table_is_of_a_release_and_spelled_one_way_in_it() -> None:
    for name in plugins.names():
        assert plugins.releases_of(name)
        others = [held for one, held in plugins.spellings(name).items() if one != name]
        assert not any(held & plugins.releases_of(name) for held in others), name


def local(*lines: str) -> str:
    inner = [f"    {line}" for line in ("  ros__parameters:", *(f"    {line}" for line in lines))]
    return "\n".join(["local_costmap:", "  local_costmap:", *(line[2:] for line in inner), ""])


@pytest.mark.parametrize(
    ("rate", "step", "found"), [(20.0, 0.05, []), (30.0, 0.033333, []), (30.0, 0.05, []), (10.0, 0.05, ["model_dt"])]
)
def test_a_step_of_mppi_is_no_shorter_than_one_of_control(
    tmp_path: Path, rate: float, step: float, found: list[str]
) -> None:
    lines = [f"controller_frequency: {rate}", "controller_plugins: [FollowPath]", "FollowPath:", f"  plugin: {MPPI}"]
    problems = findings(tmp_path, node("controller_server", *lines, f"  model_dt: {step}"))
    assert [one.parameter.rpartition("/")[2] for one in problems] == found
    assert all(one.rule == "cannot-work" for one in problems)


@pytest.mark.parametrize(("size", "found"), [(3, []), (2, ["width"])])
def test_what_mppi_looks_ahead_lies_on_the_local_costmap(tmp_path: Path, size: int, found: list[str]) -> None:
    critics = "critics: [CostCritic, GoalCritic]"
    ahead = controller(MPPI, "vx_max: 0.5", "time_steps: 56", "model_dt: 0.05", critics)
    problems = findings(tmp_path, ahead + local(f"width: {size}", f"height: {size}"))
    assert [one.parameter.rpartition("/")[2] for one in problems] == found
    assert all("time_steps" in one.text for one in problems)


@pytest.mark.parametrize(
    ("shape", "found"),
    [("robot_radius: 0.3", ["consider_footprint"]), ('footprint: "[[0.3, 0.2], [-0.3, 0.2], [-0.3, -0.2]]"', [])],
)
def test_mppi_considers_a_footprint_where_there_is_one(tmp_path: Path, shape: str, found: list[str]) -> None:
    critics = controller(MPPI, "critics: [CostCritic]", "CostCritic:", "  consider_footprint: true")
    problems = findings(tmp_path, critics + local(shape))
    assert [one.parameter.rpartition("/")[2] for one in problems if one.rule == "cannot-work"] == found


@pytest.mark.parametrize("rate", [7.0, 15.0, 20.0, 30.0])
def test_the_step_that_is_proposed_is_long_enough(tmp_path: Path, rate: float) -> None:
    lines = [f"controller_frequency: {rate}", "controller_plugins: [FollowPath]", "FollowPath:", f"  plugin: {MPPI}"]
    (problem,) = findings(tmp_path, node("controller_server", *lines, "  model_dt: 0.01"))
    proposed = problem.hint.removeprefix("Make it ").rstrip(".")
    assert findings(tmp_path, node("controller_server", *lines, f"  model_dt: {proposed}")) == ()


@pytest.mark.parametrize(
    ("lines", "key", "rule", "hint"),
    [
        (("vx_min: -0.2", "vy_min: 0.0"), "vy_min", "unknown-key", "Check its spelling, or leave it out."),
        (("vy_std: 0.2", "v_std: 0.2"), "v_std", "unknown-key", "Check its spelling, or leave it out."),
        (("vy_sdt: 0.2",), "vy_sdt", "unknown-key", "Did you mean vy_std?"),
        (("vy_std: 0.2", "vy_sdt: 0.2"), "vy_sdt", "unknown-key", "Check its spelling, or leave it out."),
        (("max_vel_x: 0.5",), "max_vel_x", "misplaced-key", "Leave it out here."),
    ],
)
def test_what_is_proposed_for_an_unknown_name_is_free_and_means_the_same(
    tmp_path: Path, lines: tuple[str, ...], key: str, rule: str, hint: str
) -> None:
    (found,) = findings(tmp_path, controller(MPPI, *lines))
    assert (found.rule, found.parameter.rpartition("/")[2], found.hint) == (rule, key, hint)


@pytest.mark.parametrize(
    ("text", "rule", "hint"),
    [
        (controller(DWB, "max_vel_theta: 1.0", "min_vel_theta: -1.0"), "unknown-key",
         "Check its spelling, or leave it out."),
        (controller(DWB, "min_vel_theta: -1.0"), "unknown-key", "Check its spelling, or leave it out."),
        (node("velocity_smoother", "max_vel: [0.5, 0.0, 1.0]"), "unknown-key", "Did you mean max_velocity?"),
        (node("velocity_smoother", "max_vel: [0.5, 0.0, 1.0]", "max_velocity: [0.5, 0.0, 1.0]"), "unknown-key",
         "Leave it out."),
        (node("planner_server", "plugins: [GridBased]"), "unknown-key", "Did you mean planner_plugins?"),
        (node("behavior_server", "behavior_plugins: [spin]", "spin:", "  plugin: nav2_behaviors::Spin",
              "  timeout: 30.0"), "unknown-key", "Leave it out."),
        (node("amcl", "use_map_topic: true"), "unknown-key", "Check its spelling, or leave it out."),
        (costmap("transform_timeout: 1.0"), "unknown-key", "Check its spelling, or leave it out."),
    ],
)  # fmt: skip
def test_a_name_that_others_have_by_chance_is_not_moved(tmp_path: Path, text: str, rule: str, hint: str) -> None:
    (found,) = findings(tmp_path, text)
    assert (found.rule, found.hint) == (rule, hint)


@pytest.mark.parametrize(
    ("text", "told_of", "hint"),
    [
        (costmap("plugin_types: ['nav2_costmap_2d::StaticLayer']", "plugin_names: [static]"),
         "plugin_names and plugin_types are",
         "Write plugins with the names, and plugin with its class below each name."),
        (costmap("plugin_names: [static]", "static: {plugin: 'nav2_costmap_2d::StaticLayer'}"), "plugin_names is",
         "Write plugins instead."),
        (costmap("plugin_names: [a]", "plugin_types: [b]", "a: {plugin: 'nav2_costmap_2d::StaticLayer'}"),
         "plugin_names and plugin_types are", "Write plugins instead of plugin_names, and leave plugin_types out."),
        (costmap("plugin_names: [static]"), "plugin_names is",
         "Write plugins with the names, and plugin with its class below each name."),
        (costmap("plugin_names: [a]", "plugin_types: [b]", "plugins: [static_layer, obstacle_layer, inflation_layer]"),
         "plugin_names and plugin_types are", "Leave them out."),
        (node("controller_server", "controller_plugin_types: [a]", "controller_plugins: [b]",
              "b: {plugin: 'my::Controller'}"), "controller_plugin_types is", "Leave it out."),
        (node("planner_server", "planner_plugin_types: [a]", "planner_plugin_ids: [b]"),
         "planner_plugin_ids and planner_plugin_types are",
         "Write planner_plugins with the names, and plugin with its class below each name."),
    ],
)  # fmt: skip
def test_the_two_lists_of_eloquent_are_one_since_foxy(tmp_path: Path, text: str, told_of: str, hint: str) -> None:
    (found,) = findings(tmp_path, text)
    assert (found.rule, found.severity, found.hint) == ("renamed", Severity.WARNING, hint)
    assert found.text.startswith(f"{told_of} of eloquent: since foxy ")
    assert ("default plugins" in found.text) is (not hint.startswith("Leave"))


@pytest.mark.parametrize(
    ("separator", "target", "proposed"), [("/", "", True), ("::", "rolling", True), ("/", "iron", False)]
)
def test_a_proposed_name_is_one_of_the_releases_that_the_file_is_for(
    tmp_path: Path, separator: str, target: str, proposed: bool
) -> None:
    drive = f"drive: {{plugin: 'nav2_behaviors{separator}DriveOnHeading', min_speed: 0.1}}"
    (found,) = findings(tmp_path, node("behavior_server", "behavior_plugins: [drive]", drive), target)
    assert found.hint == ("Did you mean minimum_speed?" if proposed else "Check its spelling, or leave it out.")


BESIDE = ("max_vel_x: 0.3", "acc_lim_x: 2.5", "critics: [RotateToGoal, BaseObstacle]", "BaseObstacle.scale: 0.02")


@pytest.mark.parametrize(
    ("lines", "target", "consequence"),
    [
        ((), "", " Without its critics controller_server does not start in galactic to kilted."),
        ((), "humble", " Without its critics controller_server does not start."),
        ((), "foxy", " FollowPath has its defaults instead."),
        (("controller_plugins: [FollowPath]", f"FollowPath.plugin: {DWB}"), "",
         " Without its critics controller_server does not start in galactic to rolling."),
        (("controller_plugins: [FollowPath]", f"FollowPath.plugin: {DWB}"), "rolling",
         " Without its critics controller_server does not start."),
    ],
)  # fmt: skip
def test_values_beside_the_plugin_that_reads_them_are_told_as_one(
    tmp_path: Path, lines: tuple[str, ...], target: str, consequence: str
) -> None:
    (found,) = findings(tmp_path, node("controller_server", *lines, *BESIDE), target)
    assert (found.rule, found.line, len(found.others)) == ("misplaced-key", 3 + len(lines), 3)
    assert found.text == (
        "max_vel_x and 3 more stand beside FollowPath, not below it: controller_server does not read them, "
        f"DWBLocalPlanner would.{consequence}"
    )
    where = "" if lines else ": that is loaded where controller_plugins is missing"
    assert found.hint == f"Write them one level deeper, below FollowPath{where}."


@pytest.mark.parametrize(
    ("below", "hint"),
    [
        ((), "Write them one level deeper, below FollowPath."),
        (("max_vel_x: 0.3",), "Write those that FollowPath lacks below it, and leave the others out."),
        (("max_vel_x: 0.3", "acc_lim_x: 2.5"), "Leave them out: FollowPath has its own."),
    ],
)
def test_values_that_the_plugin_has_itself_are_left_out(tmp_path: Path, below: tuple[str, ...], hint: str) -> None:
    inner = ("FollowPath:", f"  plugin: {DWB}", *(f"  {line}" for line in below))
    (found,) = findings(tmp_path, node("controller_server", "controller_plugins: [FollowPath]", *inner, *BESIDE[:2]))
    assert (found.rule, found.hint) == ("misplaced-key", hint)


@pytest.mark.parametrize(
    ("text", "plugin"),
    [
        (node("planner_server", "tolerance: 0.5", "use_astar: false"), "GridBased"),
        (node("controller_server", "vx_max: 0.5", "model_dt: 0.05", "controller_plugins: [Drive]",
              f"Drive: {{plugin: {MPPI}}}"), "Drive"),
        (node("controller_server", "vx_samples: 20", "sim_time: 1.7", "controller_plugins: [Drive]", "Drive:",
              "  plugin: nav2_rotation_shim_controller::RotationShimController", f"  primary_controller: {DWB}"),
         "Drive"),
        (node("controller_server", "vx_samples: 20", "sim_time: 1.7", "controller_plugins: [Drive]",
              "Drive: {plugin: 'my::Controller'}"), ""),
        (node("controller_server", "vx_samples: 20", "sim_time: 1.7", "controller_plugins: [Drive]",
              f"Drive: {{plugin: {MPPI}}}"), ""),
        (node("controller_server", "sim_time: 1.7", "my_own: 1.7"), ""),
    ],
)  # fmt: skip
def test_values_stand_beside_a_plugin_only_where_that_reads_several(tmp_path: Path, text: str, plugin: str) -> None:
    beside = [one.text for one in findings(tmp_path, text) if " more stand beside " in one.text]
    assert [one.partition(" beside ")[2].partition(",")[0] for one in beside] == ([plugin] if plugin else [])


def test_without_a_class_the_controller_is_of_mppi_since_lyrical(tmp_path: Path) -> None:
    (found,) = findings(tmp_path, node("controller_server", "vx_max: 0.5", "model_dt: 0.05"), "rolling")
    assert "MPPIController would. FollowPath has its defaults instead." in found.text


DIRECT = ("controller_plugins: [FollowPath]", "sim_time: 1.7", "FollowPath:", f"  plugin: {DWB}")


def test_a_value_is_moved_only_to_a_part_that_lacks_it(tmp_path: Path) -> None:
    (found,) = findings(tmp_path, node("controller_server", *DIRECT, "  vx_samples: 20"))
    assert found.text == "controller_server does not read sim_time; DWBLocalPlanner would."
    assert found.hint == "Move it there, or leave it out."
    (found,) = findings(tmp_path, node("controller_server", *DIRECT, "  sim_time: 1.7"))
    assert found.text == "controller_server does not read sim_time, which is for DWBLocalPlanner."
    assert found.hint == "Leave it out here."


@pytest.mark.parametrize(
    ("value", "target", "hint"),
    [
        ("5000", "", "It is in seconds since galactic, in milliseconds before: write 5.0."),
        ("5", "humble", "Write 5.0."),
        ("5.0", "foxy", "It is in milliseconds before galactic, in seconds since: write 5000."),
        ("5.0", "humble", ""),
        ("5000", "foxy", ""),
    ],
)
def test_a_value_in_the_unit_of_another_release_is_converted(
    tmp_path: Path, value: str, target: str, hint: str
) -> None:
    shown = planner("nav2_smac_planner/SmacPlannerHybrid") if not target else ""
    text = node("map_saver", f"save_map_timeout: {value}") + shown
    found = findings(tmp_path, text, target)
    assert [(one.rule, one.hint) for one in found] == ([("wrong-type", hint)] if hint else [])


@pytest.mark.parametrize("value", ["5.0", "5000"])
@pytest.mark.parametrize("beside", ["", RECOVERIES])
def test_no_error_rests_on_a_release_that_is_only_likely(tmp_path: Path, value: str, beside: str) -> None:
    older = node("bt_navigator", "default_bt_xml_filename: a.xml")
    older += node("controller_server", "goal_checker_plugin: goal_checker")
    found = findings(tmp_path, node("map_saver", f"save_map_timeout: {value}") + older + beside)
    assert [one.rule for one in found if one.severity != Severity.NOTE] == []


@pytest.mark.parametrize(
    ("separator", "target", "rules"),
    [("/", "humble", ["unknown-key"]), ("/", "", []), ("::", "", ["wrong-type"]), ("::", "jazzy", ["wrong-type"])],
)
def test_a_value_is_judged_only_where_the_release_reads_it(
    tmp_path: Path, separator: str, target: str, rules: list[str]
) -> None:
    smac = ("GridBased:", f"  plugin: nav2_smac_planner{separator}SmacPlannerHybrid",
            "  analytic_expansion_max_cost: true")  # fmt: skip
    found = findings(tmp_path, node("planner_server", "planner_plugins: [GridBased]", *smac), target)
    assert [one.rule for one in found] == rules


@pytest.mark.parametrize(
    ("plugin", "lines", "key"),
    [
        (MPPI, ("critics: [ConstraintCritic, GoalCritic, PathAlignCritic]",), "critics"),
        (MPPI, ("critics: [GoalCritic, ObstaclesCritic]",), ""),
        (MPPI, ("critics: [GoalCritic, CostCritic]", "CostCritic: {enabled: false}"), "enabled"),
        (MPPI, ("critics: [GoalCritic, CostCritic]", "CostCritic: {enabled: true}"), ""),
        (MPPI, ("critics: [GoalCritic, MyOwnCritic]",), ""),
        (DWB, ("critics: [RotateToGoal, PathDist, GoalDist]",), "critics"),
        (DWB, ("critics: [PathDist, ObstacleFootprintCritic]",), ""),
        (DWB, ("critics: [PathDist, BaseObstacle]", "BaseObstacle.scale: 0.0"), "BaseObstacle.scale"),
        (DWB, ("critics: [RotateToGoal, my_critics::Walls]",), ""),
        (DWB, ("critics: [RotateToGoal, Walls]", "Walls: {class: BaseObstacle}"), ""),
    ],
)
def test_a_controller_none_of_whose_critics_looks_at_obstacles(
    tmp_path: Path, plugin: str, lines: tuple[str, ...], key: str
) -> None:
    assert told(tmp_path, controller(plugin, *lines)) == ([("hinders", "warning", key)] if key else [])


@pytest.mark.parametrize(
    ("plugin", "lines", "wrong"),
    [
        (DWB, ("critics: [PathAlignCritic, BaseObstacle]", "PathAlign: {scale: 32.0, forward_point_distance: 0.1}"),
         [("misplaced-key", "Name the part PathAlignCritic, as the list does.")]),
        (DWB, ("critics: [PathAlign, BaseObstacle]", "PathAlignCritic: {scale: 32.0}"),
         [("misplaced-key", "Name the part PathAlign, as the list does.")]),
        (DWB, ("critics: [PathAlignCritic, BaseObstacle]", "PathAlignCritic.scale: 32.0"), []),
        (DWB, ("critics: [BaseObstacle, PathDist]", "GoalDist.scale: 24.0", "GoalDist.aggregation_type: last"),
         [("not-loaded", "Add it to critics, or leave it out.")]),
        (DWB, ("critics: [BaseObstacle, Ahead]", "Ahead: {class: GoalDist, scale: 24.0}"), []),
        (DWB, ("GoalDist.scale: 24.0",), []),
        (MPPI, ("critics: [CostCritic]", "GoalCritic: {cost_weight: 5.0}"),
         [("not-loaded", "Add it to critics, or leave it out.")]),
        (MPPI, ("critics: [CostCritic, GoalCritic]", "GoalCritic: {cost_weight: 5.0}"), []),
    ],
)  # fmt: skip
def test_a_critic_reads_its_values_below_the_name_that_the_list_has(
    tmp_path: Path, plugin: str, lines: tuple[str, ...], wrong: list[tuple[str, str]]
) -> None:
    assert [(one.rule, one.hint) for one in findings(tmp_path, controller(plugin, *lines))] == wrong


LAYERS = {
    "map": "StaticLayer", "scan": "ObstacleLayer", "voxel": "VoxelLayer", "sonar": "RangeSensorLayer",
    "noise": "DenoiseLayer", "inflated": "InflationLayer", "again": "InflationLayer",
}  # fmt: skip


def layered(*names: str, plugin: str = "", also: str = "update_frequency: 5.0") -> str:
    lines = [f"{one}: {{plugin: 'nav2_costmap_2d::{LAYERS[one]}'}}" for one in names if one in LAYERS]
    own = [f"own: {{plugin: '{plugin}'}}"] if plugin else []
    return costmap(f"plugins: [{', '.join(names)}]", *lines, *own, also)


@pytest.mark.parametrize(
    ("names", "wrong"),
    [
        (("map", "scan", "sonar", "noise", "inflated"), []),
        (("inflated", "scan"), ["scan comes after inflated: its obstacles are not inflated."]),
        (("inflated", "map"), ["map comes after inflated: its obstacles are not inflated."]),
        (("map", "scan", "inflated", "noise"), ["noise comes after inflated: what it removes stays inflated."]),
        (("map", "again", "voxel", "inflated"), []),
        (("scan", "map", "inflated"), ["map comes after scan: the map overwrites the obstacles."]),
        (("map", "inflated", "own"), []),
    ],
)
def test_layers_write_into_the_costmap_in_the_order_of_the_list(
    tmp_path: Path, names: tuple[str, ...], wrong: list[str]
) -> None:
    found = findings(tmp_path, layered(*names, plugin="my_layers::Lanes" if "own" in names else ""))
    assert [one.text for one in found] == wrong
    assert all((one.rule, one.parameter.rpartition("/")[2]) == ("hinders", "plugins") for one in found)


def test_a_map_that_is_added_by_the_larger_cost_overwrites_nothing(tmp_path: Path) -> None:
    assert findings(tmp_path, layered("scan", "map", "inflated", also="use_maximum: true")) == ()


@pytest.mark.parametrize(
    ("sources", "wrong"), [("scan", False), ("filtered", True), ("scan filtered", False), ("scan filtered rear", False)]
)
def test_a_source_by_another_name_than_the_part_that_describes_it(tmp_path: Path, sources: str, wrong: bool) -> None:
    parts = ["scan"] if " " not in sources else sources.split()
    layer = ("plugins: [obstacles]", "obstacles:", "  plugin: nav2_costmap_2d::ObstacleLayer",
             f"  observation_sources: {sources}",
             *(f"  {one}: {{topic: /{one}, marking: true, clearing: true, max_obstacle_height: 2.0}}"
               for one in parts))  # fmt: skip
    found = [(one.rule, one.hint) for one in findings(tmp_path, costmap(*layer))]
    assert found == ([("contradiction", "Give both the same name: filtered or scan.")] if wrong else [])


@pytest.mark.parametrize(
    ("plugin", "lines", "velocity", "wrong"),
    [
        (DWB, ("max_vel_x: 2.0", "max_vel_theta: 1.0"), "[0.5, 0.0, 1.0]", ["max_vel_x"]),
        (DWB, ("max_vel_x: 0.2", "max_vel_theta: 1.5"), "[0.2, 0.0, 0.2]", ["max_vel_theta"]),
        (DWB, ("max_vel_x: 0.26", "max_vel_theta: 1.0"), "[0.26, 0.0, 1.0]", []),
        (MPPI, ("vx_max: 3.5", "wz_max: 1.9"), "[2.0, 0.0, 2.0]", ["vx_max"]),
        (RPP, ("desired_linear_vel: 0.5",), "[0.4, 0.0, 0.0, 0.0, 0.0, 1.0]", ["desired_linear_vel"]),
        (RPP, ("desired_linear_vel: 0.5",), "[1.0, 0.0, 1.0]", []),
    ],
)
def test_a_smoother_lets_through_what_the_controller_plans(
    tmp_path: Path, plugin: str, lines: tuple[str, ...], velocity: str, wrong: list[str]
) -> None:
    found = findings(tmp_path, controller(plugin, *lines) + node("velocity_smoother", f"max_velocity: {velocity}"))
    slower = [one for one in found if one.rule == "hinders"]
    assert [name.rpartition("/")[2] for one in slower for name in one.others] == wrong


def test_the_values_of_a_controller_behind_a_shim_count(tmp_path: Path) -> None:
    text = controller("nav2_rotation_shim_controller::RotationShimController", f"primary_controller: {DWB}",
                      "max_vel_x: 2.0", "angular_dist_threshold: 0.785")  # fmt: skip
    (found,) = findings(tmp_path, text + node("velocity_smoother", "max_velocity: [0.5, 0.0, 1.0]"))
    assert (found.rule, found.parameter.rpartition("/")[2]) == ("hinders", "max_velocity")


BACKUP = node("behavior_server", "behavior_plugins: [backup]", "backup: {plugin: 'nav2_behaviors::BackUp'}")


@pytest.mark.parametrize(
    ("plugin", "line", "least", "wrong"),
    [
        (DWB, "min_vel_x: -0.08", "0.0", True),
        (DWB, "min_vel_x: 0.0", "0.0", False),
        (DWB, "min_vel_x: -0.08", "-0.1", False),
        (MPPI, "vx_min: -0.35", "0.0", True),
        (RPP, "allow_reversing: true", "0.0", True),
    ],
)
def test_a_smoother_that_lets_nothing_through_backwards(
    tmp_path: Path, plugin: str, line: str, least: str, wrong: bool
) -> None:
    text = controller(plugin, line) + node("velocity_smoother", f"min_velocity: [{least}, 0.0, -1.0]")
    found = findings(tmp_path, text)
    assert [one.parameter.rpartition("/")[2] for one in found] == (["min_velocity"] if wrong else [])
    assert [("backup" in one.hint) for one in findings(tmp_path, text + BACKUP)] == ([True] if wrong else [])


@pytest.mark.parametrize(
    ("critics", "costmap_line", "found"),
    [("[GoalCritic, CostCritic]", "track_unknown_space: false", ["width"]),
     ("[GoalCritic, CostCritic]", "track_unknown_space: true", []),
     ("[GoalCritic, MyCritic]", "rolling_window: true", [])],
)  # fmt: skip
def test_only_critics_that_look_at_the_costmap_need_trajectories_on_it(
    tmp_path: Path, critics: str, costmap_line: str, found: list[str]
) -> None:
    ahead = controller(MPPI, "vx_max: 3.0", "time_steps: 56", "model_dt: 0.05", f"critics: {critics}")
    inflation = ("plugins: [inflated]", "inflated: {plugin: 'nav2_costmap_2d::InflationLayer', inflation_radius: 10.0}")
    problems = findings(tmp_path, ahead + local("width: 3", "height: 3", costmap_line, *inflation))
    assert [one.parameter.rpartition("/")[2] for one in problems] == found


@pytest.mark.parametrize(("height", "found"), [(2, []), (6, []), (1, ["width"])])
def test_the_look_ahead_may_be_half_of_the_longer_side(tmp_path: Path, height: int, found: list[str]) -> None:
    width = 5 if height == 2 else 2
    text = controller(RPP, "lookahead_dist: 1.5") + local(f"width: {width}", f"height: {height}")
    problems = findings(tmp_path, text)
    assert [one.parameter.rpartition("/")[2] for one in problems] == found
