"""What is known of parameters without any log: those of the navigation stacks, from a table that comes with it."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from care_core.variables import ValueType

_TABLE = Path(__file__).with_name("navigation_parameters.csv")
_WORD = re.compile(r"[a-z]+")
_COMMON = frozenset({"server", "plugin", "parameters", "layer", "ros", "base"})


@dataclass(frozen=True, slots=True)
class Fact:
    """A parameter as its source declares it; None where the source says nothing."""

    owner: str
    """The node and plugin, in words."""
    name: str
    type: ValueType
    default: float | None
    low: float | None
    high: float | None
    values: tuple[tuple[float, str], ...]


def fact_of(ros: str, parameter: str) -> Fact | None:
    """What the table says of a parameter (`/move_base/DWAPlannerROS/sim_time`, `/controller_server.FollowPath.vx`).

    The owner must share a word with the parameter's path. Where several are as near and differ, nothing is known.

    Args:
        ros: ros1 or ros2.
    """
    parts = [part for part in re.split(r"[/.]", parameter) if part]
    if not parts:
        return None
    words = _words(parts[:-1])
    scored = [(_alike(words, _words([fact.owner])), fact) for fact in _facts(ros) if _is_called(fact.name, parts)]
    best = max((score for score, _ in scored), default=(0, 0))
    likeliest = [fact for score, fact in scored if score == best and score[0] > 0]
    return likeliest[0] if likeliest and _agree(likeliest) else None


def _is_called(name: str, parts: Sequence[str]) -> bool:
    own = name.split(".")
    return list(parts[-len(own) :]) == own


def _alike(words: set[str], owner: set[str]) -> tuple[int, int]:
    """How many words two have in common, then how few of the owner's are not among them."""
    return len(words & owner), -len(owner - words)


def _agree(facts: Sequence[Fact]) -> bool:
    return len({(fact.type, fact.default, fact.low, fact.high) for fact in facts}) == 1


def _words(texts: Sequence[str]) -> set[str]:
    """Words of names, CamelCase and snake_case alike."""
    split = (re.sub(r"(?<=[a-z])(?=[A-Z])", " ", text).casefold() for text in texts)
    return {word.removesuffix("s") for text in split for word in _WORD.findall(text)} - _COMMON


@cache
def _facts(ros: str) -> tuple[Fact, ...]:
    lines = (line for line in _TABLE.read_text(encoding="utf-8").splitlines() if not line.startswith("#"))
    return tuple(_fact(row) for row in csv.DictReader(lines) if row["ros"] == ros)


def _fact(row: dict[str, str]) -> Fact:
    kind: ValueType = "enum" if row["values"] else row["type"]  # type: ignore[assignment]
    pairs = (pair.partition("=") for pair in row["values"].split("|") if pair)
    return Fact(
        owner=f"{row['node']} {row['plugin']}",
        name=row["name"],
        type=kind,
        default=_number(row["default"]),
        low=_number(row["low"]),
        high=_number(row["high"]),
        values=tuple((float(code), label) for code, _, label in pairs),
    )


def _number(text: str) -> float | None:
    words = {"true": 1.0, "false": 0.0}
    return None if not text else words.get(text) if text in words else float(text)
