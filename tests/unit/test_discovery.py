from __future__ import annotations

from collections.abc import Sequence

import networkx as nx
import numpy as np
import pytest
from causallearn.search.ConstraintBased.FCI import fci
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from care_core.causal.graph import CausalGraph
from care_core.errors import LearningError
from care_core.learn.constraints import Constraints
from care_core.learn.discovery import FisherZ, Mark, Pag, discover
from care_core.learn.structure import learn_structure
from care_core.numbers import Floats
from care_core.variables import Role
from tests.simulated import simulate
from tests.whole import examples

METRICS = tuple("abcdef")
FREE = Constraints(dict.fromkeys(METRICS, Role.METRIC))
O, C, M, Y = Role.OPTION, Role.CONTEXT, Role.METRIC, Role.OBJECTIVE  # noqa: E741


class Oracle:
    """Knows the true graph: p is 1 where it separates the pair, else 0."""

    def __init__(self, graph: CausalGraph, names: Sequence[str]) -> None:
        self.graph, self.names = graph, names

    def p_values(self, x: NDArray[np.int64], y: NDArray[np.int64], given: NDArray[np.int64]) -> Floats:
        return np.array(
            [
                float(self.graph.m_separated(self.names[i], self.names[j], [self.names[k] for k in held]))
                for i, j, held in zip(x, y, given, strict=True)
            ]
        )


@st.composite
def mixed_graphs(draw: st.DrawFn, nodes: Sequence[str] = METRICS) -> CausalGraph:
    order = draw(st.permutations(nodes))
    pairs = [(a, b) for i, a in enumerate(order) for b in order[i + 1 :]]
    directed = draw(st.sets(st.sampled_from(pairs), max_size=8))
    bidirected = draw(st.sets(st.sampled_from(pairs), max_size=3))
    return CausalGraph(tuple(nodes), frozenset(directed), frozenset(bidirected))


def marks(pag: Pag) -> dict[tuple[str, str], Mark]:
    """(a, b) -> the mark at b of their edge."""
    return {(e.a, e.b): e.at_b for e in pag.edges} | {(e.b, e.a): e.at_a for e in pag.edges}


def assert_sound(pag: Pag, truth: CausalGraph) -> None:
    for (a, b), mark in marks(pag).items():
        if mark is Mark.ARROW:
            assert b not in truth.ancestors(a), f"{a} *-> {b}"
        if mark is Mark.TAIL:
            assert b in truth.ancestors(a), f"{a} *-- {b}"


@settings(deadline=None, max_examples=examples(60))
@given(mixed_graphs())
def test_with_an_oracle_adjacencies_are_exact_and_marks_sound(truth: CausalGraph) -> None:
    pag = discover(METRICS, Oracle(truth, METRICS), FREE, max_given=4, max_given_beyond=4)
    joined = set(marks(pag))
    for a in METRICS:
        for b in METRICS:
            if a != b:
                separable = truth.m_separated(a, b, truth.ancestors(a, b) - {a, b})
                assert ((a, b) in joined) != separable
    assert_sound(pag, truth)


@settings(deadline=None, max_examples=examples(40))
@given(st.data())
def test_constraints_keep_the_marks_sound(data: st.DataObject) -> None:
    roles = {"o1": O, "o2": O, "c": C, "m1": M, "m2": M, "m3": M, "y": Y}
    rules = Constraints(roles)
    pairs = [(a, b) for a in roles for b in roles if a < b or roles[a] is not roles[b]]
    allowed = [(a, b) for a, b in pairs if a != b and not rules.forbids(a, b)]
    directed = data.draw(st.sets(st.sampled_from(allowed)))
    hidden = data.draw(st.sets(st.sampled_from([("m1", "m2"), ("m2", "y"), ("m1", "m3")])))
    truth = CausalGraph(tuple(roles), frozenset(directed), frozenset(hidden))
    assert_sound(discover(tuple(roles), Oracle(truth, tuple(roles)), rules, max_given=5, max_given_beyond=5), truth)


