from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import f as f_distribution

from care_core.causal.graph import CausalGraph
from care_core.learn.completion import complete
from care_core.learn.constraints import Constraints
from care_core.learn.regression import Regressions, features
from care_core.learn.structure import learn_structure
from care_core.learn.table import normal_scores
from care_core.numbers import Floats
from care_core.profile.schema import Schema
from care_core.variables import Role
from tests.simulated import schema_of
from tests.whole import examples

O, M, Y = Role.OPTION, Role.METRIC, Role.OBJECTIVE  # noqa: E741


def empty(schema: Schema, *edges: tuple[str, str]) -> CausalGraph:
    return CausalGraph(tuple(schema.variables), frozenset(edges))


def table(count: int, seed: int, **columns: Floats) -> pd.DataFrame:
    """Three options drawn evenly from -1 to 1, and the columns."""
    rng = np.random.default_rng(seed)
    made: pd.DataFrame = pd.DataFrame({**{name: rng.uniform(-1, 1, count) for name in "abc"}, **columns})
    return made


def exact_p(frame: pd.DataFrame, name: str, held: list[str], target: str) -> float:
    """The F-test of two nested least-squares fits, ranks counted."""
    y = normal_scores(frame[target].to_numpy(dtype=float))

    def fit(names: list[str]) -> tuple[float, int]:
        x = np.column_stack([np.ones(len(y)), *(features(frame[n].to_numpy(dtype=float)) for n in names)])
        coefficients = np.linalg.lstsq(x, y, rcond=None)[0]
        return float(((y - x @ coefficients) ** 2).sum()), int(np.linalg.matrix_rank(x))

    (left, used), (less, more) = fit(held), fit([*held, name])
    freedom = len(y) - more
    return float(f_distribution.sf((left - less) / (more - used) / (less / freedom), more - used, freedom))


def test_an_optimum_inside_a_range_is_found() -> None:
    frame = table(400, 0)
    rng = np.random.default_rng(1)
    frame = frame.assign(m=frame.a**2 + 0.3 * rng.normal(size=400), y=rng.normal(size=400))
    schema = schema_of({"a": O, "b": O, "c": O, "m": M, "y": Y})
    found = complete(frame, schema, empty(schema), ["a", "b", "c"])
    assert ("a", "m") in found.graph.directed
    assert found.direct == ()
    assert any(note.startswith("a -> m was added") for note in found.notes)


def test_an_effect_that_a_metric_carries_joins_the_metric_to_the_objective() -> None:
    frame = table(400, 0)
    rng = np.random.default_rng(1)
    m = frame.a + 0.2 * rng.normal(size=400)
    frame = frame.assign(m=m, other=frame.b + 0.2 * rng.normal(size=400), y=m + 0.2 * rng.normal(size=400))
    schema = schema_of({"a": O, "b": O, "c": O, "m": M, "other": M, "y": Y})
    found = complete(frame, schema, empty(schema, ("a", "m"), ("b", "other")), ["a", "b", "c"], rate=0.01)
    assert found.graph.directed == {("a", "m"), ("b", "other"), ("m", "y")}
    assert found.direct == ()


def test_an_effect_beyond_all_metrics_gets_a_direct_edge() -> None:
    frame = table(400, 0)
    rng = np.random.default_rng(1)
    m = frame.a + 0.2 * rng.normal(size=400)
    frame = frame.assign(m=m, y=np.exp(m) + frame.b + 0.2 * rng.normal(size=400))
    schema = schema_of({"a": O, "b": O, "c": O, "m": M, "y": Y})
    found = complete(frame, schema, empty(schema, ("a", "m"), ("m", "y")), ["a", "b", "c"], rate=0.01)
    assert found.graph.directed == {("a", "m"), ("m", "y"), ("b", "y")}
    ((option, objective, p),) = found.direct
    assert (option, objective) == ("b", "y")
    assert p < 1e-9
    assert [edge[:2] for edge in learn_structure(frame, schema, rng=rng).direct] == [("b", "y")]


def test_what_the_graph_explains_is_left_alone() -> None:
    frame = table(300, 0)
    rng = np.random.default_rng(1)
    m = frame.a + 0.2 * rng.normal(size=300)
    frame = frame.assign(m=m, y=m + 0.2 * rng.normal(size=300))
    schema = schema_of({"a": O, "b": O, "c": O, "m": M, "y": Y})
    graph = empty(schema, ("a", "m"), ("m", "y"))
    found = complete(frame, schema, graph, ["a", "b", "c"], rate=0.01)
    assert found.graph == graph
    assert found.notes == ()


def test_options_that_do_nothing_get_no_edge_at_the_given_rate() -> None:
    """Under the complete null the false discovery rate is the chance that any edge is added at all."""
    schema = schema_of({"a": O, "b": O, "c": O, "m": M, "n": M, "y": Y})
    any_added = 0
    for seed in range(100):
        rng = np.random.default_rng(1000 + seed)
        frame = table(80, seed, m=rng.normal(size=80), n=rng.exponential(size=80), y=rng.normal(size=80))
        any_added += bool(complete(frame, schema, empty(schema), ["a", "b", "c"], rate=0.1).graph.directed)
    assert any_added <= 19  # binomial(100, 0.1): more in 0.2% of the cases


