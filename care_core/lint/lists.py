"""Lists by which nodes of Nav2 load their plugins: names of which nothing says the class, and values of a plugin that
stand beside the list instead of below the name."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from care_core.ecosystems.ros.ros2_yaml import PARAMETERS
from care_core.lint.problems import Entry, LintedFile, Problem
from care_core.lint.scopes import COSTMAP, Keys, Place, Scoped, of_class, split, words_of
from care_core.metadata import navigation
from care_core.metadata.navigation import STACKS, spanned, spans


class PluginList(NamedTuple):
    """A list of names, each of which needs a class, by who reads it."""

    owner: str
    key: str
    defaults: tuple[tuple[str, str], ...] = ()
    """The names that have a class without being told, as long as the list is this one; "": one of other tables."""

    def names(self) -> tuple[str, ...]:
        """The list where none is written."""
        return tuple(name for name, _ in self.defaults)


LISTS: tuple[PluginList, ...] = (
    PluginList("controller_server", "controller_plugins", (("FollowPath", "DWBLocalPlanner"),)),
    PluginList("controller_server", "goal_checker_plugins", (("goal_checker", "SimpleGoalChecker"),)),
    PluginList("controller_server", "progress_checker_plugins", (("progress_checker", "SimpleProgressChecker"),)),
    PluginList("controller_server", "path_handler_plugins", (("PathHandler", "FeasiblePathHandler"),)),
    PluginList("planner_server", "planner_plugins", (("GridBased", "NavfnPlanner"),)),
    PluginList("smoother_server", "smoother_plugins", (("simple_smoother", "SimpleSmoother"),)),
    PluginList("behavior_server", "behavior_plugins", tuple(
        (name, "") for name in ("spin", "backup", "drive_on_heading", "wait")
    )),
    PluginList(COSTMAP, "plugins", (
        ("static_layer", "StaticLayer"), ("obstacle_layer", "ObstacleLayer"), ("inflation_layer", "InflationLayer"),
    )),
    PluginList(COSTMAP, "filters"),
    PluginList("docking_server", "dock_plugins"),
)  # fmt: skip
_SINGLE: tuple[PluginList, ...] = (
    PluginList("controller_server", "goal_checker_plugin", (("goal_checker", ""),)),
    PluginList("controller_server", "progress_checker_plugin", (("progress_checker", ""),)),
    PluginList("waypoint_follower", "waypoint_task_executor_plugin", (("wait_at_waypoint", ""),)),
)
"""Names of one plugin alone."""
_KINDS = (("GoalChecker", "goal_checker"), ("ProgressChecker", "progress_checker"), ("PathHandler", "path_handler"))
"""What is in the name of a class, and in that of the list which loads it."""
_DWB = "DWBLocalPlanner"
_BY_DEFAULT = spanned("foxy-kilted", "ros2")
"""Since lyrical a controller without a class is MPPI's (parameter_handler.hpp of nav2_controller)."""
_NO_CRITICS = spanned("galactic-rolling", "ros2")
"""dwb_local_planner.cpp of foxy has critics of its own where none are listed; later ones refuse that."""
_SEVERAL = 2
"""Values from which on they are told as one."""
_CLASSLESS = "node_utils.hpp of Nav2, get_plugin_type_param: a name without a class is refused"


def classless(file: LintedFile, result: Scoped, shown: frozenset[str]) -> Iterator[Problem]:
    """Names in a list of plugins of which nothing in the file says the class.

    Args:
        shown: the releases that somebody or its plugins say the file is for; empty where nothing says so.
    """
    held = {split(entry) for entry in file.entries}
    anywhere = {keys[-2] for keys in held if keys[-1] == "plugin" and _is_of_any_node(keys)}
    for place in result.places:
        every = (*LISTS, *_SINGLE)
        one = next((one for one in every if (one.owner,) == place.owners and one.key == place.name), None)
        if one is None or not _is_read(one, shown) or re.search(r"[$<{]", str(place.entry.value)):
            continue
        names = words_of(place.entry)
        if one in LISTS and place.entry.kind == "str":
            yield _text(file, place, names)
        if place.entry.kind != ("str" if one in _SINGLE else "list"):
            continue
        lacking = [name for name in names if (*place.scope, name, "plugin") not in held and name not in anywhere]
        if lacking and names != one.names():
            yield _classless(file, place, lacking)