@pytest.mark.parametrize("seed", range(4))
def test_agrees_with_causal_learn_on_a_graph_without_hidden_causes(seed: int) -> None:
    """Fisher's z on many runs of a sparse linear system: same adjacencies, no contradiction in marks."""
    rng = np.random.default_rng(seed)
    data = rng.normal(size=(4000, 6))
    for i, j in ((0, 2), (1, 2), (2, 3), (2, 4), (3, 5), (4, 5)):
        data[:, j] += rng.uniform(0.6, 1.0) * data[:, i]
    ours = marks(discover(METRICS, FisherZ(data), FREE, alpha=0.001))
    reference = fci(data, alpha=0.001, show_progress=False, node_names=list(METRICS))[0]
    theirs: dict[tuple[str, str], str] = {}
    for edge in reference.get_graph_edges():
        a, b = edge.get_node1().get_name(), edge.get_node2().get_name()
        theirs |= {(a, b): edge.get_endpoint2().name, (b, a): edge.get_endpoint1().name}
    assert set(ours) == set(theirs)
    assert all("CIRCLE" in (ours[ends].name, theirs[ends]) or ours[ends].name == theirs[ends] for ends in ours)


def drawn(pag: Pag) -> set[str]:
    """Every edge as text, such as `a o-> b`."""
    left = {Mark.TAIL: "-", Mark.ARROW: "<", Mark.CIRCLE: "o"}
    return {f"{e.a} {left[e.at_a]}-{e.at_b.value} {e.b}" for e in pag.edges}


@pytest.mark.parametrize(
    ("directed", "hidden", "pag"),
    [
        ("ab bc", "", {"a o-o b", "b o-o c"}),
        ("ac bc", "", {"a o-> c", "b o-> c"}),
        ("ac bc cd", "", {"a o-> c", "b o-> c", "c --> d"}),
        ("ab dc", "bc", {"a o-> b", "b <-> c", "c <-o d"}),
        ("ac bc cd", "cd", {"a o-> c", "b o-> c", "a o-> d", "b o-> d", "c o-o d"}),
        ("ab cb cd", "", {"a o-> b", "b <-o c", "c o-o d"}),
        ("ba bc", "ac", {"a o-o b", "b o-o c", "a o-o c"}),
    ],
)
def test_the_partial_graph_of_known_graphs(directed: str, hidden: str, pag: set[str]) -> None:
    names = tuple("abcd" if "d" in directed else "abc")
    edges, arcs = (frozenset((pair[0], pair[1]) for pair in text.split()) for text in (directed, hidden))
    found = drawn(discover(names, Oracle(CausalGraph(names, edges, arcs), names), FREE))
    assert found == pag


@settings(deadline=None, max_examples=examples(25))
@given(mixed_graphs(nodes=METRICS[:5]))
def test_with_hidden_causes_agrees_with_causal_learn_on_its_own_oracle(truth: CausalGraph) -> None:
    """Same adjacencies; a mark is the same, or a circle of ours where causal-learn's R5 to R10 say more."""
    names = truth.nodes
    dag = nx.DiGraph([(names.index(a), names.index(b)) for a, b in truth.directed])
    dag.add_nodes_from(range(len(names)))
    for k, (a, b) in enumerate(sorted(truth.bidirected), start=len(names)):
        dag.add_edges_from([(k, names.index(a)), (k, names.index(b))])
    reference = fci(
        np.random.default_rng(0).normal(size=(10, len(names))), "d_separation", true_dag=dag,
        node_names=list(names), show_progress=False,
    )[0]  # fmt: skip
    theirs: dict[tuple[str, str], str] = {}
    for edge in reference.get_graph_edges():
        a, b = edge.get_node1().get_name(), edge.get_node2().get_name()
        theirs |= {(a, b): edge.get_endpoint2().name, (b, a): edge.get_endpoint1().name}
    ours = marks(discover(names, Oracle(truth, names), FREE, max_given=3, max_given_beyond=3))
    assert set(ours) == set(theirs)
    for ends, mark in ours.items():
        assert mark.name == theirs[ends] or mark is Mark.CIRCLE, ends


def test_a_confounded_metric_and_objective_stay_open_to_a_latent_cause() -> None:
    """An objective causes no metric; that is an arrowhead at the objective, not a tail at the metric."""
    rng = np.random.default_rng(0)
    cause = rng.normal(size=3000)
    data = np.column_stack([cause, cause]) + rng.normal(size=(3000, 2))
    pag = discover(("m", "y"), FisherZ(data), Constraints({"m": M, "y": Y}))
    assert marks(pag) == {("m", "y"): Mark.ARROW, ("y", "m"): Mark.CIRCLE}


