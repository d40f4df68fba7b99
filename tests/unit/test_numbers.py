"""Small questions about numbers: the answers of the plain way, which holds everything at once."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from care_core.ecosystems.ardupilot.statistics import means, smooth
from care_core.ecosystems.timeline import gaps
from care_core.logs.base import Table
from care_core.numbers import Floats, known_median, median, pauses, quantile

TIMES = st.lists(st.integers(0, 60).map(float), max_size=40)


@settings(deadline=None)
@given(st.lists(TIMES, max_size=4), st.sampled_from([0.5, 2.0, 7.0]))
def test_pauses_are_those_of_all_values_in_one_row(series: list[list[float]], longer_than: float) -> None:
    together = np.sort(np.concatenate([np.empty(0), *map(np.array, series)]))
    apart = np.flatnonzero(np.diff(together) > longer_than)
    before, after = pauses(map(np.array, series), longer_than)
    assert before.tolist() == together[apart].tolist()
    assert after.tolist() == together[apart + 1].tolist()


def test_what_counts_as_a_gap_is_told_by_all_messages_together() -> None:
    """Every second a message: nothing for 15 s is no gap, for 70 s it is. Among messages at 100 Hz 15 s are one."""
    slow = np.concatenate((np.arange(0.0, 60.0), np.arange(75.0, 120.0), np.arange(190.0, 240.0)))
    fast = np.concatenate((np.arange(0.0, 60.0, 0.01), np.arange(75.0, 120.0, 0.01)))
    told = [moment.text for moment in gaps([Table(slow, {})], [(0.0, 240.0)])]
    assert told == ["nothing is recorded for 71.0 s while armed"]
    told = [moment.text for moment in gaps([Table(slow, {}), Table(fast, {})], [(0.0, 240.0)])]
    assert told == ["nothing is recorded for 70.0 s while armed, the longest of 2 gaps"]


@settings(deadline=None, max_examples=30)
@given(st.lists(st.floats(-1e6, 1e6), min_size=3, max_size=60), st.floats(0.01, 5.0))
def test_a_smoothed_row_is_the_mean_of_a_window(values: list[float], width_s: float) -> None:
    t, x = np.arange(len(values), dtype=np.float64) * 0.1, np.array(values)
    kept = x.copy()
    n = min(max(round(width_s / 0.1) | 1, 3), len(t) if len(t) % 2 else len(t) - 1)
    total = np.cumsum(np.concatenate(([0.0], np.pad(x, n // 2, mode="edge"))))
    np.testing.assert_array_equal(smooth(t, x, width_s), (total[n:] - total[:-n]) / n)
    np.testing.assert_array_equal(x, kept)


ROWS = arrays(np.float64, st.tuples(st.integers(1, 9), st.integers(1, 4)), elements=st.floats(allow_infinity=False))


@given(ROWS, st.sampled_from([None, 0, 1]))
def test_a_median_is_the_one_that_numpy_answers(values: Floats, axis: int | None) -> None:
    with np.errstate(all="ignore"):
        np.testing.assert_array_equal(median(values, axis=axis), np.median(values, axis=axis))


@given(arrays(np.float64, st.integers(1, 30), elements=st.floats(allow_infinity=False)), st.floats(0, 1))
def test_a_quantile_is_the_one_that_numpy_answers(values: Floats, share: float) -> None:
    with np.errstate(all="ignore"):
        np.testing.assert_array_equal(quantile(values, share), np.quantile(values, share))


def test_a_median_of_what_is_known() -> None:
    assert known_median(np.array([np.nan, 3.0, 1.0, np.nan, 7.0])) == 3.0
    assert np.isnan(known_median(np.array([np.nan])))


def test_nothing_has_no_median() -> None:
    assert np.isnan(median([]))
    assert np.isnan(quantile([], 0.5))
    assert np.isnan(median(np.empty((0, 3)), axis=0)).tolist() == [True] * 3


@pytest.mark.parametrize("values", [[3, 1, 2, 4], np.array([1, 2], dtype=np.uint8), np.array([1.5, 0.1], np.float32)])
def test_whole_and_single_numbers_too(values: Any) -> None:
    assert median(values) == np.median(values)
    assert quantile(values, 0.3) == pytest.approx(float(np.quantile(values, 0.3)))


@settings(deadline=None, max_examples=30)
@given(
    st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=60), st.lists(st.integers(0, 60), max_size=5), st.integers(0, 9)
)
def test_means_are_the_same_wherever_rows_are_cut(values: list[float], cuts: list[int], half: int) -> None:
    x = np.array([values, values[::-1]])
    whole = np.concatenate([*means([x], 2 * half + 1)], axis=1)
    in_parts = np.concatenate([*means(np.split(x, sorted(cuts), axis=1), 2 * half + 1)], axis=1)
    assert whole.shape == x.shape
    np.testing.assert_array_equal(in_parts, whole)
