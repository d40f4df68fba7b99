"""Whose parameters a file of ROS holds: names below a plugin that does not read them, and planners nobody knows."""

from __future__ import annotations

from pathlib import Path

from care_core.lint.linting import lint
from care_core.lint.problems import Problem


def findings(tmp_path: Path, text: str) -> tuple[Problem, ...]:
    path = tmp_path / "planner.yaml"
    path.write_text(text)
    (linted,) = lint([str(path)])
    return linted.problems


TEB = "max_vel_x: 0.4\n  max_vel_theta: 0.3\n  dt_ref: 0.3\n  weight_obstacle: 50.0\n  min_turning_radius: 0.0\n"
TEB += "  no_inner_iterations: 5\n  weight_optimaltime: 1.0\n"


def test_the_parameters_of_another_planner_are_told_once(tmp_path: Path) -> None:
    (found,) = findings(tmp_path, f"DWAPlannerROS:\n  sim_time: 1.7\n  {TEB}")
    assert found.text == "dt_ref and 4 more are parameters of TebLocalPlannerROS: DWAPlannerROS does not read them."
    assert len(found.others) == 4


def test_a_planner_that_no_table_knows_is_not_judged(tmp_path: Path) -> None:
    text = "MpcLocalPlannerROS:\n  robot:\n    unicycle:\n      max_vel_x: 1.5\n      max_vel_x_backwards: 0\n"
    assert findings(tmp_path, f"{text}      max_vel_theta: 3.8\n      acc_lim_x: 2.5\n      dec_lim_x: 2.5\n") == ()


def test_a_plugins_file_without_its_namespace_is_the_plugins(tmp_path: Path) -> None:
    assert (
        findings(tmp_path, "sim_granularity: 0.017\nfrequency: 10\nTrajectoryPlannerROS: {acc_lim_theta: 3.2}\n") == ()
    )


def test_a_layers_name_is_moved_to_the_layer_that_reads_it(tmp_path: Path) -> None:
    text = "local_costmap:\n  obstacle_layer: {observation_sources: a, inflation_radius: 0.5}\n"
    (found,) = findings(tmp_path, f"{text}  inflation_layer: {{cost_scaling_factor: 10.0, enabled: true}}\n")
    assert found.text == "ObstacleLayer does not read inflation_radius; InflationLayer would."
