"""The frame of every published document: a frozen dataclass whose keys and types are an interface.

Each document names its format in `schema_`. Its JSON Schema is made by pydantic, from the same annotations.
"""

from __future__ import annotations

import json
from inspect import cleandoc
from typing import Any, ClassVar

from care_core.records import plain


class Strict:
    """Nothing unknown, no number that JSON does not have. Subclasses are dataclasses, frozen and by keyword."""

    __pydantic_config__: ClassVar[dict[str, Any]] = {"extra": "forbid", "allow_inf_nan": False}

    def __init_subclass__(cls) -> None:
        # pydantic takes the text of a dataclass for one that dataclasses wrote
        described = {} if cls.__doc__ is None else {"json_schema_extra": {"description": cleandoc(cls.__doc__)}}
        cls.__pydantic_config__ = Strict.__pydantic_config__ | described

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
        from pydantic import TypeAdapter

        schema = TypeAdapter(cls).json_schema(by_alias=True, mode="serialization")
        return schema | {"title": getattr(cls, "schema_", cls.__name__)}


def to_json(values: Any, indent: int | None = 2) -> str:
    """Plain values as JSON, numbers of numpy among them. Raises ValueError for one that is not finite."""
    separators = None if indent else (",", ":")
    form = json.JSONEncoder(
        indent=indent, separators=separators, ensure_ascii=False, allow_nan=False, default=lambda one: one.item()
    )
    return f"{form.encode(values)}\n"
