from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from care_core.causal.all_objectives import AllObjectives
from care_core.causal.counterfactual import CounterfactualQuery
from care_core.causal.mechanisms import TAIL
from care_core.causal.model import NoiseCarryOver
from care_core.profile.store import Profile, load_profile
from care_core.records import replace
from care_core.run import Unavailable
from care_core.variables import Threshold
from tests.planted import CALM, DEFAULTS, OPTIONS, SCHEMA, fly_many, planted_run, query_of
from tests.whole import examples

BOUNDS = {v.name: v.threshold for v in SCHEMA.objectives if v.threshold is not None}
CONFIGS = st.fixed_dictionaries(
    {
        o.name: st.sampled_from([code for code, _ in o.labels]) if o.labels else st.floats(*(o.range or (0.0, 1.0)))
        for o in OPTIONS
    }
)

QUICK = settings(deadline=None, max_examples=examples(30))


def query(
    profile: Profile,
    observed: Mapping[str, object] | None = None,
    bounds: Mapping[str, Threshold] = BOUNDS,
    **options: float,
) -> CounterfactualQuery:
    """The world of a run with these options off their default; what it met is read off unless `observed` is given."""
    return query_of(profile, planted_run(**options), observed, bounds)


@QUICK
@given(driven=CONFIGS, other=CONFIGS)
def test_probabilities_are_probabilities_and_intervals_hold_their_value(
    planted: Profile, driven: dict[str, float], other: dict[str, float]
) -> None:
    run = planted_run(**driven)
    here = query_of(planted, run)
    probability = here.probability([driven, other])
    assert ((probability >= 0) & (probability <= 1)).all()
    for name in planted.model.outcomes:
        p = here.predict(name, [driven, other])
        assert ((p.p_ok >= 0) & (p.p_ok <= 1)).all()
        assert (p.low <= p.high).all()
        assert np.isfinite(p.value).all()


@QUICK
@given(configs=st.lists(CONFIGS, min_size=2, max_size=5), data=st.data())
def test_predictions_do_not_depend_on_the_order_of_configurations(
    planted: Profile, configs: list[dict[str, float]], data: st.DataObject
) -> None:
    here = query(planted, speed=1.5)
    order = data.draw(st.permutations(range(len(configs))))
    shuffled = [configs[i] for i in order]
    np.testing.assert_allclose(here.probability(configs)[order], here.probability(shuffled), atol=1e-9)
    alone = [here.probability([config])[0] for config in configs]
    np.testing.assert_allclose(here.probability(configs), alone, atol=1e-9)


def test_without_a_change_the_next_run_is_between_this_one_and_what_was_expected(planted: Profile) -> None:
    expected = float(query(planted, {}).predict("time", [DEFAULTS]).value[0])
    again = query(planted, {"time": expected + 20}).predict("time", [DEFAULTS])
    assert expected + 5 < again.value[0] < expected + 19
    assert again.low[0] < again.value[0] < again.high[0]


def test_what_the_run_met_is_carried_over(planted: Profile) -> None:
    """A run 20 s slower than expected would also have been slower with another option."""
    expected = float(query(planted, {}).predict("time", [DEFAULTS]).value[0])
    slow = query(planted, {"time": expected + 20})
    faster = {**DEFAULTS, "speed": 8.0}
    usual = float(query(planted, {}).predict("time", [faster]).value[0])
    assert float(slow.predict("time", [faster]).value[0]) > usual + 5


def test_on_another_day_less_of_it_is_met_again(planted: Profile) -> None:
    expected = float(query(planted, {}).predict("time", [DEFAULTS]).value[0])
    slow = query(planted, {"time": expected + 20})
    another = replace(slow, conditions="another day")
    assert expected < another.predict("time", [DEFAULTS]).value[0] < slow.predict("time", [DEFAULTS]).value[0]


def test_how_much_of_an_error_far_off_persists_is_what_is_known_least(planted: Profile) -> None:
    far = query(planted, {"success": 1.0, "time": 400.0})

    def interval(pairs: int) -> tuple[float, float]:
        seen = {"time": NoiseCarryOver(same=0.5, another=0.25, pairs=(pairs, 0))}
        model = replace(far.model, training=replace(far.model.training, carry_over=seen))
        p = replace(far, model=model).predict("time", [{**DEFAULTS, "speed": 6.0}])
        return float(p.low[0]), float(p.high[0])

    low, high = interval(1000)
    lowest, highest = interval(0)
    assert lowest < low < high < highest
    assert highest - lowest > 1.5 * (high - low)


@pytest.mark.parametrize(("same", "pairs"), [(0.5, 0), (0.3, 20), (0.8, 200)])
def test_shares_that_may_persist_have_the_mean_that_was_measured(same: float, pairs: int) -> None:
    at, weights = NoiseCarryOver(same=same, another=0.25, pairs=(pairs, 0)).shares(same=True)
    assert weights.sum() == pytest.approx(1.0)
    assert weights @ at == pytest.approx(same, abs=0.02)
    assert np.sqrt(weights @ (at - same) ** 2) < 0.3 / np.sqrt(1 + pairs / 10)


