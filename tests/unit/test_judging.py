from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from care_core.causal.graph import CausalGraph
from care_core.causal.model import Model, Summary, Training
from care_core.diagnose.judging import judge, thresholds_in_force
from care_core.records import replace
from care_core.run import Unavailable, Value
from care_core.variables import Threshold
from tests.planted import SCHEMA, TIME, planted_run, with_variable

BOUNDS = thresholds_in_force(SCHEMA, {})
SUMMARIES = {"time": Summary(count=100, mean=150, sd=20, quantiles=tuple(100.0 + 5 * i for i in range(21)))}
MODEL = Model(
    schema_digest="", graph=CausalGraph(()), edges={}, bidirected=(), effects={}, paths={}, outcomes={},
    summaries=SUMMARIES, skill={}, training=Training(origin="", runs=100, seed=0, alpha=0.01, resamples=0),
)  # fmt: skip


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
    run = replace(planted_run(), objectives={"success": 1.0, "time": value})
    result = judge(run, SCHEMA, MODEL, {"time": bound}).results[1]
    assert result.status == ("ok" if value <= bound else "fault")
    assert result.value == value
    assert result.percentile is not None
    assert 0 <= result.percentile <= 1


def test_every_objective_is_judged_in_the_profiles_order() -> None:
    results = judge(planted_run(accel=3.9), SCHEMA, MODEL).results
    assert [(r.variable.name, r.status) for r in results] == [("success", "ok"), ("time", "ok"), ("energy", "fault")]
    assert [r.percentile is None for r in results] == [True, False, True]


def test_what_could_not_be_had_is_neither_zero_nor_ok() -> None:
    gone = Unavailable("no BAT in the log", "set LOG_BITMASK")
    run = replace(planted_run(), objectives={"success": 1.0, "energy": gone})
    _, time, energy = judge(run, SCHEMA, MODEL).results
    assert (energy.status, energy.value, energy.reason) == (
        "not_evaluated",
        None,
        "no BAT in the log (set LOG_BITMASK)",
    )
    assert (time.status, time.value) == ("not_evaluated", None)
    assert "does not say how" in time.reason


@pytest.mark.parametrize(("success", "told"), [(0.0, "not judged: the mission was not completed"), (1.0, "BAT says")])
def test_a_sensor_that_never_varied_is_none_to_doubt_of_what_never_set_out(success: float, told: str) -> None:
    same = Unavailable("BAT says the same throughout", "check the sensor", never_varied=True)
    run = replace(planted_run(), objectives={"success": success, "energy": same})
    assert judge(run, SCHEMA, MODEL).results[2].reason.startswith(told)


def test_without_a_threshold_the_value_is_shown_but_not_judged() -> None:
    bare = with_variable(SCHEMA, replace(TIME, threshold=None))
    time = judge(planted_run(), bare, MODEL).results[1]
    assert time.status == "not_evaluated"
    assert time.value is not None
    assert "--threshold" in time.reason


@pytest.mark.parametrize(
    ("success", "why"),
    [
        (0.0, "the mission was not completed"),
        (Unavailable("told so"), "whether the mission was completed is not known"),
    ],
)
def test_a_mission_that_was_not_accomplished_has_no_time(success: Value, why: str) -> None:
    run = replace(planted_run(), objectives={**planted_run().objectives, "success": success})
    judged = judge(run, SCHEMA, MODEL, {"time": 90.0})
    for name in ("time", "energy"):
        value = judged.run.objectives[name]
        assert isinstance(value, Unavailable)
        assert value.reason == f"not judged: {why}"


@pytest.mark.parametrize(
    ("shortfall", "status"),
    [
        (("the battery failsafe acted at 124.1 s",), "fault"),
        (("2 of 5 mission items were reached", "the battery failsafe acted at 124.1 s"), "not_evaluated"),
        ((), "not_evaluated"),
    ],
)
@pytest.mark.parametrize("grows", [True, False])
def test_a_failsafe_that_came_into_a_mission_excuses_no_time_past_its_limit(
    shortfall: tuple[str, ...], status: str, grows: bool
) -> None:
    schema = with_variable(SCHEMA, replace(TIME, grows=grows))
    run = replace(planted_run(), objectives={"success": 0.0, "time": 1e4, "energy": 1.0}, shortfall=shortfall)
    assert judge(run, schema, MODEL).results[1].status == (status if grows else "not_evaluated")
    short = replace(run, objectives={**run.objectives, "time": 1.0})
    assert judge(short, schema, MODEL).results[1].status == "not_evaluated"


@pytest.mark.parametrize(("taken_s", "status"), [(1e4, "fault"), (1.0, "not_evaluated")])
def test_a_mission_that_a_failsafe_broke_off_past_its_time_took_too_long(taken_s: float, status: str) -> None:
    schema = with_variable(SCHEMA, replace(TIME, grows=True, unit="s"))
    run = planted_run()
    left = replace(run.mission, left_s=run.mission.start_s + taken_s)
    short = ("2 of 5 mission items were reached", "the battery failsafe acted at 124.1 s")
    run = replace(run, mission=left, objectives={"success": 0.0, "time": 1e5, "energy": 1e5}, shortfall=short)
    time, energy = judge(run, schema, MODEL).results[1:3]
    assert (time.status, energy.status) == (status, "not_evaluated")
    if status == "fault":
        assert (time.value, time.reason) == (taken_s, "so far: a failsafe broke the mission off")


def test_a_log_that_ends_early_evaluates_nothing() -> None:
    run = planted_run()
    judged = judge(replace(run, mission=replace(run.mission, ended=False)), SCHEMA, MODEL)
    assert {result.status for result in judged.results} == {"not_evaluated"}
    assert all("ends before the mission" in result.reason for result in judged.results)


def test_another_mission_is_judged_only_where_the_operator_gave_a_bound() -> None:
    run = planted_run()
    other = replace(run, mission=replace(run.mission, fits=False, mismatch="it has 3 waypoints, not 5"))
    judged = judge(other, SCHEMA, MODEL, {"energy": 1e6})
    assert [result.status for result in judged.results] == ["ok", "not_evaluated", "ok"]
    hint = "give this mission's bound with --threshold time=VALUE"
    assert judged.run.objectives["time"] == Unavailable("it has 3 waypoints, not 5", hint)


def test_judging_twice_is_judging_once() -> None:
    run = planted_run()
    once = judge(replace(run, objectives={**run.objectives, "success": 0.0}), SCHEMA, MODEL)
    assert judge(once.run, SCHEMA, MODEL).results == once.results
