"""Dependence that a graph leaves unexplained, and the edges it asks for.

The graph search (Fisher's z) sees monotonic dependence, and the constraints let an option act on an objective through
metrics only. Both can miss: an option with an optimum inside, or metrics that do not carry the whole effect.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from scipy.special import fdtrc

from care_core.causal.graph import CausalGraph
from care_core.learn.screening import bin_numbers, discoveries
from care_core.learn.table import FloatArray, normal_scores
from care_core.profile.schema import Schema

Residual = tuple[str, str, float]
"""An option, what depends on it beyond the graph, and the p-value."""


def residual_metric_edges(
    frame: pd.DataFrame, schema: Schema, graph: CausalGraph, options: Sequence[str], alpha: float
) -> tuple[Residual, ...]:
    """Options that a metric still depends on given its parents in the graph, strongest first."""
    targets = [v.name for v in schema.metrics]
    return _residual_edges(frame, options, {name: graph.parents(name) for name in targets}, graph, alpha)


def residual_direct_edges(
    frame: pd.DataFrame, schema: Schema, graph: CausalGraph, options: Sequence[str], alpha: float
) -> tuple[Residual, ...]:
    """Options that an objective still depends on given all metrics and contexts, strongest first.

    Option to objective edges are forbidden (Problem 2.1), which is right only if the metrics carry the whole effect.
    """
    given = tuple(v.name for v in (*schema.metrics, *schema.contexts))
    return _residual_edges(frame, options, {v.name: given for v in schema.objectives}, graph, alpha)


def _residual_edges(
    frame: pd.DataFrame,
    options: Sequence[str],
    given: dict[str, tuple[str, ...]],
    graph: CausalGraph,
    alpha: float,
) -> tuple[Residual, ...]:
    """False discovery rate `alpha` over all pairs that the graph does not join yet."""
    pairs: list[tuple[str, str]] = []
    p_values: list[float] = []
    for target, explained_by in given.items():
        candidates = [option for option in options if option not in graph.parents(target)]
        known = frame[frame[target].notna()]
        if not candidates or known[target].nunique() < 2:
            continue
        features = _features(known[list(explained_by)].to_numpy(dtype=float))
        if len(known) < 2 * features.shape[1] + 10:
            continue
        scores = normal_scores(known[[target, *candidates]].to_numpy(dtype=float))
        p = [_adds_to(features, option, scores[:, 0]) for option in scores[:, 1:].T]
        pairs += [(option, target) for option in candidates]
        p_values += p
    found = np.flatnonzero(discoveries(np.array(p_values), alpha))
    return tuple(sorted(((*pairs[i], p_values[i]) for i in found), key=lambda edge: (edge[2], edge[:2])))


def _features(data: FloatArray) -> FloatArray:
    """Normal scores, their squares, and where a value is missing (a refused mission has no flight to measure).

    Args:
        data: shape (n, k), NaN for missing.

    Returns:
        Shape (n, f), orthonormal columns that span them and the constant.
    """
    scores = normal_scores(data)
    missing = np.isnan(scores).astype(float)
    scores = np.nan_to_num(scores)
    columns = np.column_stack([np.ones(len(data)), scores, scores**2, missing])
    # Squares of two-valued columns and repeated patterns of missing values add nothing.
    left, values, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(left[:, values > 1e-6 * values.max()])


def _adds_to(features: FloatArray, option: FloatArray, target: FloatArray) -> float:
    """p-value of the option adding nothing to a least-squares fit of the target on the features.

    F-tests of two additions, the option's scores and its bins; the smaller p-value, doubled. Ranking the residuals
    instead would not do: where most of a target's values are tied, their ranks are a function of the features.
    """
    bins = bin_numbers(option[:, None])[:, 0]
    additions = (option[:, None], (bins[:, None] == np.unique(bins)[1:]).astype(float))
    left = target - features @ (features.T @ target)
    p = [_f_test(left, added - features @ (features.T @ added), features.shape[1]) for added in additions]
    return min(1.0, 2 * min(p))


def _f_test(target: FloatArray, added: FloatArray, used: int) -> float:
    """F-test of added columns; both sides already without what `used` columns explain."""
    left, values, _ = np.linalg.svd(added, full_matrices=False)
    directions = left[:, values > 1e-6 * len(target) ** 0.5]
    count, freedom = directions.shape[1], len(target) - used - directions.shape[1]
    explained = float(((directions.T @ target) ** 2).sum())
    within = float((target**2).sum()) - explained
    if not count or within <= 1e-9:
        return 1.0
    return float(fdtrc(count, freedom, explained / count * freedom / within))
