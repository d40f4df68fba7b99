"""What nodes of Nav2 refuse, and what they take and do nothing with: the parser, words, lists, sources, frames."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.nav2_files import DWB, MPPI, RPP, controller, findings, node, told


def costmap(name: str, *lines: str) -> str:
    return "\n".join([f"{name}:", f"  {name}:", "    ros__parameters:", *(f"      {line}" for line in lines), ""])


def layer(source: str, sources: str = "scan") -> str:
    return costmap(
        "local_costmap", "plugins: [obstacles]", "obstacles:", "  plugin: nav2_costmap_2d::ObstacleLayer",
        f"  observation_sources: {sources}", f"  scan: {{clearing: true, data_type: LaserScan, {source}}}",
    )  # fmt: skip


# The parser


@pytest.mark.parametrize(
    ("held", "hint"),
    [
        ("[0.5, 0, 1.0]", "Write [0.5, 0.0, 1.0]."),
        ("[1, 0.0, 2]", "Write [1.0, 0.0, 2.0]."),
        ("[0.5, 0.0, 1.0]", ""),
        ("$(var top)", ""),
    ],
)
def test_a_list_of_integers_and_decimals_is_refused(tmp_path: Path, held: str, hint: str) -> None:
    found = findings(tmp_path, node("velocity_smoother", f"max_velocity: {held}"))
    assert [(one.rule, one.severity.value, one.hint) for one in found] == (
        [("wrong-type", "error", hint)] if hint else []
    )


def test_a_long_list_is_not_written_out(tmp_path: Path) -> None:
    (found,) = findings(tmp_path, node("ekf_filter_node", f"process_noise_covariance: [0.05{', 0' * 224}]"))
    assert found.hint == "Write each number with a decimal point."


def test_lists_of_names_and_of_switches_are_of_one_type(tmp_path: Path) -> None:
    assert told(tmp_path, node("ekf_filter_node", "flags: [true, false, no]", "names: [a, 'b', c]")) == []


@pytest.mark.parametrize(
    ("section", "hint"),
    [
        ("planner_server:\n  planner_plugins: [GridBased]\n",
         "Write planner_server: ros__parameters:, and the values below."),
        ("planner_server:\n  ros_parameters:\n    planner_plugins: [GridBased]\n",
         "Write ros__parameters for ros_parameters."),
        ("local_costmap:\n  local_costmap:\n    width: 3\n",
         "Write local_costmap: ros__parameters:, and the values below."),
        ("my_launch_arguments:\n  rate: 5\n", ""),
    ],
)  # fmt: skip
def test_a_node_whose_values_do_not_stand_below_ros_parameters(tmp_path: Path, section: str, hint: str) -> None:
    found = findings(tmp_path, node("amcl", "max_beams: 60") + section)
    assert [(one.rule, one.severity.value, one.hint) for one in found] == (
        [("no-parameters", "error", hint)] if hint else []
    )


@pytest.mark.parametrize(("value", "rules"), [("'true'", ["wrong-type"]), ('"False"', ["wrong-type"]), ("true", [])])
def test_a_clock_in_quotes(tmp_path: Path, value: str, rules: list[str]) -> None:
    assert [one.rule for one in findings(tmp_path, node("amcl", f"use_sim_time: {value}"))] == rules


# Words


MONITOR = (
    "polygons: [Stop]", "observation_sources: [scan]", "Stop: {type: TYPE, action_type: ACTION, radius: 0.3}",
    "scan: {type: SOURCE, topic: scan}",
)  # fmt: skip


@pytest.mark.parametrize(
    ("words", "wrong"),
    [
        (("circle", "stop", "scan"), ""),
        (("velocity_polygon", "approach", "pointcloud"), ""),
        (("footprint", "stop", "scan"), "type"),
        (("circle", "halt", "scan"), "action_type"),
        (("circle", "stop", "laserscan"), "type"),
        (("$(var type)", "stop", "scan"), ""),
    ],
)
def test_words_that_the_collision_monitor_does_not_know(
    tmp_path: Path, words: tuple[str, str, str], wrong: str
) -> None:
    text = node("collision_monitor", *MONITOR)
    for mark, word in zip(("TYPE", "ACTION", "SOURCE"), words, strict=True):
        text = text.replace(mark, word)
    assert told(tmp_path, text) == ([("not-in-values", "error", wrong)] if wrong else [])


@pytest.mark.parametrize(
    ("line", "wrong"),
    [
        ("polygons: [Slow]", "polygons"),
        ("cmd_vel_out_topic: /cmd_vel_raw", "cmd_vel_out_topic"),
        ("cmd_vel_out_topic: cmd_vel", ""),
    ],
)
def test_a_collision_monitor_without_a_shape_or_that_hears_itself(tmp_path: Path, line: str, wrong: str) -> None:
    found = told(tmp_path, node("collision_monitor", "cmd_vel_in_topic: cmd_vel_raw", line))
    assert [parameter for _, _, parameter in found] == ([wrong] if wrong else [])


@pytest.mark.parametrize(
    ("text", "target", "wrong"),
    [
        (controller(MPPI, "motion_model: Diffdrive", "critics: [CostCritic]"), "humble", "motion_model"),
        (controller(MPPI, "motion_model: Ackermann", "critics: [CostCritic]"), "jazzy", ""),
        (controller(MPPI, "motion_model: diff_drive", "critics: [CostCritic]"), "lyrical", ""),
        (node("velocity_smoother", "feedback: OPENLOOP"), "", "feedback"),
        (node("velocity_smoother", "feedback: CLOSED_LOOP"), "", ""),
        (node("amcl", "robot_model_type: differential"), "humble", "robot_model_type"),
        (node("amcl", "robot_model_type: differential"), "galactic", ""),
        (node("amcl", "robot_model_type: my_models::Tracked"), "jazzy", ""),
        (layer("max_obstacle_height: 2.0, topic: /scan").replace("LaserScan", "Laserscan"), "", "data_type"),
    ],
)
def test_words_that_a_node_refuses(tmp_path: Path, text: str, target: str, wrong: str) -> None:
    assert told(tmp_path, text, target) == ([("not-in-values", "error", wrong)] if wrong else [])


@pytest.mark.parametrize(
    ("critics", "rules"),
    [
        ("[PathAling, GoalDist, BaseObstacle]", ["plugin-name"]),
        ("[RotateToGoal, Oscillation, BaseObstacle]", ["cannot-work"]),
        ("[PathAlign, GoalDist, BaseObstacle]", []),
        ("[Oscillation, BaseObstacle, 'my_critics::Ahead']", []),
    ],
)
def test_critics_that_there_are_not_or_that_draw_to_nothing(tmp_path: Path, critics: str, rules: list[str]) -> None:
    found = findings(tmp_path, controller(DWB, f"critics: {critics}"))
    assert [one.rule for one in found] == rules


@pytest.mark.parametrize(("slowest", "severity"), [("0.0", "note"), ("0.1", "warning")])
def test_turns_that_must_be_faster_than_they_may(tmp_path: Path, slowest: str, severity: str) -> None:
    lines = ("min_speed_theta: 1.5", "max_vel_theta: 1.0", f"min_speed_xy: {slowest}", "max_speed_xy: 0.3")
    assert told(tmp_path, controller(DWB, *lines)) == [("contradiction", severity, "min_speed_theta")]


# Sources of obstacles


@pytest.mark.parametrize(
    ("source", "wrong"),
    [
        ("topic: /scan, marking: true, max_obstacle_height: 2.0", ""),
        ("topic: /scan, marking: true, max_obstacle_height: 0.0", "max_obstacle_height"),
        ("topic: /scan, marking: true", "clearing"),
        ("topic: /scan, marking: false", "marking"),
    ],
)
def test_a_source_of_which_nothing_above_the_floor_is_kept(tmp_path: Path, source: str, wrong: str) -> None:
    found = [parameter for _, _, parameter in told(tmp_path, layer(source))]
    assert found == ([wrong] if wrong else [])


def test_sources_of_ros_1_reach_two_metres_where_nothing_is_written(tmp_path: Path) -> None:
    text = "obstacle_layer:\n  observation_sources: scan\n  scan: {data_type: LaserScan, topic: scan, marking: true}\n"
    assert told(tmp_path, f"local_costmap:\n  {text.replace(chr(10), chr(10) + '  ').rstrip()}\n") == []


@pytest.mark.parametrize(
    ("topic", "target", "rules"),
    [("scan", "humble", ["hinders"]), ("/scan", "humble", []), ("scan", "kilted", []), ("scan", "", [])],
)
def test_a_topic_is_the_costmaps_own_before_kilted(tmp_path: Path, topic: str, target: str, rules: list[str]) -> None:
    found = findings(tmp_path, layer(f"topic: {topic}, max_obstacle_height: 2.0"), target)
    assert [one.rule for one in found if "slash" in one.text] == rules
    assert all(one.severity.value == "note" for one in found)


def test_a_list_of_sources_is_no_text(tmp_path: Path) -> None:
    text = layer("topic: /scan, max_obstacle_height: 2.0", sources="[scan]")
    assert told(tmp_path, text) == [("wrong-type", "error", "observation_sources")]


# Frames, trees, shapes


@pytest.mark.parametrize(
    ("local", "world", "tree", "wrong"),
    [
        ("base_link", "base_link", "base_link", 0),
        ("base_footprint", "base_link", "base_link", 0),
        ("robot1/base_footprint", "robot1/base_link", "robot1/base_link", 0),
        ("robot1/base_link", "robot2/base_link", "robot2/base_link", 1),
        ("base_link", "base_link", "robot_base", 1),
        ("chassis", "base_link", "base_link", 1),
        ("chassis", "chassis", "chassis", 0),
    ],
)
def test_one_robot_has_one_frame(tmp_path: Path, local: str, world: str, tree: str, wrong: int) -> None:
    text = costmap("local_costmap", f"robot_base_frame: {local}")
    text += costmap("global_costmap", f"robot_base_frame: {world}") + node("bt_navigator", f"robot_base_frame: {tree}")
    assert [rule for rule, _, _ in told(tmp_path, text)] == ["contradiction"] * wrong


@pytest.mark.parametrize(("seconds", "rules"), [("1.0", []), ("2.0", []), ("30.0", ["hinders"])])
def test_corrections_that_amcl_dates_far_ahead(tmp_path: Path, seconds: str, rules: list[str]) -> None:
    assert [one.rule for one in findings(tmp_path, node("amcl", f"transform_tolerance: {seconds}"))] == rules


@pytest.mark.parametrize(
    ("tree", "rules"),
    [
        ("navigate_to_pose_w_replanning_and_recovery.xml", ["cannot-work"]),
        ("/opt/trees/own.xml", []),
        ("$(find-pkg-share trees)/own.xml", []),
        ("NavigateToPose", []),
    ],
)
def test_a_behavior_tree_without_a_folder(tmp_path: Path, tree: str, rules: list[str]) -> None:
    assert [
        one.rule for one in findings(tmp_path, node("bt_navigator", f"default_nav_to_pose_bt_xml: {tree}"))
    ] == rules


@pytest.mark.parametrize(
    ("line", "rules"),
    [
        ("footprint: '[[0.2, 0.2], [-0.2, -0.2]]'", ["cannot-work"]),
        ("footprint: '[]'", []),
        ("robot_radius: 0.0", ["clearance"]),
        ("robot_radius: 0.2", []),
    ],
)
def test_robots_without_a_shape(tmp_path: Path, line: str, rules: list[str]) -> None:
    assert [one.rule for one in findings(tmp_path, costmap("local_costmap", line))] == rules


@pytest.mark.parametrize(("target", "rules"), [("humble", ["contradiction"]), ("jazzy", [])])
def test_reversing_beside_turning_in_place(tmp_path: Path, target: str, rules: list[str]) -> None:
    text = controller(RPP, "desired_linear_vel: 0.5", "allow_reversing: true", "use_rotate_to_heading: true")
    assert [one.rule for one in findings(tmp_path, text, target)] == rules


@pytest.mark.parametrize(
    ("name", "value", "rules"),
    [
        ("max_velocity", "[0.5, 0.0, 0.0]", ["cannot-work"]),
        ("max_velocity", "[0.0, 0.0, 1.0]", ["cannot-work"]),
        ("max_accel", "[2.5, 0.0, 0.0]", ["cannot-work"]),
        ("max_accel", "[2.5, 0.0, 3.2]", []),
    ],
)
def test_a_smoother_that_lets_no_turn_through(tmp_path: Path, name: str, value: str, rules: list[str]) -> None:
    assert [one.rule for one in findings(tmp_path, node("velocity_smoother", f"{name}: {value}"))] == rules