def _text(file: LintedFile, place: Place, names: Sequence[str]) -> Problem:
    text = f"{place.name} is a string, declared is a list of strings: the node will not start."
    hint = f"Write [{', '.join(repr(name) for name in names)}]."
    source = f"{STACKS['ros2']} declare a list of strings"
    return file.error("wrong-type", place.entry, text, hint, source)


def by_default(file: LintedFile, shown: frozenset[str]) -> Iterator[Problem]:
    """Parts without a class that a default list loads, with values of another class than the default one.

    Args:
        shown: the releases that somebody or its plugins say the file is for; empty where nothing says so.
    """
    values = {split(entry): entry for entry in file.entries}
    parts: dict[Keys, dict[Keys, Entry]] = {}
    for keys, entry in values.items():
        if PARAMETERS in keys[1:-2]:
            end = keys.index(PARAMETERS) + 2
            parts.setdefault(keys[:end], {})[keys[end:]] = entry
    for (*above, name), below in parts.items():
        one = next((one for one in LISTS if one.owner == above[-2] and name in one.names()), None)
        if one is None or ("plugin",) in below or words_of(values.get((*above, one.key))) not in ((), one.names()):
            continue
        kind = dict(one.defaults)[name]
        if kind and (kind != _DWB or (shown or _BY_DEFAULT) <= _BY_DEFAULT):
            yield from _defaulted(file, name, kind, below)


def _defaulted(file: LintedFile, name: str, kind: str, below: Mapping[Keys, Entry]) -> Iterator[Problem]:
    unread = [keys for keys in below if not navigation.known("ros2", kind, ".".join(keys)) and len(keys) == 1]
    if len(unread) >= _SEVERAL:
        entry = below[unread[0]]
        text = f"{name} has no class, and is a {kind} then, which does not read {unread[0][0]} and "
        text += f"{len(unread) - 1} more."
        hint = f"Write plugin with the class below {name}."
        yield file.warning("cannot-work", entry, text, hint, _CLASSLESS)


def spare(file: LintedFile) -> Iterator[Problem]:
    """Plugins of a node that none of its lists names."""
    values = {split(entry): entry for entry in file.entries}
    for keys, entry in values.items():
        if keys[-1] != "plugin" or len(keys) < _SEVERAL + 2 or keys[-3] != PARAMETERS:
            continue
        scope, node, name = keys[:-2], keys[-4], keys[-2]
        lists = [one for one in (*LISTS, *_SINGLE) if one.owner == node]
        named = {word for one in lists for word in words_of(values.get((*scope, one.key))) or _unwritten(one)}
        if not lists or name in named or any(re.search(r"[$<{]", word) for word in named):
            continue
        kind = next((part for word, part in _KINDS if word in str(entry.value)), "")
        key = next((one.key for one in lists if kind in one.key and one.key.startswith(kind)), lists[0].key)
        text = f"Nothing loads {name}: no list of {node} names it."
        yield file.note("not-loaded", entry, text, f"Add it to {key}, or leave it out.")


def _unwritten(one: PluginList) -> tuple[str, ...]:
    """What a list names where it is not written; a name alone that a list has replaced names nothing then."""
    return one.names() if one in LISTS or one.owner not in {each.owner for each in LISTS} else ()


def _is_of_any_node(keys: Keys) -> bool:
    """Whether a value is for every node that fits a pattern."""
    return PARAMETERS in keys and any("*" in key for key in keys[: keys.index(PARAMETERS)])


def _is_read(one: PluginList, shown: frozenset[str]) -> bool:
    facts = navigation.known("ros2", one.owner, one.key)
    return not shown or any(navigation.distributions(fact, "ros2") & shown for fact in facts)


def _classless(file: LintedFile, place: Place, names: list[str]) -> Problem:
    what = "the costmap" if place.owners == (COSTMAP,) else place.owners[0]
    below, their, them = ("each of these names", "their", "them") if names[1:] else (names[0], "its", "it")
    text = f"{place.name} names {', '.join(names)}, and nothing here says {their} class: {what} will not start."
    hint = f"Write plugin with the class below {below}, or leave {them} out."
    return file.warning("cannot-work", place.entry, text, hint, _CLASSLESS)


# Values beside the list


