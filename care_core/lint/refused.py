"""What a node of Nav2 takes back by itself: reversing beside turning in place, behavior trees it cannot open, a
footprint that is none."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator

from care_core.lint.contradictions import reach
from care_core.lint.problems import Entry, LintedFile, Problem
from care_core.lint.readers import Readers, readers
from care_core.lint.scopes import COSTMAP, Scoped
from care_core.metadata.navigation import spanned

_ONE_OF_TWO = spanned("galactic-iron", "ros2")
_CORNERS = 3
_LARGEST_M = 10.0
"""No robot of a costmap reaches so far from its centre."""
_METRES = "lengths of ROS are in metres (REP 103)"
_TREES = ("default_nav_to_pose_bt_xml", "default_nav_through_poses_bt_xml")
"""default_bt_xml_filename of foxy and galactic is not among them: Nav2's own launch files replace what stands there."""
_BARE = re.compile(r"[\w.-]+\.xml")
"""A file's name without a folder, and without anything that a launch file replaces."""


def check(file: LintedFile, result: Scoped, likely: frozenset[str]) -> Iterator[Problem]:
    """Reversing that the controller switches off as it may turn in place.

    Args:
        likely: the distributions that the file may be for.
    """
    for reader in readers(result).of("RegulatedPurePursuitController") if likely and likely <= _ONE_OF_TWO else ():
        if reader.is_on("allow_reversing") and not reader.is_off("use_rotate_to_heading"):
            entry = reader.values["allow_reversing"]
            text = "allow_reversing is switched off where use_rotate_to_heading is on, as it is by default: the robot "
            text += "never backs up."
            others = [one for name, one in reader.values.items() if name == "use_rotate_to_heading"]
            source = "regulated_pure_pursuit_controller.cpp of galactic to iron"
            yield file.warning("contradiction", entry, text, "Switch one of them off.", source, others)


def _trees(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """Behavior trees by a file's name alone: it is opened where the node was started, not where Nav2 keeps its own."""
    for reader in held.of("bt_navigator"):
        for name in _TREES:
            entry = reader.values.get(name)
            if entry is not None and _BARE.fullmatch(str(entry.value)):
                text = f"{name} is {entry.value}, without a folder: bt_navigator opens it where it was started."
                hint = "Write the whole path: without its tree it takes no goal."
                yield file.warning("cannot-work", entry, text, hint, "bt_action_server_impl.hpp, loadBehaviorTree")


def _shapes(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """Footprints of less than three corners, in whose place the radius counts."""
    for reader in held.of(COSTMAP):
        entry = reader.values.get("footprint")
        corners = None if entry is None else _corners(entry)
        if entry is not None and corners is not None and 0 < corners < _CORNERS:
            text = f"footprint has less than {_CORNERS} corners: it is refused, and robot_radius counts."
            yield file.warning("cannot-work", entry, text, "Give it all of its corners.", "footprint.cpp of costmap_2d")


def _far(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """Robots of the size of a house."""
    for reader in held.of(COSTMAP):
        footprint, radius = reader.values.get("footprint"), reader.values.get("robot_radius")
        far = None if footprint is None else reach(footprint)
        if footprint is not None and far is not None and far > _LARGEST_M:
            text = f"A corner of footprint is {far:g} m from the robot's centre."
            yield file.warning("wrong-unit", footprint, text, "Is it in centimetres? It is in metres.", _METRES)
        elif radius is not None and (radius.number or 0.0) > _LARGEST_M and not reader.has_footprint():
            text = f"robot_radius is {radius.number:g} m."
            yield file.warning("wrong-unit", radius, text, "Is it in centimetres? It is in metres.", _METRES)


def _corners(entry: Entry) -> int | None:
    """How many points a footprint has; None where it is not a list of points."""
    try:
        held = ast.literal_eval(str(entry.value).strip())
    except (ValueError, TypeError, SyntaxError, MemoryError, RecursionError):
        return None
    is_points = isinstance(held, list) and all(isinstance(one, list) for one in held)
    return len(held) if is_points else None


RULES = (_trees, _shapes, _far)
