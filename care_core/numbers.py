"""Small questions about numbers: numpy answers them, here for empty arrays and for logs that must not be copied too."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

_PIECE = 1 << 16
"""Rows that are worked on together: what is made of them on the way stays in the processor's cache."""


def pieces(count: int) -> Iterator[slice]:
    """So many rows piece by piece: of a long log no more than one piece is held of what lies between two columns."""
    return (slice(low, min(low + _PIECE, count)) for low in range(0, count, _PIECE))


def six_digits(value: float) -> float:
    """A number that was estimated, to six significant digits: more are the processor's and no knowledge."""
    return float(f"{value:.6g}")


def logit(share: Floats, nearest: float) -> Floats:
    """The logarithm of the odds of probabilities, none of which counts as nearer than that to 0 or 1."""
    clipped = np.clip(share, nearest, 1.0 - nearest)
    return np.asarray(np.log(clipped / (1.0 - clipped)))


def logistic(odds: Floats) -> Floats:
    """The probabilities of logarithms of odds."""
    return np.asarray(1.0 / (1.0 + np.exp(-odds)))


def distinct(values: NDArray[Any]) -> NDArray[Any]:
    """The distinct values of a flat array, ascending, NaN left out."""
    return np.unique(values[values == values])


def median(values: ArrayLike, axis: int | None = None) -> Any:
    """The median; NaN of nothing, which numpy says too, but with a warning."""
    array = np.asarray(values)
    if not array.size:
        return np.full(() if axis is None else np.delete(array.shape, axis), np.nan)[()]
    return np.median(array, axis)


def known_median(values: Floats) -> float:
    """The median of those that are not NaN, NaN where there are none."""
    return float(median(values[values == values]))


def quantile(values: ArrayLike, share: float) -> float:
    """A quantile, between two values in proportion; NaN of nothing, where numpy raises."""
    array = np.asarray(values, np.float64)
    return float(np.quantile(array, share)) if array.size else np.nan


def ascending(values: Floats) -> Floats:
    """The values in order; themselves where they are, as times nearly always."""
    # A stable sort merges what is several series one behind another, which is what else they are.
    return values if np.all(values[:-1] <= values[1:]) else np.sort(values, kind="stable")


def pauses(series: Iterable[Floats], longer_than: float) -> tuple[Floats, Floats]:
    """Where for longer than so much no value of any of several series lies: the last value before each such place, and
    the first behind it, ascending. The series are never put together: they may be large."""
    starts, ends = [np.empty(0)], [np.empty(0)]
    for values in series:
        if len(values):
            ordered = ascending(values)
            cuts = _leaps(ordered, longer_than)
            starts.append(ordered[np.concatenate(([0], cuts + 1))])
            ends.append(ordered[np.append(cuts, len(ordered) - 1)])
    start, end = np.concatenate(starts), np.concatenate(ends)
    order = np.argsort(start, kind="stable")
    before, after = np.maximum.accumulate(end[order])[:-1], start[order][1:]
    apart = after - before > longer_than
    return before[apart], after[apart]


def _leaps(ordered: Floats, longer_than: float) -> NDArray[np.intp]:
    """The values behind which the next follows at a longer distance."""
    found = [
        np.flatnonzero(np.diff(ordered[rows.start : rows.stop + 1]) > longer_than) + rows.start
        for rows in pieces(len(ordered) - 1)
    ]
    return np.concatenate([np.empty(0, dtype=np.intp), *found])
