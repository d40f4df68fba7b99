"""Frozen records that are made quickly answer as the standard library's do."""

from __future__ import annotations

import copy
import dataclasses
import inspect
import pickle
from dataclasses import FrozenInstanceError, field
from typing import Any

import pytest

from care_core.frozen import dataclass


@dataclass(frozen=True, slots=True)
class _Slotted:
    name: str
    sizes: tuple[float, ...] = ()
    made: dict[str, int] = field(default_factory=dict, compare=False)
    hidden: int = field(default=7, init=False, repr=False)


@dataclass(frozen=True, kw_only=True)
class _Named:
    low: float
    high: float | None = None

    def __post_init__(self) -> None:
        if self.high is not None and self.high < self.low:
            raise ValueError("upside down")


@dataclass(frozen=True)
class _Told(_Named):
    """A record with a hash of its own."""

    told: str = ""

    def __hash__(self) -> int:
        return 5


@dataclass(frozen=True, eq=False)
class _Single:
    value: int


@dataclasses.dataclass(frozen=True)
class _Standard:
    name: str
    sizes: tuple[float, ...] = ()
    made: dict[str, int] = field(default_factory=dict, compare=False)
    hidden: int = field(default=7, init=False, repr=False)


def test_a_record_holds_compares_and_shows_what_the_standard_one_does() -> None:
    ours, theirs = _Slotted("a", (1.0,)), _Standard("a", (1.0,))
    other: Any = theirs
    assert dataclasses.astuple(ours) == dataclasses.astuple(theirs) == ("a", (1.0,), {}, 7)
    assert repr(ours).partition("(")[2] == repr(theirs).partition("(")[2]
    assert ours == _Slotted("a", (1.0,), {"x": 1}) != _Slotted("b")
    assert hash(ours) == hash(theirs) == hash(_Slotted("a", (1.0,)))
    assert ours != other
    assert ours.made is not _Slotted("a").made
    assert not hasattr(ours, "__dict__")
    assert dataclasses.is_dataclass(ours)
    assert str(inspect.signature(_Slotted)).startswith("(name, sizes=()")


def test_a_record_is_not_changed() -> None:
    one: Any = _Slotted("a")
    with pytest.raises(FrozenInstanceError, match="cannot assign to field 'name'"):
        one.name = "b"
    with pytest.raises(FrozenInstanceError, match="cannot delete field 'name'"):
        del one.name
    assert dataclasses.replace(one, name="b") == _Slotted("b")
    assert one.name == "a"


def test_what_is_pickled_or_copied_is_the_same_record() -> None:
    for one in (_Slotted("a", (2.0,), {"x": 1}), _Named(low=1.0), _Told(low=1.0, told="so")):
        for again in (pickle.loads(pickle.dumps(one)), copy.copy(one), copy.deepcopy(one)):
            assert again == one
            assert dataclasses.astuple(again) == dataclasses.astuple(one)


def test_names_only_what_follows_and_what_is_inherited() -> None:
    told = _Told(low=1.0, high=2.0, told="so")
    assert (told.low, told.high, told.told, hash(told)) == (1.0, 2.0, "so", 5)
    with pytest.raises(ValueError, match="upside down"):
        _Named(low=2.0, high=1.0)
    with pytest.raises(TypeError):
        _Named(1.0)  # type: ignore[call-arg]
    with pytest.raises(TypeError):
        _Slotted()  # type: ignore[call-arg]
    assert _Single(1) != _Single(1)
    assert len({_Single(1), _Single(1)}) == 2
