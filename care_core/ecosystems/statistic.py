"""One number from the samples of a signal."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from care_core.ecosystems.measures import one_of
from care_core.numbers import Floats, quantile
from care_core.run import Unavailable, Value

STATISTIC = one_of("mean, max, min, std, rms or peak (95th percentile)", "mean", "max", "min", "std", "rms", "peak")


def statistic(values: Floats, stat: str) -> Value:
    """One number from many. `peak` is the 95th percentile, which one bad sample cannot move."""
    measures: dict[str, Callable[[Floats], object]] = {
        "mean": np.mean,
        "max": np.max,
        "min": np.min,
        "std": np.std,
        "rms": lambda x: np.sqrt(np.mean(x**2)),
        "peak": lambda x: quantile(x, 0.95),
    }
    if not len(values):
        return Unavailable("the vehicle was never under way")
    if stat not in measures:
        return Unavailable(f"there is no statistic '{stat}'", f"use one of {', '.join(measures)}")
    return float(measures[stat](values))  # type: ignore[arg-type]
