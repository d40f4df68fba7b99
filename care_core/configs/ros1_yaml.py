"""ROS 1 parameter files (YAML): nested mappings are namespaces. Values are read from the node tree, so a file can
never have an object built, whatever its tags say."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterable, Iterator, Mapping
from io import StringIO
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode

from care_core.errors import ConfigError
from care_core.run import Setting
from care_core.variables import Variable

DYNAMIC_RECONFIGURE = "dynamic_reconfigure.encoding.Config"
"""Class in the tag of a file that `dynparam dump` wrote; its values are under `dictitems`."""

_DEEPEST = 32
_MOST_VALUES = 50_000
"""Bounds on aliases, which can make a small file endless."""

_NUMBER_TAGS = ("tag:yaml.org,2002:int", "tag:yaml.org,2002:float")


def read(text: str, path: Path) -> dict[str, Setting]:
    """Parameters by path (`DWAPlannerROS/sim_time`, without a leading slash); lists and nulls are passed over."""
    root = _compose(text, path)
    settings: dict[str, Setting] = {}
    if root is None:
        return settings
    if not isinstance(root, MappingNode):
        raise ConfigError("Not a parameter file: it is no mapping of names.", where=str(path))
    for count, (name, node) in enumerate(_walk(root, "", 0, path)):
        if count > _MOST_VALUES:
            raise ConfigError("The file holds more values than a configuration can.", where=str(path))
        settings[name] = Setting(name, _value(node), f"{path}:{node.start_mark.line + 1}")
    return settings


def _compose(text: str, path: Path) -> Node | None:
    try:
        node: Node | None = YAML(typ="safe", pure=True).compose(StringIO(text))
    except YAMLError as err:
        mark = getattr(err, "problem_mark", None)
        where = f"{path}:{mark.line + 1}" if mark is not None else str(path)
        problem = getattr(err, "problem", None) or "the text cannot be read"
        raise ConfigError(f"Not valid YAML: {problem}.", hint="Correct the line.", where=where) from err
    except RecursionError as err:
        raise ConfigError("The file is nested too deeply.", where=str(path)) from err
    return node


def _walk(node: MappingNode, prefix: str, depth: int, path: Path) -> Iterator[tuple[str, ScalarNode]]:
    if depth > _DEEPEST:
        raise ConfigError("The file is nested too deeply.", where=str(path))
    dumped = DYNAMIC_RECONFIGURE in str(node.tag)
    for key, value in node.value:
        name = str(key.value).strip("/")
        if dumped and name == "dictitems" and isinstance(value, MappingNode):
            yield from _walk(value, prefix, depth + 1, path)
        elif dumped:
            continue
        elif isinstance(value, MappingNode):
            yield from _walk(value, f"{prefix}{name}/", depth + 1, path)
        elif isinstance(value, ScalarNode) and value.tag != "tag:yaml.org,2002:null":
            yield f"{prefix}{name}", value


def _value(node: ScalarNode) -> float | str:
    text = str(node.value)
    if node.tag in _NUMBER_TAGS:
        try:
            return float(text.replace("_", ""))
        except ValueError:
            return float(int(text.replace("_", ""), 0))
    return text


def write(settings: Mapping[str, Setting]) -> str:
    """A nested file in alphabetical order, to be loaded into the root namespace."""
    tree: dict[str, Any] = {}
    for name in sorted(settings):
        *spaces, key = name.strip("/").split("/")
        branch = tree
        for space in spaces:
            inner = branch.setdefault(space, {})
            # A parameter may have the name of a namespace (`/move_base/x` beside `/move_base/x/y`).
            branch = inner if isinstance(inner, dict) else branch.setdefault(f"{space}/", {})
        branch[key] = _scalar(settings[name].value)
    return _dump(tree)


def _scalar(value: float | str) -> bool | int | float | str:
    if isinstance(value, str):
        return value == "true" if value in ("true", "false") else value
    return int(value) if math.isfinite(value) and value.is_integer() else float(f"{value:.9g}")


def _dump(tree: dict[str, Any]) -> str:
    if not tree:
        return ""
    stream = StringIO()
    yaml = YAML(typ="safe", pure=True)
    yaml.default_flow_style = False
    yaml.dump(tree, stream)
    return stream.getvalue()


def text_of(option: Variable, value: float) -> str:
    """An option's value as the file has it: integers without a point, floats with one, since the server minds."""
    if option.type == "bool":
        return "true" if value else "false"
    if option.type in ("int", "enum"):
        return str(round(value))
    text = f"{value:.6g}"
    return text if set(text) & set(".en") else f"{text}.0"


def commands(changes: Iterable[tuple[Variable, str, float]]) -> list[str]:
    """dynamic_reconfigure's commands for (option, parameter, value); rosparam where a restart is needed anyway."""
    lines = []
    for option, parameter, value in changes:
        node, _, name = parameter.rpartition("/")
        text = text_of(option, value)
        if option.reboot_required:
            lines.append(f"rosparam set {shlex.quote(parameter)} {text}  # before {node} is started")
        else:
            lines.append(f"rosrun dynamic_reconfigure dynparam set {shlex.quote(node)} {shlex.quote(name)} {text}")
    return lines
