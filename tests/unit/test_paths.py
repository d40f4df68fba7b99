from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_core.causal.graph import CausalGraph
from care_core.causal.paths import Ways

NODES = ("o1", "o2", "m1", "m2", "m3", "y")
PAIRS = [(a, b) for i, a in enumerate(NODES) for b in NODES[i + 1 :]]


@st.composite
def weighted(draw: st.DrawFn) -> tuple[CausalGraph, dict[tuple[str, str], float]]:
    weight = draw(st.dictionaries(st.sampled_from(PAIRS), st.floats(-3, 3)))
    return CausalGraph(NODES, frozenset(weight)), weight


def every_path(graph: CausalGraph, node: str, sources: set[str]) -> list[tuple[str, ...]]:
    """All directed paths from a source, found the plain way."""
    longer = [(*path, node) for cause in graph.parents(node) for path in every_path(graph, cause, sources)]
    return [*longer, (node,)] if node in sources else longer


def mean_effect(path: tuple[str, ...], weight: dict[tuple[str, str], float]) -> float:
    return float(np.mean([abs(weight[edge]) for edge in pairwise(path)]))


@given(weighted(), st.integers(0, 12))
def test_finds_the_same_best_paths_as_enumeration(
    drawn: tuple[CausalGraph, dict[tuple[str, str], float]], top: int
) -> None:
    graph, weight = drawn
    found = Ways(graph, weight).ranked("y", ["o1", "o2"], top)
    best = sorted((mean_effect(p, weight) for p in every_path(graph, "y", {"o1", "o2"})), reverse=True)[:top]
    assert [path.ace for path in found] == pytest.approx(best, abs=1e-9)


@given(weighted())
def test_a_path_runs_from_an_option_to_the_objective_along_edges(
    drawn: tuple[CausalGraph, dict[tuple[str, str], float]],
) -> None:
    graph, weight = drawn
    for path in Ways(graph, weight).ranked("y", ["o1", "o2"], 20):
        assert path.nodes[0] in ("o1", "o2")
        assert path.nodes[-1] == "y"
        assert len(set(path.nodes)) == len(path.nodes)
        assert set(path.edges) <= graph.directed
        assert path.ace == pytest.approx(mean_effect(path.nodes, weight), abs=1e-9)


@given(weighted(), st.randoms())
def test_the_order_of_nodes_does_not_matter(
    drawn: tuple[CausalGraph, dict[tuple[str, str], float]], rnd: object
) -> None:
    graph, weight = drawn
    nodes = list(NODES)
    rnd.shuffle(nodes)  # type: ignore[attr-defined]
    again = Ways(CausalGraph(tuple(nodes), graph.directed), weight).ranked("y", ["o2", "o1"], 5)
    assert again == Ways(graph, weight).ranked("y", ["o1", "o2"], 5)


def test_bidirected_edges_and_edges_without_an_effect_carry_no_path() -> None:
    graph = CausalGraph(("o", "m", "n", "y"), frozenset({("o", "m"), ("o", "n"), ("n", "y")}), frozenset({("m", "y")}))
    assert Ways(graph, {("o", "m"): 1.0, ("o", "n"): 1.0}).ranked("y", ["o"], 5) == ()


def test_ties_go_to_the_shorter_path_then_by_name() -> None:
    edges = frozenset({("o", "b"), ("b", "y"), ("o", "a"), ("a", "y"), ("o", "y")})
    graph = CausalGraph(("o", "b", "a", "y"), edges)
    found = Ways(graph, dict.fromkeys(edges, 1.0)).ranked("y", ["o"], 5)
    assert [path.nodes for path in found] == [("o", "y"), ("o", "a", "y"), ("o", "b", "y")]


def test_an_unknown_objective_is_refused() -> None:
    with pytest.raises(ValueError, match="unknown objective"):
        Ways(CausalGraph(("a",)), {}).ranked("y", ["a"], 5)


def test_a_dense_graph_is_searched_without_listing_its_paths() -> None:
    metrics = [f"m{i:02d}" for i in range(40)]
    nodes = ("o", *metrics, "y")
    edges = frozenset((a, b) for i, a in enumerate(nodes) for b in nodes[i + 1 :])  # 2^40 paths
    rng = np.random.default_rng(0)
    weight = {edge: float(rng.random()) for edge in sorted(edges)}
    assert len(Ways(CausalGraph(nodes, edges), weight).ranked("y", ["o"], 20)) == 20


class Counted(CausalGraph):
    """Counts how many suffixes the search expands: each asks for the parents of its first node once."""

    def parents(self, node: str) -> tuple[str, ...]:
        EXPANDED.append(node)
        return super().parents(node)


EXPANDED: list[str] = []


def test_no_suffix_is_expanded_that_does_not_lead_to_a_best_path() -> None:
    """2^40 paths; each of the ten best has at most 41 edges, so the bound leaves at most 410 expansions."""
    metrics = [f"m{i:02d}" for i in range(40)]
    nodes = ("o", *metrics, "y")
    edges = frozenset((a, b) for i, a in enumerate(nodes) for b in nodes[i + 1 :])
    rng = np.random.default_rng(1)
    weight = {edge: float(rng.random()) for edge in sorted(edges)}
    EXPANDED.clear()
    found = Ways(Counted(nodes, edges), weight).ranked("y", ["o"], 10)
    assert len(found) == 10
    assert len(EXPANDED) <= 10 * (len(nodes) - 1)
