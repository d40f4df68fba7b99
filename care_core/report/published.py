"""The frame of every published document: a record whose keys and types are an interface.

Each document names its format in `schema_`. Its JSON Schema is made from the same annotations.
"""

from __future__ import annotations

import json
from typing import Any

from care_core.records import Record, plain


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


def to_json(values: Any, indent: int | None = 2) -> str:
    """Plain values as JSON, numbers of numpy among them. Raises ValueError for one that is not finite."""
    separators = None if indent else (",", ":")
    form = json.JSONEncoder(
        indent=indent, separators=separators, ensure_ascii=False, allow_nan=False, default=lambda one: one.item()
    )
    return f"{form.encode(values)}\n"
