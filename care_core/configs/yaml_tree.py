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
from ruamel.yaml.error import YAMLError
from ruamel.yaml.nodes import MappingNode, Node, ScalarNode, SequenceNode

from care_core.errors import ConfigError

_BARE = re.compile(r"[A-Za-z][\w/]*")
"""A text that needs no quotes in a list."""

_REFERENCE = re.compile(r"(^|[\[,\s])[&*!]")
"""An anchor, an alias or a tag in a list, which no parameter has and which can make a short one endless."""

_DEEPEST = 32
_MOST_VALUES = 50_000
"""Bounds on aliases, which can make a small file endless."""

_NULL_TAG = "tag:yaml.org,2002:null"
_INT_TAG = "tag:yaml.org,2002:int"
_FLOAT_TAG = "tag:yaml.org,2002:float"
_LIST_TAG = "tag:yaml.org,2002:seq"
_BOOL_TAG = "tag:yaml.org,2002:bool"


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
        node: Node | None = YAML(typ="safe", pure=True).compose(StringIO(text))
    except YAMLError as err:
        mark = getattr(err, "problem_mark", None)
        where = f"{path}:{mark.line + 1}" if mark is not None else str(path)
        problem = getattr(err, "problem", None) or "the text cannot be read"
        raise ConfigError(f"Not valid YAML: {problem}.", hint="Correct the line.", where=where) from err
    except RecursionError as err:
        raise ConfigError("The file is nested too deeply.", where=str(path)) from err
    if node is not None and not isinstance(node, MappingNode):
        raise ConfigError("Not a parameter file: it is no mapping of names.", where=str(path))
    return node


def leaves(root: MappingNode, path: Path, *, unwrap: str = "") -> Iterator[Leaf]:
    """Every value with the keys that lead to it. Nulls and lists of mappings are passed over.

    Args:
        unwrap: class in the tag of a dumped Python object, whose values are those under its key `dictitems`.

    Raises:
        ConfigError: deeper or longer than any configuration.
    """
    for count, leaf in enumerate(_walk(root, (), path, unwrap)):
        if count > _MOST_VALUES:
            raise ConfigError("The file holds more values than a configuration can.", where=str(path))
        yield leaf


def _walk(node: MappingNode, keys: tuple[str, ...], path: Path, unwrap: str) -> Iterator[Leaf]:
    if len(keys) > _DEEPEST:
        raise ConfigError("The file is nested too deeply.", where=str(path))
    dumped = bool(unwrap) and unwrap in str(node.tag)
    for key, value in node.value:
        name = str(key.value).strip("/") or str(key.value)
        if dumped and name == "dictitems" and isinstance(value, MappingNode):
            yield from _walk(value, keys, path, unwrap)
        elif dumped:
            continue
        elif isinstance(value, MappingNode):
            yield from _walk(value, (*keys, name), path, unwrap)
        elif (plain := _plain(value, path)) is not None:
            yield Leaf((*keys, name), plain, value.start_mark.line + 1)


def _plain(node: Node, path: Path) -> float | str | None:
    if isinstance(node, ScalarNode) and node.tag != _NULL_TAG:
        return _scalar(node)
    if isinstance(node, SequenceNode) and node.tag == _LIST_TAG:
        return _list(node, path, 0)
    return None


def _scalar(node: ScalarNode) -> float | str:
    """A number where YAML resolves one, else the text; an integer stays one, since ROS minds the difference."""
    text = str(node.value)
    if node.tag == _INT_TAG:
        return int(text.replace("_", ""), 0) if text.lstrip("+-").startswith(("0x", "0o", "0b")) else int(text)
    if node.tag == _FLOAT_TAG:
        return float(text.replace("_", "").replace(".inf", "inf").replace(".nan", "nan").replace(".NaN", "nan"))
    return text.lower() if node.tag == _BOOL_TAG else text


def _list(node: SequenceNode, path: Path, depth: int) -> str | None:
    """A list as its text, `[1.0, 2.0]`; None for one that holds mappings."""
    if depth > _DEEPEST:
        raise ConfigError("The file is nested too deeply.", where=str(path))
    parts = []
    for item in node.value:
        if isinstance(item, SequenceNode):
            part = _list(item, path, depth + 1)
        else:
            part = _item(item) if isinstance(item, ScalarNode) else None
        if part is None:
            return None
        parts.append(part)
    return f"[{', '.join(parts)}]"


def _item(node: ScalarNode) -> str:
    value = _scalar(node)
    is_bare = not isinstance(value, str) or node.tag == _BOOL_TAG or _BARE.fullmatch(value)
    return str(value) if is_bare else dumps(value)


def plain(value: float | str) -> Any:
    """The value as YAML should hold it: true and false, numbers, lists and text."""
    if not isinstance(value, str):
        return value if isinstance(value, int) else float(f"{value:.9g}")
    if value in ("true", "false"):
        return value == "true"
    if value.startswith("[") and value.endswith("]") and not _REFERENCE.search(value):
        try:
            items = YAML(typ="safe", pure=True).load(value)
        except (YAMLError, RecursionError):
            return value
        return items if isinstance(items, list) else value
    return value


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
