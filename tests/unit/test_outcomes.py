from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from care_core.causal.counterfactual import CounterfactualQuery
from care_core.causal.graph import CausalGraph
from care_core.causal.model import Model
from care_core.learn.fitting import Effort, slopes
from care_core.learn.outcomes import (
    FEW_RUNS,
    Outcomes,
    ask_total,
    causes_of,
    chosen,
    find_stages,
    fit_on,
    fit_outcomes,
    fit_total,
    groups_that_move_together,
    met,
    questions_of_objectives,
)
from care_core.learn.train import with_weak
from care_core.profile.schema import Schema
from care_core.profile.store import Profile
from care_core.records import replace
from care_core.variables import Role, Threshold, Variable
from tests.planted import SCHEMA, SUCCESS, TIME, fly_many

QUICK = Effort(points=120, iterations=15)
FLAGS = ("armed", "located")
SMALL = replace(
    SCHEMA,
    variables={
        v.name: v
        for v in (
            Variable("gain", Role.OPTION, range=(0.0, 1.0), default=0.5),
            Variable("wind", Role.CONTEXT),
            *(Variable(name, Role.METRIC, "bool") for name in FLAGS),
            Variable("error", Role.METRIC),
            SUCCESS,
            TIME,
        )
    },
)
GRAPH = CausalGraph(
    tuple(SMALL.variables),
    frozenset(
        {("gain", "armed"), ("armed", "success"), ("located", "success"), ("error", "success"), ("gain", "error")}
    ),
)


def missions(n: int = FEW_RUNS) -> pd.DataFrame:
    """Refused where the gain is high; lost at random, whatever the gain; else failed where the gain is low."""
    rng = np.random.default_rng(0)
    gain = rng.uniform(size=n)
    armed = gain < 0.8
    located = np.where(armed, rng.random(n) < 0.7, np.nan)
    flew = located == 1
    error = np.where(flew, 1 - gain + 0.1 * rng.normal(size=n), np.nan)
    success = flew & (np.nan_to_num(error, nan=9) < 0.8)
    time = np.where(success, 100 + 50 * error, np.nan)
    wind = np.where(armed, rng.normal(size=n), np.nan)
    columns = {"gain": gain, "wind": wind, "armed": armed, "located": located, "error": error, "success": success}
    table: pd.DataFrame = pd.DataFrame({**columns, "time": time}).astype(float)
    return table


def stages(frame: pd.DataFrame, schema: Schema = SMALL) -> list[tuple[str, int, int]]:
    return [
        (s.variable, int(s.reached.sum()), int((s.reached & s.passed).sum()))
        for s in find_stages(SUCCESS, schema, frame)
    ]


def test_met_is_one_zero_or_unknown() -> None:
    frame = pd.DataFrame({"time": [100.0, 500.0, np.nan]})
    np.testing.assert_array_equal(met(TIME, frame, SMALL), [1.0, 0.0, np.nan])


def test_stages_come_in_order_each_on_the_missions_that_reached_it() -> None:
    frame = missions()
    armed, located = int(frame.armed.sum()), int((frame.located == 1).sum())
    assert stages(frame) == [
        ("armed", len(frame), armed),
        ("located", armed, located),
        ("success", located, int(frame.success.sum())),
    ]


def test_a_stage_may_pass_at_zero() -> None:
    frame = missions()
    turned = frame.assign(armed=1 - frame.armed)
    found = find_stages(SUCCESS, SMALL, turned)
    assert [(s.variable, s.passes) for s in found] == [("armed", 0.0), ("located", 1.0), ("success", 1.0)]


def test_a_metric_that_successful_missions_can_fail_is_no_stage() -> None:
    frame = missions()
    frame.loc[frame.index[frame.success == 1][0], "armed"] = 0.0
    assert "armed" not in [name for name, _, _ in stages(frame)]


