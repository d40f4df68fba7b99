"""Causal paths and their rank (paper, Alg. 2 and Eq. 2)."""

from __future__ import annotations

import heapq
from collections.abc import Collection, Mapping
from functools import cached_property

import numpy as np

from care_core.causal.graph import CausalGraph, Edge
from care_core.records import Record


class CausalPath(Record):
    """A directed path from an option to an objective. `ace` is Eq. 2 (K = number of edges)."""

    nodes: tuple[str, ...]
    ace: float

    @property
    def edges(self) -> tuple[Edge, ...]:
        return tuple(zip(self.nodes, self.nodes[1:], strict=False))


class Ways(Record, eq=False, dict=True):
    """The edges of a graph that carry an effect, ready to be asked for paths many times over.

    `weight`: effect of each edge on scaled variables; its magnitude counts. An edge without one (its effect is not
    identified) carries no path.
    """

    graph: CausalGraph
    weight: Mapping[Edge, float]

    def ranked(self, objective: str, sources: Collection[str], top: int) -> tuple[CausalPath, ...]:
        """The `top` directed paths from a source to the objective with the largest mean edge effect.

        Backtracks from the objective (Alg. 2), most promising suffix first. The graph has no cycle, so the best sum
        over exactly r further edges is known beforehand for every node and the bound of a suffix is reached by one of
        its completions: no suffix is expanded that does not lead to a path at least as good as those still to come.
        The search costs O(V^3) and O(top * V * in-degree), however many paths there are.

        Returns:
            Best first; equal ranks: shorter path first, then by node names.
        """
        if objective not in self.graph.nodes:
            raise ValueError(f"unknown objective {objective!r}")
        ahead = self._best_sums(sources)
        lengths = np.arange(len(ahead))
        found: list[CausalPath] = []
        # (minus the best mean this suffix can reach, edges, nodes, sum of effects, whether it ends here)
        queue: list[tuple[float, int, tuple[str, ...], float, bool]] = [(-np.inf, 0, (objective,), 0.0, False)]
        while queue and len(found) < top:
            negative_mean, edges, nodes, total, ends_here = heapq.heappop(queue)
            if ends_here:
                found.append(CausalPath(nodes, -negative_mean))
                continue
            if edges and nodes[0] in sources:
                heapq.heappush(queue, (-total / edges, edges, nodes, total, True))
            for cause in self.graph.parents(nodes[0]):
                effect = self._usable.get((cause, nodes[0]))
                if effect is None:
                    continue
                means = (total + effect + ahead[:, self._index[cause]]) / (edges + 1 + lengths)
                bound = -np.inf if not len(means) else float(means.max())
                if bound > -np.inf:
                    heapq.heappush(queue, (-bound, edges + 1, (cause, *nodes), total + effect, False))
        return tuple(sorted(found, key=lambda path: (-path.ace, len(path.nodes), path.nodes)))

    @cached_property
    def _index(self) -> dict[str, int]:
        return {node: i for i, node in enumerate(self.graph.nodes)}

    @cached_property
    def _usable(self) -> dict[Edge, float]:
        return {edge: abs(value) for edge, value in self.weight.items() if edge in self.graph.directed}

    @cached_property
    def _effects(self) -> np.ndarray:
        """Shape (n_nodes, n_nodes), from the row's node to the column's; -inf where no edge carries anything."""
        effects = np.full((len(self._index), len(self._index)), -np.inf)
        for (cause, effect), value in self._usable.items():
            effects[self._index[cause], self._index[effect]] = value
        return effects

    def _best_sums(self, sources: Collection[str]) -> np.ndarray:
        """Largest sum of effects over a path of exactly r edges from any source to each node; -inf where there is none.

        Returns:
            Shape (longest path + 1, n_nodes); row r is for r edges.
        """
        row = np.full(len(self._index), -np.inf)
        row[[self._index[source] for source in sources if source in self._index]] = 0.0
        rows = [row]
        while np.isfinite(row).any():
            row = (row[:, None] + self._effects).max(axis=0, initial=-np.inf)
            rows.append(row)
        return np.array(rows)