def test_constraints_and_acyclicity_are_respected() -> None:
    """The metric that carries the effect must not close a cycle, nor an objective cause anything."""
    frame = table(300, 0)
    rng = np.random.default_rng(1)
    m = frame.a + 0.1 * rng.normal(size=300)
    n = m + frame.b + 0.1 * rng.normal(size=300)
    frame = frame.assign(m=m, n=n, y=n + 0.1 * rng.normal(size=300), z=n + 0.5 * rng.normal(size=300))
    schema = schema_of({"a": O, "b": O, "c": O, "m": M, "n": M, "y": Y, "z": Y})
    found = complete(frame, schema, empty(schema, ("n", "m"), ("y", "z")), ["a", "b", "c"])
    rules = Constraints.of(schema)
    added = found.graph.directed - {("n", "m"), ("y", "z")}
    assert added
    assert all(edge == (a, y) for edge in added if rules.forbids(*edge) for a, y, _ in found.direct if (a, y) == edge)
    assert {e for e in added if rules.forbids(*e)} == {(a, y) for a, y, _ in found.direct}
    assert len(found.graph.topological_order()) == len(schema.variables)


@settings(deadline=None, max_examples=examples(30))
@given(st.integers(0, 10**6))
def test_the_graph_only_grows(seed: int) -> None:
    rng = np.random.default_rng(seed)
    frame = table(60, seed)
    frame = frame.assign(m=frame.a + rng.normal(size=60), n=frame.b * frame.c + rng.normal(size=60))
    frame = frame.assign(y=frame.m + frame.n + frame.c)
    schema = schema_of({"a": O, "b": O, "c": O, "m": M, "n": M, "y": Y})
    start = empty(schema, ("m", "n"))
    found = complete(frame, schema, start, ["a", "b", "c"])
    assert start.directed <= found.graph.directed
    assert len(found.notes) == len(found.graph.directed - start.directed)
    assert {(a, y) for a, y, _ in found.direct} == {e for e in found.graph.directed if e[0] in "abc" and e[1] == "y"}


@pytest.mark.parametrize("share", [0.1, 0.5])
def test_one_fit_and_one_by_one_give_the_exact_test(share: float) -> None:
    """A yes-or-no option adds one column, not two: its magnitude repeats its score."""
    rng = np.random.default_rng(0)
    frame = table(200, 0, flag=(rng.random(200) < share).astype(float), code=rng.integers(0, 3, 200).astype(float))
    frame = frame.assign(y=frame.a + 0.3 * frame.flag + rng.normal(size=200) / 2)
    names = ["a", "b", "c", "flag", "code"]
    others = {name: [n for n in names if n != name] for name in names}
    together = Regressions(frame).p_of_each(names, "y")
    np.testing.assert_allclose(
        together, [Regressions(frame).p_of(name, others[name], "y") for name in names], rtol=1e-6
    )
    np.testing.assert_allclose(together, [exact_p(frame, name, others[name], "y") for name in names], rtol=1e-6)


def test_more_options_than_the_runs_can_carry() -> None:
    """Not all can be held at once; the one that matters is still found, and p-values stay p-values."""
    rng = np.random.default_rng(0)
    n, many = 60, 40
    frame = pd.DataFrame({f"x{i}": rng.uniform(size=n) for i in range(many)})
    frame["y"] = frame.x7 + 0.1 * rng.normal(size=n)
    p = Regressions(frame).p_of_each([f"x{i}" for i in range(many)], "y")
    assert ((p >= 0) & (p <= 1)).all()
    assert p.argmin() == 7


def test_constants_and_targets_without_values_give_one() -> None:
    frame = table(40, 0, constant=np.ones(40), y=np.ones(40), z=np.full(40, np.nan))
    assert Regressions(frame).p_of_each(["a", "constant"], "y").tolist() == [1.0, 1.0]
    assert Regressions(frame).p_of_each(["a", "constant"], "z").tolist() == [1.0, 1.0]
    assert Regressions(frame.assign(y=frame.a)).p_of_each(["a", "constant"], "y")[1] == 1.0


def test_columns_that_repeat_each_other_are_counted_once() -> None:
    """An option that alone decides whether a mission flies adds nothing to a metric that only flights have."""
    rng = np.random.default_rng(0)
    flew = rng.random(200) < 0.6
    flight = {name: np.where(flew, rng.normal(size=200), np.nan) for name in ("m", "second")}
    frame = table(200, 0, permit=flew.astype(float), y=flew + 0.3 * rng.normal(size=200), **flight)
    assert Regressions(frame).p_of("permit", ["a"], "y") < 1e-9
    assert Regressions(frame).p_of("permit", ["a", "m"], "y") == 1.0
    assert Regressions(frame).p_of("second", ["m"], "y") > 0.01
    names = ["m", "second", "a"]
    exact = [exact_p(frame, name, [n for n in names if n != name], "y") for name in names]
    np.testing.assert_allclose(Regressions(frame).p_of_each(names, "y"), exact, rtol=1e-6)
