"""Round numbers at the axes of a plot, in the app and in pages."""

from __future__ import annotations

import math

from care_core.records import Record
from care_core.text import LONG_S, seconds

_STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)
_STEPS_OF_TIME = (
    0.1,
    0.2,
    0.5,
    1.0,
    2.0,
    5.0,
    10.0,
    15.0,
    20.0,
    30.0,
    60.0,
    120.0,
    300.0,
    600.0,
    1200.0,
    1800.0,
    3600.0,
)


def value_ticks(low: float, high: float, most: int) -> tuple[float, ...]:
    """About so many round values between two others."""
    step = round_step((high - low) / most)
    first = math.ceil(low / step)
    return tuple(float(f"{i * step:.12g}") for i in range(first, math.floor(high / step) + 1))


def time_ticks(start_s: float, end_s: float, most: int) -> tuple[float, ...]:
    """At most so many round times, in seconds of the log."""
    span = max(end_s - start_s, 1e-9)
    step = next((step for step in _STEPS_OF_TIME if span / step <= most), round_step(span / most))
    return tuple(round(i * step, 6) for i in range(math.ceil(start_s / step), math.floor(end_s / step) + 1))


def tick_time(time_s: float) -> str:
    """A round time as an axis has it: 60, from ten minutes on 12:05."""
    return seconds(time_s) if abs(time_s) >= LONG_S else f"{time_s:g}"


def round_step(step: float) -> float:
    """The next round number: 1, 2, 2.5 or 5 times a power of ten."""
    power = float(10.0 ** math.floor(math.log10(step)))
    return next(nice * power for nice in _STEPS if nice * power >= step * (1 - 1e-9))


class Scale(Record):
    """The values of a parameter along an axis, as ratios where `is_log`."""

    low: float
    high: float
    is_log: bool = False

    def share(self, value: float) -> float:
        """Where a value stands between both ends, 0 to 1."""
        value = min(max(value, self.low), self.high)
        if self.is_log:
            return math.log(value / self.low) / math.log(self.high / self.low)
        return (value - self.low) / (self.high - self.low)

    def ticks(self) -> tuple[float, ...]:
        """Round values between the ends."""
        if not self.is_log:
            return value_ticks(self.low, self.high, 5)
        decades = range(math.floor(math.log10(self.low)), math.ceil(math.log10(self.high)) + 1)
        values = (step * 10.0**decade for decade in decades for step in (1, 2, 5))
        return tuple(value for value in values if self.low < value < self.high)
