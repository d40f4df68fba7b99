from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_core.causal.graph import CausalGraph

NODES = tuple("abcdefg")


@st.composite
def graphs(draw: st.DrawFn) -> CausalGraph:
    order = draw(st.permutations(NODES))
    pairs = [(a, b) for i, a in enumerate(order) for b in order[i + 1 :]]
    directed = draw(st.sets(st.sampled_from(pairs)))
    bidirected = draw(st.sets(st.sampled_from(pairs), max_size=5))
    return CausalGraph(NODES, frozenset(directed), frozenset(bidirected))


def test_neighbours_follow_the_order_of_the_nodes() -> None:
    graph = CausalGraph(("a", "b", "c"), frozenset({("c", "b"), ("a", "b")}), frozenset({("c", "a")}))
    assert graph.parents("b") == ("a", "c")
    assert graph.children("a") == ("b",)
    assert graph.siblings("a") == ("c",)
    assert graph.siblings("c") == ("a",)
    assert graph.bidirected == {("a", "c")}


@pytest.mark.parametrize(
    ("nodes", "directed", "bidirected", "message"),
    [
        (("a", "b"), {("a", "b"), ("b", "a")}, set(), "cycle"),
        (("a", "b"), {("a", "x")}, set(), "unknown node"),
        (("a", "b"), set(), {("x", "b")}, "unknown node"),
        (("a",), {("a", "a")}, set(), "itself"),
        (("a", "a"), set(), set(), "twice"),
    ],
)
def test_unsound_graphs_are_refused(
    nodes: tuple[str, ...], directed: set[tuple[str, str]], bidirected: set[tuple[str, str]], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        CausalGraph(nodes, frozenset(directed), frozenset(bidirected))


def test_an_unknown_node_has_no_parents() -> None:
    with pytest.raises(ValueError, match="unknown node 'x'"):
        CausalGraph(("a",)).parents("x")


@given(graphs())
def test_causes_come_before_effects(graph: CausalGraph) -> None:
    place = {node: i for i, node in enumerate(graph.topological_order())}
    assert sorted(place) == sorted(graph.nodes)
    assert all(place[a] < place[b] for a, b in graph.directed)


@given(graphs(), st.sampled_from(NODES), st.sampled_from(NODES))
def test_ancestors_and_descendants_mirror_each_other(graph: CausalGraph, a: str, b: str) -> None:
    assert (a in graph.ancestors(b)) == (b in graph.descendants(a))


@given(graphs(), st.data())
def test_separation_is_symmetric_and_fails_for_neighbours(graph: CausalGraph, data: st.DataObject) -> None:
    a, b = data.draw(st.permutations(NODES))[:2]
    held = data.draw(st.sets(st.sampled_from([n for n in NODES if n not in (a, b)])))
    assert graph.m_separated(a, b, held) == graph.m_separated(b, a, held)
    if b in (*graph.parents(a), *graph.children(a), *graph.siblings(a)):
        assert not graph.m_separated(a, b, held)


@given(graphs(), st.data())
def test_a_node_is_separated_from_earlier_ones_by_its_parents_without_hidden_causes(
    graph: CausalGraph, data: st.DataObject
) -> None:
    dag = CausalGraph(graph.nodes, graph.directed)
    node = data.draw(st.sampled_from(NODES))
    for other in set(NODES) - dag.descendants(node) - set(dag.parents(node)):
        assert dag.m_separated(node, other, dag.parents(node))


def test_separation_around_a_collider() -> None:
    graph = CausalGraph(("x", "m", "y", "d"), frozenset({("x", "m"), ("m", "d")}), frozenset({("m", "y")}))
    assert graph.m_separated("x", "y")
    assert not graph.m_separated("x", "y", ["m"])
    assert not graph.m_separated("x", "y", ["d"])


def test_subgraph_keeps_the_edges_among_its_nodes() -> None:
    graph = CausalGraph(("a", "b", "c"), frozenset({("a", "b"), ("b", "c")}), frozenset({("a", "c")}))
    assert graph.subgraph(["c", "a"]) == CausalGraph(("a", "c"), frozenset(), frozenset({("a", "c")}))
