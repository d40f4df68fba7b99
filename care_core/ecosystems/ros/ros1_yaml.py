"""ROS 1 parameter files (YAML): nested mappings are namespaces, `DWAPlannerROS: {sim_time: 1.7}`."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from care_core.ecosystems.ros import yaml_tree
from care_core.run import Find, Setting
from care_core.text import command
from care_core.variables import Variable


def read(text: str, path: Path, namespace: str = "") -> dict[str, Setting]:
    """Parameters by path (`DWAPlannerROS/sim_time`, without a leading slash), under the namespace given."""
    root = yaml_tree.compose(text, path)
    if root is None:
        return {}
    outer = (namespace.strip("/"),) if namespace.strip("/") else ()
    settings = {}
    for leaf in yaml_tree.leaves(root, unwrap=yaml_tree.DYNAMIC_RECONFIGURE):
        name = "/".join((*outer, *leaf.keys))
        settings[name] = Setting(name, leaf.value, f"{path}:{leaf.line}")
    return settings


def finder(files: Sequence[Mapping[str, Setting]]) -> Find:
    """The values that files loaded one after the other give parameters of a log."""
    return partial(_find, tuple(files))


def _find(files: Sequence[Mapping[str, Setting]], parameter: str) -> Setting | None:
    """The value that files give a parameter.

    A file does not name the namespace it is loaded into: `DWAPlannerROS/sim_time` in it is
    `/move_base/DWAPlannerROS/sim_time` in the log. In one file the longest trailing part counts. A bare last name
    could belong to any node, so it is taken only where no file says more.
    """
    parts = parameter.strip("/").split("/")
    guess: Setting | None = None
    found: Setting | None = None
    for settings in files:
        names = ("/".join(parts[skipped:]) for skipped in range(len(parts)))
        name = next((name for name in names if name in settings), None)
        if name is None:
            continue
        if is_guess(name, parameter):
            guess = settings[name]
        else:
            found = settings[name]
    return found or guess


def is_guess(name: str, parameter: str) -> bool:
    """Whether a name in a file says nothing of where the parameter belongs."""
    return "/" not in name and "/" in parameter.strip("/")


def write(settings: Mapping[str, Setting], remarks: Mapping[str, str] | None = None) -> str:
    """A nested file in alphabetical order, to be loaded into the root namespace."""
    tree: dict[str, Any] = {}
    comments: dict[tuple[str, ...], str] = {}
    for name in sorted(settings):
        *spaces, key = name.strip("/").split("/")
        branch = tree
        at: list[str] = []
        for space in spaces:
            # A parameter may have the name of a namespace (`/move_base/x` beside `/move_base/x/y`).
            at.append(space if isinstance(branch.get(space, {}), dict) else f"{space}/")
            branch = branch.setdefault(at[-1], {})
        branch[key] = yaml_tree.plain(settings[name].value)
        if remarks and remarks.get(name):
            at.append(key)
            comments[tuple(at)] = remarks[name]
    return yaml_tree.dump(tree, comments)


def text_of(option: Variable, value: float) -> str:
    """An option's value as the file has it: integers without a point, floats with one, since the server minds."""
    if option.type == "bool":
        return "true" if value else "false"
    if option.type in ("int", "enum"):
        return str(round(value))
    text = f"{value:.6g}"
    return text if set(text) & set(".en") else f"{text}.0"


def line_of(option: Variable, parameter: str, value: float) -> str:
    """One setting as a line of a diff."""
    return f"{parameter}: {text_of(option, value)}"


def commands(changes: Iterable[tuple[Variable, str, float]]) -> list[str]:
    """dynamic_reconfigure's commands for (option, parameter, value); rosparam where a restart is needed anyway."""
    lines = []
    for option, parameter, value in changes:
        node, _, name = parameter.rpartition("/")
        text = text_of(option, value)
        if option.reboot_required:
            lines.append(command("rosparam", "set", parameter, text, note=f"before {node} is started"))
        else:
            lines.append(command("rosrun", "dynamic_reconfigure", "dynparam", "set", node, name, text))
    return lines
