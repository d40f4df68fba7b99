"""Spans of time in which something holds: where they are, what lies in them, how long they are."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from care_core.numbers import Bools, Floats

Span = tuple[float, float]
"""Start and end, in seconds from the start of the log."""


def unbroken(mask: Bools) -> list[tuple[int, int]]:
    """First and last row of each run of rows in which a mask holds."""
    first, last = _edges(mask)
    return list(zip(first.tolist(), last.tolist(), strict=True))


def runs(t: Floats, mask: Bools, gap_s: float = 0.0) -> list[Span]:
    """Spans in which a mask holds; those closer than `gap_s` are one."""
    first, last = _edges(mask)
    spans: list[Span] = []
    for start, end in zip(t[first].tolist(), t[last].tolist(), strict=True):
        if spans and start - spans[-1][1] <= gap_s:
            spans[-1] = (spans[-1][0], end)
        else:
            spans.append((start, end))
    return spans


def _edges(mask: Bools) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The first rows of the runs of a mask, and their last ones."""
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(np.int8)))
    return edges[::2], edges[1::2] - 1


def stretches(t: Floats, mask: Bools, gap_s: float) -> list[Span]:
    """Spans in which a mask holds; those closer than `gap_s` are one, and a pause as long between two rows parts them,
    whatever lies in it."""
    spans: list[Span] = []
    for time_s in t[mask].tolist():
        if spans and time_s - spans[-1][1] < gap_s:
            spans[-1] = (spans[-1][0], time_s)
        else:
            spans.append((time_s, time_s))
    return spans


def during(spans: Iterable[Span], t: Floats) -> Bools:
    """Which of these times lie within one of the spans."""
    found = np.zeros(len(t), dtype=bool)
    for start, end in spans:
        found |= (t >= start) & (t <= end)
    return found


def inside(spans: Iterable[Span], t: Floats) -> Bools:
    """The same without the start of each span: what a source that froze says there is still true."""
    found = np.zeros(len(t), dtype=bool)
    for start, end in spans:
        found |= (t > start) & (t <= end)
    return found


def within(spans: Iterable[Span], t: float) -> bool:
    """Whether a time lies within one of the spans."""
    return any(start <= t <= end for start, end in spans)


def seconds_in(spans: Iterable[Span]) -> float:
    """How long they are together, in seconds."""
    return float(sum(end - start for start, end in spans))
