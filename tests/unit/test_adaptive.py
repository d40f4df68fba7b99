"""Adaptive sampling on planted models: it goes where nothing is known, and parts two suspects."""

from __future__ import annotations

import math

import numpy as np
import pytest

from care_core.collect.adaptive import Known, choose
from tests.campaigns import space

pytest.importorskip("sklearn")

UNIT = dict.fromkeys("abcd", (0.0, 1.0))


def test_it_goes_where_the_objective_is_known_least() -> None:
    """Only `a` matters. It was tried below 0.5, and `d`, which is of no account, too: to go above tells more of `a`."""
    rng = np.random.default_rng(0)
    configs = [dict(zip("abcd", (*rng.uniform(0, 1, 3), rng.uniform(0, 0.5)), strict=True)) for _ in range(60)]
    for config in configs:
        config["a"] /= 2
    values = [math.sin(6 * config["a"]) + 0.05 * rng.normal() for config in configs]
    chosen = choose(space(UNIT), Known(configs, {"time": values}), 8, at_reference=0.0, seed=1)
    assert all(config["a"] > 0.5 for config in chosen[:4])
    assert np.ptp([config["a"] for config in chosen]) > 0.2  # each reckons with those chosen before it


def test_two_suspects_that_moved_together_are_parted() -> None:
    rng = np.random.default_rng(0)
    both = rng.uniform(0, 1, 40)
    configs = [{"a": v, "b": v, "c": rng.uniform(), "d": rng.uniform()} for v in both]
    values = [2 * config["a"] + 0.1 * rng.normal() for config in configs]
    known = Known(configs, {"time": values})
    chosen = choose(space(UNIT), known, 6, at_reference=0.0, seed=1, apart=("a", "b"))
    assert all(abs(config["a"] - config["b"]) > 0.5 for config in chosen)
    assert {config["a"] > config["b"] for config in chosen} == {True, False}


def test_what_is_chosen_keeps_limits_and_the_seed_decides() -> None:
    where = space(UNIT, "a + b <= 1.2")
    configs = [{"a": v, "b": 1 - v, "c": 0.5, "d": v} for v in np.linspace(0, 1, 12)]
    known = Known(configs, {"time": [c["a"] for c in configs], "success": [math.nan] * 12})
    chosen = choose(where, known, 10, at_reference=0.5, seed=3)
    assert all(where.allows(config) for config in chosen)
    assert chosen == choose(where, known, 10, at_reference=0.5, seed=3)


def test_before_anything_is_known_the_points_are_spread() -> None:
    chosen = choose(space(UNIT), Known([], {"time": []}), 5, at_reference=0.0, seed=1)
    assert len(chosen) == 5
