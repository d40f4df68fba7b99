"""Does the model predict missions it has not seen? Cross-validated probabilities, and whether they can be believed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.metrics import roc_auc_score

from care_core.causal.counterfactual import CounterfactualQuery
from care_core.causal.graph import CausalGraph
from care_core.causal.model import Model, SkillRecord, Training
from care_core.learn.fitting import Effort
from care_core.learn.outcomes import fit_outcomes, groups_that_move_together, met
from care_core.learn.processes import answers
from care_core.learn.relative import left_out_together, relative
from care_core.numbers import Floats
from care_core.profile.schema import Schema

BINS = 10
FOLD = Effort(points=400, iterations=30, folds=5)
"""Folds are fitted with less effort than the model itself, so the skill of large tables is rather understated."""


def cross_validated_skill(
    frame: pd.DataFrame, schema: Schema, graph: CausalGraph, rng: np.random.Generator, *, folds: int, n_jobs: int = 1
) -> dict[str, SkillRecord]:
    """Per objective, and for `all` of them, skill of the probabilities on held-out runs. The graph is kept.

    Args:
        rng: draws the folds and the runs that mechanisms keep; the answer does not depend on `n_jobs`.
        n_jobs: processes, one thread each.
    """
    if not folds:
        return {}
    promised = held_out_probabilities(frame, schema, partial(_kept, graph), rng, folds=folds, n_jobs=n_jobs)
    truth: dict[str, Floats] = {objective.name: met(objective, frame, schema) for objective in schema.objectives}
    truth["all"] = all_met(frame, schema)
    found = {name: score(promised[name], truth[name]) for name in promised}
    return {name: skill for name, skill in found.items() if skill is not None}


def _kept(graph: CausalGraph, _runs: pd.DataFrame, _rng: np.random.Generator) -> CausalGraph:
    return graph


Learn = Callable[[pd.DataFrame, np.random.Generator], CausalGraph]
"""The runs of the other folds -> the graph to fit mechanisms on."""


def held_out_probabilities(
    frame: pd.DataFrame, schema: Schema, learn: Learn, rng: np.random.Generator, *, folds: int, n_jobs: int = 1
) -> dict[str, Floats]:
    """Probability of every objective, and of `all`, for each run by a model that has not seen it; shape (n,) each.

    Args:
        learn: can be imported by name where `n_jobs` is more than 1.
    """
    fold = _folds(frame, schema, rng, folds)
    seeds = rng.integers(2**32, size=folds)
    calls = [partial(_predict, frame[fold != k], frame[fold == k], schema, learn, seeds[k]) for k in range(folds)]
    predicted = answers(calls, n_jobs)
    promised: dict[str, Floats] = {}
    for k, values in enumerate(predicted):
        for name, held_out in values.items():
            promised.setdefault(name, np.full(len(frame), np.nan))[fold == k] = held_out
    return promised


def _predict(
    runs: pd.DataFrame, left_out: pd.DataFrame, schema: Schema, learn: Learn, seed: int
) -> Mapping[str, Floats]:
    rng = np.random.default_rng(seed)
    return _probabilities(runs, left_out, schema, learn(runs, rng), rng)


def _folds(frame: pd.DataFrame, schema: Schema, rng: np.random.Generator, folds: int) -> NDArray[np.int64]:
    """The part that each run is in, shape (n,). Where missions differ, a mission is left out whole; the repeats of a
    configuration are left out with it."""
    numbers, together = np.unique(left_out_together(frame, schema), return_inverse=True)
    return np.asarray((rng.permutation(len(numbers)) % folds)[together.ravel()])


def all_met(frame: pd.DataFrame, schema: Schema) -> Floats:
    """1 where every objective has a value that keeps its threshold, else 0; shape (n,)."""
    kept = [np.nan_to_num(met(objective, frame, schema), nan=0.0) == 1.0 for objective in schema.objectives]
    answer: Floats = np.all(kept, axis=0).astype(float)
    return answer


def _probabilities(
    train: pd.DataFrame,
    test: pd.DataFrame,
    schema: Schema,
    graph: CausalGraph,
    rng: np.random.Generator,
) -> Mapping[str, Floats]:
    outcomes, mechanisms = fit_outcomes(train, schema, graph, rng, effort=FOLD)
    training = Training(
        origin="", runs=len(train), seed=0, alpha=0.0, resamples=0,
        moves_together=groups_that_move_together(schema, relative(train, schema)),
    )  # fmt: skip
    model = Model(
        schema_digest="", graph=graph, edges={}, bidirected=(), effects={}, paths={}, outcomes=outcomes, summaries={},
        skill={}, training=training, mechanisms=mechanisms,
    )  # fmt: skip
    filled = test.fillna({v.name: train[v.name].median() for v in schema.contexts})
    names = [name for name in schema.variables if name in filled]
    configs = [{str(k): float(v) for k, v in row.items()} for row in filled[names].to_dict("records")]
    fixed = {v.name: v.fixed for v in schema.objectives if v.fixed is not None and v.name in outcomes}
    relative_ones = [
        (v.name, v.relative)
        for v in schema.objectives
        if v.fixed is None and v.relative is not None and v.name in outcomes
    ]
    if not relative_ones:
        return _predicted_odds(CounterfactualQuery(model, configs[0], {}, fixed), configs)
    reference = {v.name: v.default for v in schema.options if v.default is not None}
    rows = []
    for config in configs:  # each mission has thresholds of its own
        query = CounterfactualQuery(model, config, {}, {})
        at_reference = [{**config, **reference}]
        needed = {
            name: bound.for_need(float(query.predict(name, at_reference).value[0])) for name, bound in relative_ones
        }
        rows.append(_predicted_odds(CounterfactualQuery(model, config, {}, {**fixed, **needed}), [config]))
    return {name: np.concatenate([row[name] for row in rows]) for name in rows[0]}


def _predicted_odds(query: CounterfactualQuery, configs: Sequence[Mapping[str, float]]) -> dict[str, Floats]:
    promised = {name: query.p_ok(name, configs) for name in query.thresholds}
    return {**promised, "all": query.probability(configs)}


def score(promised: Floats, truth: Floats) -> SkillRecord | None:
    """Log loss, Brier score, AUC, calibration and the base rate over the runs that have a truth; None without any."""
    known = np.isfinite(promised) & np.isfinite(truth)
    p, y = promised[known], truth[known]
    if not len(y):
        return None
    clipped = np.clip(p, 1e-3, 1 - 1e-3)
    return SkillRecord(
        runs=len(y),
        base_rate=float(y.mean()),
        log_loss=float(-(y * np.log(clipped) + (1 - y) * np.log(1 - clipped)).mean()),
        brier=float(((p - y) ** 2).mean()),
        calibration_error=calibration_error(p, y),
        auc=None if y.min() == y.max() else float(roc_auc_score(y, p)),
        curve=tuple(reliability(p, y)),
    )


def reliability(p: Floats, y: Floats) -> list[tuple[float, float, int]]:
    """Rows of (mean predicted probability, share that was met, runs), one for each tenth that holds any."""
    tenth = np.minimum((p * BINS).astype(int), BINS - 1)
    return [
        (float(p[tenth == k].mean()), float(y[tenth == k].mean()), int((tenth == k).sum()))
        for k in range(BINS)
        if (tenth == k).any()
    ]


def calibration_error(p: Floats, y: Floats) -> float:
    """Expected calibration error over tenths of the predicted probability."""
    rows = reliability(p, y)
    return sum(abs(predicted - seen) * count for predicted, seen, count in rows) / len(p)
