"""Parts of ROS navigation that are named otherwise than their reader, without a class, or with values that it refuses:
docks, polygons, planners of TEB, nodes and plugins."""

from __future__ import annotations

from pathlib import Path

import pytest

from care_core.lint.linting import lint
from care_core.lint.problems import Problem
from care_core.report.linting import counted
from tests.nav2_files import findings, node

DOCKS = (
    "dock_plugins: [charger]", "charger:", "  plugin: opennav_docking::SimpleChargingDock", "docks: [home]", "home:",
)  # fmt: skip
HOME = ("  type: charger", "  frame: map", "  pose: [0.0, 1.0, 0.0]")
POLYGON = ("polygons: [Stop]", "Stop:", "  type: polygon", "  action_type: stop")
RPP = (
    "controller_plugins: [FollowPath]", "FollowPath:", "  desired_linear_vel: 0.5", "  lookahead_dist: 0.6",
    "  use_rotate_to_heading: true",
)  # fmt: skip
CHECKER = ("goal_checker:", "  plugin: nav2_controller::SimpleGoalChecker")
BEHAVIORS = (
    "cycle_frequency: 10.0", "behavior_plugins: [spin]", "transform_tolerance: 0.1", "spin:",
    "  plugin: nav2_behaviors::Spin",
)  # fmt: skip


@pytest.mark.parametrize(
    ("text", "rule", "severity", "says"),
    [
        (node("docking_server", *DOCKS, "  type: charge", *HOME[1:]), "cannot-work", "warning", "mean charger?"),
        (node("docking_server", *DOCKS, *HOME[:2], "  pose: [0.0, 1.0]"), "cannot-work", "error", "has 2 numbers"),
        (node("docking_server", *DOCKS[:2], "  docking_threshold: 0.1", *DOCKS[3:], *HOME), "cannot-work", "warning",
         "dock_plugins names charger, and nothing here says its class"),
        (node("collision_monitor", *POLYGON, "  points: [0.3, 0.3, 0.3, -0.3, 0.0]"), "cannot-work", "error", "has 5"),
        (node("collision_monitor", "observation_sources: [lidar]", "scan:", "  type: scan", "  topic: /scan"),
         "cannot-work", "warning", "Is scan meant?"),
        (node("controller_server", *RPP), "cannot-work", "warning", "FollowPath has no class"),
        (node("controller_server", 'progress_checker_plugins: "progress_checker"'), "wrong-type", "error",
         "Write ['progress_checker']."),
        (node("controller_server", "goal_checker_plugins: [precise]", "precise:",
              "  plugin: nav2_controller::SimpleGoalChecker", *CHECKER), "not-loaded", "note",
         "Nothing loads goal_checker: no list of controller_server names it. Add it to goal_checker_plugins"),
        (node("waypoint_follower", "waypoint_task_executor_plugin: wait_there"), "cannot-work", "warning",
         "nothing here says its class: waypoint_follower will not start"),
        (node("behaviour_server", *BEHAVIORS), "unknown-key", "warning", "Did you mean behavior_server?"),
        (node("amcl", "alpha1: -0.2"), "cannot-work", "warning", "takes the root"),
        (node("amcl", "z_hit: 5.0"), "out-of-range", "warning", "from 0 to 1"),
        (node("amcl", "laser_model_type: likelihood-field"), "not-in-values", "warning", "likelihood_field counts"),
        (node("amcl", "use_sim_time: 'yes please'"), "wrong-type", "warning", "Write true or false without quotes"),
        (node("local_costmap", "footprint: [[0.2, 0.2], [0.2, -0.2], [-0.2, 0.0]]").replace(
            "local_costmap:\n", "local_costmap:\n local_costmap:\n"), "wrong-type", "error", "is a list of lists"),
    ],
)  # fmt: skip
def test_what_a_part_is_called_and_holds(tmp_path: Path, text: str, rule: str, severity: str, says: str) -> None:
    (found,) = findings(tmp_path, text)
    assert (found.rule, found.severity.value) == (rule, severity)
    assert says in f"{found.text} {found.hint}"
    assert found.source


@pytest.mark.parametrize(
    "text",
    [
        node("docking_server", *DOCKS, *HOME),
        node("collision_monitor", *POLYGON, "  points: [0.3, 0.3, 0.3, -0.3, 0.0, -0.3]"),
        node("controller_server", *CHECKER),
        node("waypoint_follower", "waypoint_task_executor_plugin: wait_at_waypoint"),
        node("my_behavior_server", *BEHAVIORS),
        node("behavior_server", *BEHAVIORS) + node("behaviour_server", "rate: 1.0"),
    ],
)
def test_parts_that_are_named_as_they_are_read_raise_nothing(tmp_path: Path, text: str) -> None:
    assert not findings(tmp_path, text)


TEB = {
    "max_vel_x": "0.4", "max_vel_x_backwards": "0.2", "max_vel_theta": "0.3", "acc_lim_x": "0.5", "dt_ref": "0.3",
    "dt_hysteresis": "0.1", "min_obstacle_dist": "0.2", "inflation_dist": "0.6", "penalty_epsilon": "0.1",
}  # fmt: skip


def of_teb(tmp_path: Path, values: dict[str, str], name: str = "TebLocalPlannerROS") -> list[Problem]:
    path = tmp_path / "teb.yaml"
    path.write_text(f"{name}:\n" + "".join(f"  {key}: {value}\n" for key, value in (TEB | values).items()))
    (found,) = lint([str(path)])
    return list(found.problems)


