"""Average causal effects (paper, Eq. 1) on scaled variables."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from care_core.numbers import Floats, distinct
from care_core.records import Record
from care_core.variables import Role, Variable

Direction = Literal["increasing", "decreasing", "optimum inside", "none"]

NO_EFFECT = 1e-9
"""A response whose range is below this share of the variable's standard deviation is flat."""
BUMP = 0.25
"""Share of the response's range by which an inner value must beat both ends to be an optimum."""


class Effect(Record):
    """How far one variable moves another, in standard deviations of the latter, and which way.

    `low` and `high` bound the magnitude over bootstrap resamples, None where none were drawn.
    """

    magnitude: float
    direction: Direction
    low: float | None = None
    high: float | None = None


def average_causal_effect(response: ArrayLike, scale: float) -> Effect:
    """Eq. 1: how far V2 moves, on average, between two acceptable values of V1.

    As printed, Eq. 1 adds signed differences over all ordered pairs, which is zero. The magnitude here is the mean of
    their absolute values over ordered pairs of different values, divided by the standard deviation of V2, so that
    effects of options in different units compare; the sign is reported apart.

    Args:
        response: shape (m,), E[V2 | do(V1 = value_k)] for the acceptable values of V1 in increasing order.
        scale: standard deviation of V2 in its own unit; 0 for a variable that never varies.

    Raises:
        ValueError: the response is empty or not finite, or the scale is negative or not finite.
    """
    values = np.asarray(response, dtype=float)
    if values.ndim != 1 or not len(values) or not np.isfinite(values).all():
        raise ValueError("response must be a non-empty, finite vector")
    if not np.isfinite(scale) or scale < 0:
        raise ValueError(f"scale must be finite and not negative, got {scale}")
    if len(values) == 1 or scale == 0 or np.ptp(values) <= NO_EFFECT * scale:
        return Effect(0.0, "none")
    ordered = np.sort(values)
    # Sum of |difference| over pairs: the k-th smallest is added k times and subtracted m - 1 - k times.
    m = len(ordered)
    pair_sum = float(((2 * np.arange(m) - m + 1) * ordered).sum())
    return Effect(pair_sum / (m * (m - 1) / 2) / scale, _direction(values))


def _direction(values: Floats) -> Direction:
    ends = values[[0, -1]]
    bump = max(values.max() - ends.max(), ends.min() - values.min())
    if bump > BUMP * np.ptp(values):
        return "optimum inside"
    return "increasing" if values[-1] > values[0] else "decreasing"


def along(directions: Sequence[Direction]) -> Direction:
    """Which way the end of a path moves with its start: the signs multiply, unless an edge has none or turns round."""
    for unclear in ("none", "optimum inside"):
        if unclear in directions:
            return unclear
    return "decreasing" if directions.count("decreasing") % 2 else "increasing"


def acceptable_values(variable: Variable, observed: ArrayLike, count: int = 9) -> Floats:
    """The values of a variable over which Eq. 1 averages, increasing and without repeats.

    An option: its codes, or its acceptable range in equal steps (equal ratios where log scaled), whole numbers for
    integers. Anything without an acceptable range: what was observed, at equal steps of rank from the 5th to the
    95th percentile (so that one wild run does not stretch the span).

    Args:
        observed: shape (n,), the training values; NaN is ignored.
    """
    if variable.labels:
        return np.array(sorted(code for code, _ in variable.labels))
    if variable.type == "bool":
        return np.array([0.0, 1.0])
    if variable.role is Role.OPTION and variable.range is not None:
        low, high = variable.range
        steps = np.geomspace(low, high, count) if variable.is_log_scaled else np.linspace(low, high, count)
    else:
        known = np.asarray(observed, dtype=float)
        known = known[np.isfinite(known)]
        levels = distinct(known)
        if len(levels) <= count:
            return levels
        steps = np.quantile(known, np.linspace(0.05, 0.95, count))
    return distinct(np.round(steps) if variable.type == "int" else steps)
