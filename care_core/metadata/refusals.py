"""What the checks before arming read: the parameters behind a refusal, and what must hold of them.

Facts of the firmware's source, in the table beside this module.
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Literal, get_args

from care_core.metadata.aliases import alias_in
from care_core.metadata.fact import expanded, lines_of
from care_core.metadata.output_functions import MOTORS
from care_core.records import Record

TABLE = Path(__file__).with_name("ardupilot_refusals.tsv")
Also = Literal["", "world", "voltage", "calibration"]
"""What else brings a refusal about: nothing; surroundings or hardware; the battery; a calibration that was not done."""

RELATIONS: Mapping[str, tuple[str, Callable[[float, float], bool]]] = {
    "<": ("must be below", operator.lt),
    "<=": ("must be at most", operator.le),
    ">": ("must be above", operator.gt),
    ">=": ("must be at least", operator.ge),
    "=": ("must be", operator.eq),
    "!=": ("must not be", operator.ne),
    "within": ("must be within", lambda a, b: abs(a) <= b),
    "usually": ("is usually within", lambda a, b: abs(a) <= b),  # no check of the firmware
}
_NAME = re.compile(r"\b[A-Z][A-Z0-9]*_[A-Z0-9_]*[A-Z0-9]\b")


class Must(Record):
    """What must hold between a parameter and a number or another one."""

    left: str
    relation: str
    right: str
    only_if: Must | None = None

    @property
    def parameters(self) -> tuple[str, ...]:
        """The parameters that it binds."""
        return tuple(side for side in (self.left, self.right) if _NAME.fullmatch(side))

    def is_broken(self, values: Mapping[str, float]) -> bool:
        """Whether these values break it; not where one of them is unknown."""
        if self.only_if is not None and not self.only_if.holds(values):
            return False
        left, right = (_number(side, values) for side in (self.left, self.right))
        return left is not None and right is not None and not RELATIONS[self.relation][1](left, right)

    def holds(self, values: Mapping[str, float]) -> bool:
        """Whether these values are known, and keep it."""
        return not self.is_broken(values) and all(side in values for side in self.parameters)

    def asks(self, name: str, values: Mapping[str, float]) -> str:
        """What it asks of one of its parameters: "must be below BATT_LOW_VOLT (10.5)"."""
        if name == self.left:
            known = f" ({values[self.right]:g})" if self.right in values else ""
            return f"{RELATIONS[self.relation][0]} {self.right}{known}"
        return f"{self.left} ({values[self.left]:g}) {RELATIONS[self.relation][0]} it"

    def value_of(self, name: str) -> float | None:
        """The one number that it leaves to a parameter, None where it leaves a choice."""
        is_one = self.relation == "=" and name == self.left and not _NAME.fullmatch(self.right)
        return _number(self.right, {}) if is_one else None


class RefusalReads(Record):
    """What the check behind a refusal reads, by the names that the vehicle has."""

    named: tuple[str, ...]
    """Parameters that the text itself names."""
    read: tuple[str, ...]
    """The other parameters that its check reads."""
    must: tuple[Must, ...]
    also: frozenset[Also]

    @property
    def parameters(self) -> tuple[str, ...]:
        """Those that the text names first."""
        return (*self.named, *self.read)


def refusal_reads(text: str, kind: str, names: Collection[str]) -> RefusalReads:
    """What the check reads that refuses with this text; nothing where it is not known.

    Args:
        text: as the firmware says it, without "Arm: " or "PreArm: "; it may be cut at its end.
        kind: the kind of vehicle (`ardupilot.VEHICLES`).
        names: the parameters that the vehicle has; a name of another release counts by its own.
    """
    named = tuple(dict.fromkeys(_names_present(_NAME.findall(text), kind, names)))
    read: list[str] = []
    must: list[Must] = []
    also: set[Also] = set()
    for row in _rows():
        match = row.text.search(text)
        if match is None:
            continue
        number = next(iter(match.groups()), "")
        read += _names_present(row.names(number), kind, names)
        must += row.bound(number)
        also.add(row.also)
    return RefusalReads(
        named, tuple(one for one in dict.fromkeys(read) if one not in named), tuple(must), frozenset(also)
    )


def _names_present(wanted: Iterable[str], kind: str, names: Collection[str]) -> Iterator[str]:
    for one in wanted:
        held = alias_in(one, names, kind)
        if held is not None:
            yield held.name


class _Row(Record):
    text: re.Pattern[str]
    reads: tuple[str, ...]
    must: tuple[str, ...]
    also: Also

    def names(self, number: str) -> Iterator[str]:
        for pattern in self.reads:
            yield from expanded(_filled(pattern, number))

    def bound(self, number: str) -> Iterator[Must]:
        for pattern in self.must:
            yield from map(_must, expanded(_filled(pattern, number)))


def _filled(pattern: str, number: str) -> str:
    """A pattern with the number of its refusal, and with the function of that motor's output."""
    motor = int(number or 0)
    filled = pattern.replace("{n}", number).replace("{k}", "" if motor == 1 else number)
    return filled.replace("{m}", str(MOTORS.get(motor, 0)))


def _must(text: str) -> Must:
    bound, _, condition = text.partition(" if ")
    left, relation, right = bound.split()
    return Must(left, relation, right, _must(condition) if condition else None)


def _number(side: str, values: Mapping[str, float]) -> float | None:
    value = values.get(side)
    if value is None and not _NAME.fullmatch(side):
        value = float(side)
    return None if value is None or not math.isfinite(value) else value


@cache
def _rows() -> tuple[_Row, ...]:
    rows = []
    for text, reads, must, also in (line.split("\t") for line in lines_of(TABLE)[1:]):
        pattern = re.escape(text).replace(r"\{n\}", r"(\d+)").replace(r"\{x\}", ".*?")
        bound = tuple(must.split("; ")) if must else ()
        rows.append(_Row(re.compile(pattern, re.IGNORECASE), tuple(reads.split()), bound, _also(also)))
    return tuple(rows)


def _also(text: str) -> Also:
    known: tuple[Also, ...] = get_args(Also)
    return next(one for one in known if one == text)
