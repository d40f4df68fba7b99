"""Nav2's plugins under the names that a robot gave them: lists of their server name them, classes say what they are."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from care_core.ecosystems.ros.node_messages import LogMessage
from care_core.metadata.navigation import OBSTACLES
from care_core.run import Setting, Settings

_LISTS = {
    "FollowPath": "controller_plugins",
    "GridBased": "planner_plugins",
    "general_goal_checker": "goal_checker_plugins",
    "progress_checker": "progress_checker_plugins",
}
"""Usual name of a plugin, and the list of its server that holds the names which a robot has for such."""
_LAYERS = {"obstacle_layer": OBSTACLES, "voxel_layer": OBSTACLES, "inflation_layer": ("InflationLayer",)}
"""Usual name of a costmap's layer, and the classes that read the same parameters."""
_SOURCE = "scan"
"""Usual name of what a layer gets its obstacles from."""
_NAME = r"[\w-]+"
_CREATED = re.compile(
    rf"Created (controller :|global planner plugin|goal checker :|progress_checker :) ({_NAME}) of type ([\w:/]+)"
)
_SHIMMED = re.compile(rf"Created internal controller for rotation shimming: ({_NAME}) of type ([\w:/]+)")
_LIST_OF = {
    "controller :": "controller_plugins", "global planner plugin": "planner_plugins",
    "goal checker :": "goal_checker_plugins", "progress_checker :": "progress_checker_plugins",
}  # fmt: skip
"""What Nav2's servers (humble to lyrical) call a plugin when they say that they made one, and their list of such."""


def named_here(name: str, settings: Settings) -> str:
    """What a robot calls a parameter that has this name where plugins have their usual ones.

    The name itself where the robot has it, or where several plugins might be meant.
    """
    node, _, rest = name.partition(".")
    usual, _, tail = rest.partition(".")
    if name in settings or not tail:
        return name
    own = _only(_names_of(usual, node, settings), usual)
    source, _, last = tail.partition(".")
    if usual in _LAYERS and source == _SOURCE:
        tail = f"{_only(_words(settings, f'{node}.{own}.observation_sources'), source)}.{last}"
    return f"{node}.{own}.{tail}"


def created(messages: Iterable[LogMessage]) -> dict[str, tuple[Setting, ...]]:
    """The plugins that servers said they made when they were configured: classes and lists, as parameters tell them."""
    classes: dict[str, str] = {}
    lists: dict[str, dict[str, None]] = {}
    for one in messages:
        node = f"/{one.node.strip('/').replace('.', '/')}"
        if (behind := _SHIMMED.match(one.text)) is not None:
            classes[f"{node}.{behind[1]}.primary_controller"] = behind[2]
        if (said := _CREATED.match(one.text)) is not None:
            classes[f"{node}.{said[2]}.plugin"] = said[3]
            lists.setdefault(f"{node}.{_LIST_OF[said[1]]}", {})[said[2]] = None
    told = {**classes, **{name: " ".join(names) for name, names in lists.items()}}
    return {name: (Setting(name, value, "/rosout"),) for name, value in told.items()}


def is_named_alike(name: str, other: str) -> bool:
    """Whether a robot may call a parameter by the other name: only plugins and sources are called as one likes."""
    node, _, rest = name.partition(".")
    usual, _, tail = rest.partition(".")
    if usual not in _LISTS and usual not in _LAYERS:
        return name == other
    parts = [_NAME if usual in _LAYERS and part == _SOURCE else re.escape(part) for part in tail.split(".")]
    return re.fullmatch(rf"{re.escape(node)}\.{_NAME}\.{re.escape('.').join(parts)}", other) is not None


def _names_of(usual: str, node: str, settings: Settings) -> list[str]:
    """The names that a robot has for plugins of a kind."""
    if usual in _LISTS:
        return _words(settings, f"{node}.{_LISTS[usual]}")
    kinds = _LAYERS.get(usual, ())
    return [one for one in _words(settings, f"{node}.plugins") if _class(settings, f"{node}.{one}.plugin") in kinds]


def _only(names: Sequence[str], usual: str) -> str:
    return names[0] if len(names) == 1 else usual


def _words(settings: Settings, name: str) -> list[str]:
    return re.findall(_NAME, str(settings[name][-1].value)) if name in settings else []


def _class(settings: Settings, name: str) -> str:
    """The class of a plugin without its package, which releases write as `package::Class` or `package/Class`."""
    return re.split(r"::|/", str(settings[name][-1].value))[-1] if name in settings else ""
