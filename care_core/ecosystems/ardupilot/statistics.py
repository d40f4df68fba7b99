"""Statistics of columns that checks share. Arrays have shape (n,) and one row a record."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from care_core.ecosystems.base import Limits
from care_core.ecosystems.spans import Span, runs
from care_core.logs.base import Table
from care_core.numbers import Bools, Floats, median, pieces, quantile

Calibration = Sequence[tuple[float, float]]
"""Points (how many times over the limit, probability that the part really failed), rising."""

_DOZENS = 40


def calibrated(limits: Limits, points: Calibration, source: str, over: str = "the limit") -> Calibration:
    """Declares the points of a calibration among the limits of a check; `over` names what they are multiples of."""
    for ratio, share in points:
        limits.add(f"probability at {ratio:g} times {over}", share, "", source)
    return points


def calibrated_probability(over: float, points: Calibration) -> float:
    """Probability at `over` times the limit, between measured points on a logarithmic scale."""
    ratios, shares = zip(*points, strict=True)
    return float(np.interp(np.log(max(over, 1e-9)), np.log(ratios), shares))


def lasting(t: Floats, mask: Bools, for_s: float, gap_s: float = 1.0, records: int = 3) -> list[Span]:
    """Spans of at least `for_s` seconds and that many records in which a mask holds, but for gaps of `gap_s` or a
    record."""
    if not mask.any():
        return []
    step = float(median(np.diff(t))) if len(t) > 1 else 0.0
    held = runs(t, mask, max(gap_s, 1.5 * step))
    counts = np.searchsorted(t[mask], [edge for span in held for edge in span], side="right").tolist()
    starts = np.searchsorted(t[mask], [span[0] for span in held], side="left").tolist()
    return [
        span
        for span, begin, end in zip(held, starts, counts[1::2], strict=True)
        if span[1] - span[0] >= for_s and end - begin >= records
    ]


def parts(table: Table) -> Iterator[Table]:
    """The messages piece by piece: of a long log no more than one piece of a column is decoded."""
    return (table.where(rows) for rows in pieces(len(table)))


def smooth(t: Floats, x: Floats, width_s: float) -> Floats:
    """Mean over a window of `width_s` around each record, shape of x; at least three records wide."""
    if len(t) < 3:
        return x
    found, at = np.empty(len(x)), 0
    for mean in means((x[rows] for rows in pieces(len(x))), records(t, width_s)):
        found[at : at + len(mean)] = mean
        at += len(mean)
    return found


def means(parts: Iterable[Floats], n: int) -> Iterator[Floats]:
    """Means over n records, an odd number, around each of those that come part by part along the last axis; ahead of
    the first and behind the last stands what these say. As many come out as go in, the last later: no more is held than
    a window and a part."""
    total = np.zeros(1)
    for part in _framed(parts, n // 2):
        if total.ndim < part.ndim:
            total = np.zeros((*part.shape[:-1], 1))
        following = np.concatenate((total[..., -1:], part), axis=-1)
        np.cumsum(following, axis=-1, out=following)
        total = np.concatenate((total, following[..., 1:]), axis=-1)
        if total.shape[-1] > n:
            yield (total[..., n:] - total[..., :-n]) / n
            total = total[..., -n:]


def _framed(parts: Iterable[Floats], count: int) -> Iterator[Floats]:
    """The parts, with so many copies of the first record ahead of them and of the last behind."""
    last = None
    for part in parts:
        if part.shape[-1]:
            if last is None:
                yield np.repeat(part[..., :1], count, axis=-1)
            yield part
            last = part[..., -1:]
    if last is not None:
        yield np.repeat(last, count, axis=-1)


def steady(t: Floats, x: Floats, width_s: float) -> Floats:
    """Median over a window as `smooth` has it: what lasts for less than half of it leaves no trace. Of what comes fast
    only so many records are looked at that a window holds a few dozen."""
    if len(t) < 3:
        return x
    n = records(t, width_s)
    if n > 2 * _DOZENS:
        few = slice(None, None, n // _DOZENS)
        return np.interp(t, t[few], steady(t[few], x[few], width_s))
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(x, n // 2, mode="edge"), n)
    middle: Floats = median(windows, axis=1)
    return middle


def records(t: Floats, width_s: float) -> int:
    """How many of at least three records, an odd number, lie in a window of `width_s`."""
    step = max(float(median(np.diff(t))), 1e-6)
    return min(max(round(width_s / step) | 1, 3), len(t) if len(t) % 2 else len(t) - 1)


def roughness(x: Floats) -> Floats:
    """How far each record lies off the middle of its neighbours, as a standard deviation of white noise; length n."""
    if len(x) < 3:
        return np.zeros(len(x))
    off = np.abs(x[1:-1] - 0.5 * (x[2:] + x[:-2])) / np.sqrt(1.5)
    return np.concatenate((off[:1], off, off[-1:]))


def length(columns: Iterable[Floats]) -> Floats:
    """Euclidean length of a vector per record."""
    return np.sqrt(sum((np.square(column) for column in columns), start=np.zeros(1)))


def aligned(t: Floats, other_t: Floats, x: Floats) -> Floats:
    """A second instance's column at the first's times."""
    return np.interp(t, other_t, x) if len(other_t) else np.full(len(t), np.nan)


def top(x: Floats, share: float = 0.975) -> float:
    """A value that only few exceed; NaN where there is none."""
    known = x[np.isfinite(x)]
    return quantile(known, share) if len(known) else float("nan")
