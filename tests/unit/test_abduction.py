"""The conditional of a planted joint Gaussian, against simulation."""

from __future__ import annotations

import numpy as np
import pytest

from care_core.causal.abduction import ErrorCovariance, by_mediators, next_passes, next_value

ERRORS = ErrorCovariance(variance=np.array([1.0, 1.5]), covariance=np.array([0.7, 0.4]), here=1.0, repeated=0.7)
RNG = np.random.default_rng(0)


def draw(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Errors of two runs here, and of the next at the second configuration."""
    covariance = [[1.0, 0.7, 0.4], [0.7, 1.0, 0.4], [0.4, 0.4, 1.5]]
    first, second, after = RNG.multivariate_normal(np.zeros(3), covariance, n).T
    return first, second, after


@pytest.mark.parametrize("runs", [1, 2])
def test_values_are_conditioned_as_simulated(runs: int) -> None:
    first, second, after = draw(400_000)
    near = np.abs(first - 1.0) < 0.1
    seen = [1.0]
    if runs == 2:
        near &= np.abs(second - 1.4) < 0.1
        seen.append(1.4)
    centre, sd = next_value(ERRORS, np.array([5.0, 5.0]), 3.0, np.array(seen) + 3.0)
    assert centre[1] == pytest.approx(5.0 + after[near].mean(), abs=0.05)
    assert sd[1] == pytest.approx(after[near].std(), abs=0.05)


@pytest.mark.parametrize("passed", [[False], [True], [False, False], [False, True]])
def test_passing_is_conditioned_as_simulated(passed: list[bool]) -> None:
    first, second, after = draw(400_000)
    threshold = 0.3
    match = np.ones(len(first), dtype=bool)
    for errors, ok in zip((first, second), passed, strict=False):
        match &= (errors < threshold) == ok
    here, chance = float((first < threshold).mean()), float((after < threshold).mean())
    found = next_passes(ERRORS, np.array([here, chance]), here, passed)
    assert found[1] == pytest.approx((after[match] < threshold).mean(), abs=0.01)


def test_what_an_outcome_would_have_been_is_read_off_the_metrics_on_its_way() -> None:
    among, weights = np.array([[1.0, 0.3], [0.3, 1.0]]), np.array([0.6, -0.5])
    kept = np.array([0.8, 0.2])
    left_over = RNG.multivariate_normal(np.zeros(2), among - among * np.outer(kept, kept), 100_000)
    after = kept * np.array([1.0, -1.0]) + left_over
    outcome = after @ weights + np.sqrt(1 - weights @ among @ weights) * RNG.normal(size=len(after))
    # In their own units the metrics' errors are twice and three times as large, the second's half as large at x'.
    covariances = [
        ErrorCovariance(variance=np.array([4.0]), covariance=np.array([0.8 * 4.0]), here=4.0, repeated=2.0),
        ErrorCovariance(variance=np.array([2.25]), covariance=np.array([0.2 * 4.5]), here=9.0, repeated=2.0),
    ]
    centre, left = by_mediators(covariances, np.array([[2.0, -3.0]]), weights, among)
    assert centre[0] == pytest.approx(outcome.mean(), abs=0.03)
    assert left[0] == pytest.approx(outcome.var(), abs=0.03)


def test_metrics_that_do_not_persist_say_nothing() -> None:
    covariances = [ErrorCovariance(variance=np.ones(3), covariance=np.zeros(3), here=1.0, repeated=0.0)]
    centre, left = by_mediators(covariances, np.array([[2.0]]), np.array([0.9]), np.eye(1))
    assert centre.tolist() == [0.0] * 3
    assert left.tolist() == [1.0] * 3
