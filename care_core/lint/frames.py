"""Names that nodes of one robot must agree on: its frame, and the topics of its sensors; and what amcl says of the
future."""

from __future__ import annotations

import re
from collections.abc import Iterator

from care_core.lint.problems import Entry, LintedFile, Problem
from care_core.lint.readers import Readers
from care_core.lint.scopes import COSTMAP

_ABOVE = re.compile(r"base_(link|footprint)$")
"""Frames of one robot that stand above each other (REP 105 and 120): for a plan one is as good as the other."""
_LATEST_S = 5.0
"""Transforms this far in the future, s: Nav2 and ROS 1 have 1.0 and 0.1, slow computers set 2."""


def _bases(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """Robots that are looked for in another frame by one node than by the others."""
    found = [
        (reader.name() or reader.owners[0], entry)
        for reader in held.of(COSTMAP, "bt_navigator", "amcl")
        if (entry := reader.values.get("robot_base_frame") or reader.values.get("base_frame_id")) is not None
    ]
    frames = {_frame(entry) for _, entry in found}
    if len({_body(frame) for frame in frames}) < 2 or any("$" in one for one in frames):
        return
    counts = {frame: sum(_frame(entry) == frame for _, entry in found) for frame in frames}
    most = max(counts, key=lambda one: counts[one])
    odd = [(name, entry) for name, entry in found if _body(_frame(entry)) != _body(most)]
    others = [entry for _, entry in found if _frame(entry) == most]
    for name, entry in odd[:1]:
        text = f"{entry.keys[-1]} of {name} is {_frame(entry)}, and of the others {most}: one robot has one frame."
        source = "each node asks tf where this frame is on its map"
        yield file.warning("contradiction", entry, text, "Give all the same.", source, others[:1])


def _moving(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """Costmaps in the frame of the robot itself: what was seen moves along with it."""
    for reader in held.of(COSTMAP):
        entry, base = reader.values.get("global_frame"), reader.values.get("robot_base_frame")
        own = {"base_link", "base_footprint"} | ({_frame(base)} if base is not None else set())
        if entry is not None and _frame(entry) in own:
            text = f"global_frame is {_frame(entry)}, the robot's own: what was seen moves along with it."
            hint = "Give it odom or map."
            yield file.warning("hinders", entry, text, hint, "costmap_2d_ros.cpp keeps obstacles in that frame")


def _frame(entry: Entry) -> str:
    return str(entry.value).strip("/")


def _body(frame: str) -> str:
    """The robot that a frame is of: `robot1/base_link` and `robot1/base_footprint` are of one."""
    return _ABOVE.sub("base", frame)


def _postdated(file: LintedFile, held: Readers) -> Iterator[Problem]:
    """Corrections of amcl that come late: it dates them ahead, and tf interpolates between what was dated so."""
    for reader in held.of("amcl"):
        entry = reader.values.get("transform_tolerance")
        if entry is not None and entry.number is not None and entry.number >= _LATEST_S:
            text = (
                f"transform_tolerance of amcl is {entry.number:g} s: each correction of the robot's place counts only "
                "so much later."
            )
            source = "amcl_node.cpp dates map -> odom so far ahead, and tf interpolates between two dates"
            yield file.warning("hinders", entry, text, "1 is usual: give it what the transforms lag.", source)


RULES = (_bases, _moving, _postdated)