def test_a_stage_with_too_few_missions_is_left_out_and_training_goes_on() -> None:
    """Fifteen missions get past arming: enough of each kind, too few to learn from."""
    frame = missions(60)
    frame = frame.assign(armed=0.0, located=np.nan, error=np.nan, success=0.0, time=np.nan)
    frame.loc[:14, "armed"] = 1.0
    frame.loc[:7, "success"] = 1.0
    assert [name for name, _, _ in stages(frame)] == ["armed"]
    outcomes, _ = fit_outcomes(frame, SMALL, GRAPH, np.random.default_rng(0), effort=QUICK)
    assert [s.variable for s in outcomes["success"].stages] == ["armed"]


def test_a_run_lost_at_a_stage_that_no_option_moves_is_not_laid_to_a_later_one(planted: Profile) -> None:
    frame = missions()
    outcomes, mechanisms = fit_outcomes(frame, SMALL, GRAPH, np.random.default_rng(0), effort=QUICK)
    assert [s.variable for s in outcomes["success"].stages] == ["armed", "located", "success"]
    rate = frame.located.mean()
    assert mechanisms["stage:located"].probability(np.zeros((1, 0)))[0] == pytest.approx(rate, abs=0.05)
    model: Model = replace(planted.model, outcomes=outcomes, mechanisms=mechanisms)
    lost = CounterfactualQuery(
        model, {"gain": 0.6}, {"armed": 1.0, "located": 0.0, "success": 0.0}, {"success": Threshold(">=", 1)}
    )
    flown = CounterfactualQuery(model, {"gain": 0.6}, {"armed": 1.0, "located": 1.0, "success": 1.0}, lost.thresholds)
    configs = [{"gain": g} for g in (0.3, 0.5, 0.6, 0.7)]
    # What was met may not be met again, but no other gain brings it back.
    assert lost.probability(configs).max() < lost.probability([lost.config])[0] + 0.02
    assert lost.probability(configs).max() < 0.7 * rate < rate < flown.probability(configs).max()


def test_an_objective_that_nothing_moves_has_no_outcome() -> None:
    bare = CausalGraph(tuple(SMALL.variables))
    assert fit_outcomes(missions(), SMALL, bare, np.random.default_rng(0), effort=QUICK) == ({}, {})


def test_among_few_runs_what_the_search_did_not_find_is_not_ruled_out() -> None:
    bare, frame = CausalGraph(tuple(SMALL.variables)), missions(100)
    found = fit_total("error", frame, SMALL, bare, np.random.default_rng(0), effort=QUICK)
    assert found is not None
    low, high = found.expected(np.array([[0.1], [0.7]]))
    assert (low, high) == (pytest.approx(0.9, abs=0.1), pytest.approx(0.3, abs=0.1))
    nothing: Outcomes = ({}, {})
    weak = with_weak(bare, frame, SMALL, nothing)
    assert weak.directed == {("gain", "success"), ("gain", "time")}
    assert with_weak(GRAPH, frame, SMALL, nothing).directed == {*GRAPH.directed, ("gain", "time")}
    assert with_weak(bare, missions(), SMALL, nothing) == bare
    assert with_weak(bare, frame, replace(SMALL, observational=True), nothing) == bare


OPTIONS = [Variable(f"option{i}", Role.OPTION, range=(0.0, 1.0), default=0.5) for i in range(8)]
WIDE = replace(SMALL, variables={**{v.name: v for v in OPTIONS}, **SMALL.variables})


def wide_missions(n: int) -> pd.DataFrame:
    """Seldom off the reference; the error answers to option7 alone, which no search found."""
    rng = np.random.default_rng(1)
    off = rng.random((n, len(OPTIONS))) < 0.25
    values = np.where(off, rng.uniform(size=off.shape), 0.5)
    table: pd.DataFrame = pd.DataFrame(values, columns=[v.name for v in OPTIONS])
    table["error"] = 1.0 + 2.0 * np.abs(table["option7"] - 0.5) + 0.05 * rng.standard_normal(n)
    table["gain"], table["wind"] = rng.uniform(size=n), 0.0
    table[["armed", "located", "success", "time"]] = np.nan
    return table


