"""Spans of time in which something holds."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from care_core.logs.base import Table
from care_core.numbers import Bools, Floats, pieces

Span = tuple[float, float]
"""Start and end, in seconds from the start of the log."""


def runs(t: Floats, mask: Bools, gap_s: float = 0.0) -> list[Span]:
    """Spans in which a mask holds; those closer than `gap_s` are one."""
    if not mask.any():
        return []
    edges = np.flatnonzero(np.diff(np.concatenate(([False], mask, [False])).astype(np.int8)))
    spans: list[Span] = []
    for start, end in zip(t[edges[::2]].tolist(), t[edges[1::2] - 1].tolist(), strict=True):
        if spans and start - spans[-1][1] <= gap_s:
            spans[-1] = (spans[-1][0], end)
        else:
            spans.append((start, end))
    return spans


def during(spans: Iterable[Span], t: Floats) -> Bools:
    """Which of these times lie within one of the spans."""
    inside = np.zeros(len(t), dtype=bool)
    for start, end in spans:
        inside |= (t >= start) & (t <= end)
    return inside


def parts(table: Table) -> Iterator[Table]:
    """The messages piece by piece: of a long log no more than one piece of a column is decoded."""
    return (table.where(rows) for rows in pieces(len(table)))
