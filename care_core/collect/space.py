"""Where a campaign may go: the options that vary with their ranges, the reference, the limits that nothing crosses."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from care_core.constraints import Constraint
from care_core.errors import UsageError
from care_core.numbers import Floats
from care_core.records import Record
from care_core.variables import Variable

Config = Mapping[str, float]

_DIGITS = 4
"""Significant digits of a sampled value: what an operator would write."""


class Axis(Record, eq=False):
    """An option that varies: between `low` and `high`, both allowed, in its unit."""

    option: Variable
    low: float
    high: float

    @property
    def name(self) -> str:
        return self.option.name

    @property
    def values(self) -> tuple[float, ...] | None:
        """The values of one that has only a few; None where it is a number."""
        if self.option.labels:
            return tuple(sorted(code for code, _ in self.option.labels if self.low <= code <= self.high))
        return (0.0, 1.0) if self.option.type == "bool" else None

    def at(self, share: float) -> float:
        """The value at a share (0 to 1) of the range, as a file holds it; never outside the range."""
        values = self.values
        if values is not None:
            return values[min(int(share * len(values)), len(values) - 1)]
        if self.option.type == "int":
            low, high = math.ceil(self.low), math.floor(self.high)
            return float(min(low + int(share * (high - low + 1)), high))
        if self.option.is_log_scaled and self.low > 0:
            value = self.low * (self.high / self.low) ** share
        else:
            value = self.low + share * (self.high - self.low)
        return min(max(float(f"{value:.{_DIGITS}g}"), _inward(self.low, up=True)), _inward(self.high, up=False))

    def share(self, value: float) -> float:
        """Where a value lies in the range, 0 to 1: the inverse of `at`, as far as values are rounded."""
        values = self.values
        if values is not None:
            return (min(range(len(values)), key=lambda i: abs(values[i] - value)) + 0.5) / len(values)
        if self.option.is_log_scaled and self.low > 0 and value > 0:
            found = math.log(value / self.low) / math.log(self.high / self.low)
        else:
            found = (value - self.low) / (self.high - self.low)
        return min(max(found, 0.0), 1.0)

    def holds(self, value: float) -> bool:
        """Whether a value may be driven."""
        values = self.values
        if values is not None:
            return value in values
        return self.low <= value <= self.high and (self.option.type != "int" or value == round(value))


def _inward(bound: float, *, up: bool) -> float:
    """The bound in the six digits that files hold, on the side that is allowed."""
    written = float(f"{bound:.6g}")
    if written >= bound if up else written <= bound:
        return written
    step = 10.0 ** (math.floor(math.log10(abs(bound))) - 5)
    return float(f"{written + (step if up else -step):.6g}")


class Space(Record, eq=False):
    """Everything that a plan may choose from."""

    axes: Sequence[Axis]
    reference: Config
    """Of every option that has a known value, those that never vary too."""
    limits: Sequence[Constraint]
    left_out: Sequence[tuple[str, str]] = ()
    """Options that do not vary, and why."""

    def __post_init__(self) -> None:
        """Refuse a reference that may not be driven. Raises UsageError."""
        for axis in self.axes:
            value = self.reference[axis.name]
            if not axis.holds(value):
                raise UsageError(
                    f"The reference of {axis.name} is {value:g}, outside {axis.low:g} to {axis.high:g}.",
                    hint="Correct the parameter file, or give the option its range under 'options'.",
                )
        broken = self.broken(self.reference)
        if broken is not None:
            raise UsageError(f"The reference breaks the limit '{broken}'.", hint="Correct one of them.")

    def broken(self, config: Config) -> str | None:
        """The first limit or range that a configuration does not keep, None where it may be driven."""
        for axis in self.axes:
            if not axis.holds(config[axis.name]):
                return f"{axis.low:g} <= {axis.name} <= {axis.high:g}"
        return next((limit.text for limit in self.limits if not limit.holds(config)), None)

    def allows(self, config: Config) -> bool:
        return self.broken(config) is None

    def config(self, shares: Sequence[float] | Floats, at_reference: Sequence[bool]) -> dict[str, float]:
        """The configuration at these shares of the ranges, with some options at their reference."""
        own = {
            axis.name: self.reference[axis.name] if keep else axis.at(share)
            for axis, share, keep in zip(self.axes, shares, at_reference, strict=True)
        }
        return {**self.reference, **own}

    def shares(self, config: Config) -> list[float]:
        """Where a configuration lies in the ranges, one number an axis."""
        return [axis.share(config[axis.name]) for axis in self.axes]
