"""What a profile talks about: options, contexts, metrics and objectives. Values only, no data."""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Mapping
from enum import Enum
from types import MappingProxyType
from typing import Any, Literal

from care_core.records import Record, field


class Role(str, Enum):
    """The part a variable plays (paper, section III-A: X, exogenous, S, Y)."""

    OPTION = "option"
    CONTEXT = "context"
    METRIC = "metric"
    OBJECTIVE = "objective"


Op = Literal["<=", ">=", "<", ">", "=="]
Kind = Literal["functional", "non-functional"]
About = Literal["mission", "vehicle", "world"]
"""What a context tells of: what was asked, what flew, or what was met. The first two are known before the start."""
ValueType = Literal["float", "int", "bool", "enum"]

_NAME = re.compile(r"\w[\w.-]*")
_PARAMETER = re.compile(r"[A-Za-z0-9_/~][\w./~-]*", re.ASCII)

_WORDS = {"true": 1.0, "yes": 1.0, "on": 1.0, "false": 0.0, "no": 0.0, "off": 0.0}
_COMPARE = {"<=": operator.le, ">=": operator.ge, "<": operator.lt, ">": operator.gt, "==": operator.eq}

ASSUMED = " (assumed)"
"""Stands behind a value that no source of a run holds, wherever it is shown."""

SAME_SHARE, SAME_LEAST = 0.05, 0.5
"""Two missions are the same where their numbers differ by no more: home is never in the same place to the metre, and a
leg more is one."""


def asks_alike(one: float, other: float) -> bool:
    """Whether two numbers that missions ask for are those of the same mission."""
    return math.isclose(one, other, rel_tol=SAME_SHARE, abs_tol=SAME_LEAST)


def is_variable_name(name: str) -> bool:
    """Whether a profile may call a variable so: one word in every table, file and command."""
    return _NAME.fullmatch(name) is not None


def is_parameter_name(name: str) -> bool:
    """Whether a robot's parameter can be called so. What is written into files and shells has nothing else in it."""
    return _PARAMETER.fullmatch(name) is not None


class Threshold(Record):
    """What an objective should keep: a value, a multiple of what the reference configuration needs for the same mission
    and conditions, or the one for the profile's own mission and the other for any."""

    op: Op
    value: float | None = None
    """In the objective's unit."""
    ratio: float | None = None
    """Times what the reference configuration needs."""
    at_least: float | None = None
    """A multiple is never tighter than this, in the objective's unit."""
    source: str | None = None
    """Whose it is: the file of the operator's own limits, "" for this run's, None for the profile's."""
    mission: Mapping[str, float] = field(default_factory=dict)
    """Contexts of the mission that an operator's value belongs to; empty: any mission."""

    @property
    def bound(self) -> float:
        """The value of a threshold that has one. Raises ValueError where it is a multiple alone."""
        if self.value is None:
            raise ValueError(f"a threshold of '{self}' has no value before a run is known")
        return self.value

    def met(self, value: float) -> bool:
        """Whether an objective of this value keeps the bound."""
        return bool(_COMPARE[self.op](value, self.bound))

    def for_need(self, need: float) -> Threshold:
        """The bound where the reference configuration needs `need`. Raises ValueError where there is no ratio."""
        if self.ratio is None:
            raise ValueError(f"a threshold of '{self}' is no multiple")
        value = self.ratio * need
        if self.at_least is not None:
            value = max(value, self.at_least) if self.op in ("<=", "<") else min(value, self.at_least)
        return Threshold(self.op, float(f"{value:.4g}"))

    def mismatch(self, context: Mapping[str, object]) -> str:
        """Why a run is of another mission than this threshold, in one clause; empty where it is of the same."""
        for name, wanted in self.mission.items():
            value = context.get(name)
            if not isinstance(value, (int, float)):
                return f"the limit of {self.source} is for another mission, or {name} is not known"
            if not asks_alike(value, wanted):
                return f"the limit of {self.source} is for a mission with {name} {wanted:g}, this one has {value:.4g}"
        return ""

    def __str__(self) -> str:
        if self.value is not None:
            return f"{self.op} {self.value:g}"
        floor = "" if self.at_least is None else f", or {self.at_least:g}"
        return f"{self.op} {self.ratio:g} x what the reference configuration needs{floor}"


