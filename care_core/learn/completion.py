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

import numpy as np
import pandas as pd

from care_core.causal.graph import CausalGraph
from care_core.learn.constraints import Constraints
from care_core.learn.outcomes import find_stages
from care_core.learn.regression import Regressions
from care_core.learn.screening import discoveries
from care_core.learn.table import varying
from care_core.profile.schema import Schema
from care_core.records import Record
from care_core.variables import Variable

RATE = 0.05
"""False discovery rate of total effects. A mechanism forgets an input that explains nothing, but never learns of one
that the graph leaves out. Against 0.1, the graphs of simulated robots have fewer false edges and the same causes
(benchmarks/discovery.py); on held-out missions the two predict alike, and 0.01 worse on the smaller table."""
LEVEL = 0.01
"""Level of the tests that choose the metric to carry an effect."""

DirectEdge = tuple[str, str, float]
"""An option, the objective it acts on beyond the metrics, and the p-value."""


class Completion(Record):
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
        self.regressions = Regressions(frame)
        self.options = [*options, *((c.name for c in schema.contexts) if schema.observational else ())]
        self.constraints = Constraints.of(schema)
        self.metrics = varying(frame, [m.name for m in schema.metrics])
        self.objectives = varying(frame, [o.name for o in schema.objectives])
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
        p = np.array([self.regressions.p_of_each(self.options, target) for target in targets])
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
        mediators = [m for m in self.metrics if option in self.graph.ancestors(m) and self._may_add(m, objective)]
        left = {m: self.regressions.p_of(option, [*parents, m], objective) for m in mediators}
        helps = [m for m in mediators if self.regressions.p_of(m, parents, objective) <= LEVEL]
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
