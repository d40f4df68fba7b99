"""Which metrics carry an objective, by the graph, and how much of its errors they show.

Where the graph has a path option -> metric -> objective, the metric's error in a run is part of the objective's. Errors
are those of mechanisms that do not know the run (nor its mission, nor its repeats). How they go together is estimated
over the training runs that have all of them, and kept only where it predicts other runs better.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from care_core.causal.abduction import FARTHEST
from care_core.causal.graph import CausalGraph
from care_core.causal.mechanisms import LEAST, Mechanism, transformed
from care_core.causal.model import Mediation, OutcomeRecord
from care_core.learn.fitting import left_out
from care_core.learn.relative import left_out_together
from care_core.numbers import Floats
from care_core.profile.schema import Schema
from care_core.records import replace
from care_core.variables import Role

MOST = 3
"""Metrics beside one objective: each costs its mechanism at every configuration that is asked about."""
LEAST_RUNS = 40
"""Runs that a correlation of errors is estimated from."""
MOST_RUNS = 1000
"""Runs that it is estimated from at most, drawn at random: it is known to 0.03 then. The errors of n runs cost n^3."""
FOLDS = 5
RIDGE = 0.05
"""Added to the correlations of metrics that nearly repeat each other, and to what they explain."""
EXPLAINED = 0.95
"""Most of an objective's error that metrics are taken to explain."""


def mediation(
    objective: str, mechanisms: Mapping[str, Mechanism], graph: CausalGraph, frame: pd.DataFrame, schema: Schema
) -> Mediation | None:
    """The metrics that carry an objective; None where the graph names none or they tell nothing of other runs."""
    metrics = [
        name
        for name in graph.parents(objective)
        if schema.variables[name].role is Role.METRIC and schema.variables[name].type != "bool" and name in mechanisms
    ]
    if len(frame) > MOST_RUNS:
        frame = frame.iloc[np.sort(np.random.default_rng(0).choice(len(frame), MOST_RUNS, replace=False))]
    errors = np.column_stack([_errors(name, mechanisms, frame, schema) for name in (objective, *metrics)])
    known = np.isfinite(errors).all(axis=1)
    if not metrics or known.sum() < LEAST_RUNS:
        return None
    own, theirs = errors[known, 0], errors[known, 1:]
    strongest = np.sort(np.argsort(-np.abs(_correlation(theirs, own)), kind="stable")[:MOST])
    theirs = theirs[:, strongest]
    gain = _gain(theirs, own, left_out_together(frame, schema)[known])
    if gain.sum() <= gain.std() * np.sqrt(len(gain)):
        return None
    weights, among = _weights(theirs, own)
    return Mediation(
        metrics=tuple(metrics[i] for i in strongest),
        weights=tuple(map(float, weights)),
        among=tuple(tuple(map(float, row)) for row in among),
    )


def with_mediation(
    outcomes: Mapping[str, OutcomeRecord],
    mechanisms: Mapping[str, Mechanism],
    graph: CausalGraph,
    frame: pd.DataFrame,
    schema: Schema,
) -> dict[str, OutcomeRecord]:
    """The outcomes with the metrics that carry each. What ends a mission bends what is measured in it, so the stages
    of a functional objective have none."""
    return {
        name: outcome
        if outcome.stages
        else replace(outcome, mediation=mediation(name, mechanisms, graph, frame, schema))
        for name, outcome in outcomes.items()
    }


def _errors(name: str, mechanisms: Mapping[str, Mechanism], frame: pd.DataFrame, schema: Schema) -> Floats:
    """Errors of the runs in standard deviations, each by a mechanism that does not know it; NaN where a run has no
    value; shape (n,)."""
    mechanism, values = mechanisms[name], frame[name].to_numpy(dtype=float)
    met = {v.name: frame[v.name].fillna(frame[v.name].median()) for v in schema.contexts if v.name in frame}
    inputs = frame.assign(**met)[list(mechanism.inputs)].to_numpy(dtype=float)
    rows = np.isfinite(values) & (values > LEAST[mechanism.transform]) & np.isfinite(inputs).all(axis=1)
    x = inputs[rows]
    targets = transformed(values[rows], mechanism.transform) - mechanism.known(x) - mechanism.mean
    groups = left_out_together(frame, schema)[rows]
    errors, sd = left_out(mechanism.kernel, mechanism.scaled(x), targets / mechanism.scale, groups)
    standard = np.full(len(values), np.nan)
    standard[rows] = np.clip(errors / sd, -FARTHEST, FARTHEST)
    return standard


def _gain(theirs: Floats, own: Floats, parts: NDArray[np.int64]) -> Floats:
    """Log likelihood of each run's error by what the metrics of runs of other parts say, over that without them."""
    numbers, place = np.unique(parts, return_inverse=True)
    fold = (np.random.default_rng(0).permutation(len(numbers)) % FOLDS)[place]
    gain = np.zeros(len(own))
    for k in range(FOLDS):
        out = fold == k
        weights, among = _weights(theirs[~out], own[~out])
        left = 1.0 - float(weights @ among @ weights)
        rest = own[out] - theirs[out] @ weights
        gain[out] = 0.5 * (own[out] ** 2 - rest**2 / left - np.log(left))
    return gain


def _weights(theirs: Floats, own: Floats) -> tuple[Floats, Floats]:
    """Share of each metric's error (n, q) in the objective's (n,), and the correlations of the metrics' errors."""
    count = theirs.shape[1]
    among = np.array([_correlation(theirs, column) for column in theirs.T]) / (1 + RIDGE)
    among[np.diag_indices(count)] = 1.0
    weights = np.linalg.solve(among + RIDGE * np.eye(count), _correlation(theirs, own))
    explained = float(weights @ among @ weights)
    return weights * np.sqrt(EXPLAINED / max(explained, EXPLAINED)), among


def _correlation(columns: Floats, values: Floats) -> Floats:
    """Of each column with the values, 0 where one of them never varies; shape (q,)."""
    covariance = (columns - columns.mean(axis=0)).T @ (values - values.mean()) / len(values)
    spread = columns.std(axis=0) * values.std()
    return np.asarray(np.where(spread > 0, covariance / np.where(spread > 0, spread, 1.0), 0.0))