class Loaded(NamedTuple):
    """A plugin of a node with who reads its values."""

    name: str
    owners: tuple[str, ...]
    has_class: bool
    """Whether the file says its class."""
    instead_of: str
    """The list that the file lacks, where the plugin is loaded without one; empty where it is listed."""

    def reads(self, name: str) -> bool:
        return any(navigation.known("ros2", owner, name) for owner in self.owners)


class Raised(NamedTuple):
    """Values that stand one level too high, and what is said of them."""

    problem: Problem
    places: Sequence[Place]


def raised(file: LintedFile, result: Scoped, shown: frozenset[str]) -> Iterator[Raised]:
    """Values that a node does not read and one of its plugins does, where they are several.

    Args:
        shown: the releases that somebody or its plugins say the file is for; empty where nothing says so.
    """
    values = {split(entry): entry for entry in file.entries}
    beside: dict[Keys, list[Place]] = {}
    for place in result.places:
        if place.scope and place.scope[-1] == PARAMETERS:
            beside.setdefault(place.scope, []).append(place)
    for scope, places in beside.items():
        loaded = [one for each in LISTS if each.owner == scope[-2] for one in _loaded(each, scope, values, shown)]
        unread = [one for one in places if _may_be_raised(one, scope, values)]
        theirs = [(plugin, [one for one in unread if plugin.reads(one.name)]) for plugin in loaded]
        plugin, most = max(theirs, key=lambda one: len(one[1]), default=(None, []))
        if plugin is not None and len(most) >= _SEVERAL:
            yield Raised(_raised(file, plugin, most, values, shown), most)


def _loaded(one: PluginList, scope: Keys, values: Mapping[Keys, Entry], shown: frozenset[str]) -> Iterator[Loaded]:
    """The plugins that a list loads, as far as somebody knows what they read."""
    names = words_of(values.get((*scope, one.key))) or one.names()
    for name in names:
        plugin = values.get((*scope, name, "plugin"))
        if plugin is not None:
            owners = of_class(plugin, values, (*scope, name))
        else:
            kind = dict(one.defaults)[name] if names == one.names() else ""
            owners = ("MPPIController" if kind == _DWB and shown and not shown & _BY_DEFAULT else kind,) if kind else ()
        if owners and owners != (one.owner,):
            yield Loaded(name, owners, plugin is not None, "" if (*scope, one.key) in values else one.key)


def _may_be_raised(place: Place, scope: Keys, values: Mapping[Keys, Entry]) -> bool:
    """Whether a node does not read a value itself: a plain one, or one of a critic that stands beside its list."""
    first, dot, _ = place.name.partition(".")
    if dot:
        return not place.owners and first in words_of(values.get((*scope, "critics")))
    return place.owners == (scope[-2],) and not navigation.known("ros2", scope[-2], place.name)


def _raised(
    file: LintedFile, plugin: Loaded, places: Sequence[Place], values: Mapping[Keys, Entry], shown: frozenset[str]
) -> Problem:
    first, *more = places
    scope = first.scope
    lacking = [one for one in places if (*scope, plugin.name, *one.name.split(".")) not in values]
    text = (
        f"{first.name} and {len(more)} more stand beside {plugin.name}, not below it: {scope[-2]} does not read them, "
        f"{plugin.owners[-1]} would."
    )
    if len(lacking) == len(places):
        text += _consequence(plugin, lacking, shown)
        hint = f"Write them one level deeper, below {plugin.name}"
        hint += f": that is loaded where {plugin.instead_of} is missing." if plugin.instead_of else "."
    elif lacking:
        hint = f"Write those that {plugin.name} lacks below it, and leave the others out."
    else:
        hint = f"Leave them out: {plugin.name} has its own."
    others = [one.entry for one in more]
    return file.warning("misplaced-key", first.entry, text, hint, STACKS["ros2"], others)


def _consequence(plugin: Loaded, lacking: Sequence[Place], shown: frozenset[str]) -> str:
    """What comes of values that a plugin lacks: it has its defaults, and DWB does not start without critics."""
    refusing = _NO_CRITICS if plugin.has_class else _NO_CRITICS & _BY_DEFAULT
    refused = (shown or refusing) & refusing
    if _DWB in plugin.owners and refused and any(one.name == "critics" for one in lacking):
        where = "" if refused == shown else f" in {spans(refused, 'ros2')}"
        return f" Without its critics controller_server does not start{where}."
    return f" {plugin.name} has its defaults instead."
