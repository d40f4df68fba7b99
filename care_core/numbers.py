"""Small questions about numbers that numpy answers too, for more."""

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


def distinct(values: NDArray[Any]) -> NDArray[Any]:
    """The distinct values of a flat array, ascending, NaN left out. `numpy.unique` imports masked arrays, 6 ms."""
    ordered = np.sort(values[values == values])
    first = np.ones(len(ordered), dtype=bool)
    first[1:] = ordered[1:] != ordered[:-1]
    return ordered[first]


def median(values: ArrayLike, axis: int | None = None, *, in_place: bool = False) -> Any:
    """The median as `numpy.median` answers it, which imports masked arrays to ask whether it was given one: 20 ms.

    Args:
        in_place: an array of the caller's that nobody needs in its order, which saves a copy.
    """
    array = np.ravel(values) if axis is None else np.asarray(values)
    along = 0 if axis is None else axis
    count = array.shape[along]
    if not count:
        return np.full(np.delete(array.shape, along), np.nan)[()]
    middle = range((count - 1) // 2, count // 2 + 1)
    if in_place:
        array.partition((*middle, -1), along)
    else:
        array = np.partition(array, (*middle, -1), along)
    last = array.take(-1, along)  # NaN comes last
    return np.where(last == last, array.take(middle, along).mean(along), np.nan)[()]


def known_median(values: Floats) -> float:
    """The median of those that are not NaN, NaN where there are none."""
    return float(median(values[values == values]))


def quantile(values: ArrayLike, share: float) -> float:
    """A quantile as `numpy.quantile` answers it, between two values in proportion; NaN of none, and of any NaN."""
    array = np.ravel(values)
    if not len(array):
        return np.nan
    place = share * (len(array) - 1)
    low = int(place)
    high = min(low + 1, len(array) - 1)
    ordered = np.partition(array, (low, high, -1))
    if ordered[-1] != ordered[-1]:
        return np.nan
    below, above, part = float(ordered[low]), float(ordered[high]), place - low
    return below + (above - below) * part if part < 0.5 else above - (above - below) * (1 - part)


def ascending(values: Floats) -> Floats:
    """The values in order; themselves where they are, as times nearly always."""
    return values if np.all(values[:-1] <= values[1:]) else np.sort(values)


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