def test_a_second_failure_is_evidence_against_chance(planted: Profile) -> None:
    once = query(planted, {"armed": 1.0, "success": 0.0})
    twice = replace(once, repeats=({"armed": 1.0, "success": 0.0},))
    rescued = replace(once, repeats=({"armed": 1.0, "success": 1.0},))
    probability = [w.predict("success", [DEFAULTS]).p_ok[0] for w in (twice, once, rescued)]
    assert probability[0] < probability[1] < probability[2]


def test_runs_left_out_say_what_to_make_of_the_product_of_the_single_probabilities(planted: Profile) -> None:
    here = query(planted, {})
    modest = ((0.05, 0.02, 100), (0.55, 0.8, 100), (0.75, 0.97, 200))
    told = replace(here, model=replace(planted.model, skill={"all": replace(planted.model.skill["all"], curve=modest)}))
    plain = replace(here, model=replace(planted.model, skill={}))
    configs = [DEFAULTS, {**DEFAULTS, "speed": 1.5}]
    (good, bad), (as_product, bad_product) = told.probability(configs), plain.probability(configs)
    assert as_product < good < 0.97
    assert bad < bad_product < 0.05
    for name in here.thresholds:
        assert (told.predict(name, configs).p_ok >= told.probability(configs)).all(), "what is kept with all is kept"
    only_time = {"time": BOUNDS["time"]}
    assert replace(told, thresholds=only_time).probability(configs) == pytest.approx(
        replace(plain, thresholds=only_time).probability(configs)
    ), "they were asked about all objectives"


@QUICK
@example(offset=1.5, slope=0.625, runs=40, shares=[0.5, 0.75, 0.625, 0.25, 0.03125])  # whole Newton steps part from it
@given(
    offset=st.floats(-1.5, 1.5), slope=st.floats(0.6, 1.6), runs=st.integers(40, 400),
    shares=st.lists(st.floats(0.02, 0.98), min_size=5, max_size=10, unique=True),
)  # fmt: skip
def test_what_is_made_of_a_product_follows_the_runs_and_its_order(
    offset: float, slope: float, runs: int, shares: list[float]
) -> None:
    truth = AllObjectives(offset, slope, best=1.0)
    product = np.array(sorted(shares))
    met = truth.of_product(product)
    found = AllObjectives.of(list(zip(product.tolist(), met.tolist(), [runs] * len(product), strict=True)))
    made = found.of_product(product)
    assert np.abs(made - met).max() <= 0.1
    assert (np.diff(made) >= 0).all()
    assert AllObjectives.of(()).of_product(product) == pytest.approx(product)


def test_an_objective_without_a_mechanism_counts_with_its_base_rate(planted: Profile) -> None:
    outcomes = {name: record for name, record in planted.model.outcomes.items() if name != "time"}
    blind = replace(query(planted, {}), model=replace(planted.model, outcomes=outcomes))
    rate = blind.base_rates()["time"]
    assert 0 < rate < 1
    others = replace(blind, thresholds={name: BOUNDS[name] for name in outcomes}).probability([DEFAULTS])[0]
    assert blind.probability([DEFAULTS])[0] == pytest.approx(rate * others)


def test_an_unknown_outcome_is_predicted_from_the_options_alone(planted: Profile) -> None:
    gone = query(planted, {"time": Unavailable("no end in the log")})
    np.testing.assert_array_equal(
        gone.predict("time", [DEFAULTS]).value, query(planted, {}).predict("time", [DEFAULTS]).value
    )


def test_interventions_follow_the_true_mechanism(planted: Profile) -> None:
    here = query(planted, reserve=50)
    values = [20.0, 35.0, 50.0, 60.0]
    predicted = here.predict("time", [{**DEFAULTS, "reserve": v} for v in values]).value
    truth = [float(planted_run(reserve=v).objectives["time"]) for v in values]  # type: ignore[arg-type]
    np.testing.assert_allclose(predicted, truth, atol=8)


def test_a_run_that_failed_a_stage_keeps_failing_until_an_option_changes(planted: Profile) -> None:
    refused = query(planted, min_sats=12)
    blind = CounterfactualQuery(planted.model, refused.config, {}, BOUNDS)
    same, reset = refused.config, {**refused.config, "min_sats": 6.0}
    assert refused.predict("success", [same]).p_ok[0] <= blind.predict("success", [same]).p_ok[0] + 1e-9
    assert refused.predict("success", [reset]).p_ok[0] > 0.7


