"""Words of which a node knows a few: any other, and it refuses to start."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple

from care_core.errors import nearest
from care_core.lint.problems import Entry, LintedFile, Problem, Severity
from care_core.lint.readers import readers
from care_core.lint.scopes import Scoped
from care_core.metadata.navigation import DISTRIBUTIONS, OBSTACLES, spanned

_REPLACED = re.compile(r"[$<{]")
"""A text that a launch file replaces before the node reads it."""


class Choice(NamedTuple):
    """A parameter whose source compares it with words, and what becomes of another."""

    owners: tuple[str, ...]
    name: str
    words: tuple[str, ...]
    why: str
    source: str
    ros: str = "ros2"
    releases: str = ""
    """Where only these releases have the list, as the tables write them."""
    severity: Severity = Severity.ERROR


_LASERS = ("beam", "likelihood_field", "likelihood_field_prob")
_REFUSED = "the node will not start"
CHOICES: tuple[Choice, ...] = (
    Choice(("MPPIController",), "motion_model", ("DiffDrive", "Omni", "Ackermann"), "MPPI does not start",
           "optimizer.cpp of humble to kilted, setMotionModel", releases="humble-kilted"),
    Choice(("velocity_smoother",), "feedback", ("OPEN_LOOP", "CLOSED_LOOP"), _REFUSED,
           "velocity_smoother.cpp, on_configure"),
    Choice(("Polygon",), "action_type", ("stop", "slowdown", "limit", "approach", "none"), _REFUSED,
           "polygon.cpp of nav2_collision_monitor"),
    Choice(OBSTACLES, "data_type", ("LaserScan", "PointCloud2"), "the costmap will not start", "obstacle_layer.cpp"),
    Choice(OBSTACLES, "data_type", ("LaserScan", "PointCloud", "PointCloud2"), "the costmap will not start",
           "obstacle_layer.cpp", "ros1"),
    Choice(("amcl",), "robot_model_type", ("nav2_amcl::DifferentialMotionModel", "nav2_amcl::OmniMotionModel"),
           "amcl does not start", "amcl_node.cpp since humble loads a plugin of that name", releases="humble-rolling"),
    Choice(("SmacPlannerHybrid",), "motion_model_for_search", ("DUBIN", "REEDS_SHEPP"), "the planner does not start",
           "node_hybrid.cpp of nav2_smac_planner, initMotionModel"),
    Choice(("amcl",), "laser_model_type", _LASERS, "likelihood_field counts instead",
           "amcl_node.cpp, createLaserObject", severity=Severity.WARNING),
    Choice(("amcl",), "laser_model_type", _LASERS, "likelihood_field counts instead", "amcl_node.cpp", "ros1",
           severity=Severity.WARNING),
    Choice(("TebLocalPlannerROS",), "type", ("point", "circular", "two_circles", "line", "polygon"),
           "the robot counts as a point", "teb_local_planner_ros.cpp, getRobotFootprintFromParamServer", "ros1",
           severity=Severity.WARNING),
)  # fmt: skip
_OWN = re.compile(r"nav2_amcl::|^\w+$")
"""Of plugins: only words without a package and names of Nav2's own; another package may bring more."""


def check(file: LintedFile, result: Scoped, likely: frozenset[str]) -> Iterator[Problem]:
    """Words that none of the releases knows for which the file may be.

    Args:
        likely: the distributions that the file may be for.
    """
    every = frozenset(DISTRIBUTIONS[result.ros])
    for reader in readers(result):
        for choice in CHOICES:
            if choice.ros != result.ros or not reader.is_a(*choice.owners):
                continue
            if choice.releases and not (likely or every) <= spanned(choice.releases, result.ros):
                continue
            for entry in reader.own(choice.name):
                if _is_refused(entry, choice):
                    yield _refused(file, entry, choice)


def _is_refused(entry: Entry, choice: Choice) -> bool:
    word = entry.value
    if not isinstance(word, str) or entry.kind != "str" or word in choice.words or _REPLACED.search(word):
        return False
    return choice.name != "robot_model_type" or bool(_OWN.search(word))


def _refused(file: LintedFile, entry: Entry, choice: Choice) -> Problem:
    text = f"{entry.keys[-1]} is {entry.value}, which is none of its values: {choice.why}."
    hint = f"They are {', '.join(choice.words)}."
    meant = nearest(str(entry.value), choice.words)
    return file.problem("not-in-values", choice.severity, entry, text, f"{hint} {meant}".strip(), choice.source)
