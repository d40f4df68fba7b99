"""Options that nothing depends on are set aside before the graph search, at a controlled false discovery rate.

The search grows steeply with the number of options, and a vehicle has hundreds to thousands of them.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.special import fdtrc, ndtri, stdtr
from scipy.stats import false_discovery_control

from care_core.learn.table import normal_scores
from care_core.numbers import Bools, Floats
from care_core.profile.schema import Schema
from care_core.records import Record

BINS = 5
LEAST_COUNT = 5
"""Expected count in a cell from which a test of counts holds its level (Cochran 1954)."""
CUTS = ndtri(np.arange(1, BINS) / BINS)
"""Normal scores are standardised, so the normal quantiles cut them into equally filled bins."""


class Screening(Record, eq=False):
    """`p_values`: one row an option, one column a metric or objective. Constant options have p = 1."""

    kept: tuple[str, ...]
    dropped: tuple[str, ...]
    p_values: pd.DataFrame


def screen_options(frame: pd.DataFrame, schema: Schema, *, false_discovery_rate: float = 0.1) -> Screening:
    """Test every option with every metric and objective, and keep the options with a discovery.

    Args:
        false_discovery_rate: expected share of null pairs among the discovered ones (Benjamini-Hochberg). The graph
            search tests again at its own alpha, so this one errs on the side of keeping.
    """
    options = [v.name for v in schema.options]
    targets = [v.name for v in (*schema.metrics, *schema.objectives)]
    p = dependence(frame[options].to_numpy(float), frame[targets].to_numpy(float))
    found = np.flatnonzero(discoveries(p, false_discovery_rate).any(axis=1))
    kept = tuple(options[i] for i in found)
    return Screening(
        kept=kept,
        dropped=tuple(name for name in options if name not in set(kept)),
        p_values=pd.DataFrame(p, index=options, columns=targets),
    )


def dependence(sources: Floats, targets: Floats) -> Floats:
    """p-values of marginal independence of every source with every target.

    Two tests on normal scores: correlation (sensitive to monotonic effects) and one-way analysis of variance over
    up to `BINS` equally filled bins of the source (sensitive to an optimum inside); the smaller p-value, doubled. Where
    the target rarely leaves its usual value (few missions are refused), a bin expects less than `LEAST_COUNT` of them
    and the variances say nothing: correlation alone; with fewer than that in all there is no test.

    Args:
        sources: shape (n, k).
        targets: shape (n, m). NaN in either leaves the row out of that pair.

    Returns:
        Shape (k, m).
    """
    x, y = normal_scores(sources), normal_scores(targets)
    bins = bin_numbers(x)
    straight, binned = _correlation_p(x, y), _binned_p(bins, y)
    rare = _rarest_count(bins, y)
    either = np.where(rare < LEAST_COUNT, straight, 2 * np.minimum(straight, binned))
    uncommon = _off_mode(y) < LEAST_COUNT
    return np.asarray(np.where(uncommon, 1.0, np.minimum(either, 1.0)))


def discoveries(p: Floats, rate: float) -> Bools:
    """Benjamini-Hochberg: which of the p-values are discoveries at this false discovery rate. Any shape."""
    if not p.size:
        return np.zeros(p.shape, dtype=bool)
    return np.asarray(false_discovery_control(p, axis=None) <= rate).reshape(p.shape)


def pairwise_correlation(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Pearson correlation over the rows that both columns have.

    Args:
        x: shape (n, k), NaN for missing.
        y: shape (n, m), likewise.

    Returns:
        Correlations and numbers of rows, both of shape (k, m); correlation and number are 0 where a column is constant
        over the common rows (a metric that only accomplished missions have says nothing of success).
    """
    has_x, has_y = np.isfinite(x).astype(float), np.isfinite(y).astype(float)
    x, y = np.nan_to_num(x), np.nan_to_num(y)
    n = has_x.T @ has_y
    rows = np.maximum(n, 1.0)
    sum_x, sum_y = x.T @ has_y, has_x.T @ y
    var_x = (x**2).T @ has_y / rows - (sum_x / rows) ** 2
    var_y = has_x.T @ (y**2) / rows - (sum_y / rows) ** 2
    covariance = x.T @ y / rows - sum_x * sum_y / rows**2
    varies = (var_x > 1e-9) & (var_y > 1e-9)
    scale = np.sqrt(np.where(varies, var_x * var_y, 1.0))
    r = np.where(varies, np.clip(covariance / scale, -1.0, 1.0), 0.0)
    return np.asarray(r), np.asarray(np.where(varies, n, 0.0))


def _correlation_p(x: Floats, y: Floats) -> Floats:
    r, n = pairwise_correlation(x, y)
    freedom = np.maximum(n - 2, 1)
    t = np.abs(r) * np.sqrt(freedom / np.maximum(1 - r**2, 1e-12))
    return np.asarray(np.where(n > 2, 2 * stdtr(freedom, -t), 1.0))


def _off_mode(y: Floats) -> Floats:
    """How many rows of each column are off its most frequent value, shape (m,)."""
    known = [column[np.isfinite(column)] for column in y.T]
    return np.array([len(v) - max(np.unique(v, return_counts=True)[1], default=0) for v in known], dtype=float)


def _rarest_count(bins: NDArray[np.int64], y: Floats) -> Floats:
    """Rows off the usual value of a target that the emptiest bin of a source expects, shape (k, m)."""
    filled = [np.bincount(column[column >= 0], minlength=BINS) for column in bins.T]
    smallest = np.array([min(count[count > 0], default=0) / max(count.sum(), 1) for count in filled])
    return np.asarray(np.outer(smallest, _off_mode(y)))


def _binned_p(bins: NDArray[np.int64], y: Floats) -> Floats:
    """F-tests of the targets' means over the sources' bins, all pairs at once."""
    has_y = np.isfinite(y).astype(float)
    y = np.nan_to_num(y)
    rows = np.zeros((bins.shape[1], y.shape[1]))
    total, squares, between = rows.copy(), rows.copy(), rows.copy()
    groups = rows.copy()
    for level in range(BINS):
        member = (bins == level).astype(float)
        count, sums = member.T @ has_y, member.T @ y
        rows += count
        total += sums
        squares += member.T @ y**2
        between += sums**2 / np.maximum(count, 1)
        groups += count > 0
    correction = total**2 / np.maximum(rows, 1)
    between, within = between - correction, squares - between
    freedom = rows - groups
    usable = (groups > 1) & (freedom > 0) & (squares - correction > 1e-9)
    f = (between / np.maximum(groups - 1, 1)) / np.maximum(within / np.maximum(freedom, 1), 1e-12)
    p = fdtrc(np.maximum(groups - 1, 1), np.maximum(freedom, 1), np.maximum(f, 0.0))
    return np.asarray(np.where(usable, p, 1.0))


def bin_numbers(x: Floats) -> NDArray[np.int64]:
    """Bin numbers 0..BINS-1 of normal scores, equally filled (equal values stay together), -1 for missing."""
    return np.where(np.isfinite(x), np.searchsorted(CUTS, np.nan_to_num(x)), -1)