@pytest.mark.parametrize(
    ("values", "rule", "says"),
    [
        ({"dt_hysteresis": "0.3"}, "contradiction", "is not below dt_ref (0.3)"),
        ({"max_vel_trans": "0.2"}, "contradiction", "max_vel_trans (0.2) is below max_vel_x (0.4)"),
        ({"inflation_dist": "0.1"}, "dead-key", "is not above min_obstacle_dist (0.2 m)"),
        ({"weight_optimaltime": "0"}, "hinders", "nothing draws the robot on"),
        ({"min_samples": "2"}, "cannot-work", "no trajectory of so few points"),
        ({"acc_lim_x": "0.1"}, "hinders", "acc_lim_x (0.1) is not above penalty_epsilon (0.1)"),
        ({"cmd_angle_instead_rotvel": "true", "wheelbase": "0.0"}, "cannot-work", "the distance of the axles"),
        ({"footprint_model": "{type: lines}"}, "not-in-values", "the robot counts as a point"),
    ],
)
def test_what_teb_warns_of_itself(tmp_path: Path, values: dict[str, str], rule: str, says: str) -> None:
    (found,) = of_teb(tmp_path, values)
    assert found.rule == rule
    assert says in f"{found.text} {found.hint}"


def test_a_part_of_move_base_that_is_misspelt_is_named(tmp_path: Path) -> None:
    assert of_teb(tmp_path, {}) == []
    (found,) = of_teb(tmp_path, {}, "TebLocalPlanerROS")
    assert found.rule == "unknown-key"
    assert found.hint == "Did you mean TebLocalPlannerROS?"


@pytest.mark.parametrize(
    ("text", "rule", "says"),
    [
        ("base_local_planner: teb_local_planner/TebLocalPlanner\ncontroller_frequency: 5.0\n", "plugin-name",
         "Did you mean teb_local_planner/TebLocalPlannerROS?"),
        ("local_costmap:\n  global_frame: base_link\n  robot_base_frame: base_link\n", "hinders", "moves along"),
        ("local_costmap:\n  footprint: [[15.0, 0.2], [0.15, -0.2], [-0.15, 0.0]]\n  update_frequency: 5.0\n",
         "wrong-unit", "Is it in centimetres?"),
    ],
)  # fmt: skip
def test_planners_frames_and_sizes_of_ros_1(tmp_path: Path, text: str, rule: str, says: str) -> None:
    path = tmp_path / "move_base.yaml"
    path.write_text(text)
    (found,) = lint([str(path)])[0].problems
    assert found.rule == rule
    assert says in f"{found.text} {found.hint}"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (node("my_driver", "port: /dev/ttyUSB0", "baud: 115200"), ", most of whose keys care does not know"),
        (node("amcl", "alpha1: 0.2", "max_beams: 60") + node("my_driver", "baud: 115200"), ""),
        (node("slam_toolbox", "resolution: 0.05"), ""),
        (node("ekf_filter_node", "odom0: /odom", f"odom0_config: [{', '.join(['true'] * 15)}]"), ""),
    ],
)  # fmt: skip
def test_that_nothing_was_found_is_said_with_what_was_not_judged(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "nav2.yaml"
    path.write_text(text)
    assert counted(lint([str(path)])).endswith(f"1 file{says}")


def costmap(name: str, *lines: str) -> str:
    return node(name, *lines).replace(f"{name}:\n", f"{name}:\n {name}:\n", 1)


MAPPED = (
    "plugins: [static_layer, obstacle_layer]", "static_layer:", "  plugin: nav2_costmap_2d::StaticLayer",
    "obstacle_layer:", "  plugin: nav2_costmap_2d::ObstacleLayer", "  enabled: true",
)  # fmt: skip
SCAN = ("observation_sources: scan", "scan:", "  topic: /scan")
INSIDE = tuple(f"  {line}" for line in SCAN)


@pytest.mark.parametrize(
    ("lines", "rule", "says"),
    [
        ((*MAPPED, *INSIDE, "global_frame: map"), "", ""),
        ((*MAPPED, *INSIDE, "global_frame: odom"), "hinders", "as odometry drifts"),
        ((*MAPPED, *INSIDE, "global_frame: odom", "rolling_window: true"), "", ""),
        ((*MAPPED, *SCAN), "cannot-work", "stands beside obstacle_layer, not in it"),
        ((*MAPPED, *INSIDE, "width: -20"), "cannot-work", "width is -20"),
    ],
)
def test_a_costmap_lies_in_the_frame_of_its_map_and_its_layers_hear_their_sensors(
    tmp_path: Path, lines: tuple[str, ...], rule: str, says: str
) -> None:
    found = [one for one in findings(tmp_path, costmap("global_costmap", *lines)) if one.severity.value != "note"]
    assert [one.rule for one in found] == ([rule] if rule else [])
    assert all(says in one.text for one in found)


@pytest.mark.parametrize(("frame", "rules"), [("odom", ["hinders"]), ("map", [])])
def test_a_map_of_move_base_lies_in_its_own_frame(tmp_path: Path, frame: str, rules: list[str]) -> None:
    layers = '  plugins: [{name: static_layer, type: "costmap_2d::StaticLayer"}]\n'
    text = f"global_costmap:\n  global_frame: {frame}\n  update_frequency: 2.0\n{layers}"
    assert [one.rule for one in findings(tmp_path, text)] == rules
