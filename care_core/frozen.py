"""`dataclass` as the standard library has it, for frozen records made in a fifth of the time.

The standard library writes seven functions for each frozen record and compiles them one by one, half a millisecond a
record; a triage needs 140 of them before it begins. Only `__init__` has to be a record's own: the others are the same
for all, and told here once, and it is written when the first record is made. All that reads records (`fields`,
`replace`, `is_dataclass`) finds what it expects.
"""

from __future__ import annotations

from dataclasses import MISSING, Field, FrozenInstanceError, fields
from dataclasses import dataclass as standard
from operator import attrgetter
from reprlib import recursive_repr
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

T = TypeVar("T")

_DEFAULT = object()
"""Stands for what a factory makes."""


def _quick(cls: type[T] | None = None, /, *, eq: bool = True, **options: Any) -> Any:
    if cls is None:
        return lambda kind: _quick(kind, eq=eq, **options)
    if not options.pop("frozen", False):
        return standard(cls, eq=eq, **options)
    own = set(vars(cls))
    said = cls.__doc__
    cls.__doc__ = said or cls.__name__  # else its signature is worked out to say so
    made: Any = standard(cls, init=False, repr=False, eq=False, **options)
    made.__doc__ = said
    made.__init__ = _init_when_needed(made)
    made.__setattr__, made.__delattr__ = _refuse_to_set, _refuse_to_delete
    if "__repr__" not in own:
        made.__repr__ = _repr
    if eq:
        made.__compared__ = _values([field.name for field in fields(made) if field.compare])
        made.__eq__ = _eq
        if "__hash__" not in own:
            made.__hash__ = _hash
    if options.get("slots"):  # else unpickling would set attributes one by one
        made.__getstate__, made.__setstate__ = _state, _restore
    return made


def _init_when_needed(cls: Any) -> Any:
    """Writes the record's own `__init__` when the first one is made: of half of them a triage makes none."""

    def __init__(self: Any, *values: Any, **named: Any) -> None:  # noqa: N807
        cls.__init__ = _init(cls)
        cls.__init__(self, *values, **named)

    return __init__


def _init(cls: Any) -> Any:
    """The one function that differs: it takes the fields by their names, and sets them past `__setattr__`."""
    places: list[str] = []
    named: list[str] = []
    body: list[str] = []
    known: dict[str, Any] = {"_set": object.__setattr__, "_DEFAULT": _DEFAULT}
    for field in fields(cls):
        value = _given(field, known)
        if value is not None:
            body.append(f" _set(self, {field.name!r}, {value})")
        if field.init:
            default = "" if value == field.name and field.default is MISSING else f"=_of_{field.name}"
            (named if field.kw_only else places).append(field.name + default)
    if hasattr(cls, "__post_init__"):
        body.append(" self.__post_init__()")
    signature = ", ".join(["self", *places, *(["*", *named] if named else [])])
    exec(f"def __init__({signature}):\n" + "\n".join(body or [" pass"]), known)
    made = known["__init__"]
    made.__qualname__ = f"{cls.__qualname__}.__init__"
    return made


def _given(field: Field[Any], known: dict[str, Any]) -> str | None:
    """The words for a field's value, None where nobody gives one; what they need goes into `known`."""
    name = field.name
    if field.default_factory is not MISSING:
        known[f"_make_{name}"], known[f"_of_{name}"] = field.default_factory, _DEFAULT
        return f"_make_{name}() if {name} is _DEFAULT else {name}" if field.init else f"_make_{name}()"
    if field.default is not MISSING:
        known[f"_of_{name}"] = field.default
        return name if field.init else f"_of_{name}"
    return name if field.init else None


def _values(names: list[str]) -> Any:
    """A function that answers these attributes of an object as a tuple."""
    if len(names) > 1:
        return staticmethod(attrgetter(*names))
    return staticmethod(lambda record: tuple(getattr(record, name) for name in names))


def _eq(self: Any, other: Any) -> Any:
    if other.__class__ is not self.__class__:
        return NotImplemented
    return self.__compared__(self) == self.__compared__(other)


def _hash(self: Any) -> int:
    return hash(self.__compared__(self))


@recursive_repr()
def _repr(self: Any) -> str:
    shown = ", ".join(f"{field.name}={getattr(self, field.name)!r}" for field in fields(self) if field.repr)
    return f"{type(self).__qualname__}({shown})"


def _refuse_to_set(self: object, name: str, _value: object) -> NoReturn:
    raise FrozenInstanceError(f"cannot assign to field {name!r}")


def _refuse_to_delete(self: object, name: str) -> NoReturn:
    raise FrozenInstanceError(f"cannot delete field {name!r}")


def _state(self: Any) -> list[Any]:
    return [getattr(self, field.name) for field in fields(self)]


def _restore(self: Any, state: list[Any]) -> None:
    for field, value in zip(fields(self), state, strict=True):
        object.__setattr__(self, field.name, value)


if TYPE_CHECKING:
    from dataclasses import dataclass as dataclass  # noqa: PLC0414 - a name for others to import
else:
    dataclass = _quick
