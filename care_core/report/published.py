"""The frame of every published document: a record whose keys and types are an interface.

Each document names its format in `schema_`. Its JSON Schema is made from the same annotations.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any, TypeVar

from care_core.records import Record, plain
from care_core.text import clean

R = TypeVar("R", bound=Record)


class Document(Record):
    """Nothing unknown, no number that JSON does not have. Fields of its kinds are given by keyword."""

    def plain(self) -> dict[str, Any]:
        """In dicts and lists, under the names that files have."""
        values: dict[str, Any] = plain(self)
        return values

    def to_json(self, indent: int | None = 2) -> str:
        """One object, in lines where it is indented."""
        return to_json(self.plain(), indent)

    @classmethod
    def json_schema(cls) -> dict[str, Any]:
        """The JSON Schema of the document."""
        from msgspec.json import schema
        from msgspec.structs import fields

        names = [field.default for field in fields(cls) if field.encode_name == "schema"]
        return schema(cls) | {"title": names[0] if names else cls.__name__}


def publish(kind: type[R], record: Record, **others: Any) -> R:
    """The published form of a record: the fields that both have under one name, and `others`.

    Texts are cleaned, tuples become lists, and a number that JSON does not have becomes None.
    """
    shared = set(kind.__struct_fields__) & set(record.__struct_fields__) - set(others)
    return kind(**{name: publishable(getattr(record, name)) for name in shared}, **others)


def publishable(value: Any) -> Any:
    """A text, a number, or what holds them, fit to be written."""
    if isinstance(value, str):
        return clean(value)
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, (tuple, list)):
        return [publishable(part) for part in value]
    if isinstance(value, Mapping):
        return {name: publishable(part) for name, part in value.items()}
    return value


def to_json(values: Any, indent: int | None = 2) -> str:
    """Plain values as JSON, numbers of numpy among them. Raises ValueError for one that is not finite."""
    separators = None if indent else (",", ":")
    form = json.JSONEncoder(
        indent=indent, separators=separators, ensure_ascii=False, allow_nan=False, default=lambda one: one.item()
    )
    return f"{form.encode(values)}\n"
