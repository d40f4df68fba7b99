"""YAML as a tree of nodes: values with their lines. No tag in a file ever has an object built."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from io import StringIO
from json import dumps
from pathlib import Path
from typing import Any, NamedTuple

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode
from ruamel.yaml.scalarstring import DoubleQuotedScalarString

from care_core import plain_yaml
from care_core.errors import ConfigError

_BARE = re.compile(r"[A-Za-z][\w/]*")
"""A text that needs no quotes in a list."""

_REFERENCE = re.compile(r"(^|[\[,\s])[&*!]")
"""An anchor, an alias or a tag in a list, which no parameter has and which can make a short one endless."""

_NOT_ONE = "Is it the robot's configuration?"

_NULL_TAG = "tag:yaml.org,2002:null"
_INT_TAG = "tag:yaml.org,2002:int"
_FLOAT_TAG = "tag:yaml.org,2002:float"
_LIST_TAG = "tag:yaml.org,2002:seq"
_BOOL_TAG = "tag:yaml.org,2002:bool"
_STRING_TAG = "tag:yaml.org,2002:str"

_SWITCHES = {"yes": "true", "on": "true", "no": "false", "off": "false"}
"""What YAML 1.1, which ROS reads, takes for true and false beside these words."""
_LETTERS = {"y": "true", "n": "false"}
"""What the parser of ROS 2 takes for true and false as well (rcl_yaml_param_parser, parse.c), and PyYAML does not."""

DYNAMIC_RECONFIGURE = "dynamic_reconfigure.encoding.Config"
"""Class in the tag of a file that `dynparam dump` wrote."""


class Leaf(NamedTuple):
    """A value of the file: the keys that lead to it, and its line, from 1."""

    keys: tuple[str, ...]
    value: float | str
    line: int


def compose(text: str, path: Path) -> MappingNode | None:
    """The root of a file, None when it is empty.

    Raises:
        ConfigError: not YAML, or no mapping of names.
    """
    try:
        node = plain_yaml.compose(text)
    except plain_yaml.PlainYamlError as err:
        where = str(path) if err.line is None else f"{path}:{err.line}"
        raise ConfigError(f"Not valid YAML: {err.problem}.", hint="Correct the line.", where=where) from err
    if node is not None and not isinstance(node, MappingNode):
        raise ConfigError("Not a parameter file: it is no mapping of names.", hint=_NOT_ONE, where=str(path))
    return node


def leaves(root: MappingNode, *, unwrap: str = "", letters: bool = False) -> Iterator[Leaf]:
    """Every value with the keys that lead to it. Nulls and lists of mappings are passed over.

    Args:
        unwrap: class in the tag of a dumped Python object, whose values are those under its key `dictitems`.
        letters: whether y and n are true and false, as ROS 2 has it.
    """
    return _mapping(root, (), unwrap, letters)


def is_dumped(node: MappingNode, name: str = DYNAMIC_RECONFIGURE) -> bool:
    """Whether a mapping is a Python object of that class, as its tag says."""
    return name in str(node.tag)


def _mapping(node: MappingNode, keys: tuple[str, ...], unwrap: str, letters: bool) -> Iterator[Leaf]:
    dumped = bool(unwrap) and is_dumped(node, unwrap)
    for key, value in node.value:
        name = str(key.value).strip("/") or str(key.value)
        if dumped and name == "dictitems" and isinstance(value, MappingNode):
            yield from _mapping(value, keys, unwrap, letters)
        elif dumped:
            continue
        elif isinstance(value, MappingNode):
            yield from _mapping(value, (*keys, name), unwrap, letters)
        elif (plain := plain_value(value, letters=letters)) is not None:
            yield Leaf((*keys, name), plain, value.start_mark.line + 1)


def plain_value(node: Node, *, letters: bool = False) -> float | str | None:
    """A number, text or list as its text; None for nothing, and for what holds mappings."""
    if isinstance(node, ScalarNode) and node.tag != _NULL_TAG:
        return _scalar(node, letters)
    return _list(node, letters) if isinstance(node, SequenceNode) and node.tag == _LIST_TAG else None


def is_bool(node: Node, *, letters: bool = False) -> bool:
    """Whether ROS takes a value for true or false."""
    return isinstance(node, ScalarNode) and (node.tag == _BOOL_TAG or bool(_switch(node, letters)))


def _switch(node: ScalarNode, letters: bool) -> str:
    """true or false for a bare word that ROS takes for one, else nothing. `yEs` is a text, and so is `!!str yes`."""
    text = str(node.value)
    if node.tag != _STRING_TAG or node.style or text not in (text.lower(), text.upper(), text.capitalize()):
        return ""
    is_tagged = node.end_mark.index - node.start_mark.index != len(text) and not node.anchor
    words = {**_SWITCHES, **_LETTERS} if letters else _SWITCHES
    return "" if is_tagged else words.get(text.lower(), "")


def _list(node: SequenceNode, letters: bool) -> str | None:
    """A list as its text, `[1.0, 2.0]`; None for one that holds mappings."""
    parts = []
    for item in node.value:
        is_list = isinstance(item, SequenceNode)
        part = _list(item, letters) if is_list else _item(item, letters) if isinstance(item, ScalarNode) else None
        if part is None:
            return None
        parts.append(part)
    return f"[{', '.join(parts)}]"


def _scalar(node: ScalarNode, letters: bool) -> float | str:
    """A number where YAML resolves one, else the text; an integer stays one, since ROS minds the difference."""
    text = str(node.value)
    if node.tag == _BOOL_TAG:
        return text.lower()
    plain = text.replace("_", "").lower()
    try:
        if node.tag == _INT_TAG:
            return int(plain, 0) if plain.lstrip("+-").startswith(("0x", "0o", "0b")) else int(plain)
        if node.tag == _FLOAT_TAG:
            return float(plain.replace(".inf", "inf").replace(".nan", "nan"))
    except ValueError:  # an integer of more digits than any number has
        return text
    return _switch(node, letters) or text


def _item(node: ScalarNode, letters: bool) -> str:
    value = _scalar(node, letters)
    if not isinstance(value, str) or is_bool(node, letters=letters):
        return str(value)
    return value if _BARE.fullmatch(value) and not _is_switch(value) else dumps(value)


def _is_switch(text: str) -> bool:
    """Whether a text would be read as true or false without its quotes."""
    return text.lower() in (*_SWITCHES, *_LETTERS, "true", "false")


def plain(value: float | str) -> Any:
    """The value as YAML should hold it: true and false, numbers, lists and text."""
    if not isinstance(value, str):
        return value if isinstance(value, int) else float(f"{value:.9g}")
    if value in ("true", "false"):
        return value == "true"
    if value.startswith("[") and value.endswith("]") and not _REFERENCE.search(value):
        try:
            items = plain_yaml.load(value)
        except plain_yaml.PlainYamlError:
            return value
        return items if isinstance(items, list) else value
    return DoubleQuotedScalarString(value) if _is_switch(value) else value


def typed(text: str) -> float | str:
    """A value as a line of a file has it: an integer, a number or a word."""
    for number in (int, float):
        try:
            return number(text)
        except ValueError:
            continue
    return text


def dump(tree: Mapping[str, Any], remarks: Mapping[tuple[str, ...], str]) -> str:
    """A nested mapping as text; `remarks` are comments at the end of the line of the key that a path leads to."""
    if not tree:
        return ""
    yaml = YAML()
    yaml.default_flow_style = False
    yaml.width = 4096
    stream = StringIO()
    yaml.dump(_commented(tree, (), remarks), stream)
    return stream.getvalue()


def _commented(tree: Mapping[str, Any], at: tuple[str, ...], remarks: Mapping[tuple[str, ...], str]) -> CommentedMap:
    made = CommentedMap()
    for key, value in tree.items():
        here = (*at, key)
        made[key] = _commented(value, here, remarks) if isinstance(value, dict) else value
        if here in remarks:
            made.yaml_add_eol_comment(remarks[here], key)
    return made
