from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.peers import PlainClassifier, largest_deviation
from care_core.learn.bug_isolation import cooperative_bug_isolation
from tests.planted import DEFAULTS, OPTIONS, SCHEMA, fly_many

NAMES = [o.name for o in OPTIONS]


@pytest.fixture(scope="module")
def frame() -> pd.DataFrame:
    return fly_many(250)


def test_the_largest_deviation_is_a_share_of_the_range() -> None:
    config = {**DEFAULTS, "speed": 6.0, "radius": 0.9, "reserve": 30.0}
    assert largest_deviation(config, DEFAULTS, SCHEMA, ["speed", "reserve", "radius"]) == ["radius", "reserve", "speed"]
    assert largest_deviation(DEFAULTS, DEFAULTS, SCHEMA, ["speed", "accel"]) == ["accel", "speed"]


@given(st.permutations(NAMES))
def test_ties_are_broken_by_name_whatever_the_order(names: list[str]) -> None:
    assert largest_deviation(DEFAULTS, DEFAULTS, SCHEMA, names) == sorted(names)


def test_bug_isolation_finds_what_refuses_to_arm(frame: pd.DataFrame) -> None:
    failed = frame.success.to_numpy() == 0
    config = {**DEFAULTS, "min_sats": 14.0, "inert": 0.9, "filter": 0.0}
    ranked = list(cooperative_bug_isolation(frame, failed, config, SCHEMA, ["filter", "inert", "min_sats"]))
    assert ranked[0] == "min_sats"
    assert sorted(ranked) == ["filter", "inert", "min_sats"]


@pytest.mark.parametrize("value", [-100.0, 1e9])
def test_bug_isolation_outside_what_was_seen(frame: pd.DataFrame, value: float) -> None:
    failed = frame.success.to_numpy() == 0
    config = {**DEFAULTS, "min_sats": value}
    assert sorted(cooperative_bug_isolation(frame, failed, config, SCHEMA, NAMES)) == sorted(NAMES)


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_bug_isolation_without_contrast_ranks_by_name(frame: pd.DataFrame, share: float) -> None:
    failed = np.full(len(frame), bool(share))
    assert list(cooperative_bug_isolation(frame, failed, DEFAULTS, SCHEMA, NAMES)) == sorted(NAMES)


def test_the_classifier_ranks_by_what_each_reset_brings(frame: pd.DataFrame) -> None:
    met_all = ((frame.success == 1) & (frame.time <= 175) & (frame.energy <= 20)).to_numpy()
    classifier = PlainClassifier(frame, met_all, NAMES)
    config = {**DEFAULTS, "min_sats": 13.0, "inert": 0.9}
    probability = classifier.probability([config, DEFAULTS])
    assert probability.shape == (2,)
    assert 0 <= probability[0] < probability[1] <= 1
    assert classifier.rank(config, DEFAULTS, ["inert", "min_sats"]) == ["min_sats", "inert"]
    again = PlainClassifier(frame, met_all, NAMES).probability([config, DEFAULTS])
    np.testing.assert_array_equal(probability, again)
