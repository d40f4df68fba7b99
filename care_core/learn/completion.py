"""Edges that the graph search could not see, found by asking of every option whether its effects are accounted for.

The search tests one pair at a time given a few others, through normal scores. On some hundred missions with dozens of
metrics that repeat each other it loses real links: it cannot see an optimum inside a range, and a metric that sums up
others hides what they carry. Options that were drawn at random allow a much sharper question, since all of them can be
held at once: does this target depend on this option given all other options? Where it does and the graph has no path
for it, the missing link is the metric that best carries the dependence; where no metric does, the option acts on the
objective directly, against Problem 2.1, and the model card says so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.stats import f as f_distribution

from care_core.causal.graph import CausalGraph
from care_core.learn.constraints import Constraints
from care_core.learn.outcomes import find_stages
from care_core.learn.screening import discoveries
from care_core.learn.table import FloatArray, normal_scores
from care_core.profile.schema import Schema
from care_core.variables import Variable

ROWS_PER_COLUMN = 3
"""Runs that each fitted column must have; with fewer, only options that matter marginally are held."""

RATE = 0.1
"""False discovery rate of total effects. A mechanism forgets an input that explains nothing, but never learns of one
that the graph leaves out: on held-out missions 0.05 and 0.1 predicted alike, 0.01 worse on the smaller table."""
LEVEL = 0.01
"""Level of the tests that choose the metric to carry an effect."""

DirectEdge = tuple[str, str, float]
"""An option, the objective it acts on beyond the metrics, and the p-value."""


@dataclass(frozen=True)
class Completion:
    """The completed graph, the option -> objective edges in it, and one sentence for each edge that was added."""

    graph: CausalGraph
    direct: tuple[DirectEdge, ...]
    notes: tuple[str, ...]


def complete(
    frame: pd.DataFrame, schema: Schema, graph: CausalGraph, options: Sequence[str], *, rate: float = RATE
) -> Completion:
    """Add the links that the options' total effects need.

    Args:
        options: those that passed the screening.
        rate: false discovery rate over all (option, target) pairs.
    """
    return _Completer(frame, schema, graph, options, rate).run()


class _Completer:
    """Grows one graph; every added edge respects the constraints and keeps the graph acyclic."""

    def __init__(
        self, frame: pd.DataFrame, schema: Schema, graph: CausalGraph, options: Sequence[str], rate: float
    ) -> None:
        self.frame, self.schema, self.graph, self.rate = frame, schema, graph, rate
        self.options = [*options, *((c.name for c in schema.contexts) if schema.observational else ())]
        self.constraints = Constraints.of(schema)
        self.metrics = [m.name for m in schema.metrics if frame[m.name].nunique() > 1]
        self.objectives = [o.name for o in schema.objectives if frame[o.name].nunique() > 1]
        self.direct: list[DirectEdge] = []
        self.notes: list[str] = []

    def run(self) -> Completion:
        effects = self._total_effects()
        for metric in self.metrics:
            for option, p in effects[metric]:
                if option not in self.graph.ancestors(metric) and self._may_add(option, metric):
                    self._add(option, metric, f"depends on it given all other options (p = {p:.2g})")
        for declared in self.schema.objectives:
            if declared.kind == "functional" and declared.name in self.objectives:
                self._link_stages(declared)
        for objective in self.objectives:
            for option, p in effects[objective]:
                if option not in self.graph.ancestors(objective):
                    self._link(option, objective, p)
        return Completion(self.graph, tuple(self.direct), tuple(self.notes))

    def _total_effects(self) -> dict[str, list[tuple[str, float]]]:
        """Per target the options it depends on given all the others, strongest first."""
        targets = [*self.metrics, *self.objectives]
        p = np.array([_p_of_each(self.frame, self.options, target) for target in targets])
        found = discoveries(p, self.rate) if p.size else np.zeros_like(p, dtype=bool)
        return {
            target: sorted(
                ((option, float(p[i, j])) for j, option in enumerate(self.options) if found[i, j]),
                key=lambda pair: pair[1],
            )
            for i, target in enumerate(targets)
        }

    def _link_stages(self, objective: Variable) -> None:
        """A condition that no mission fails without missing the objective causes it, however few missions fail it."""
        for stage in find_stages(objective, self.schema, self.frame):
            known = {objective.name, *self.graph.ancestors(objective.name)}
            if stage.variable not in known and self._may_add(stage.variable, objective.name):
                self._add(stage.variable, objective.name, "is missed by every mission that fails there")

    def _link(self, option: str, objective: str, p: float) -> None:
        """Give the option a path to the objective: through the metric that best carries it, else directly."""
        parents = sorted(self.graph.parents(objective))
        carriers = [m for m in self.metrics if option in self.graph.ancestors(m) and self._may_add(m, objective)]
        left = {m: _p_of(self.frame, option, [*parents, m], objective) for m in carriers}
        helps = [m for m in carriers if _p_of(self.frame, m, parents, objective) <= LEVEL]
        best = max(helps, key=lambda m: (left[m], m), default=None)
        if best is not None:
            self._add(best, objective, f"carries the effect of '{option}' (p = {p:.2g})")
        remaining = p if best is None else left[best]
        if remaining <= LEVEL:
            self._add(option, objective, f"depends on it beyond every metric (p = {remaining:.2g})")
            self.direct.append((option, objective, remaining))

    def _may_add(self, cause: str, effect: str) -> bool:
        return not self.constraints.forbids(cause, effect) and cause not in self.graph.descendants(effect)

    def _add(self, cause: str, effect: str, why: str) -> None:
        self.graph = CausalGraph(self.graph.nodes, self.graph.directed | {(cause, effect)}, self.graph.bidirected)
        self.notes.append(f"{cause} -> {effect} was added: '{effect}' {why}.")


def _p_of_each(frame: pd.DataFrame, names: Sequence[str], target: str) -> FloatArray:
    """p-value of each variable adding nothing to a least-squares fit of the target on all the others.

    Every variable enters by its normal scores and their magnitude, so an optimum inside is seen; a missing metric (a
    mission that never flew) enters as 0 with a column of its own. Of more variables than the runs can carry, the ones
    most correlated with the target are held, and the rest tested one by one beside them.

    Returns:
        Shape (len(names),).
    """
    known = frame[frame[target].notna()]
    y = normal_scores(known[target].to_numpy(dtype=float))
    p = np.ones(len(names))
    if len(known) < 2 * ROWS_PER_COLUMN or np.ptp(y) == 0:
        return p
    blocks = [_features(known[name].to_numpy(dtype=float)) for name in names]
    held = _held(blocks, y)
    x = np.column_stack([np.ones((len(y), 1)), *(blocks[i] for i in held)])
    inverse = np.linalg.pinv(x.T @ x, rcond=1e-10, hermitian=True)
    b = inverse @ (x.T @ y)
    left = y - x @ b
    # Metrics of missions that never flew are missing together: columns repeat each other, and only what is a
    # block's own is tested. `repeated` projects on the combinations of columns that cancel.
    repeated = np.eye(x.shape[1]) - inverse @ (x.T @ x)
    rank = x.shape[1] - round(float(np.trace(repeated)))
    freedom = len(y) - rank
    noise = max(float((left**2).sum()) / freedom, 1e-12)
    start = 1
    for i in held:
        part = slice(start, start + blocks[i].shape[1])
        start = part.stop
        share, directions = np.linalg.eigh(repeated[part, part])
        own = directions[:, share < 1e-6]
        if own.size:
            effect = own.T @ b[part]
            explained = float(effect @ np.linalg.solve(own.T @ inverse[part, part] @ own, effect))
            p[i] = f_distribution.sf(explained / own.shape[1] / noise, own.shape[1], freedom)
    for i in set(range(len(names))) - set(held):
        p[i] = _f_test(left, blocks[i] - x @ (inverse @ (x.T @ blocks[i])), rank)
    return p


def _held(blocks: Sequence[FloatArray], y: FloatArray) -> list[int]:
    """The blocks that are fitted together: the most correlated ones, as many columns as the runs can carry."""
    order = sorted(range(len(blocks)), key=lambda i: -float(np.abs(blocks[i].T @ y).max(initial=0.0)))
    held, used = [], 1
    for i in order:
        if blocks[i].shape[1] and ROWS_PER_COLUMN * (used + blocks[i].shape[1]) <= len(y):
            held.append(i)
            used += blocks[i].shape[1]
    return held


def _p_of(frame: pd.DataFrame, name: str, given: Sequence[str], target: str) -> float:
    """The test of `_p_of_each` for one variable beside given ones."""
    return float(_p_of_each(frame[frame[name].notna()], [name, *given], target)[0])


def _features(values: FloatArray) -> FloatArray:
    """Scores and their magnitude, and where the value is missing, as orthonormal columns; shape (n, 0 to 3).

    A yes-or-no variable has one column, since its magnitude repeats its score: a test counts what is really added.
    """
    scores = normal_scores(values)
    missing = np.isnan(scores)
    scores = np.nan_to_num(scores)
    columns = np.column_stack([scores, np.abs(scores), missing.astype(float)])
    columns = columns[:, np.ptp(columns, axis=0) > 0]
    return _span(columns - columns.mean(axis=0)) if columns.size else columns


def _span(columns: FloatArray) -> FloatArray:
    """Orthonormal columns with the same span."""
    left, values, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(left[:, values > 1e-8 * values.max()])


def _f_test(target: FloatArray, added: FloatArray, used: int) -> float:
    """F-test of added columns; both sides already without what `used` columns explain."""
    if not added.size or float(np.abs(added).max()) < 1e-9:
        return 1.0
    directions = _span(added)
    count, freedom = directions.shape[1], len(target) - used - directions.shape[1]
    explained = float(((directions.T @ target) ** 2).sum())
    within = float((target**2).sum()) - explained
    if freedom < 1 or within <= 1e-9:
        return 1.0
    return float(f_distribution.sf(explained / count * freedom / within, count, freedom))
