"""Lists by which nodes of Nav2 load their plugins: names of which nothing says the class."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from care_core.ecosystems.ros.ros2_yaml import PARAMETERS
from care_core.lint.generic import problem_at
from care_core.lint.problems import ConfigFile, Problem, Severity
from care_core.lint.scopes import COSTMAP, Keys, Place, Scoped, split, words_of
from care_core.metadata import navigation


class PluginList(NamedTuple):
    """A list of names, each of which needs a class, by who reads it."""

    owner: str
    key: str
    defaults: tuple[str, ...] = ()
    """The names that have a class without being told, as long as the list is this one."""


LISTS: tuple[PluginList, ...] = (
    PluginList("controller_server", "controller_plugins", ("FollowPath",)),
    PluginList("controller_server", "goal_checker_plugins", ("goal_checker",)),
    PluginList("controller_server", "progress_checker_plugins", ("progress_checker",)),
    PluginList("controller_server", "path_handler_plugins", ("PathHandler",)),
    PluginList("planner_server", "planner_plugins", ("GridBased",)),
    PluginList("smoother_server", "smoother_plugins", ("simple_smoother",)),
    PluginList("behavior_server", "behavior_plugins", ("spin", "backup", "drive_on_heading", "wait")),
    PluginList(COSTMAP, "plugins", ("static_layer", "obstacle_layer", "inflation_layer")),
    PluginList(COSTMAP, "filters"),
)
_SOURCE = "node_utils.hpp of Nav2, get_plugin_type_param: a name without a class is refused"


def classless(file: ConfigFile, result: Scoped, shown: frozenset[str]) -> Iterator[Problem]:
    """Names in a list of plugins of which nothing in the file says the class.

    Args:
        shown: the releases that somebody or its plugins say the file is for; empty where nothing says so.
    """
    held = {split(entry) for entry in file.entries}
    anywhere = {keys[-2] for keys in held if keys[-1] == "plugin" and _is_of_any_node(keys)}
    for place in result.places:
        one = next((one for one in LISTS if (one.owner,) == place.owners and one.key == place.name), None)
        if one is None or place.entry.kind != "list" or not _is_read(one, shown):
            continue
        names = words_of(place.entry)
        lacking = [name for name in names if (*place.scope, name, "plugin") not in held and name not in anywhere]
        if lacking and names != one.defaults:
            yield _classless(file, place, lacking)


def _is_of_any_node(keys: Keys) -> bool:
    """Whether a value is for every node that fits a pattern."""
    return PARAMETERS in keys and any("*" in key for key in keys[: keys.index(PARAMETERS)])


def _is_read(one: PluginList, shown: frozenset[str]) -> bool:
    facts = navigation.known("ros2", one.owner, one.key)
    return not shown or any(navigation.distributions(fact, "ros2") & shown for fact in facts)


def _classless(file: ConfigFile, place: Place, names: list[str]) -> Problem:
    what = "the costmap" if place.owners == (COSTMAP,) else place.owners[0]
    below, their, them = ("each of these names", "their", "them") if names[1:] else (names[0], "its", "it")
    text = f"{place.name} names {', '.join(names)}, and nothing here says {their} class: {what} will not start."
    hint = f"Write plugin with the class below {below}, or leave {them} out of the list."
    return problem_at("cannot-work", Severity.WARNING, file, place.entry, text, hint, _SOURCE)
