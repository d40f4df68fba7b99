"""Values of ROS navigation with which a robot cannot do its work, or hardly: limits of one value, and values of
several readers beside each other."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import combinations
from typing import NamedTuple

from care_core.lint import critics, docks, frames, layers, monitor, refused, smoother, sources, teb, window
from care_core.lint.contradictions import inscribed_radius
from care_core.lint.problems import Entry, LintedFile, Problem
from care_core.lint.readers import (
    CHECKERS,
    COLLISIONS,
    CONTROLLERS,
    INFLATIONS,
    PLANNERS,
    PROGRESS,
    SAMPLED,
    TOP_SPEEDS,
    Reader,
    Readers,
    readers,
)
from care_core.lint.scopes import COSTMAP, Scoped, words_of
from care_core.metadata.navigation import OBSTACLES

_SAME_S = 1e-6
"""Periods that are so near count as one (optimizer.cpp)."""
_OTHER_ROBOT = 1.5
"""How far apart the sizes of one robot in two costmaps are never meant to be: padding makes a few percent."""


class Above(NamedTuple):
    """A value that must be above 0 (`sign` -1: below, 0: another), by who reads it."""

    owners: tuple[str, ...]
    names: tuple[str, ...]
    why: str
    source: str
    sign: int = 1
    rule: str = "cannot-work"
    zero: bool = False
    """Whether 0 is a value like others."""
    unless_off: str = ""
    """A switch without which the value is not used."""


_SPEED = "the planner samples speeds up to it"
_SAMPLES = "dwb_plugins, xy_theta_iterator.cpp: speeds are sampled between the least and the largest"
_TOLERANCE = "a goal is reached when the distance is below it"
ABOVE: tuple[Above, ...] = (
    Above(("move_base", "controller_server"), ("controller_frequency",), "no command is ever computed",
          "the control loop runs at this rate (move_base.cpp, controller_server.cpp)"),
    Above((COSTMAP,), ("update_frequency",), "the costmap is never updated", "costmap_2d_ros.cpp, mapUpdateLoop"),
    Above((COSTMAP,), ("width", "height"), "there is no such costmap, and its cells fill the memory",
          "ros-navigation/navigation2 #4005", zero=True),
    Above((COSTMAP,), ("transform_tolerance",), "every pose of the robot counts as too old",
          "costmap_2d_ros.cpp, getRobotPose"),
    Above((*PLANNERS, *CONTROLLERS), TOP_SPEEDS, "the robot may not drive forwards", _SPEED),
    Above(("DWAPlannerROS",), ("max_vel_trans", "max_trans_vel"), "the robot may not drive", _SPEED),
    Above(("DWBLocalPlanner",), ("max_speed_xy",), "the robot may not drive",
          "dwb_plugins, kinematic_parameters.cpp: below 0 there is no limit", 0),
    Above((*PLANNERS, *CONTROLLERS), ("max_vel_theta", "max_rot_vel", "wz_max"), "the robot may not turn", _SPEED),
    Above((*PLANNERS, "DWBLocalPlanner", "MPPIController"), ("acc_lim_x", "acc_lim_theta", "ax_max", "az_max"),
          "the speed can never change", "speeds are sampled as far as this acceleration leads in a step"),
    Above(("DWBLocalPlanner",), ("decel_lim_x", "decel_lim_theta"), "the robot cannot slow down",
          "dwb_plugins, one_d_velocity_iterator.hpp: a deceleration is negative", -1),
    Above(("DWBLocalPlanner",), ("acc_lim_y",), "the speed sideways can never change",
          "dwb_plugins, one_d_velocity_iterator.hpp: an acceleration is positive", zero=True),
    Above(("DWBLocalPlanner",), ("decel_lim_y",), "the robot cannot slow down sideways",
          "dwb_plugins, one_d_velocity_iterator.hpp: a deceleration is negative", -1, zero=True),
    Above(("DWBLocalPlanner",), ("min_vel_x",), "the robot can neither stop nor turn in place", _SAMPLES, -1,
          "hinders", zero=True),
    Above(("DWBLocalPlanner",), ("min_vel_y",), "the robot always drifts sideways", _SAMPLES, -1, "hinders", zero=True),
    Above(("DWBLocalPlanner",), ("max_vel_y",), "the robot always drifts sideways", _SAMPLES, 1, "hinders", zero=True),
    Above(("MPPIController",), ("vx_min",), "the robot can neither stop nor turn in place",
          "optimizer.cpp keeps the speed between vx_min and vx_max", -1, "hinders", zero=True),
    Above(("MPPIController",), ("vy_max", "ay_max"), "no speed sideways is within its limits",
          "optimizer.cpp keeps speeds sideways between -vy_max and vy_max, and their change below ay_max", zero=True),
    Above(("MPPIController",), ("ax_min", "ay_min"), "it is a deceleration, of which MPPI turns the sign",
          "optimizer.cpp: a deceleration is negative", -1, "contradiction", zero=True),
    Above(("RegulatedPurePursuitController", "RotationShimController"),
          ("rotate_to_heading_angular_vel", "max_angular_accel"), "the robot cannot turn to its path",
          "the controller turns in place at this speed, reached with this acceleration",
          unless_off="use_rotate_to_heading"),
    Above(("RegulatedPurePursuitController",), ("lookahead_time", "min_lookahead_dist"),
          "there is nothing ahead to drive to", "the look-ahead is the speed times lookahead_time, at least "
          "min_lookahead_dist", zero=True),
    Above(("RegulatedPurePursuitController",), ("min_approach_linear_velocity", "regulated_linear_scaling_min_speed"),
          "it is the least speed while the robot slows down", "regulation_functions.hpp keeps the speed above it",
          1, "contradiction", zero=True),
    Above(("GracefulController",), ("v_linear_min", "v_angular_max"), "it is a size of a speed",
          "smooth_control_law.cpp keeps the size of speeds between them", zero=True),
    Above(("behavior_server",), ("max_rotational_vel",), "the robot cannot turn in place",
          "spin.cpp turns at most at this speed"),
    Above(("behavior_server",), ("min_rotational_vel",), "it is a size of a speed", "spin.cpp turns no slower",
          zero=True),
    Above(SAMPLED, ("sim_time", "sim_granularity", "linear_granularity", "angular_granularity"),
          "no trajectory is simulated", "the trajectory generators step through sim_time by the granularity"),
    Above(("RegulatedPurePursuitController",), ("lookahead_dist", "max_lookahead_dist"),
          "there is nothing ahead to drive to", "the controller drives to the point so far ahead"),
    Above((*PLANNERS, *CHECKERS), ("xy_goal_tolerance", "yaw_goal_tolerance"), "no goal is ever reached", _TOLERANCE),
    Above(PROGRESS, ("movement_time_allowance",), "every drive counts as stuck at once", "simple_progress_checker.cpp"),
    Above(("velocity_smoother",), ("smoothing_frequency",), "no command is passed on", "velocity_smoother.cpp"),
    Above(("behavior_server",), ("cycle_frequency",), "no behaviour runs", "timed_behavior.hpp"),
    Above(("bt_navigator",), ("bt_loop_duration", "default_server_timeout"), "no server can answer in time",
          "bt_action_node.hpp waits so many milliseconds"),
    Above(("move_base",), ("controller_patience", "planner_patience"), "one failed attempt starts the recoveries",
          "move_base.cpp compares the time since the last good plan or command with it", rule="hinders"),
    Above(OBSTACLES, ("obstacle_range", "obstacle_max_range", "max_obstacle_height"), "no obstacle is ever marked",
          "obstacle_layer.cpp, updateBounds"),
    Above(("StaticLayer", COSTMAP), ("lethal_cost_threshold",), "every cell of the map is an obstacle",
          "static_layer.cpp, interpretValue"),
    Above((COSTMAP,), ("robot_radius",), "the robot has no size, and plans touch obstacles",
          "costmap_2d_ros.cpp draws a circle of it where no footprint is set", rule="clearance"),
    Above(("amcl",), tuple(f"{odom}alpha{number}" for odom in ("", "odom_") for number in range(1, 6)),
          "it is a noise, of which amcl takes the root", "the motion models of amcl", zero=True),
    Above(("SmacPlannerHybrid",), ("minimum_turning_radius",), "there is no curve to search along",
          "node_hybrid.cpp of nav2_smac_planner takes the arc sine of sqrt(2) / (2 * radius)"),
    Above(INFLATIONS, ("inflation_radius",), "plans may touch obstacles", "inflation_layer.cpp", rule="clearance"),
)  # fmt: skip


class Off(NamedTuple):
    """A switch that is off, by who reads it."""

    owners: tuple[str, ...]
    name: str
    why: str
    source: str
    rule: str = "hinders"
    unless: str = ""
    """What does without it, which no parameter file shows."""


OFF: tuple[Off, ...] = (
    Off(("amcl",), "tf_broadcast", "it does not tell where odom is on the map", "amcl publishes that transform",
        "cannot-work", "another node publishes that transform"),
    Off(("move_base",), "recovery_behavior_enabled", "a robot that is stuck gives up at once", "move_base.cpp"),
    Off(("StaticLayer",), "map_subscribe_transient_local", "a map that was sent before it listens never arrives",
        "static_layer.cpp; map_server sends its map once, and keeps it for those that ask"),
    Off(INFLATIONS, "enabled", "plans may touch obstacles", "inflation_layer.cpp"),
)  # fmt: skip


def check(file: LintedFile, result: Scoped) -> Iterator[Problem]:
    """Values with which a robot cannot do its work, or hardly."""
    held = readers(result)
    for reader in held:
        yield from _above(file, reader)
        yield from _off(file, reader)
    for rule in RULES_OF_SEVERAL:
        yield from rule(file, held)


def _above(file: LintedFile, reader: Reader) -> Iterator[Problem]:
    for rule in ABOVE:
        if not reader.is_a(*rule.owners) or reader.is_off(rule.unless_off):
            continue
        for key, entry in reader.values.items():
            if key.rpartition(".")[2] not in rule.names or entry.number is None or _is_of_source(key):
                continue
            if key == "robot_radius" and reader.has_footprint():
                continue
            if entry.number * rule.sign < 0 or (entry.number == 0 and not rule.zero):
                text = f"{entry.keys[-1]} is {entry.number:g}: {rule.why}."
                side = {1: "above", -1: "below", 0: "other than"}[rule.sign]
                hint = f"It must be 0 or {side} it." if rule.zero else f"It must be {side} 0."
                yield file.warning(rule.rule, entry, text, hint, rule.source)


def _is_of_source(key: str) -> bool:
    """Whether it is a source's own height: 0 is then that of its layer."""
    return key.endswith(".max_obstacle_height")


