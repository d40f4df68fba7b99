from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from care_core.causal.graph import CausalGraph
from care_core.learn.constraints import Constraints
from care_core.learn.discovery import Mark, Pag, PagEdge
from care_core.learn.orientation import (
    THRESHOLD,
    entropy,
    exogenous_entropy,
    has_latent_cause,
    joint_distribution,
    latent_entropy,
    mutual_information,
    points_forward,
    resolve,
)
from care_core.variables import Role
from tests.whole import examples

NAMES = tuple("abcde")
FREE = Constraints(dict.fromkeys(NAMES, Role.METRIC))
MARKS = st.sampled_from([Mark.ARROW, Mark.CIRCLE, Mark.TAIL])


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(0)


@st.composite
def partial_graphs(draw: st.DrawFn) -> Pag:
    pairs = [(a, b) for i, a in enumerate(NAMES) for b in NAMES[i + 1 :]]
    edges = []
    for a, b in sorted(draw(st.sets(st.sampled_from(pairs)))):
        at_a, at_b = draw(st.tuples(MARKS, MARKS).filter(lambda ends: ends != (Mark.TAIL, Mark.TAIL)))
        edges.append(PagEdge(a, b, at_a, at_b))
    return Pag(NAMES, tuple(edges))


@settings(deadline=None, max_examples=examples(40))
@given(partial_graphs(), st.integers(0, 100))
def test_every_edge_is_resolved_without_touching_arrowheads_or_making_a_cycle(pag: Pag, seed: int) -> None:
    rng = np.random.default_rng(seed)
    columns = dict(zip(NAMES, rng.normal(size=(5, 60)) + rng.normal(size=60), strict=True))
    resolved = resolve(pag, columns, FREE, rng)
    CausalGraph(NAMES, frozenset(resolved.directed))  # which refuses a cycle
    assert len(resolved.directed) + len(resolved.bidirected) == len(pag.edges)
    for edge in pag.edges:
        if edge.at_a is Mark.ARROW:
            assert (edge.a, edge.b) not in resolved.directed
        if edge.at_b is Mark.ARROW:
            assert (edge.b, edge.a) not in resolved.directed


def test_an_arrowhead_is_kept_although_entropy_says_otherwise(rng: np.random.Generator) -> None:
    """y = f(x) loses values, so x -> y needs no noise and entropy prefers it; the arrowhead at x decides."""
    x = rng.integers(0, 6, size=500).astype(float)
    columns = {"a": x, "b": x // 2}
    forward = resolve(Pag(("a", "b"), (PagEdge("a", "b", Mark.CIRCLE, Mark.CIRCLE),)), columns, FREE, rng)
    assert forward.directed == {("a", "b")}
    kept = resolve(Pag(("a", "b"), (PagEdge("a", "b", Mark.ARROW, Mark.CIRCLE),)), columns, FREE, rng)
    assert ("a", "b") not in kept.directed


def test_constraints_decide_before_entropy(rng: np.random.Generator) -> None:
    y = rng.integers(0, 6, size=500).astype(float)
    columns = {"m": y // 2, "y": y}
    rules = Constraints({"m": Role.METRIC, "y": Role.OBJECTIVE})
    resolved = resolve(Pag(("m", "y"), (PagEdge("m", "y", Mark.CIRCLE, Mark.CIRCLE),)), columns, rules, rng)
    assert ("y", "m") not in resolved.directed


def test_a_cycle_is_broken_at_its_weakest_edge_and_noted(rng: np.random.Generator) -> None:
    a = rng.normal(size=2000)
    b = a + 0.3 * rng.normal(size=2000)
    c = b + 0.3 * rng.normal(size=2000)
    edges = tuple(
        PagEdge(x, y, at_x, at_y)
        for x, y, at_x, at_y in (
            ("a", "b", Mark.TAIL, Mark.ARROW),
            ("b", "c", Mark.TAIL, Mark.ARROW),
            ("a", "c", Mark.ARROW, Mark.TAIL),
        )
    )
    resolved = resolve(Pag(("a", "b", "c"), edges), {"a": a, "b": b, "c": c}, FREE, rng)
    assert resolved.directed == {("a", "b"), ("b", "c")}
    assert resolved.bidirected == {("a", "c")}
    assert len(resolved.notes) == 1


def test_finds_a_coin_behind_two_metrics(rng: np.random.Generator) -> None:
    coin = rng.choice([-1.0, 1.0], size=1000)
    x, y = coin + 0.3 * rng.normal(size=(2, 1000))
    assert has_latent_cause(joint_distribution(x, y), rng)


def test_finds_no_latent_cause_behind_a_mechanism(rng: np.random.Generator) -> None:
    x = rng.normal(size=1000)
    y = x + 0.4 * rng.normal(size=1000)
    assert not has_latent_cause(joint_distribution(x, y), rng)


def test_a_latent_state_is_recovered_exactly(rng: np.random.Generator) -> None:
    """Two states, within which the pair is independent: the latent needs one bit."""
    within = np.array([[0.25, 0.25], [0.25, 0.25]])
    joint = np.zeros((4, 4))
    joint[:2, :2] = joint[2:, 2:] = within / 2
    assert latent_entropy(joint, rng) == pytest.approx(np.log(2), abs=0.01)


@pytest.mark.parametrize(("own", "share"), [([0.5, 0.5], 2 / 3), ([0.92, 0.08], 0.83)])
def test_a_latent_counts_below_eight_tenths_of_the_smaller_entropy(
    own: list[float], share: float, rng: np.random.Generator
) -> None:
    """X = (Z, U) and Y = (Z, V) with four states of Z: only Z explains the pair, and H(Z) / H(X) is known."""
    within = np.outer(own, own) / 4
    joint = np.asarray(np.kron(np.eye(4), within), dtype=np.float64)
    assert np.log(4) / entropy(joint.sum(axis=1)) == pytest.approx(share, abs=0.01)
    assert latent_entropy(joint, rng) == pytest.approx(np.log(4), abs=0.02)
    assert has_latent_cause(joint, rng) == (share < THRESHOLD)


@given(st.integers(0, 1000))
def test_the_exogenous_entropy_of_a_function_is_zero(seed: int) -> None:
    rng = np.random.default_rng(seed)
    joint = np.zeros((6, 3))
    joint[np.arange(6), rng.integers(0, 3, 6)] = rng.dirichlet(np.ones(6))
    assert exogenous_entropy(joint) == pytest.approx(0, abs=1e-6)


@given(st.integers(0, 1000))
def test_exogenous_entropy_is_at_least_that_of_any_row(seed: int) -> None:
    joint = np.random.default_rng(seed).dirichlet(np.ones(12)).reshape(3, 4)
    rows = joint / joint.sum(axis=1, keepdims=True)
    assert exogenous_entropy(joint) >= max(entropy(row) for row in rows) - 1e-6


def test_direction_of_a_noisy_function(rng: np.random.Generator) -> None:
    x = rng.integers(0, 8, size=2000).astype(float)
    y = (x % 3) + (rng.random(2000) < 0.1)
    assert points_forward(joint_distribution(x, y))


def test_discretisation_keeps_few_values_and_bins_many(rng: np.random.Generator) -> None:
    x, y = rng.integers(0, 2, size=800).astype(float), rng.normal(size=800)
    y[:50] = np.nan
    joint = joint_distribution(x, y)
    assert joint.shape == (2, 8)
    assert joint.sum() == pytest.approx(1)
    assert joint.sum(axis=0).min() > 0.1
    assert mutual_information(joint) < 0.02