def test_what_a_failed_stage_leads_to_says_no_more_of_the_next_run() -> None:
    """A plane that never climbed is disarmed by force: that says nothing of one that climbs."""
    plane = load_profile("arduplane")
    reference = {option.name: float(option.default or 0.0) for option in plane.schema.options}
    driven = {**reference, "TKOFF_THR_MINACC": 10.0}
    bounds = {v.name: v.threshold for v in plane.schema.objectives if v.threshold is not None}
    lost = {"never_climbed": 1.0, "mission_success": 0.0}
    alone, with_more = (
        CounterfactualQuery(plane.model, driven, seen, bounds) for seen in (lost, {**lost, "forced_disarm": 1.0})
    )
    assert with_more.p_ok("mission_success", [reference])[0] == alone.p_ok("mission_success", [reference])[0] > 0.9


def test_a_stage_passed_speaks_for_the_run(planted: Profile) -> None:
    """It armed with many satellites asked for: it would probably arm again."""
    armed = query(planted, {"armed": 1.0}, min_sats=11)
    blind = query(planted, {}, min_sats=11)
    assert armed.predict("success", [armed.config]).p_ok[0] > blind.predict("success", [blind.config]).p_ok[0]


def test_all_thresholds_count_and_only_those_in_force(planted: Profile) -> None:
    config = [{**DEFAULTS, "accel": 2.4}]
    every = query(planted, {}).probability(config)[0]
    some = query(planted, {}, {"time": BOUNDS["time"], "success": BOUNDS["success"]}).probability(config)[0]
    assert every < some
    assert query(planted, {}, {}).probability(config)[0] == 1.0


def test_without_a_threshold_there_are_no_probability(planted: Profile) -> None:
    p = query(planted, {}, {}).predict("time", [DEFAULTS])
    assert np.isnan(p.p_ok[0])
    assert np.isfinite(p.value[0])


def test_objectives_that_move_together_count_once(planted: Profile) -> None:
    training = replace(planted.model.training, moves_together=(("time", "energy"),))
    model = replace(planted.model, training=training)
    bounds = {"time": BOUNDS["time"], "energy": BOUNDS["energy"]}
    config = [{**DEFAULTS, "speed": 3.0, "accel": 2.2}]
    apart, together = (CounterfactualQuery(m, DEFAULTS, {}, bounds) for m in (planted.model, model))
    each = [apart.predict(name, config).p_ok[0] for name in bounds]
    assert together.probability(config)[0] == pytest.approx(min(each))
    assert apart.probability(config)[0] == pytest.approx(each[0] * each[1])


def test_a_bound_above_and_a_bound_below_are_complements(planted: Profile) -> None:
    below = query(planted, {}, {"time": Threshold("<=", 150)}).predict("time", [DEFAULTS]).p_ok[0]
    above = query(planted, {}, {"time": Threshold(">", 150)}).predict("time", [DEFAULTS]).p_ok[0]
    assert below + above == pytest.approx(1.0)


@pytest.mark.parametrize(("op", "probability"), [("<=", TAIL), (">=", 1 - TAIL)])
def test_a_bound_outside_what_the_target_can_be(planted: Profile, op: str, probability: float) -> None:
    bound = Threshold(op, -5.0)  # type: ignore[arg-type]
    assert query(planted, bounds={"time": bound}).predict("time", [DEFAULTS]).p_ok[0] == pytest.approx(probability)


def test_the_interval_of_a_new_mission_holds_four_in_five(planted: Profile) -> None:
    flown = fly_many(600, seed=7)
    flown = flown[flown["time"].notna()]
    configs = flown[list(DEFAULTS)].to_dict("records")
    for name in ("time", "energy"):
        p = query(planted, {}).predict(name, [{str(key): value for key, value in one.items()} for one in configs])
        seen = flown[name].to_numpy()
        assert 0.65 < np.mean((p.low <= seen) & (seen <= p.high)) < 0.93


def test_metrics_of_a_run_that_ended_early_tell_what_it_would_have_taken(planted: Profile) -> None:
    calm, busy = (planted_run({**CALM, "replans": noise}, radius=0.1) for noise in (0.0, 2.0))
    assert isinstance(busy.objectives["time"], Unavailable)
    unseen = query_of(planted, busy, {}).predict("time", [DEFAULTS])
    expected, longer = (query_of(planted, run).predict("time", [DEFAULTS]) for run in (calm, busy))
    # 1.4 more replans of 6 s each, half of which the next run is taken to meet again.
    assert longer.value[0] - expected.value[0] == pytest.approx(0.5 * 1.4 * 6, abs=2.0)
    assert longer.high[0] - longer.low[0] < unseen.high[0] - unseen.low[0]


def test_metrics_behind_what_ended_the_run_say_nothing_of_it(planted: Profile) -> None:
    run, graph = planted_run({**CALM, "replans": 2.0}, radius=0.1), planted.model.graph
    behind = replace(graph, directed=frozenset({*graph.directed, ("success", "replans")} - {("replans", "success")}))
    here = query_of(planted, run)
    unseen = query_of(planted, run, {}).predict("time", [DEFAULTS])
    told = replace(here, model=replace(here.model, graph=behind)).predict("time", [DEFAULTS])
    assert told.value[0] == unseen.value[0]
    assert here.predict("time", [DEFAULTS]).value[0] != unseen.value[0]
