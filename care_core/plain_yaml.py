"""YAML as plain data, read within limits: nothing in a text makes it deep or endless, or builds an object."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from io import StringIO
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.constructor import SafeConstructor
from ruamel.yaml.error import YAMLError
from ruamel.yaml.events import AliasEvent, CollectionEndEvent, CollectionStartEvent, ScalarEvent
from ruamel.yaml.nodes import Node, ScalarNode
from ruamel.yaml.scanner import ScannerError

from care_core import limits

_SHALLOW = 400
"""A text whose longest line and brackets together are fewer cannot be nested any deeper."""
_LONG_TEXT = 1000
"""Characters that count as one value more."""
_WIDTH = 120
"""Columns of a text that is written."""


_COLON = "found unexpected ':'"
"""What the parser in C has against `{a: b::c}`, a class of C++ without quotes; those of ROS and of Python read it."""


class PlainYamlError(ValueError):
    """The text is no YAML, or goes beyond a limit: `problem` in one clause, `line` from 1 where it is known."""

    def __init__(self, problem: str, line: int | None = None) -> None:
        super().__init__(problem if line is None else f"{problem}, in line {line}")
        self.problem, self.line = problem, line


class _Constructor(SafeConstructor):
    def construct_yaml_int(self, node: ScalarNode) -> Any:
        if len(node.value) > limits.INTEGER_DIGITS:
            raise PlainYamlError(f"an integer of {len(node.value)} digits", node.start_mark.line + 1)
        return super().construct_yaml_int(node)


_Constructor.add_constructor("tag:yaml.org,2002:int", _Constructor.construct_yaml_int)


def load(text: str) -> Any:
    """The data of a text, None where it is empty. Raises PlainYamlError."""
    safe = YAML(typ="safe")
    safe.Constructor = _Constructor
    with _explained():
        _check(text)
        return safe.load(text)


def editable(text: str) -> Any:
    """The data of a text with its comments, for `written`; like `load` it builds no object. Raises PlainYamlError."""
    with _explained():
        _check(text)
        return _round_trip().load(text)


def written(data: Any) -> str:
    """The text of data, those of `editable` with the comments they came with."""
    stream = StringIO()
    _round_trip().dump(data, stream)
    return stream.getvalue()


def _round_trip() -> YAML:
    yaml = YAML(typ="rt")
    yaml.width = _WIDTH
    return yaml


def compose(text: str) -> Node | None:
    """The tree of a text, whose nodes know their lines; None where it is empty. Raises PlainYamlError."""
    with _explained():
        try:
            return _composed(text)
        except ScannerError as err:
            if err.problem != _COLON:
                raise
            return _composed(text, pure=True)


def _composed(text: str, *, pure: bool = False) -> Node | None:
    _check(text, pure=pure)
    tree: Node | None = YAML(typ="safe", pure=pure).compose(text)
    return tree


@contextmanager
def _explained() -> Iterator[None]:
    try:
        yield
    except PlainYamlError:
        raise
    except (YAMLError, ValueError, TypeError, OverflowError, RecursionError, AttributeError) as err:
        # A date that no calendar has is a ValueError, a mapping as a key a TypeError.
        raise _explanation(err) from err


def _check(text: str, *, pure: bool = False) -> None:
    """Refuse what is nested too deeply, or too large once its aliases are followed: both end the process when built."""
    if len(text) > limits.YAML_BYTES:
        raise PlainYamlError(f"it is larger than {limits.megabytes(limits.YAML_BYTES)}")
    longest = max(map(len, text.splitlines()), default=0)
    if "&" not in text and longest + text.count("[") + text.count("{") < _SHALLOW:
        return
    sizes: dict[str, int] = {}
    opened: list[tuple[str | None, int]] = []
    count = 0
    for event in YAML(typ="safe", pure=pure).parse(text):
        if isinstance(event, CollectionStartEvent):
            opened.append((event.anchor, count))
            count += 1
        elif isinstance(event, CollectionEndEvent):
            anchor, before = opened.pop()
            if anchor:
                sizes[anchor] = count - before
        elif isinstance(event, ScalarEvent):
            size = 1 + len(event.value) // _LONG_TEXT
            count += size
            if event.anchor:
                sizes[event.anchor] = size
        elif isinstance(event, AliasEvent):
            if event.anchor in (anchor for anchor, _ in opened):
                raise _beyond("an alias stands inside what it stands for", event)
            count += sizes.get(event.anchor, 1)
        if len(opened) > limits.YAML_DEPTH:
            raise _beyond(f"it is nested deeper than {limits.YAML_DEPTH} levels", event)
        if count > limits.YAML_NODES:
            raise _beyond(f"it holds more than {limits.YAML_NODES} values, its aliases followed", event)


def _beyond(problem: str, event: Any) -> PlainYamlError:
    return PlainYamlError(problem, event.start_mark.line + 1)


def _explanation(err: Exception) -> PlainYamlError:
    mark = getattr(err, "problem_mark", None)
    problem = getattr(err, "problem", None) or " ".join(str(err).split())[:120] or "it cannot be read"
    if problem.startswith("but "):
        problem = f"{getattr(err, 'context', '')} {problem}"
    return PlainYamlError(problem, None if mark is None else mark.line + 1)
