"""ROS 2 parameter files (YAML): `node: {ros__parameters: {...}}`, where a node's name may hold wildcards.

A parameter is called `/fully/qualified/node.param.path`, as in logs; in a setting that a file holds, the node may be
a pattern: `/**.use_sim_time`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from care_core.ecosystems.ros import yaml_tree
from care_core.ecosystems.ros.ros1_yaml import line_of, text_of
from care_core.errors import ConfigError
from care_core.run import Find, Setting
from care_core.text import clean, command
from care_core.variables import Variable

__all__ = ["PARAMETERS", "commands", "finder", "line_of", "read", "text_of", "write"]

PARAMETERS = "ros__parameters"
"""The key under which a node's parameters are."""


def read(text: str, path: Path, namespace: str = "") -> dict[str, Setting]:
    """Parameters by node (a leading slash is added) and path; `namespace` goes before every node that has none.

    Raises:
        ConfigError: not YAML, or a value that belongs to no node, which ROS 2 refuses as well.
    """
    root = yaml_tree.compose(text, path)
    if root is None:
        return {}
    settings = {}
    for leaf in yaml_tree.leaves(root, letters=True):
        where = f"{path}:{leaf.line}"
        if PARAMETERS not in leaf.keys[1:-1]:
            hint = f"A parameter file has NODE: {PARAMETERS}: NAME: VALUE."
            raise ConfigError(f"'{'.'.join(leaf.keys)}' is not under '{PARAMETERS}'.", hint=hint, where=where)
        split = leaf.keys.index(PARAMETERS)
        node = "/".join((namespace.strip("/"), *leaf.keys[:split])).strip("/")
        name = f"/{node}.{'.'.join(leaf.keys[split + 1 :])}"
        settings[name] = Setting(name, leaf.value, where)
    return settings


def finder(files: Sequence[Mapping[str, Setting]]) -> Find:
    """The values that files loaded together give parameters.

    As rclcpp does it: of the nodes whose name or pattern fits, the one named last counts, where a node that several
    files name stands at its first place and has the value of the last of them.
    """
    merged: dict[str, Setting] = {}
    for settings in files:
        merged.update(settings)
    order = {pattern: place for place, pattern in enumerate(dict.fromkeys(name.partition(".")[0] for name in merged))}
    wild = [pattern for pattern in order if "*" in pattern]

    @cache
    def fitting(node: str) -> tuple[str, ...]:
        """The patterns that fit a node, the one that counts most first."""
        found = [pattern for pattern in wild if _fits(pattern, node)]
        return tuple(sorted([*found, node] if node in order else found, key=order.__getitem__, reverse=True))

    def find(parameter: str) -> Setting | None:
        node, _, path = parameter.partition(".")
        return next((merged[name] for pattern in fitting(node) if (name := f"{pattern}.{path}") in merged), None)

    return find


def _fits(pattern: str, node: str) -> bool:
    """Whether a pattern is a node's: `/*` stands for one part of a name, `/**` for any number of them. Each part of the
    pattern is gone through once, however many stars there are."""
    parts = [part for part in node.split("/") if part]
    ends = {0}
    for part in pattern.strip("/").split("/"):
        if part == "**":
            ends = set(range(min(ends, default=len(parts) + 1), len(parts) + 1))
        else:
            ends = {end + 1 for end in ends if end < len(parts) and part in ("*", parts[end])}
    return node.startswith("/") and len(parts) in ends


def write(settings: Mapping[str, Setting], remarks: Mapping[str, str] | None = None) -> str:
    """One block a node, in alphabetical order, as `ros2 param load` and `--params-file` take it."""
    tree: dict[str, Any] = {}
    comments: dict[tuple[str, ...], str] = {}
    for name in sorted(settings):
        node, _, path = name.partition(".")
        branch = tree.setdefault(node, {}).setdefault(PARAMETERS, {})
        at = [node, PARAMETERS]
        *spaces, key = path.split(".")
        while spaces and isinstance(branch.get(spaces[0], {}), dict):
            at.append(spaces[0])
            branch = branch.setdefault(spaces.pop(0), {})
        # A parameter may have the name of a group (`FollowPath` beside `FollowPath.x`): the rest keeps its dots.
        key = ".".join((*spaces, key))
        branch[key] = yaml_tree.plain(settings[name].value)
        if remarks and remarks.get(name):
            at.append(key)
            comments[tuple(at)] = remarks[name]
    return yaml_tree.dump(tree, comments)


def commands(changes: Iterable[tuple[Variable, str, float]]) -> list[str]:
    """`ros2 param set` for (option, parameter, value); where a restart is needed, what to write into the file."""
    lines = []
    for option, parameter, value in changes:
        node, _, path = parameter.partition(".")
        text = text_of(option, value)
        if option.reboot_required:
            lines.append(clean(f"# in the parameter file of {node}: {path}: {text}, then start it again"))
        else:
            lines.append(command("ros2", "param", "set", node, path, text))
    return lines
