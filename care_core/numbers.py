"""Small questions about numbers that numpy answers too, for more."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def six_digits(value: float) -> float:
    """A number that was estimated, to six significant digits: more are the processor's and no knowledge."""
    return float(f"{value:.6g}")


def distinct(values: NDArray[Any]) -> NDArray[Any]:
    """The distinct values of a flat array, ascending, NaN left out. `numpy.unique` imports masked arrays, 6 ms."""
    ordered = np.sort(values[values == values])
    first = np.ones(len(ordered), dtype=bool)
    first[1:] = ordered[1:] != ordered[:-1]
    return ordered[first]
