"""A profile as text, with a comment on everything that its writer should look at."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator, Mapping
from typing import Any

from care_core.text import clean
from care_core.variables import Threshold, Variable

WIDTH = 120
_PLAIN = re.compile(r"[A-Za-z_/][\w./ ()-]*[\w)]|[A-Za-z]")
_WORDS = frozenset({"true", "false", "yes", "no", "on", "off", "null", "y", "n", "none"})


def scalar(value: object) -> str:
    """A value as YAML: lists and mappings on one line, text quoted where it could be read as anything else."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, float)):
        return f"{value:.7g}"
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{scalar(key)}: {scalar(one)}" for key, one in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(map(scalar, value)) + "]"
    text = clean(str(value))
    if _PLAIN.fullmatch(text) and text.casefold() not in _WORDS:
        return text
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def comment(text: str, indent: int = 0) -> list[str]:
    """The text as comment lines of at most `WIDTH` columns."""
    head = f"{' ' * indent}# "
    return textwrap.wrap(clean(text), WIDTH, initial_indent=head, subsequent_indent=head, break_on_hyphens=False)


def variable_lines(variable: Variable, remark: str = "") -> Iterator[str]:
    """An entry of `variables`, its remark above it."""
    yield from comment(remark, 2) if remark else ()
    yield f"  {scalar(variable.name)}:"
    for key, value in _entry(variable):
        yield f"    {key}: {scalar(value)}"


def _entry(variable: Variable) -> Iterator[tuple[str, Any]]:
    yield "role", variable.role.value
    if variable.type != "float":
        yield "type", variable.type
    if variable.about != "world":
        yield "about", variable.about
    if variable.labels:
        yield "values", dict(variable.labels)
    if variable.unit:
        yield "unit", variable.unit
    if variable.range is not None:
        yield "range", list(variable.range)
    if variable.default is not None:
        yield "default", variable.default
    if variable.order is not None:
        yield "order", variable.order
    if variable.kind is not None:
        yield "kind", variable.kind
    if variable.doc:
        yield "doc", variable.doc
    if variable.parameters:
        yield "parameter", variable.parameters[0] if len(variable.parameters) == 1 else list(variable.parameters)
    yield from ((name, True) for name in ("safety", "ceiling", "airframe") if getattr(variable, name))
    if variable.threshold is not None:
        yield "threshold", _bound(variable.threshold)
    if variable.extract is not None:
        yield "extract", {"kind": variable.extract.kind, **variable.extract.args}


def _bound(bound: Threshold) -> dict[str, Any]:
    if bound.value is not None:
        return {"op": bound.op, "value": bound.value}
    floor = {} if bound.at_least is None else {"at_least": bound.at_least}
    return {"op": bound.op, "ratio": bound.ratio, **floor}
