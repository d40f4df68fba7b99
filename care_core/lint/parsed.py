"""What the parser of ROS 2 refuses, and with it the whole file: a node that is given one does not start."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator

from care_core.ecosystems.ros.ros2_yaml import PARAMETERS
from care_core.errors import nearest
from care_core.lint.problems import Entry, LintedFile, Problem
from care_core.metadata import navigation
from care_core.metadata.navigation import COSTMAPS

_PARSER = "parse.c of rcl_yaml_param_parser"
_SHORT = 6
"""A list of so many numbers, as nodes of Nav2 have them, is written out in the advice."""
_DECIMALS = "Write each number with a decimal point."
_KINDS = {bool: "true or false", int: "an integer", float: "a decimal number", str: "a string"}


def check(file: LintedFile) -> Iterator[Problem]:
    """Lists of several types, and nodes whose values do not stand below `ros__parameters`."""
    for entry in file.entries:
        if entry.kind == "list" and PARAMETERS in entry.keys[:-1]:
            yield from _mixed(file, entry)
            yield from _nested(file, entry)
        elif entry.keys[-1] == "use_sim_time" and entry.kind == "str" and PARAMETERS in entry.keys[:-1]:
            yield from _quoted(file, entry)
    yield from _outside(file)


def _quoted(file: LintedFile, entry: Entry) -> Iterator[Problem]:
    """A clock that is told in quotes. What a launch file of Nav2 brings replaces it."""
    word = str(entry.value).lower()
    if not re.search(r"[$<{]", word):
        text = "use_sim_time is a string, declared is true or false: a node that is given it so will not start."
        plain = word if word in ("true", "false") else "true or false"
        hint = f"Write {plain} without quotes, unless the launch file sets it."
        yield file.warning("wrong-type", entry, text, hint, "time_source.cpp of rclcpp")


def _mixed(file: LintedFile, entry: Entry) -> Iterator[Problem]:
    """A list of several types: YAML reads 0 as an integer, and 0.0 as a decimal number."""
    items = _items(str(entry.value))
    kinds = list(dict.fromkeys(_KINDS[type(one)] for one in items if type(one) in _KINDS))
    if len(kinds) < 2:
        return
    text = f"{entry.keys[-1]} holds {kinds[0]} and {kinds[1]}: ROS 2 refuses the whole file, no node starts with it."
    hint = "All of a list are of one type."
    plain = [float(one) for one in items if isinstance(one, (int, float)) and not isinstance(one, bool)]
    if len(plain) == len(items):
        hint = f"Write [{', '.join(repr(one) for one in plain)}]." if len(plain) <= _SHORT else _DECIMALS
    yield file.error("wrong-type", entry, text, hint, f"{_PARSER}, parse_value")


def _nested(file: LintedFile, entry: Entry) -> Iterator[Problem]:
    """Lists in a list, such as the corners of a footprint, which Nav2 reads from a text."""
    items = _items(str(entry.value))
    if len(items) > 1 and any(isinstance(one, list) for one in items):
        text = f"{entry.keys[-1]} is a list of lists: ROS 2 refuses the whole file, no node starts with it."
        hint = "Put it in quotes, where the node reads a text, or write one flat list."
        yield file.error("wrong-type", entry, text, hint, f"{_PARSER}, parse_file_events")


def _items(text: str) -> list[object]:
    try:
        held = ast.literal_eval(text.strip())
    except (ValueError, TypeError, SyntaxError, MemoryError, RecursionError):
        return []  # words without quotes, which are all strings, or what a launch file replaces
    return list(held) if isinstance(held, list) else []


def _outside(file: LintedFile) -> Iterator[Problem]:
    """Nodes of Nav2 that have values beside `ros__parameters`, or not below it, in a file of others that have."""
    done: set[str] = set()
    for entry in file.entries:
        node = next((key for key in entry.keys[:-1] if _is_node(key)), "")
        if not node or node in done or PARAMETERS in entry.keys[:-1]:
            continue
        done.add(node)
        text = f"{entry.keys[-1]} of {node} does not stand below {PARAMETERS}: ROS 2 refuses the whole file."
        meant = next((key for key in entry.keys[:-1] if nearest(key, [PARAMETERS])), "")
        hint = f"Write {PARAMETERS} for {meant}." if meant else f"Write {node}: {PARAMETERS}:, and the values below."
        yield file.error("no-parameters", entry, text, hint, f"{_PARSER}, parse_key")


def _is_node(name: str) -> bool:
    is_known = name in navigation.owners("ros2") and navigation.node_of("ros2", name) == name
    return name in COSTMAPS or is_known
