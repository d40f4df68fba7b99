"""Records: the one kind of value that passes between rooms, how it is written plain, and how it is read back checked.

What programs write is read so. What people write (`profile.yaml`, campaigns) pydantic checks, which names the nearest
known key and takes as long to import as numpy: a triage reads none of that.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, TypeVar

from msgspec import DecodeError, Meta, Struct, ValidationError, convert, field, json, to_builtins
from msgspec.structs import asdict, force_setattr, replace

if TYPE_CHECKING:
    from typing_extensions import dataclass_transform
else:  # a type checker alone needs it

    def dataclass_transform(**_options: Any) -> Any:
        return lambda cls: cls


__all__ = [
    "Meta",
    "Record",
    "Struct",
    "UnfitError",
    "asdict",
    "field",
    "force_setattr",
    "plain",
    "read",
    "read_json",
    "replace",
]

R = TypeVar("R")

_PLACE = re.compile(r"^(.*?)(?: - at `\$?(.*)`)?$", re.DOTALL)


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
class Record(Struct, frozen=True, forbid_unknown_fields=True):
    """A frozen value. `eq=False` where it holds arrays, `dict=True` where it keeps what it worked out."""


class UnfitError(ValueError):
    """A value that is none of what its place holds; `where` leads to it: "faults[0].causes"."""

    def __init__(self, message: str, where: str = "") -> None:
        super().__init__(f"'{where}': {message}" if where else message)
        self.message, self.where = message, where


def plain(value: Any) -> Any:
    """A record, or what is made of records, in dicts and lists, under the names that files have."""
    return to_builtins(value, enc_hook=_builtin)


def _builtin(value: Any) -> Any:
    """What `to_builtins` does not know: mappings of other kinds, and numbers of numpy."""
    return dict(value) if isinstance(value, Mapping) else value.item()


def read(kind: type[R], value: Any) -> R:
    """The record that plain values hold.

    Raises:
        UnfitError: a key is missing or not known, or a value is no such thing: numbers are finite, and none is a text.
    """
    for where in _not_finite(value, ""):
        raise UnfitError("should be a finite number", where)
    try:
        return convert(value, kind)
    except ValidationError as err:
        raise _unfit(err) from None


def read_json(kind: type[R], text: bytes) -> R:
    """The record that a JSON text of this program holds; JSON has no number that is not finite.

    Raises:
        UnfitError: as `read`, or the text is no JSON.
    """
    try:
        return json.decode(text, type=kind)
    except ValidationError as err:
        raise _unfit(err) from None
    except DecodeError as err:
        raise UnfitError(str(err)) from None


def _unfit(err: ValidationError) -> UnfitError:
    match = _PLACE.match(str(err))
    message, where = (match[1], match[2] or "") if match else (str(err), "")
    return UnfitError(message, where.lstrip("."))


def _not_finite(value: Any, where: str) -> Iterator[str]:
    """Where in plain values a number is that JSON does not have."""
    if isinstance(value, (float, int)):
        if not -sys.float_info.max <= value <= sys.float_info.max:  # nor any number of more digits than that
            yield where
    elif isinstance(value, Mapping):
        for key, part in value.items():
            yield from _not_finite(part, f"{where}.{key}" if where else str(key))
    elif isinstance(value, (list, tuple)):
        for index, part in enumerate(value):
            yield from _not_finite(part, f"{where}[{index}]")
