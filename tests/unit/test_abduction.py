"""The conditional of a planted joint Gaussian, against simulation."""

from __future__ import annotations

import numpy as np
import pytest

from care_core.causal.abduction import Kinship, next_passes, next_value

KIN = Kinship(variance=np.array([1.0, 1.5]), covariance=np.array([0.7, 0.4]), here=1.0, repeated=0.7)
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
    centre, sd = next_value(KIN, np.array([5.0, 5.0]), 3.0, np.array(seen) + 3.0)
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
    found = next_passes(KIN, np.array([here, chance]), here, passed)
    assert found[1] == pytest.approx((after[match] < threshold).mean(), abs=0.01)
