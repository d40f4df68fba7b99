from __future__ import annotations

import numpy as np
import pandas as pd

from care_core.learn.screening import dependence, discoveries, pairwise_correlation, screen_options
from care_core.variables import Role
from tests.simulated import schema_of, simulate


def test_keeps_the_options_that_matter_and_few_others() -> None:
    frame, schema, graph = simulate(600, np.random.default_rng(0), options=8, inert=200)
    screening = screen_options(frame, schema)
    kept = set(screening.kept)
    assert {name for name in graph.nodes if name.startswith("option_")} <= kept
    assert sum(name.startswith("inert_") for name in kept) <= 5
    assert kept.isdisjoint(screening.dropped)
    assert len(kept) + len(screening.dropped) == 208


def test_sees_an_optimum_inside() -> None:
    rng = np.random.default_rng(0)
    x = rng.uniform(-1, 1, size=(300, 1))
    y = x**2 + rng.normal(size=(300, 1)) * 0.3
    assert dependence(x, y)[0, 0] < 1e-6


def test_p_values_are_uniform_without_dependence_also_with_gaps() -> None:
    rng = np.random.default_rng(0)
    x = rng.integers(0, 2, size=(300, 100)).astype(float)
    y = rng.normal(size=(300, 10))
    y[rng.random(y.shape) < 0.3] = np.nan
    p = dependence(x, y)
    assert 0.02 < (p < 0.05).mean() < 0.09


def test_a_constant_or_empty_column_depends_on_nothing() -> None:
    x = np.random.default_rng(0).normal(size=(50, 2))
    x[:, 1] = 3.0
    y = np.column_stack([np.full(50, np.nan), np.zeros(50), x[:, 0]])
    p = dependence(x, y)
    assert (p[1] == 1).all()
    assert (p[0, :2] == 1).all()
    assert p[0, 2] < 1e-9


def test_a_metric_of_accomplished_missions_says_nothing_of_success() -> None:
    success = np.repeat([0.0, 1.0], 50)[:, None]
    time_s = np.where(success == 1, np.arange(100.0)[:, None], np.nan)
    r, n = pairwise_correlation(success, time_s)
    assert r[0, 0] == 0
    assert n[0, 0] == 0


def test_benjamini_hochberg() -> None:
    assert discoveries(np.array([0.01, 0.02, 0.03, 0.9]), 0.05).tolist() == [True, True, True, False]
    assert not discoveries(np.array([0.2, 0.5]), 0.05).any()
    assert discoveries(np.array([]), 0.05).shape == (0,)


def test_row_order_does_not_matter() -> None:
    frame, schema, _ = simulate(200, np.random.default_rng(1))
    shuffled = frame.sample(frac=1, random_state=0).reset_index(drop=True)
    pd.testing.assert_frame_equal(
        screen_options(frame, schema).p_values, screen_options(shuffled, schema).p_values, atol=1e-12
    )


def test_constant_options_are_dropped() -> None:
    frame, _, _ = simulate(100, np.random.default_rng(0), options=1, inert=1, metrics=1)
    frame["inert_0"] = 1.0
    roles = {"option_0": Role.OPTION, "inert_0": Role.OPTION, "metric_0": Role.METRIC, "objective_0": Role.OBJECTIVE}
    screening = screen_options(frame, schema_of(roles))
    assert screening.dropped == ("inert_0",)


def test_rare_outcomes_do_not_pass_for_discoveries() -> None:
    """Six binary outcomes of 3 to 10 in 300 runs, independent of 30 options most of which stay at their reference."""
    rng, found = np.random.default_rng(0), 0
    for _ in range(60):
        options = np.where(rng.random((300, 30)) < 0.6, 0.5, rng.uniform(size=(300, 30)))
        outcomes = np.zeros((300, 6))
        for column, count in enumerate((3, 4, 5, 6, 8, 10)):
            outcomes[rng.choice(300, count, replace=False), column] = 1
        found += bool(discoveries(dependence(options, outcomes), 0.1).any())
    assert found <= 14, "6 of 60 expected at a rate of 0.1; 42 before counts were looked at"