class Extract(Record):
    """How a value is read from a log: the name of an extractor and its arguments."""

    kind: str
    args: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))


class Typical(Record):
    """What a vehicle like those of the training has of a context, by what else its run shows: the name of a formula,
    and how many times that a value may be to be believed as the vehicle's own."""

    kind: str
    at_least: float = 0.0
    at_most: float | None = None

    def believes(self, value: float, usual: float) -> bool:
        """Whether a vehicle of which `usual` is expected may have this value."""
        return value >= self.at_least * usual and (self.at_most is None or value <= self.at_most * usual)


class Events(Record):
    """The like parts of a mission, each with noise of its own: the context that counts them, and the metric that holds
    the standard deviation of the logarithm of what each took."""

    count: str
    variation: str


class Variable(Record):
    """One declared variable of a profile.

    `range` holds the acceptable values (what may be suggested), in `unit`. `parameters` are the keys an option
    sets, in the log and in configuration files; several when one option sets them all (both costmaps).
    `labels` names the codes of an enum; values are always numbers (bool: 0 or 1).
    """

    name: str
    role: Role
    type: ValueType = "float"
    unit: str = ""
    doc: str = ""
    range: tuple[float, float] | None = None
    default: float | None = None
    labels: tuple[tuple[float, str], ...] = ()
    parameters: tuple[str, ...] = ()
    scale: float = 1.0
    """A value under its parameters is this times the option's: firmware that renamed cm/s to m/s counts in 0.01."""
    reboot_required: bool = False
    modes: tuple[str, ...] = ()
    """The modes that read an option; empty where every mode does, or nothing is known."""
    phase: str = ""
    """The part of a mission that reads an option, as the mission's kind names it; empty where all of it does."""
    safety: bool = False
    ceiling: bool = False
    """How fast the robot may go at most: less than the reference's is no fault but what this robot can or is to do."""
    airframe: bool = False
    """Whether it is chosen for the airframe, as a plane's gains and speeds are: then a firmware's default that is not
    the profile's own is no reference for it, and a vehicle is judged with its own value."""
    kind: Kind | None = None
    threshold: Threshold | None = None
    grows: bool = False
    """Whether an objective only grows while the mission lasts: past its limit it is broken, however that ends."""
    accuracy: float = 0.0
    """Share of an objective's value within which a log tells it."""
    about: About = "world"
    """What a context tells of."""
    typical: Typical | None = None
    """What a context about the vehicle is held against before a limit rests on it."""
    nominal: Extract | None = None
    """What physics says the value is: the name of a formula, and the variables that are its arguments."""
    events: Events | None = None
    """The like parts that the value is a sum over, where there are any."""
    extract: Extract | None = None
    order: int | None = None
    """Place in the mission, or in the making of a number out of others: a variable never causes one of a lower
    order. None where nothing is known."""

    @property
    def fixed(self) -> Threshold | None:
        """The threshold, where it has a value whatever the mission needs."""
        return self.threshold if self.threshold is not None and self.threshold.value is not None else None

    @property
    def relative(self) -> Threshold | None:
        """The threshold, where it is a multiple of what the reference configuration needs."""
        return self.threshold if self.threshold is not None and self.threshold.ratio is not None else None

    @property
    def is_yes_or_no(self) -> bool:
        """Whether an objective is met or not, which no other limit makes another question."""
        return self.kind == "functional"

    def wrong_limit(self, limit: float) -> str:
        """Why an operator cannot judge this objective by a limit, one sentence; empty where they can."""
        own = self.fixed
        if self.is_yes_or_no:
            is_own = own is not None and limit == own.value
            return "" if is_own else f"{self.name} is met or not: it has no other threshold."
        # Times, energies and errors are amounts.
        is_at_most = self.threshold is None or self.threshold.op in ("<=", "<")
        is_amount = own is None or own.bound > 0
        return "No mission can keep a limit of 0 or less." if is_at_most and is_amount and limit <= 0 else ""

    def accepts(self, value: float) -> bool:
        """Whether `value` may be suggested for this option."""
        if self.labels:
            return any(value == code for code, _ in self.labels)
        return self.range is None or self.range[0] <= value <= self.range[1]

    def is_no_looser(self, value: float, now: float | None) -> bool:
        """Whether a `safety` option may be set to `value`: on the way from what it is now to its default, not past
        it. Codes have no order, and what nobody knows has no way: there only the default, or what it is already."""
        default = self.default
        if default is None or value in (default, now):
            return default is not None
        if now is None or self.labels:
            return False
        return min(now, default) <= value <= max(now, default)

    @property
    def acceptable(self) -> str:
        """The acceptable values in words."""
        if self.labels:
            return ", ".join(f"{code:g} ({label})" for code, label in self.labels)
        if self.range is None:
            return "any"
        low, high = self.range
        if self.type == "int":  # the range of some whole-numbered parameters is documented with fractions
            low, high = math.ceil(low), math.floor(high)
        return f"{low:g} to {high:g} {self.unit}".rstrip()

    def code_of(self, text: str) -> float | None:
        """The number that a word stands for: one of the labels, true or false; None where it is no such word."""
        words = {**_WORDS, **{label.casefold(): code for code, label in self.labels}}
        return words.get(text.strip().casefold())

    def snap(self, value: float) -> float:
        """The nearest acceptable value of the option's type, floats to four significant digits."""
        if self.labels:
            return min((code for code, _ in self.labels), key=lambda code: abs(code - value))
        if self.range is not None:
            value = min(max(value, self.range[0]), self.range[1])
        if self.type in ("int", "bool"):
            return float(round(value))
        return float(f"{value:.4g}")

    def across(self, count: int) -> tuple[float, ...]:
        """About so many acceptable values from one end of the range to the other, even on its scale; every code
        of an enum, and none where nothing bounds them."""
        if self.labels:
            return tuple(sorted(code for code, _ in self.labels))
        low, high = (0.0, 1.0) if self.type == "bool" else self.range or (0.0, 0.0)
        if low == high:
            return ()
        shares = (step / (count - 1) for step in range(count))
        if self.is_log_scaled:
            return tuple(sorted({self.snap(low * (high / low) ** share) for share in shares}))
        return tuple(sorted({self.snap(low + (high - low) * share) for share in shares}))

    @property
    def is_log_scaled(self) -> bool:
        """Whether a change is better judged as a ratio: a positive range over more than a decade."""
        return self.range is not None and self.range[0] > 0 and self.range[1] / self.range[0] >= 10

    def distance(self, a: float, b: float) -> float:
        """How far apart two values are, as a share of the acceptable range (0 to 1), ratios where log scaled."""
        if self.range is None or self.range[1] <= self.range[0]:
            return float(a != b)
        low, high = self.range
        if self.is_log_scaled and a > 0 and b > 0:
            return abs(math.log(a / b)) / math.log(high / low)
        return abs(a - b) / (high - low)

    def show(self, value: float | None) -> str:
        """The value as an operator writes it, without its unit."""
        if value is None:
            return "unknown"
        for code, label in self.labels:
            if value == code:
                return f"{code:g} ({label})"
        if self.type == "bool":
            return "true" if value else "false"
        return f"{value:.6g}"

    def told_of(self, value: float) -> str:
        """What its documentation says where it speaks of this very value; empty where it does not."""
        return self.doc if re.search(rf"(?<![\w.-]){re.escape(f'{value:g}')}(?![\w.])", self.doc) else ""

    def driven(self, value: float | None, is_assumed: bool) -> str:
        """The value that a run had, marked where no source holds it."""
        return f"{self.show(value)}{ASSUMED if is_assumed else ''}"


class Change(Record):
    """One option to change, in the option's unit."""

    option: Variable
    current: float
    suggested: float
    notes: tuple[str, ...] = ()
    in_support: bool = True
    """False for a value that no training run came near: what is predicted of it is a guess."""
    is_assumed: bool = False
    """Whether no source holds the current value: it is taken to be at its reference."""

    def __str__(self) -> str:
        return f"{self.option.name} {self.values}"

    @property
    def values(self) -> str:
        """From what to what, without the unit."""
        return f"{self.option.driven(self.current, self.is_assumed)} -> {self.option.show(self.suggested)}"
