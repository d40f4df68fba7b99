from __future__ import annotations

import numpy as np
import pytest

from care_core.learn.bootstrap import support as measure_support
from tests.simulated import simulate


def test_true_edges_come_again_and_chance_edges_do_not() -> None:
    frame, schema, truth = simulate(800, np.random.default_rng(3))
    support = measure_support(frame, schema, resamples=10, rng=np.random.default_rng(0))
    assert all(0 < share <= 1 for share in support.values())
    from_options = {edge for edge in truth.directed if edge[0].startswith("option_")}
    assert np.mean([support.get(edge, 0.0) for edge in from_options]) > 0.8
    false = [share for edge, share in support.items() if isinstance(edge, tuple) and edge[0].startswith("inert_")]
    assert max(false, default=0.0) <= 0.5


@pytest.mark.long
def test_same_seed_same_answer_whatever_the_number_of_processes() -> None:
    frame, schema, _ = simulate(80, np.random.default_rng(0), hidden=1, noise=2.0)
    one = measure_support(frame, schema, resamples=3, rng=np.random.default_rng(5), n_jobs=1)
    two = measure_support(frame, schema, resamples=3, rng=np.random.default_rng(5), n_jobs=2)
    other = measure_support(frame, schema, resamples=3, rng=np.random.default_rng(6), n_jobs=1)
    assert one == two
    assert one != other


def test_a_resample_without_a_rare_outcome_counts_as_none() -> None:
    frame, schema, _ = simulate(60, np.random.default_rng(0))
    frame["objective_0"] = 0.0
    frame.loc[0, "objective_0"] = 1.0
    support = measure_support(frame, schema, resamples=6, rng=np.random.default_rng(0))
    assert max(support.values(), default=0.0) < 1.0


def test_no_resamples_no_support() -> None:
    frame, schema, _ = simulate(60, np.random.default_rng(0))
    assert measure_support(frame, schema, resamples=0, rng=np.random.default_rng(0)) == {}
