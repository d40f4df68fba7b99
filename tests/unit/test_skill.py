from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sklearn.metrics import brier_score_loss, log_loss, roc_auc_score

from care_core.learn.skill import calibration_error, cross_validated_skill, reliability, score
from care_core.profile.store import Profile
from tests.planted import SCHEMA, fly_many

PAIRS = st.lists(st.tuples(st.floats(0.01, 0.99), st.booleans()), min_size=4, max_size=60)


@given(PAIRS)
def test_scores_are_those_of_the_field(pairs: list[tuple[float, bool]]) -> None:
    p, y = np.array([a for a, _ in pairs]), np.array([float(b) for _, b in pairs])
    found = score(p, y)
    assert found is not None
    assert found.runs == len(pairs)
    assert found.base_rate == pytest.approx(y.mean())
    assert found.log_loss == pytest.approx(log_loss(y, p, labels=[0, 1]))
    assert found.brier == pytest.approx(brier_score_loss(y, p))
    assert found.auc == (pytest.approx(roc_auc_score(y, p)) if 0 < y.mean() < 1 else None)
    assert 0 <= found.calibration_error <= 1
    assert found.curve == tuple(reliability(p, y))


@given(PAIRS)
def test_every_run_is_in_one_tenth(pairs: list[tuple[float, bool]]) -> None:
    p, y = np.array([a for a, _ in pairs]), np.array([float(b) for _, b in pairs])
    rows = reliability(p, y)
    assert sum(count for _, _, count in rows) == len(pairs)
    assert all(0 <= predicted <= 1 and 0 <= seen <= 1 for predicted, seen, _ in rows)


def test_calibration_error_is_the_mean_distance() -> None:
    p = np.repeat([0.25, 0.75], [40, 60])
    y = np.r_[np.repeat([1.0, 0.0], [20, 20]), np.repeat([1.0, 0.0], [45, 15])]
    assert calibration_error(p, y) == pytest.approx(0.4 * 0.25)


def test_what_has_no_truth_or_no_probability_does_not_count() -> None:
    found = score(np.array([0.5, np.nan, 0.5]), np.array([1.0, 1.0, np.nan]))
    assert found is not None
    assert found.runs == 1
    assert score(np.array([np.nan]), np.array([1.0])) is None


def test_the_planted_robot_is_predicted_on_runs_it_has_not_seen(planted: Profile) -> None:
    skill = planted.model.skill
    assert set(skill) == {"success", "time", "energy", "all"}
    for name, found in skill.items():
        base = found.base_rate
        assert found.log_loss < 0.7 * -(base * np.log(base) + (1 - base) * np.log(1 - base)), name
        assert found.auc is not None
        assert found.auc > 0.9, name
        assert found.calibration_error < 0.1, name


@pytest.mark.long
def test_folds_are_the_same_on_any_number_of_processes(planted: Profile) -> None:
    frame = fly_many(60)
    answers = [
        cross_validated_skill(frame, SCHEMA, planted.model.graph, np.random.default_rng(0), folds=2, n_jobs=n_jobs)
        for n_jobs in (1, 2)
    ]
    assert answers[0] == answers[1]
    assert "all" in answers[0]
    assert cross_validated_skill(frame, SCHEMA, planted.model.graph, np.random.default_rng(0), folds=0) == {}
