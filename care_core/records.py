"""Frozen dataclasses as JSON holds them: written plain, and read back with each value checked against its annotation.

What programs write is read so. What people write (`profile.yaml`, campaigns) pydantic checks, whose import takes as
long as numpy's: a triage reads none of that.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Mapping
from dataclasses import MISSING, Field, fields, is_dataclass
from functools import cache
from types import NoneType, UnionType
from typing import Any, Literal, TypeVar, Union, cast, get_args, get_origin, get_type_hints

R = TypeVar("R")

_Reader = Callable[[Any], Any]


class UnfitError(ValueError):
    """A value that is none of what its place holds; `where` are the keys and numbers that lead to it."""

    def __init__(self, message: str, *where: str | int) -> None:
        super().__init__(message)
        self.message, self.where = message, where

    def __str__(self) -> str:
        return f"'{'.'.join(map(str, self.where))}': {self.message}" if self.where else self.message


def key_of(field: Field[Any]) -> str:
    """The name of a field in files: its `alias`, where Python has the word for itself."""
    key: str = field.metadata.get("alias", field.name)
    return key


def plain(value: Any) -> Any:
    """A record, or what is made of records, in dicts and lists."""
    if is_dataclass(value):
        kind: Any = type(value)
        return {key: plain(getattr(value, name)) for name, key in _keys(kind)}
    if isinstance(value, Mapping):
        return {key: plain(part) for key, part in value.items()}
    return [plain(part) for part in value] if isinstance(value, (list, tuple)) else value


@cache
def _keys(kind: type) -> tuple[tuple[str, str], ...]:
    return tuple((field.name, key_of(field)) for field in fields(kind))


def read(kind: type[R], value: Any) -> R:
    """The record that plain values hold.

    Raises:
        UnfitError: a key is missing or not known, or a value is no such thing: numbers are finite, and none is a text.
    """
    reader: Callable[[Any], R] = _reader(cast(Hashable, kind))
    return reader(value)


@cache
def _reader(kind: Any) -> _Reader:
    if is_dataclass(kind) and isinstance(kind, type):
        return _record(kind)
    if kind in _SIMPLE:
        return _SIMPLE[kind]
    origin, inner = get_origin(kind), get_args(kind)
    if origin is Literal:
        return _one_of(inner)
    if origin in (Union, UnionType):
        return _any_of([_reader(one) for one in inner])
    if origin is tuple and inner[-1] is not ...:
        return _row([_reader(one) for one in inner])
    if origin in (tuple, list):
        return _many(origin, _reader(inner[0]))
    if origin in (dict, Mapping):
        return _mapping(_reader(inner[1]))
    raise TypeError(f"no record holds {kind}")


def _number(value: Any) -> float:
    try:
        number = float(value) if type(value) in (int, float) else math.nan
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise UnfitError("should be a finite number")
    return number


def _exactly(kind: type, words: str) -> _Reader:
    def read(value: Any) -> Any:
        if type(value) is not kind:
            raise UnfitError(f"should be {words}")
        return value

    return read


_SIMPLE: Mapping[Any, _Reader] = {
    float: _number,
    int: _exactly(int, "a whole number"),
    bool: _exactly(bool, "true or false"),
    str: _exactly(str, "text"),
    NoneType: _exactly(NoneType, "null"),
}


def _one_of(known: tuple[Any, ...]) -> _Reader:
    def read(value: Any) -> Any:
        if value not in known:
            raise UnfitError(f"should be {' or '.join(map(repr, known))}")
        return value

    return read


def _any_of(readers: list[_Reader]) -> _Reader:
    def read(value: Any) -> Any:
        unfit = []
        for one in readers:
            try:
                return one(value)
            except UnfitError as err:
                # Its traceback holds this call and all that led to it, for as long as the error is held here.
                unfit.append(err.with_traceback(None))
        raise max(unfit, key=lambda err: len(err.where))

    return read


def _row(readers: list[_Reader]) -> _Reader:
    def read(value: Any) -> Any:
        if not isinstance(value, (list, tuple)) or len(value) != len(readers):
            raise UnfitError(f"should be a list of {len(readers)}")
        found = []
        try:
            for reader, part in zip(readers, value, strict=True):
                found.append(reader(part))
        except ValueError as err:
            raise _unfit(err, len(found)) from None
        return tuple(found)

    return read


def _many(kind: type, reader: _Reader) -> _Reader:
    def read(value: Any) -> Any:
        if not isinstance(value, (list, tuple)):
            raise UnfitError("should be a list")
        found = []
        try:
            for part in value:
                found.append(reader(part))
        except ValueError as err:
            raise _unfit(err, len(found)) from None
        return kind(found)

    return read


def _mapping(reader: _Reader) -> _Reader:
    def read(value: Any) -> Any:
        found = {}
        for key, part in _entries(value).items():
            _key(key)
            try:
                found[key] = reader(part)
            except ValueError as err:
                raise _unfit(err, key) from None
        return found

    return read


def _record(kind: type) -> _Reader:
    hints = get_type_hints(kind)
    readers = {key_of(field): (field.name, _reader(hints[field.name])) for field in fields(kind)}
    needed = [key_of(field) for field in fields(kind) if field.default is MISSING and field.default_factory is MISSING]

    def read(value: Any) -> Any:
        entries = _entries(value)
        for key in needed:
            if key not in entries:
                raise UnfitError("is missing", key)
        values = {}
        for key, part in entries.items():
            if key not in readers:
                raise UnfitError("is not known", _key(key))
            name, reader = readers[key]
            try:
                values[name] = reader(part)
            except ValueError as err:
                raise _unfit(err, key) from None
        return kind(**values)

    return read


def _entries(value: Any) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise UnfitError("should hold keys and values")
    return value


def _key(key: Any) -> str:
    if not isinstance(key, str):
        raise UnfitError("should have a text for its key", str(key))
    return key


def _unfit(err: ValueError, place: str | int) -> UnfitError:
    """The error of what stands at a place, with the way to it; one of a record's own says only what is wrong."""
    return UnfitError(err.message, place, *err.where) if isinstance(err, UnfitError) else UnfitError(str(err), place)