def test_a_randomised_option_is_a_cause_and_an_observed_one_may_be_confounded() -> None:
    rng = np.random.default_rng(0)
    option = rng.normal(size=500)
    data = np.column_stack([option, option + rng.normal(size=500)])
    roles = {"o": O, "m": M}
    assert marks(discover(("o", "m"), FisherZ(data), Constraints(roles)))["m", "o"] is Mark.TAIL
    observed = Constraints(roles, observational=True)
    assert marks(discover(("o", "m"), FisherZ(data), observed))["m", "o"] is Mark.CIRCLE


def test_options_are_never_joined_however_correlated() -> None:
    rng = np.random.default_rng(0)
    a = rng.normal(size=300)
    data = np.column_stack([a, a + 0.1 * rng.normal(size=300)])
    assert discover(("a", "b"), FisherZ(data), Constraints({"a": O, "b": O})).edges == ()


def test_nothing_is_printed(capfd: pytest.CaptureFixture[str]) -> None:
    frame, schema, _ = simulate(300, np.random.default_rng(0), metrics=6)
    learn_structure(frame, schema, rng=np.random.default_rng(0))
    assert capfd.readouterr() == ("", "")


def test_tests_use_the_runs_that_have_all_variables() -> None:
    """An option that ends missions early moves the metric over all runs, but not over those that have a time."""
    rng = np.random.default_rng(0)
    option = rng.uniform(size=800)
    failed = option > 0.6
    speed = rng.normal(size=800) - 3 * failed
    time_s = np.where(failed, np.nan, -speed + 0.5 * rng.normal(size=800))
    test = FisherZ(np.column_stack([option, speed, time_s]))
    none = np.zeros((1, 0), dtype=np.int64)
    assert test.p_values(np.array([0]), np.array([1]), none)[0] < 1e-9
    assert test.p_values(np.array([0]), np.array([2]), none)[0] > 0.01
    assert test.p_values(np.array([0]), np.array([2]), np.array([[1]]))[0] > 0.01


def test_what_cannot_be_tested_is_nan() -> None:
    success = np.repeat([0.0, 1.0], 50)
    time_s = np.where(success == 1, np.arange(100.0), np.nan)
    test = FisherZ(np.column_stack([success, time_s]))
    assert np.isnan(test.p_values(np.array([0]), np.array([1]), np.zeros((1, 0), dtype=np.int64))[0])


def test_many_patterns_of_missing_values_are_merged() -> None:
    rng = np.random.default_rng(0)
    data = rng.normal(size=(500, 20))
    data[:, 1:] += data[:, :1]
    data[rng.random(data.shape) < 0.02] = np.nan
    p = FisherZ(data).p_values(np.array([1]), np.array([2]), np.zeros((1, 0), dtype=np.int64))
    assert p[0] < 1e-6


def test_recovers_a_simulated_robot() -> None:
    found = missed = wrong = 0
    for seed in range(6):
        frame, schema, truth = simulate(1000, np.random.default_rng(seed), contexts=1)
        learned = learn_structure(frame, schema, rng=np.random.default_rng(0)).graph
        found += len(learned.directed & truth.directed)
        missed += len(truth.directed - learned.directed)
        wrong += len(learned.directed - truth.directed)
    assert found / (found + missed) > 0.8
    assert found / (found + wrong) > 0.8


def test_a_table_without_variation_carries_no_graph() -> None:
    frame, schema, _ = simulate(100, np.random.default_rng(0))
    with pytest.raises(LearningError, match="No objective varies"):
        learn_structure(frame.assign(objective_0=1.0), schema, rng=np.random.default_rng(0))


def test_screened_options_and_constants_stand_alone_in_the_graph() -> None:
    frame, schema, _ = simulate(300, np.random.default_rng(0), inert=10)
    structure = learn_structure(frame.assign(inert_0=2.0), schema, rng=np.random.default_rng(0))
    assert set(structure.graph.nodes) == set(schema.variables)
    assert "inert_0" in structure.dropped_options
    assert structure.graph.children("inert_0") == ()
    assert "'inert_0' never varies in the table." in structure.notes