def _off(file: LintedFile, reader: Reader) -> Iterator[Problem]:
    for rule in OFF:
        if reader.is_a(*rule.owners) and reader.is_off(rule.name):
            entry = reader.values[rule.name]
            text = f"{rule.name} of {reader.owners[0]} is off: {rule.why}."
            hint = f"Switch it on{f', unless {rule.unless}' if rule.unless else ''}."
            yield file.warning(rule.rule, entry, text, hint, rule.source)


# Several values beside each other


def _rate(held: Readers) -> Entry | None:
    """The rate of the control loop, where it can be divided by."""
    entry = held.one(("move_base", "controller_server"), ("controller_frequency",))
    return entry if entry is not None and entry.number is not None and entry.number > 0 else None


def _simulated(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """Trajectories shorter than a control step."""
    rate = _rate(held)
    for reader in held.of(*SAMPLED) if rate is not None else ():
        entry = reader.values.get("sim_time")
        if entry is not None and entry.number and rate is not None and 0 < entry.number * (rate.number or 0) < 1:
            text = f"sim_time ({entry.number:g} s) is shorter than a step of controller_frequency ({rate.number:g} Hz)."
            hint = "The robot drives on past what was tried out: raise the rate or sim_time."
            yield file.warning("contradiction", entry, text, hint, "the trajectory generators", [rate])


def _predicted(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """Steps of MPPI shorter than a control step."""
    rate = _rate(held)
    hz = 0.0 if rate is None or rate.number is None else rate.number
    for reader in held.of("MPPIController") if rate is not None else ():
        entry = reader.values.get("model_dt")
        if rate is not None and entry is not None and entry.number and 0 < entry.number < 1 / hz - _SAME_S:
            text = (
                f"model_dt ({entry.number:g} s) is shorter than a step of controller_frequency ({hz:g} Hz): "
                "MPPI does not start."
            )
            hint = f"Make it {math.ceil(1e4 / hz) / 1e4:g}."
            yield file.warning("cannot-work", entry, text, hint, "optimizer.cpp, setOffset", [rate])


def _considered(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """A footprint that MPPI is told to consider and nobody draws."""
    local = [one for one in held.of(COSTMAP) if any("local_costmap" in key for key in one.scope)]
    if not local or any(one.has_footprint() for one in local):
        return
    for reader in held.of("MPPIController", *COLLISIONS):
        for switch in reader.own("consider_footprint"):
            if switch.value == "true":
                text = (
                    f"{'.'.join(switch.keys[-2:])} is on, and the local costmap has no footprint: MPPI does not start."
                )
                hint = "Give the costmap a footprint, or switch it off."
                yield file.warning("cannot-work", switch, text, hint, "cost_critic.cpp, obstacles_critic.cpp")


def _weights(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """Shares of what a laser sees that are more than all of it."""
    for reader in held.of("amcl"):
        for name in ("z_hit", "z_short", "z_max", "z_rand", "laser_z_hit", "laser_z_short", "laser_z_max",
                     "laser_z_rand"):  # fmt: skip
            entry = reader.values.get(name)
            if entry is not None and entry.number is not None and not 0 <= entry.number <= 1:
                text = f"{name} is {entry.number:g}, and it is a share of what the laser sees, from 0 to 1."
                hint = "z_hit, z_short, z_max and z_rand make 1 together."
                yield file.warning("out-of-range", entry, text, hint, "the laser models of amcl weigh by it")


def _settles(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """Tolerances that the smallest step of a turn leaps over."""
    rate = _rate(held)
    for reader in held.of("DWAPlannerROS", "TrajectoryPlannerROS"):
        slowest = reader.first(("min_vel_theta", "min_rot_vel", "min_in_place_vel_theta"))
        entry = reader.values.get("yaw_goal_tolerance")
        if None in (rate, slowest, entry) or rate is None or slowest is None or entry is None:
            continue
        step = (slowest.number or 0.0) / (rate.number or 1.0)
        if entry.number and 0 < entry.number < step / 2:
            text = (
                f"yaw_goal_tolerance ({entry.number:g} rad) is less than half of the smallest step of a turn "
                f"({step:.2g} rad: {slowest.keys[-1]} {slowest.number:g} at {rate.number:g} Hz)."
            )
            source = "latched_stop_rotate_controller.cpp turns no slower"
            yield file.warning("contradiction", entry, text, "The robot turns to and fro.", source, [slowest, rate])


def _starts(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """Least speeds that no acceleration reaches within a control step."""
    rate = _rate(held)
    for reader in held.of("DWAPlannerROS"):
        least, turn = reader.first(("min_vel_trans", "min_trans_vel")), reader.first(("min_vel_theta", "min_rot_vel"))
        ahead, around = reader.values.get("acc_lim_x"), reader.values.get("acc_lim_theta")
        every = (rate, least, turn, ahead, around)
        hz, v, w, a, b = (0.0 if one is None or one.number is None else one.number for one in every)
        if ahead is None or None in every or reader.is_off("use_dwa"):
            continue
        if 0 < a < v * hz and 0 < b < w * hz:
            text = (
                f"acc_lim_x ({a:g}) and acc_lim_theta ({b:g}) reach neither min_vel_trans ({v:g}) nor min_vel_theta "
                f"({w:g}) within a step at {hz:g} Hz: the robot never starts."
            )
            source = "simple_trajectory_generator.cpp: only speeds that a step reaches, and none below both"
            others = [one for one in every if one is not None and one is not ahead]
            yield file.warning("contradiction", ahead, text, "Raise them or lower the least speeds.", source, others)


def _progress(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """Progress that is asked for faster than the robot may drive."""
    top = held.one((*PLANNERS, *CONTROLLERS), TOP_SPEEDS)
    names = (
        (("move_base",), "oscillation_distance", "oscillation_timeout", "move_base.cpp"),
        (PROGRESS, "required_movement_radius", "movement_time_allowance", "simple_progress_checker.cpp"),
    )
    for owners, way, time, source in names:
        for reader in held.of(*owners):
            far, within, speed = reader.number(way), reader.number(time), None if top is None else top.number
            if top is None or far is None or not within or within < 0 or not speed or far < within * speed:
                continue
            text = (
                f"{way} ({far:g} m) within {time} ({within:g} s) asks for {far / within:.2g} m/s, and {top.keys[-1]} "
                f"is {speed:g}: every drive counts as stuck."
            )
            others = [reader.values[way], top]
            yield file.warning("contradiction", reader.values[time], text, "Give it more time.", source, others)


def _cells(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """Cells larger than the robot or than the tolerance of its goals."""
    for reader in held.of(COSTMAP):
        cell, radius = (
            reader.values.get("resolution"),
            inscribed_radius(reader.values.get("footprint"), reader.values.get("robot_radius")),
        )
        if cell is None or cell.number is None:
            continue
        if cell.number <= 0:
            text = f"resolution is {cell.number:g}: the costmap has no cells."
            yield file.warning("cannot-work", cell, text, "It must be above 0.", "costmap_2d")
        elif radius is not None and cell.number > radius > 0:
            text = f"resolution ({cell.number:g} m) is coarser than the robot's inscribed radius ({radius:.3g} m)."
            yield file.warning("hinders", cell, text, "Ways through are closed: make cells smaller.", "costmap_2d")
    cell = held.one((COSTMAP,), ("resolution",))
    for reader in held.of(*PLANNERS, *CHECKERS):
        entry = reader.values.get("xy_goal_tolerance")
        if cell is not None and cell.number and entry is not None and entry.number and 0 < entry.number < cell.number:
            text = f"xy_goal_tolerance ({entry.number:g} m) is finer than a cell of the costmap ({cell.number:g} m)."
            hint = "The robot circles about its goal: give it more."
            yield file.warning("hinders", entry, text, hint, _TOLERANCE, [cell])


def _sizes(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """One robot of two sizes."""
    sized = []
    for reader in held.of(COSTMAP):
        radius = inscribed_radius(reader.values.get("footprint"), reader.values.get("robot_radius"))
        entry = reader.values.get("footprint" if reader.has_footprint() else "robot_radius")
        if radius and entry is not None:
            sized.append((radius, entry))
        padding = reader.values.get("footprint_padding")
        if radius and padding is not None and padding.number is not None and padding.number > radius:
            text = f"footprint_padding ({padding.number:g} m) is more than the robot itself ({radius:.3g} m)."
            yield file.warning(
                "contradiction", padding, text, "It closes narrow ways.", "costmap_2d pads each side by it"
            )
    for one, other in combinations(sized, 2):
        (small, _), (large, entry) = sorted((one, other), key=lambda pair: pair[0])
        if large > _OTHER_ROBOT * small > 0:
            text = f"The robot has an inscribed radius of {large:.3g} m in one costmap and {small:.3g} m in the other."
            others = [pair[1] for pair in (one, other) if pair[1] is not entry]
            source = "both planners have to keep the same robot clear"
            yield file.warning("contradiction", entry, text, "Give both the same.", source, others)


def _goal_checks(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """A controller that turns at the goal before the goal checker counts it as there."""
    checker = held.one(CHECKERS, ("xy_goal_tolerance",))
    for reader in held.of("DWBLocalPlanner") if checker is not None else ():
        entry = reader.values.get("xy_goal_tolerance")
        least = 0.0 if checker is None or checker.number is None else checker.number
        if checker is not None and entry is not None and entry.number and 0 < least * 1.001 < entry.number:
            text = (
                f"xy_goal_tolerance of the controller ({entry.number:g} m) is above that of the goal checker "
                f"({least:g} m): it stops to turn before it has arrived."
            )
            hint = "Give both the same."
            yield file.warning("contradiction", checker, text, hint, "dwb_critics, rotate_to_goal.cpp", [entry])


def _unknown_space(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """Planners that keep to known space, of which there is none."""
    costmap = next((one for one in held.of(COSTMAP) if any("global_costmap" in key for key in one.scope)), None)
    if costmap is None or not words_of(costmap.values.get("plugins")) or costmap.is_off("track_unknown_space"):
        return
    loaded = words_of(costmap.values["plugins"])
    mapped = {one.scope[-1] for one in held.within(costmap.scope) if one.is_a("StaticLayer")}
    is_mapped = any("static" in word or word in mapped for word in loaded)
    planner = next((one for one in held if one.is_off("allow_unknown")), None)
    if planner is not None and not is_mapped and "track_unknown_space" in costmap.values:
        entry = planner.values["allow_unknown"]
        text = "allow_unknown is off, and the global costmap has no map: where nothing was seen there is no plan."
        others = [costmap.values["plugins"]]
        yield file.warning("contradiction", entry, text, "Allow it.", "the planners keep to known cells", others)


def _drawn(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """Planners that nothing draws to the goal."""
    for reader in held.of("DWAPlannerROS", "TrajectoryPlannerROS"):
        names = ("goal_distance_bias", "path_distance_bias")
        entries = [one for name in names if (one := reader.first((name, name.replace("tance_bias", "t_scale"))))]
        if len(entries) == len(names) and not any(one.number for one in entries):
            text = "goal_distance_bias and path_distance_bias are 0: nothing draws the robot to its goal."
            yield file.warning("cannot-work", entries[0], text, "Raise them.", "dwa_planner.cpp", entries[1:])


def _clocks(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """Nodes of one robot on two clocks."""
    entries = [one.values["use_sim_time"] for one in held if "use_sim_time" in one.values]
    off = [one for one in entries if one.value == "false"]
    on = [one for one in entries if one.value == "true"]
    for entry in off if on and len(off) <= len(on) else on if off else ():
        text = f"use_sim_time is {entry.value} here and not for {len(entries) - min(len(off), len(on))} other nodes."
        source = "nodes on two clocks drop each other's transforms"
        yield file.warning("contradiction", entry, text, "Give all the same.", source)


RULES_OF_SEVERAL: tuple[Callable[[LintedFile, Readers], Iterator[Problem]], ...] = (
    _simulated, _predicted, _considered, _settles, _starts, _progress, window.window, _cells, _sizes, *layers.RULES,
    _goal_checks, _unknown_space, _drawn, _weights, *docks.RULES, *teb.RULES, *smoother.RULES, *monitor.RULES,
    *critics.RULES, *frames.RULES, *sources.RULES, *refused.RULES, _clocks,
)  # fmt: skip
