from __future__ import annotations

from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st

from care_core.causal.model import Summary
from care_core.diagnose.faults import judge, thresholds_in_force
from care_core.run import Unavailable
from care_core.variables import Threshold
from tests.planted import SCHEMA, TIME, planted_run, with_variable

BOUNDS = thresholds_in_force(SCHEMA, {})
SUMMARIES = {"time": Summary(count=100, mean=150, spread=20, quantiles=tuple(100.0 + 5 * i for i in range(21)))}


def test_the_profiles_thresholds_hold_unless_the_operator_says_otherwise() -> None:
    assert {v.name: v.threshold for v in SCHEMA.objectives} == BOUNDS
    assert thresholds_in_force(SCHEMA, {"time": 90.0})["time"] == Threshold("<=", 90.0)
    assert thresholds_in_force(SCHEMA, {"success": 0.5})["success"] == Threshold(">=", 0.5)


def test_an_operators_threshold_where_the_profile_has_none() -> None:
    bare = with_variable(SCHEMA, replace(TIME, threshold=None))
    assert "time" not in thresholds_in_force(bare, {})
    assert thresholds_in_force(bare, {"time": 90.0})["time"] == Threshold("<=", 90.0)


@given(st.floats(0, 1e4), st.floats(0, 1e4))
def test_a_fault_is_a_value_beyond_its_threshold(value: float, bound: float) -> None:
    run = replace(planted_run(), objectives={"time": value})
    result = judge(run, SCHEMA, {"time": Threshold("<=", bound)}, SUMMARIES)[1]
    assert result.status == ("ok" if value <= bound else "fault")
    assert result.value == value
    assert result.percentile is not None
    assert 0 <= result.percentile <= 1


def test_every_objective_is_judged_in_the_profiles_order() -> None:
    results = judge(planted_run(accel=3.9), SCHEMA, BOUNDS, SUMMARIES)
    assert [(r.variable.name, r.status) for r in results] == [("success", "ok"), ("time", "ok"), ("energy", "fault")]
    assert [r.percentile is None for r in results] == [True, False, True]


def test_what_could_not_be_had_is_neither_zero_nor_ok() -> None:
    gone = Unavailable("no BAT in the log", "set LOG_BITMASK")
    run = replace(planted_run(), objectives={"success": 1.0, "energy": gone})
    _, time, energy = judge(run, SCHEMA, BOUNDS, SUMMARIES)
    assert (energy.status, energy.value, energy.reason) == (
        "not_evaluated",
        None,
        "no BAT in the log (set LOG_BITMASK)",
    )
    assert (time.status, time.value) == ("not_evaluated", None)
    assert "does not say how" in time.reason


def test_without_a_threshold_the_value_is_shown_but_not_judged() -> None:
    time = judge(planted_run(), SCHEMA, {}, SUMMARIES)[1]
    assert time.status == "not_evaluated"
    assert time.value is not None
    assert "--threshold" in time.reason
