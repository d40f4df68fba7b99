"""Tolerance limits against the distributions that they come from."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from care_core.diagnose.tolerance import CONFIDENCE, CONTENT, FEW, MANY, factor, upper_quantile

Z = float(stats.norm.ppf(CONTENT))


@pytest.mark.parametrize("count", [2, 3, 5, 10, 30, 58])
@pytest.mark.parametrize("confidence", [1 - CONFIDENCE, CONFIDENCE])
def test_the_factor_is_that_of_the_noncentral_t(count: int, confidence: float) -> None:
    exact = stats.nct.ppf(confidence, count - 1, Z * count**0.5) / count**0.5
    assert factor(count, count - 1, confidence) == pytest.approx(exact, rel=2e-3)


def test_a_known_spread_needs_no_more_than_the_normal() -> None:
    assert factor(4, None, 0.5) == pytest.approx(Z)
    assert factor(1, None, CONFIDENCE) == pytest.approx(2 * Z)


def test_the_largest_of_59_is_a_limit_whatever_the_distribution() -> None:
    assert MANY == 59
    found = upper_quantile([float(n) for n in range(59)])
    assert found is not None
    assert (found.high, found.method) == (58.0, "distribution-free")


def test_the_interval_holds_the_quantile_as_often_as_it_says() -> None:
    rng, inside, above = np.random.default_rng(0), 0, 0
    for _ in range(400):
        found = upper_quantile(rng.normal(size=12).tolist())
        assert found is not None
        inside += found.low <= Z <= found.high
        above += found.high >= Z
    assert 0.86 < inside / 400 < 0.94
    assert 0.92 < above / 400 < 0.98


def test_few_runs_need_a_spread_from_elsewhere_and_never_shrink_it() -> None:
    assert upper_quantile([1.0] * (FEW - 1)) is None
    one = upper_quantile([0.0], known_spread=0.1)
    assert one is not None
    assert one.high == pytest.approx(2 * Z * 0.1)
    alike = upper_quantile([0.0] * 10, known_spread=0.1)
    assert alike is not None
    assert alike.high > 0.2
