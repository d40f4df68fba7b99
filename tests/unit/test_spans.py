"""Spans of time in which something holds."""

from __future__ import annotations

import numpy as np

from care_core.ecosystems.spans import during, inside, runs, seconds_in, stretches, unbroken, within

T = np.array([0.0, 1.0, 2.0, 3.0, 10.0, 11.0])
HELD = np.array([True, True, False, True, True, False])


def test_runs_are_told_by_their_first_and_last_rows() -> None:
    assert unbroken(HELD) == [(0, 1), (3, 4)]
    assert unbroken(np.zeros(3, dtype=bool)) == [] == unbroken(np.zeros(0, dtype=bool))


def test_runs_that_are_close_are_one() -> None:
    assert runs(T, HELD) == [(0.0, 1.0), (3.0, 10.0)]
    assert runs(T, HELD, gap_s=2.0) == [(0.0, 10.0)]


def test_stretches_end_where_nothing_is_recorded() -> None:
    assert stretches(T, HELD, 5.0) == [(0.0, 3.0), (10.0, 10.0)]


def test_a_start_is_part_of_a_span_and_no_part_of_what_froze_there() -> None:
    assert during([(1.0, 3.0)], T).tolist() == [False, True, True, True, False, False]
    assert inside([(1.0, 3.0)], T).tolist() == [False, False, True, True, False, False]
    assert within([(1.0, 3.0)], 1.0)
    assert within([(1.0, 3.0)], 3.0)
    assert not within([], 1.0)


def test_spans_are_so_long_together() -> None:
    assert seconds_in([(0.0, 1.5), (2.0, 3.0)]) == 2.5
    assert seconds_in([]) == 0.0
