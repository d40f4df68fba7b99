"""A parameter as a public source declares it, and how tables write it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Literal

from care_core.files import read_small_text
from care_core.records import Record

FactType = Literal["float", "int", "bool", "enum", "str", "list", ""]


_ROUNDING = 1e-6
"""Of a bound: logs hold single precision."""


class Fact(Record):
    """What a table says of a parameter; None or empty where its source says nothing.

    Values that are listed are exhaustive only where no range is given: ArduPilot lists presets beside a range.
    """

    name: str
    owner: str
    """Who reads it: a node, a plugin's class, a kind of vehicle."""
    source: str
    """Where the table has it from, in words."""
    type: FactType = ""
    default: str = ""
    low: float | None = None
    high: float | None = None
    values: tuple[tuple[float, str], ...] = ()
    bits: frozenset[int] = frozenset()
    unit: str = ""
    reboot: bool = False
    read_only: bool = False
    releases: str = ""
    """The releases that know it, "" for all that the table covers."""
    line: str = ""
    """What it does, in one line."""

    @property
    def default_number(self) -> float | None:
        """The default as an option counts it (true: 1), None where it is unknown or no number."""
        try:
            return float({"true": "1", "false": "0"}.get(self.default, self.default))
        except ValueError:
            return None

    def allows(self, value: float) -> bool:
        """Whether a value is in the documented range, rounding aside, or a listed one; true where neither is known."""
        if any(value == code for code, _ in self.values):
            return True
        if self.low is None and self.high is None:
            return not self.values
        near = _ROUNDING * max(abs(self.low or 0.0), abs(self.high or 0.0))
        return (self.low is None or value >= self.low - near) and (self.high is None or value <= self.high + near)


def lines_of(table: Path) -> list[str]:
    """The lines of a table, its head first, without what is said about them."""
    return [line for line in read_small_text(table).splitlines() if not line.startswith("#")]


def number(text: str) -> float | None:
    """A cell of a table."""
    return float(text) if text else None


def codes(text: str) -> Iterator[float]:
    """The numbers of a cell: `0..3|10` is 0, 1, 2, 3 and 10."""
    for part in text.split("|") if text else ():
        first, dots, last = part.partition("..")
        yield from map(float, range(int(first), int(last) + 1)) if dots else [float(part)]


def expanded(pattern: str) -> Iterator[str]:
    """The names of a family: {1..16} stands for each of the numbers, {|2|A} for nothing, 2 or A; a name for itself."""
    before, brace, rest = pattern.partition("{")
    if not brace:
        yield pattern
        return
    choices, _, after = rest.partition("}")
    endings = list(expanded(after))
    for part in choices.split("|"):
        first, dots, last = part.partition("..")
        several = map(str, range(int(first), int(last) + 1)) if dots else [part]
        yield from (f"{before}{one}{ending}" for one in several for ending in endings)
