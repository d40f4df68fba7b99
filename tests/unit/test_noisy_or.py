"""A noisy-OR of causes, held against missions that are drawn from it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_core.diagnose.estimates import REPEATS
from care_core.diagnose.noisy_or import CHANCE, Key, NoisyOr

A: Key = ("parameter", "a")
B: Key = ("hardware", "b")
C: Key = ("world", "c")
CAUSES = NoisyOr({A: 0.5, B: 0.2, C: 0.1, CHANCE: 0.3})
losing = st.dictionaries(st.sampled_from([A, B, C, CHANCE]), st.floats(0.01, 1.0), min_size=1)


def drawn(model: NoisyOr, count: int = 200_000) -> tuple[dict[Key, np.ndarray], np.ndarray]:
    """Which causes act in missions, and which of these were lost."""
    rng = np.random.default_rng(1)
    acts = {key: rng.random(count) < share for key, share in model.loses.items()}
    return acts, np.logical_or.reduce(list(acts.values()))


def test_what_acts_is_as_often_as_in_missions_that_were_drawn() -> None:
    acts, lost = drawn(CAUSES)
    for key in CAUSES.loses:
        assert CAUSES.acts(key) == pytest.approx(acts[key][lost].mean(), abs=0.005)
    either = (acts[A] | acts[B])[lost].mean()
    assert CAUSES.acts_among([A, B]) == pytest.approx(either, abs=0.005)


def test_a_ranking_says_what_acts_where_nothing_above_it_does() -> None:
    acts, lost = drawn(CAUSES)
    above = np.zeros(len(lost), dtype=bool)
    ranking = CAUSES.ranking()
    assert list(ranking) == [A, CHANCE, B, C]
    for key, share in ranking.items():
        assert share == pytest.approx((acts[key] & ~above)[lost].mean(), abs=0.005)
        above |= acts[key]


@pytest.mark.parametrize("gone", [(), (A,), (B,), (A, B), (A, B, C)])
def test_a_repair_holds_as_often_as_in_missions_that_are_drawn_again(gone: tuple[Key, ...]) -> None:
    acts, lost = drawn(CAUSES)
    again = np.random.default_rng(2).random(len(lost)) < REPEATS.value
    stays = acts[CHANCE] & again
    for key in (A, B, C):
        stays |= acts[key] & (key not in gone)
    assert CAUSES.repaired(gone) == pytest.approx((~stays)[lost].mean(), abs=0.005)


def test_a_parameter_that_is_set_aside_leaves_the_others_what_they_are_in_missions_without_it() -> None:
    acts, lost = drawn(CAUSES)
    lost = lost & ~acts[A]
    left = CAUSES.without({"a"})
    for key in (B, C, CHANCE):
        assert left.acts(key) == pytest.approx(acts[key][lost].mean(), abs=0.005)
    assert left.acts(A) == 0.0


@given(losing)
def test_a_ranking_adds_up_to_one_in_order(loses: dict[Key, float]) -> None:
    shares = list(NoisyOr(loses).ranking().values())
    assert sum(shares) == pytest.approx(1.0)
    assert shares == sorted(shares, reverse=True)


@given(losing)
def test_a_repair_is_worth_no_more_than_what_it_takes_away_explains(loses: dict[Key, float]) -> None:
    model = NoisyOr(loses)
    driven = model.repaired(())
    for key in (A, B, C):
        better = model.repaired([key])
        assert driven - 1e-9 <= better <= driven + model.acts(key) + 1e-9
        assert better <= 1.0 - max((model.acts(other) for other in (A, B, C) if other != key), default=0.0) + 1e-9


def test_a_part_that_is_about_as_likely_as_a_parameter_is_told_first() -> None:
    assert list(NoisyOr({A: 0.88, B: 0.87}).ranking()) == [B, A]
    assert list(NoisyOr({A: 0.95, B: 0.87}).ranking()) == [A, B]
    assert list(NoisyOr({A: 0.12, B: 0.1}).ranking()) == [A, B]


def test_a_run_that_nothing_explains_is_not_promised() -> None:
    assert NoisyOr({CHANCE: 0.0}).repaired(()) == 0.0
    assert NoisyOr({}).acts(A) == 0.0
