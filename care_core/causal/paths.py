"""Causal paths and their rank (paper, Alg. 2 and Eq. 2)."""

from __future__ import annotations

import heapq
from collections.abc import Collection, Mapping

import numpy as np

from care_core.causal.graph import CausalGraph, Edge
from care_core.frozen import dataclass


@dataclass(frozen=True)
class CausalPath:
    """A directed path from an option to an objective. `ace` is Eq. 2 (K = number of edges)."""

    nodes: tuple[str, ...]
    ace: float

    @property
    def edges(self) -> tuple[Edge, ...]:
        return tuple(zip(self.nodes, self.nodes[1:], strict=False))


def rank_paths(
    graph: CausalGraph, objective: str, sources: Collection[str], weight: Mapping[Edge, float], top: int
) -> tuple[CausalPath, ...]:
    """The `top` directed paths from a source to the objective with the largest mean edge effect.

    Backtracks from the objective (Alg. 2), most promising suffix first. The graph has no cycle, so the best sum over
    exactly r further edges is known beforehand for every node and the bound of a suffix is reached by one of its
    completions: no suffix is expanded that does not lead to a path at least as good as those still to come.
    The search costs O(V^3) and O(top * V * in-degree), however many paths there are.

    Args:
        weight: effect of each edge on scaled variables; its magnitude counts. An edge without one (its effect is
            not identified) carries no path.

    Returns:
        Best first; equal ranks: shorter path first, then by node names.
    """
    if objective not in graph.nodes:
        raise ValueError(f"unknown objective {objective!r}")
    index = {node: i for i, node in enumerate(graph.nodes)}
    usable = {edge: abs(value) for edge, value in weight.items() if edge in graph.directed}
    ahead = _best_sums(index, sources, usable)
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
        for cause in graph.parents(nodes[0]):
            effect = usable.get((cause, nodes[0]))
            if effect is None:
                continue
            means = (total + effect + ahead[:, index[cause]]) / (edges + 1 + lengths)
            bound = -np.inf if not len(means) else float(means.max())
            if bound > -np.inf:
                heapq.heappush(queue, (-bound, edges + 1, (cause, *nodes), total + effect, False))
    return tuple(sorted(found, key=lambda path: (-path.ace, len(path.nodes), path.nodes)))


def _best_sums(index: Mapping[str, int], sources: Collection[str], usable: Mapping[Edge, float]) -> np.ndarray:
    """Largest sum of effects over a path of exactly r edges from any source to each node; -inf where there is none.

    Returns:
        Shape (longest path + 1, n_nodes); row r is for r edges.
    """
    effects = np.full((len(index), len(index)), -np.inf)
    for (cause, effect), value in usable.items():
        effects[index[cause], index[effect]] = value
    row = np.full(len(index), -np.inf)
    row[[index[source] for source in sources if source in index]] = 0.0
    rows = [row]
    while np.isfinite(row).any():
        row = (row[:, None] + effects).max(axis=0, initial=-np.inf)
        rows.append(row)
    return np.array(rows)
