"""Intervals of effects count the resamples in which the graph lacks the effect as zero."""

from __future__ import annotations

import numpy as np
import pytest

from care_core.learn.train import _interval


@pytest.mark.parametrize("support", [1.0, 0.97, 0.6, 0.04])
def test_an_interval_is_that_of_effects_and_zeros_together(support: float) -> None:
    drawn = np.linspace(1.0, 2.0, 2001)
    zeros = np.zeros(round(len(drawn) * (1 - support) / support))
    expected = np.quantile(np.r_[zeros, drawn], [0.05, 0.95])
    assert _interval(drawn, support) == pytest.approx(tuple(expected), abs=0.01)
