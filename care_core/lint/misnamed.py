"""Names of nodes, planners and plugins that are a slip of the pen for one that there is."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from difflib import SequenceMatcher

from care_core.ecosystems.ros.ros2_yaml import PARAMETERS
from care_core.lint.generic import near
from care_core.lint.problems import Entry, LintedFile, Problem
from care_core.lint.scopes import Keys, Scoped, split
from care_core.metadata import navigation
from care_core.metadata.navigation import STACKS, Ros

_ALIKE = 0.9
_SHARE = 0.25
"""Least share of the values of a part that whoever is meant reads; the others may be of its plugins."""
_PLANNERS = {
    "base_global_planner": ("navfn/NavfnROS", "global_planner/GlobalPlanner", "carrot_planner/CarrotPlanner"),
    "base_local_planner": (
        "base_local_planner/TrajectoryPlannerROS", "dwa_local_planner/DWAPlannerROS",
        "teb_local_planner/TebLocalPlannerROS",
    ),
}  # fmt: skip
"""Planners of move_base by the parameter that names one."""
_CLASSES = "the plugin description files of the planners"


def check(file: LintedFile, result: Scoped) -> Iterator[Problem]:
    """Parts that nobody reads whose name is nearly that of a node, or in ROS 1 a planner, that reads most of them; and
    planners of ROS 1 by a name that their package does not have."""
    yield from _parts(file, result.ros)
    if result.ros == "ros1":
        yield from _classes(file)


def _parts(file: LintedFile, ros: Ros) -> Iterator[Problem]:
    parts: dict[Keys, list[Entry]] = {}
    for entry in file.entries:
        keys = split(entry) if ros == "ros2" else entry.keys
        end = keys.index(PARAMETERS) if PARAMETERS in keys[:-1] else len(keys) - 1
        if end and (ros == "ros1" or PARAMETERS in keys[:-1]):
            parts.setdefault(keys[:end], []).append(entry)
    names = {keys[-1] for keys in parts}
    for keys, entries in parts.items():
        meant = _meant(keys[-1], entries, ros)
        if meant and meant not in names:
            what = "node of Nav2" if ros == "ros2" else "part of move_base"
            text = f"No {what} is called {keys[-1]}: nothing reads what stands below it."
            hint = f"Did you mean {meant}?"
            yield file.warning("unknown-key", entries[0], text, hint, STACKS[ros])


def _meant(name: str, entries: Sequence[Entry], ros: Ros) -> str:
    """The node or planner that a name is a slip for: so near that no other is likely, and it reads most of the part."""
    if name in navigation.owners(ros) or any(letter.isdigit() for letter in name):
        return ""
    others = (one for one in navigation.owners(ros) if one not in name and name not in one)
    like = [one for one in others if SequenceMatcher(None, one, name).ratio() >= _ALIKE]
    own = [one for one in like if ros == "ros1" or navigation.node_of(ros, one) == one]
    for one in own:
        known = sum(bool(navigation.known(ros, one, entry.keys[-1])) for entry in entries)
        if known and known >= len(entries) * _SHARE:
            return one
    return ""


def _classes(file: LintedFile) -> Iterator[Problem]:
    for entry in file.entries:
        known = _PLANNERS.get(entry.keys[-1], ())
        name = str(entry.value)
        if name in known or not any(name.partition("/")[0] == one.partition("/")[0] for one in known):
            continue
        meant = near(name, known)
        if meant:
            text = f"{entry.keys[-1]} is {name}, which its package does not have: move_base does not start."
            yield file.error("plugin-name", entry, text, f"Did you mean {meant}?", _CLASSES)