def test_among_many_runs_what_the_search_did_not_find_is_read_where_runs_left_out_say_so() -> None:
    graph = CausalGraph(tuple(WIDE.variables), frozenset({("option0", "error")}))
    frame, effort = wide_missions(FEW_RUNS + 50), replace(QUICK, folds=3)
    found = fit_total("error", frame, WIDE, graph, np.random.default_rng(0), effort=effort)
    assert found is not None
    moves = {found.inputs[place] for place, slope in zip(found.reads, slopes(found.kernel), strict=True) if slope > 0.2}
    assert "option7" in moves
    bare = CausalGraph(tuple(WIDE.variables))
    assert fit_total("error", frame, WIDE, bare, np.random.default_rng(0), effort=effort) is None, "of many runs"


def test_all_options_are_taken_where_that_is_no_worse_by_more_than_chance() -> None:
    rng = np.random.default_rng(0)
    best = rng.normal(size=400)
    near, far = best + rng.normal(0.005, 0.2, size=400), best + rng.normal(0.1, 0.2, size=400)
    assert chosen([best, near], [False, True]) == 1
    assert chosen([best, far], [False, True]) == 0
    assert chosen([best, near], [False, False]) == 0
    assert chosen([near, best], [True, True]) == 1
    assert chosen([np.full(400, np.nan), near], [True, False]) == 1


def test_contexts_are_read_only_where_operators_chose_by_them() -> None:
    graph = CausalGraph(tuple(SMALL.variables), GRAPH.directed | {("wind", "error")})
    assert causes_of("success", graph, SMALL) == ("gain",)
    assert causes_of("success", graph, replace(SMALL, observational=True)) == ("gain", "wind")
    assert causes_of("gain", graph, SMALL) == ("gain",)


def test_a_context_that_refused_missions_do_not_have_is_no_error() -> None:
    graph = CausalGraph(tuple(SMALL.variables), GRAPH.directed | {("wind", "armed")})
    schema = replace(SMALL, observational=True)
    outcomes, mechanisms = fit_outcomes(missions(), schema, graph, np.random.default_rng(0), effort=QUICK)
    assert outcomes["success"].stages
    assert all(np.isfinite(m.points).all() for m in mechanisms.values())


def test_the_middle_of_the_line_is_fitted_on_the_missions_that_have_it() -> None:
    frame, rng = missions(), np.random.default_rng(0)
    m = fit_total("error", frame, SMALL, GRAPH, rng, effort=QUICK)
    assert m is not None
    assert len(m.targets) == min(120, int(frame.error.notna().sum()))
    assert m.expected(np.array([[0.3]]))[0] == pytest.approx(0.7, abs=0.1)
    assert fit_total("time", frame, SMALL, GRAPH, rng, effort=QUICK) is None


def test_too_few_or_constant_values_give_no_mechanism() -> None:
    frame, rng = missions(), np.random.default_rng(0)
    assert fit_on([["gain"]], "time", frame.iloc[:15], SMALL, rng, effort=QUICK) is None
    assert fit_on([["gain"]], "time", frame.assign(time=3.0), SMALL, rng, effort=QUICK) is None


def test_answers_are_the_same_in_any_order() -> None:
    """What chance decides was drawn when a question was asked, so processes may share the answering."""
    frame, rng, effort = missions(), np.random.default_rng(0), replace(QUICK, folds=2)
    questions = [q for one in questions_of_objectives(frame, SMALL, GRAPH, rng, effort=effort) for q in one.questions]
    error = ask_total("error", frame, SMALL, GRAPH, rng, effort=effort)
    assert error is not None
    assert error.folds
    assert len(questions) == 3
    asked = [*questions, error]
    forwards, backwards = [q.answer() for q in asked], [q.answer() for q in asked[::-1]][::-1]
    for one, other in zip(forwards, backwards, strict=True):
        assert np.array_equal(one.weights, other.weights)
        assert np.array_equal(one.calibration, other.calibration)


def test_objectives_that_nearly_repeat_each_other_are_grouped() -> None:
    frame = fly_many(100)
    assert groups_that_move_together(SCHEMA, frame) == ()
    assert groups_that_move_together(SCHEMA, frame.assign(energy=np.exp(frame.time / 50))) == (("time", "energy"),)
    assert groups_that_move_together(SCHEMA, frame.assign(energy=np.nan)) == ()
