"""Files read for the rules: every value with its place, also those that a later one hides, and what cannot be read."""

from __future__ import annotations

import math
import re
import sys
from collections.abc import Iterator
from pathlib import Path

from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from care_core.configs.formats import format_of
from care_core.configs.loading import text_of_file
from care_core.ecosystems.ardupilot.parameter_file import FLAGS
from care_core.ecosystems.dialect import Dialect
from care_core.ecosystems.px4.dialect import QGC_PARAMS, is_row
from care_core.ecosystems.ros import yaml_tree
from care_core.ecosystems.ros.dialect import ROS2_YAML
from care_core.errors import ConfigError
from care_core.lint.problems import Entry, LintedFile, Problem, Severity
from care_core.lint.rules import BY_ID

_PARAMETER = re.compile(r"\s*([^\s,]+)(?:\s*,\s*|\s+)(\S+)")
_COMMAND = re.compile(r"\s*param\s+set(?:-default)?\s+(?:-s\s+)?(\S+)\s+(\S+)")
"""How the shell of PX4 and its airframes set a parameter; the other lines of such a file are the shell's."""
_CONFLICT = re.compile(r"(<{7}|\|{7}|={7}|>{7})(\s|$)")
_TAGS = {"int": "int", "float": "float", "bool": "bool", "str": "str", "seq": "list"}
_DICTITEMS = "dictitems"
_GROUPS = "groups"
"""Of a dump of dynamic_reconfigure: how its windows show the values, which its client does not set (client.py)."""

Named = tuple[tuple[str, ...], str, str]


def read_file(path: Path, namespace: str = "") -> tuple[LintedFile, tuple[Problem, ...]]:
    """A file, and what stands in the way of reading it.

    Raises:
        ConfigError: no such file, or not text.
    """
    text = text_of_file(path)
    format = format_of(text, path)
    if not format.is_yaml:
        return _of_parameters(path, format, text)
    try:
        root = yaml_tree.compose(text, path)
    except ConfigError as err:
        line = int(number) if (number := err.where.rpartition(":")[2]).isdigit() else 1
        problem = syntax(path, line, 1, "", err.message, err.hint)
        return LintedFile(path, format, text, (), (), namespace), (problem,)
    entries: list[Entry] = []
    named: list[Named] = []
    if root is not None:
        _walk(root, (), entries, named, letters=format is ROS2_YAML)
    held = tuple(entry for entry in entries if not _is_too_large(entry))
    problems = tuple(_too_large(path, one.line, one.column, one.name) for one in entries if _is_too_large(one))
    return LintedFile(path, format, text, held, tuple(named), namespace), problems


def _is_too_large(entry: Entry) -> bool:
    """Whether a whole number, which has no end in YAML, fits into none that a robot's software has."""
    return isinstance(entry.value, int) and not -sys.float_info.max <= entry.value <= sys.float_info.max


def syntax(path: Path, line: int, column: int, parameter: str, text: str, hint: str) -> Problem:
    """A line that cannot be read."""
    source = BY_ID["syntax"].source
    return Problem("syntax", Severity.ERROR, path, line, column, parameter, text, hint or "Correct the line.", source)


def _too_large(path: Path, line: int, column: int, name: str) -> Problem:
    return syntax(path, line, column, name, f"{name} is larger than any number can be.", "")


def _walk(node: MappingNode, keys: tuple[str, ...], entries: list[Entry], named: list[Named], *, letters: bool) -> None:
    dumped = yaml_tree.is_dumped(node)
    for key, value in node.value:
        name = str(key.value).strip("/") or str(key.value)
        here = keys if dumped and name == _DICTITEMS else (*keys, *name.split("/"))
        if name == _GROUPS and yaml_tree.is_dumped(value):
            continue
        if isinstance(value, MappingNode):
            _walk(value, here, entries, named, letters=letters)
        elif not dumped and (plain := yaml_tree.plain_value(value, letters=letters)) is not None:
            is_bool = yaml_tree.is_bool(value, letters=letters)
            kind = "bool" if is_bool else _TAGS.get(str(value.tag).rpartition(":")[2], "str")
            mark = key.start_mark
            entries.append(Entry(here, plain, mark.line + 1, mark.column + 1, kind))
        elif isinstance(value, SequenceNode):
            named += _plugins(value, here)


def _plugins(node: SequenceNode, keys: tuple[str, ...]) -> Iterator[Named]:
    for item in node.value:
        if isinstance(item, MappingNode):
            found = {str(key.value): _text(value) for key, value in item.value}
            if "name" in found and "type" in found:
                yield keys, found["name"], found["type"]


def _text(node: Node) -> str:
    return str(node.value) if isinstance(node, ScalarNode) else ""


def _of_parameters(path: Path, format: Dialect, text: str) -> tuple[LintedFile, tuple[Problem, ...]]:
    entries, problems = [], []
    lines = text.splitlines()
    pair = _command if any(_COMMAND.match(line) for line in lines) else _pair
    for number, line in enumerate(lines, start=1):
        if _CONFLICT.match(line):
            problems += [_conflict(path, number)] if line.startswith("<") else []
            continue
        body = line.partition("#")[0].rstrip()
        for flag in FLAGS:
            body = body.removesuffix(flag).rstrip()
        if not body.strip():
            continue
        found = _row(line) if format is QGC_PARAMS else pair(body)
        if found is None and pair is _command:
            continue
        if found is None:
            problems.append(syntax(path, number, 1, "", "This line is not a parameter.", "A line is NAME,VALUE."))
            continue
        name, value, column, kind = found
        try:
            held = float(int(value, 16)) if value.lower().startswith("0x") else float(value)
        except OverflowError:
            held = math.inf
        except ValueError:
            problems.append(syntax(path, number, column, name, f"The value of {name} is not a number: '{value}'.", ""))
            continue
        if math.isinf(held):
            problems.append(_too_large(path, number, column, name))
            continue
        entries.append(Entry((name,), held, number, column, kind))
    return LintedFile(path, format, text, tuple(entries)), tuple(problems)


def _conflict(path: Path, line: int) -> Problem:
    text = "A merge conflict was left here: both sides are read, and of each name the last line counts."
    return syntax(path, line, 1, "", text, "Keep one side.")


def _command(body: str) -> tuple[str, str, int, str] | None:
    match = _COMMAND.match(body)
    return None if match is None else (match[1], match[2], match.start(1) + 1, "float")


def _pair(body: str) -> tuple[str, str, int, str] | None:
    match = _PARAMETER.fullmatch(body)
    return None if match is None else (match[1], match[2], match.start(1) + 1, "float")


def _row(line: str) -> tuple[str, str, int, str] | None:
    if not is_row(line):
        return None
    vehicle, component, name, value, kind = line.split("\t")
    column = len(vehicle) + len(component) + 3
    return name.strip(), value.strip(), column, "float" if kind.strip() in ("9", "10") else "int"
