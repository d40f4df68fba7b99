"""The tree of what leads to a variable."""

from __future__ import annotations

from collections.abc import Iterator

from hypothesis import given, settings
from hypothesis import strategies as st

from care_core.causal.graph import CausalGraph
from care_core.causal.model import EdgeRecord, Model
from care_core.causal.tree import Branch, Way, tree_of
from care_core.profile.store import Profile
from care_core.records import replace
from care_tui.render.rows import ASCII
from care_tui.render.tree import tree_rows
from tests.unit.test_paths import NODES, weighted


def model_of(planted: Profile, graph: CausalGraph, weight: dict[tuple[str, str], float]) -> Model:
    edges = {
        (a, b): EdgeRecord(source=a, target=b, kind="directed", support=0.9, effect=effect)
        for (a, b), effect in weight.items()
    }
    return replace(planted.model, graph=graph, edges=edges)


def every(branch: Branch) -> Iterator[Branch]:
    for one in branch.branches:
        yield one
        yield from every(one)


@settings(deadline=None)
@given(weighted(), st.integers(0, 12))
def test_a_tree_has_edges_of_the_graph_the_strongest_first_and_no_more_than_were_asked_for(
    planted: Profile, drawn: tuple[CausalGraph, dict[tuple[str, str], float]], count: int
) -> None:
    graph, weight = drawn
    model = model_of(planted, graph, weight)
    ways: tuple[tuple[str, Way], ...] = (("y", "causes"), ("o1", "effects"))
    for node, way in ways:
        tree = tree_of(model, node, way, count)
        found = list(every(tree))
        assert len(found) <= count
        assert all(one.edge is not None and (one.edge.source, one.edge.target) in weight for one in found)
        reached = graph.ancestors(node) if way == "causes" else graph.descendants(node)
        if count == 12 and len(weight) <= count:
            assert {one.name for one in found} == reached - {node}
        for one in (tree, *found):
            effects = [abs(below.edge.effect) for below in one.branches if below.edge is not None]
            assert effects == sorted(effects, reverse=True)
        followed = [one.name for one in (tree, *found) if one.branches]
        assert len(followed) == len(set(followed))  # what is reached twice has its branches once


def test_the_strongest_way_is_kept_where_there_is_little_room(planted: Profile) -> None:
    weight = {("m1", "y"): 0.9, ("m2", "y"): 0.2, ("o1", "m1"): -0.8, ("o2", "m2"): 0.9}
    tree = tree_of(model_of(planted, CausalGraph(NODES, frozenset(weight)), weight), "y", "causes", 2)
    assert [(one.name, one.edge and one.edge.effect) for one in every(tree)] == [("m1", 0.9), ("o1", -0.8)]


def test_lines_lead_from_each_variable_to_what_is_joined_to_it(planted: Profile) -> None:
    weight = {("m1", "y"): 0.9, ("m2", "m1"): 0.2, ("o1", "m1"): -0.8, ("m2", "y"): 0.5, ("o2", "m2"): 0.7}
    tree = tree_of(model_of(planted, CausalGraph(NODES, frozenset(weight)), weight), "y", "causes", 9)
    rows = tree_rows(tree, lambda name: "12 s" if name == "y" else "", {"y", "m1"}, 40, ASCII)
    lines = [row.content.plain for row in rows]
    assert "".join(lines[0].split()) == "*y12s"
    assert [" ".join(line.split()) for line in lines[1:]] == [
        "|- * m1 +0.90",
        "| |- o1 -0.80",
        "| `- m2 ~ +0.20",
        "`- m2 +0.50",
        "`- o2 +0.70",
    ]
    assert all(row.content.cell_length <= 40 for row in rows)
