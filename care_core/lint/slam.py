"""SLAM toolbox: names, types, frames, and what keeps it from telling where the robot is."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping

from care_core.ecosystems.ros.ros2_yaml import PARAMETERS
from care_core.errors import nearest
from care_core.lint.generic import near
from care_core.lint.problems import Entry, LintedFile, Problem

_NODE = re.compile(r"\w*slam_toolbox\w*")
_DECIMALS = (
    "transform_publish_period", "map_update_interval", "resolution", "max_laser_range", "min_laser_range",
    "minimum_time_interval", "transform_timeout", "tf_buffer_duration", "minimum_travel_distance",
    "minimum_travel_heading", "scan_buffer_maximum_scan_distance", "link_match_minimum_response_fine",
    "link_scan_maximum_distance", "loop_search_maximum_distance", "loop_match_maximum_variance_coarse",
    "loop_match_minimum_response_coarse", "loop_match_minimum_response_fine", "correlation_search_space_dimension",
    "correlation_search_space_resolution", "correlation_search_space_smear_deviation", "loop_search_space_dimension",
    "loop_search_space_resolution", "loop_search_space_smear_deviation", "distance_variance_penalty",
    "angle_variance_penalty", "fine_search_angle_offset", "coarse_search_angle_offset", "coarse_angle_resolution",
    "minimum_angle_penalty", "minimum_distance_penalty", "position_covariance_scale", "yaw_covariance_scale",
)  # fmt: skip
"""Numbers that its node of ROS 2 declares as decimal ones."""
_OTHERS = (
    "solver_plugin", "ceres_linear_solver", "ceres_preconditioner", "ceres_trust_strategy", "ceres_dogleg_type",
    "ceres_loss_function", "odom_frame", "map_frame", "base_frame", "scan_topic", "mode", "map_file_name",
    "map_start_pose", "map_start_at_dock", "map_name", "debug_logging", "throttle_scans", "stack_size_to_use",
    "enable_interactive_mode", "interactive_mode", "use_map_saver", "use_scan_matching", "use_scan_barycenter",
    "scan_buffer_size", "scan_queue_size", "do_loop_closing", "loop_match_minimum_chain_size",
    "use_response_expansion", "use_sim_time", "use_lifecycle_manager", "paused_processing",
    "paused_new_measurements", "localization_on_configure", "restamp_tf", "min_pass_through", "occupancy_threshold",
    "check_min_dist_and_heading_precisely", "lifelong_search_use_tree", "lifelong_minimum_score", "lifelong_iou_match",
    "lifelong_node_removal_score", "lifelong_overlap_score_scale", "lifelong_constraint_multiplier",
    "lifelong_nearby_penalty", "lifelong_candidates_scale",
)  # fmt: skip
_MODES = ("mapping", "localization")
_SOLVERS = ("solver_plugins::CeresSolver", "solver_plugins::GTSAMSolver", "solver_plugins::SpaSolver",
            "solver_plugins::G2oSolver")  # fmt: skip
_OWN_ENDINGS = ("posegraph", "data")
_ENDINGS = (*_OWN_ENDINGS, "yaml", "yml", "pgm", "png")
_FRAMES = ("map_frame", "odom_frame", "base_frame")
_COMMON = "slam_toolbox_common.cpp"

Values = Mapping[str, Entry]


def check(file: LintedFile) -> Iterator[Problem]:
    """What is wrong with the node of SLAM toolbox that a file of ROS 2 holds."""
    found: dict[str, dict[str, Entry]] = {}
    for entry in file.entries:
        if is_of_slam(entry):
            at = entry.keys.index(PARAMETERS)
            found.setdefault(entry.keys[at - 1], {})[".".join(entry.keys[at + 1 :])] = entry
    for values in found.values():
        yield from _names(file, values)
        yield from _map(file, values)
        yield from _words(file, values)
        yield from _frames(file, values)
        yield from _numbers(file, values)


def is_of_slam(entry: Entry) -> bool:
    """Whether a value is of the node of SLAM toolbox."""
    keys = entry.keys
    return PARAMETERS in keys[1:-1] and bool(_NODE.fullmatch(keys[keys.index(PARAMETERS) - 1]))


def _names(file: LintedFile, values: Values) -> Iterator[Problem]:
    """Names that are a slip of the pen, and whole numbers: releases and forks add names of their own."""
    known = (*_DECIMALS, *_OTHERS)
    for name, entry in values.items():
        if name not in known and "." not in name and not name.startswith("bond_"):
            meant = near(name, known)
            if meant and meant not in values:
                text = f"No parameter {name} of slam_toolbox is known."
                hint = f"Did you mean {meant}?"
                yield file.warning("unknown-key", entry, text, hint, _COMMON)
        elif name in _DECIMALS and entry.kind == "int" and entry.number is not None:
            text = f"{name} is an integer, declared is a decimal number: the node will not start."
            yield file.error("wrong-type", entry, text, f"Write {entry.number:g}.0.", _COMMON)


def _words(file: LintedFile, values: Values) -> Iterator[Problem]:
    """Words of which it knows a few; solvers of another package it takes as well."""
    mode, solver = values.get("mode"), values.get("solver_plugin")
    if mode is not None and mode.kind == "str" and mode.value not in _MODES and "$" not in str(mode.value):
        text = f"mode is {mode.value}, which is none of its values: launch files and tools do not know it."
        hint = f"They are {', '.join(_MODES)}. {nearest(str(mode.value), _MODES)}".strip()
        yield file.warning("not-in-values", mode, text, hint, "the parameter files of slam_toolbox")
    if solver is None or "$" in str(solver.value):
        return
    package = str(solver.value).partition("::")[0]
    if solver.value not in _SOLVERS and (package == "solver_plugins" or nearest(package, ["solver_plugins"])):
        text = f"solver_plugin is {solver.value}, which no package of slam_toolbox brings: the node exits."
        hint = nearest(str(solver.value), _SOLVERS) or f"It is {_SOLVERS[0]} as it ships."
        yield file.error("plugin-name", solver, text, hint, "solver_plugins.xml")


def _map(file: LintedFile, values: Values) -> Iterator[Problem]:
    """A map with an ending: the node adds its own."""
    entry = values.get("map_file_name")
    stem, dot, ending = str(entry.value).rpartition(".") if entry is not None else ("", "", "")
    if entry is not None and dot and ending in _ENDINGS:
        text = f"map_file_name ends in .{ending}, and the node adds .posegraph to it: no map is loaded."
        hint = f"Write {stem}."
        if ending not in _OWN_ENDINGS:
            hint += " It is the pose graph that is loaded, not an image of the map: save that first."
        yield file.warning("cannot-work", entry, text, hint, "serialization.hpp of slam_toolbox")


def _frames(file: LintedFile, values: Values) -> Iterator[Problem]:
    seen: dict[str, Entry] = {}
    for name in _FRAMES:
        entry = values.get(name)
        frame = "" if entry is None else str(entry.value).strip("/")
        if entry is not None and frame in seen and "$" not in frame:
            text = f"{seen[frame].keys[-1]} and {name} are both {frame}: no scan finds its place."
            hint = "Map, odometry and robot are three frames (REP 105)."
            yield file.warning("cannot-work", entry, text, hint, f"{_COMMON} asks tf for each", [seen[frame]])
        elif entry is not None:
            seen[frame] = entry


def _numbers(file: LintedFile, values: Values) -> Iterator[Problem]:
    period, heading = values.get("transform_publish_period"), values.get("minimum_travel_heading")
    if period is not None and period.number == 0:
        text = "transform_publish_period is 0: it never tells where odom is on the map."
        hint = "0.02 is usual, unless another node publishes that transform."
        yield file.warning("cannot-work", period, text, hint, f"{_COMMON}, publishTransformLoop")
    if heading is not None and heading.number is not None and heading.number > 2 * math.pi:
        text = f"minimum_travel_heading is {heading.number:g} rad, more than a whole turn."
        hint = f"Is it in degrees? {math.radians(heading.number):.4g} rad would be."
        yield file.warning("wrong-unit", heading, text, hint, "an angle is at most 2 pi")
