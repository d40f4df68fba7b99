from __future__ import annotations

import numpy as np
import pytest

from care_core.causal import posteriors as module
from care_core.causal.kernel import Factor
from care_core.causal.mechanisms import Averaging
from care_core.causal.posteriors import PosteriorCache
from care_core.numbers import Floats
from care_core.records import replace
from tests.unit.test_mechanisms import mechanism

X = np.random.default_rng(3).uniform(1, 2, size=(6, 2))


def test_cached_posterior_equals_the_mechanisms_own() -> None:
    m, posteriors = mechanism(), PosteriorCache()
    here = posteriors.at(m, X[:1])
    for rows in ([0, 1, 2], [2, 0, 0, 3], [1], [3, 2, 1, 0]):
        there, alone = posteriors.at(m, X[rows]), m.posterior(X[rows])
        np.testing.assert_allclose(there.latent, alone.latent, rtol=1e-12)
        np.testing.assert_allclose(there.variance, alone.variance, rtol=1e-9)
        np.testing.assert_allclose(there.epistemic_ratio, alone.epistemic_ratio, rtol=1e-9)
        np.testing.assert_allclose(there.covariance(here), alone.covariance(m.posterior(X[:1])), rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(there.change_sd(here), alone.change_sd(m.posterior(X[:1])), rtol=1e-6)


def test_no_row_is_worked_out_twice(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[int] = []
    original = Factor.whitened

    def whitened(self: Factor, rows: Floats) -> Floats:
        asked.append(len(rows))
        return original(self, rows)

    monkeypatch.setattr(Factor, "whitened", whitened)
    m, posteriors = mechanism(), PosteriorCache()
    for rows in ([0, 1], [1, 0, 2], [2], [0, 1, 2, 2]):
        assert posteriors.at(m, X[rows]).variance.shape == (len(rows),)
    assert asked == [2, 1]


def test_inputs_that_nothing_reads_make_no_new_row() -> None:
    m = replace(mechanism(), inputs=("a", "b", "unread"))
    assert len(set(m.active_inputs(np.array([[1.0, 2.0, 3.0], [1.0, 2.0, 4.0], [1.0, 2.5, 3.0]])))) == 2
    counted = replace(m, averaging=Averaging("unread", 5.0, 0.5))
    assert len(set(counted.active_inputs(np.array([[1.0, 2.0, 3.0], [1.0, 2.0, 4.0]])))) == 2


def test_cache_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MOST", 2)
    m, posteriors = mechanism(), PosteriorCache()
    for rows in ([0, 1], [2, 3, 1], [3, 2, 1, 0, 3]):
        np.testing.assert_allclose(posteriors.at(m, X[rows]).latent, m.latent(X[rows]), rtol=1e-12)
