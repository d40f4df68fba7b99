from __future__ import annotations

from itertools import pairwise

import pytest

from care_core.causal.graph import CausalGraph
from care_core.causal.model import EdgeRecord
from care_core.diagnose.ranking import (
    _mediators,
    best_paths,
    describe_path,
    deviating,
    suspects,
)
from care_core.diagnose.reference import profile_config
from care_core.diagnose.symptoms import better_than_expected
from care_core.profile.store import Profile
from care_core.records import replace
from care_core.variables import Threshold
from tests.planted import BOUNDS, DEFAULTS, OPTIONS, SCHEMA, planted_query, planted_run, query_of, with_variable


def test_an_option_that_is_off_alone_costs_what_its_reset_brings(planted: Profile) -> None:
    here = planted_query(planted, speed=1.4)
    before, after = here.predict("time", [here.config, {**here.config, **DEFAULTS}]).p_ok
    (found,) = [one for one in suspects(here, "time") if one.contribution]
    assert found.option == "speed"
    assert found.contribution == pytest.approx(after - before)


def test_a_contribution_is_the_mean_of_going_back_first_and_last(planted: Profile) -> None:
    here = planted_query(planted, speed=1.4, planner=2)
    changes: tuple[dict[str, float], ...] = (
        {},
        {"speed": DEFAULTS["speed"]},
        {"planner": DEFAULTS["planner"]},
        DEFAULTS,
    )
    driven, speed_back, planner_back, all_back = here.p_ok("time", [{**here.config, **one} for one in changes])
    found = {one.option: one.contribution for one in suspects(here, "time")}
    assert found["speed"] == pytest.approx(((speed_back - driven) + (all_back - planner_back)) / 2)
    assert found["planner"] == pytest.approx(((planner_back - driven) + (all_back - speed_back)) / 2)


def test_of_equal_shares_the_one_goes_first_that_repairs_the_run_alone(planted: Profile) -> None:
    """Either alone brings the time back, yet at its reference the speed costs too much energy."""
    bounds = {**BOUNDS, "time": Threshold("<=", 197), "energy": Threshold("<=", 15)}
    here = query_of(planted, planted_run(speed=3.2, planner=2), bounds=bounds)
    found = suspects(here, "time")
    assert found[0].contribution == pytest.approx(found[1].contribution, abs=0.01)
    assert [s.option for s in found[:2]] == ["planner", "speed"]


def test_only_options_off_their_reference_with_a_path_are_suspects(planted: Profile) -> None:
    found = suspects(planted_query(planted, speed=1.4, accel=3.0, inert=0.0), "time")
    names = {s.option for s in found}
    assert "speed" in names
    assert "planner" not in names
    assert names <= {"speed", "accel", "inert"}
    graph = planted.model.graph
    for suspect in found:
        nodes = suspect.path.nodes
        assert (nodes[0], nodes[-1]) == (suspect.option, "time")
        assert set(pairwise(nodes)) <= graph.directed


def test_an_effect_that_is_not_identified_is_not_ranked(planted: Profile) -> None:
    effects = dict(planted.model.effects)
    effects["speed", "time"] = replace(effects["speed", "time"], identified=False)
    here = planted_query(planted, speed=1.4, planner=2)
    found = suspects(replace(here, model=replace(planted.model, effects=effects)), "time")
    assert [s.option for s in found if not s.is_identified] == ["speed"]


def test_the_reference_is_the_default_or_the_middle_of_the_training_runs(planted: Profile) -> None:
    assert profile_config(SCHEMA, planted.model) == DEFAULTS
    bare = with_variable(SCHEMA, replace(OPTIONS[0], default=None))
    quantiles = planted.model.summaries["speed"].quantiles
    assert profile_config(bare, planted.model)["speed"] == OPTIONS[0].snap(quantiles[10])


@pytest.mark.parametrize(("value", "off"), [(5.0, False), (5.001, False), (5.01, True), (-5.0, True)])
def test_a_deviation_is_more_than_rounding(value: float, off: bool) -> None:
    assert deviating({"speed": value}, {"speed": 5.0, "accel": 1.0}) == (("speed",) if off else ())


def test_zero_is_no_deviation_from_zero() -> None:
    assert deviating({"a": 0.0, "b": 1e-3}, {"a": 0.0, "b": 0.0}) == ("b",)


def test_one_path_an_option_the_strongest(planted: Profile) -> None:
    model = planted.model
    found = best_paths(model, "time", [o.name for o in OPTIONS])
    assert found["reserve"].nodes == ("reserve", "hold_s", "time")
    for option, path in found.items():
        rivals = [record.ace for record in model.paths["time"] if record.nodes[0] == option]
        assert path.ace >= max(rivals, default=0.0) - 1e-4


def test_a_path_tells_what_the_run_met_and_what_it_would_have(planted: Profile) -> None:
    run, here = planted_run(reserve=58), planted_query(planted, reserve=58)
    path = describe_path(best_paths(planted.model, "time", [o.name for o in OPTIONS])["reserve"], here, run)
    option, hold, time = path
    assert (option.value, option.expected) == (58, 20)
    assert hold.value == run.metrics["hold_s"]
    assert hold.expected == pytest.approx(18, abs=2)
    assert time.expected == pytest.approx(planted_run().objectives["time"], abs=8)
    assert option.effect is not None
    assert option.effect > 0
    assert (time.effect, time.support) == (None, None)
    assert all(0 <= node.support <= 1 for node in path[:-1] if node.support is not None)


def test_a_decreasing_edge_is_negative(planted: Profile) -> None:
    run, here = planted_run(speed=1.4), planted_query(planted, speed=1.4)
    path = describe_path(best_paths(planted.model, "time", [o.name for o in OPTIONS])["speed"], here, run)
    signs = {node.name: node.effect for node in path if node.effect is not None}
    assert signs["mean_speed"] < 0 < signs["speed"]


def test_a_refused_mission_has_unknown_values_on_the_path(planted: Profile) -> None:
    run, here = planted_run(min_sats=14), planted_query(planted, min_sats=14)
    path = describe_path(best_paths(planted.model, "success", [o.name for o in OPTIONS])["radius"], here, run)
    assert [node.value for node in path] == [0.5, None, 0.0]


def test_a_path_is_not_led_over_an_edge_that_carries_nothing(planted: Profile) -> None:
    edges = dict(planted.model.edges)
    direct, around = ("speed", "time"), (("speed", "mean_speed"), ("mean_speed", "time"))
    some = next(iter(edges.values()))

    def edge(pair: tuple[str, str], effect: float) -> EdgeRecord:
        return replace(some, source=pair[0], target=pair[1], effect=effect, support=1.0)

    strong_last = ("tracking_error", "time")
    made = {around[0]: 0.3, around[1]: 0.3, ("speed", "tracking_error"): 0.0, strong_last: 1.5}
    graph = CausalGraph(planted.model.graph.nodes, frozenset(made))
    model = replace(planted.model, graph=graph, edges={pair: edge(pair, effect) for pair, effect in made.items()})
    assert best_paths(model, "time", ["speed"])["speed"].nodes == ("speed", "mean_speed", "time")
    assert best_paths(model, "time", ["speed"], {"tracking_error"})["speed"].nodes == (
        "speed",
        "tracking_error",
        "time",
    )

    lone = replace(model, graph=CausalGraph(graph.nodes, frozenset({direct})), edges={direct: edge(direct, 0.0)})
    assert best_paths(lone, "time", ["speed"])["speed"].nodes == direct


def test_what_was_better_than_expected_carried_nothing_where_there_is_another_way(planted: Profile) -> None:
    slow = planted_query(planted, reserve=58)
    seen = {**slow.observed, "hold_s": 2.0}
    here = replace(slow, observed=seen)
    assert "hold_s" not in better_than_expected(slow, "time")
    assert "hold_s" in better_than_expected(here, "time")
    (before,), (found,) = ([one for one in suspects(at, "time") if one.option == "reserve"] for at in (slow, here))
    assert (before.path.nodes, before.not_borne_out) == (("reserve", "hold_s", "time"), ())
    # There is no other way in this graph: the path stays, and says that this run does not bear it out.
    assert ("hold_s" in found.path.nodes) == (found.not_borne_out == ("hold_s",))
    around = ("reserve", "time")
    edges = {
        **here.model.edges,
        around: replace(here.model.edges["reserve", "hold_s"], source="reserve", target="time"),
    }
    graph = CausalGraph(here.model.graph.nodes, here.model.graph.directed | {around}, here.model.graph.bidirected)
    wide = replace(here, model=replace(here.model, edges=edges, graph=graph))
    (other,) = [one for one in suspects(wide, "time") if one.option == "reserve"]
    assert (other.path.nodes, other.not_borne_out) == (around, ())


def test_a_check_that_did_not_act_carried_nothing(planted: Profile) -> None:
    assert "armed" not in _mediators(planted_query(planted, speed=1.4))
    refused = planted_query(planted, min_sats=13)
    assert _mediators(refused) == {"armed", "success"}
    assert "time" in _mediators(planted_query(planted, speed=1.4))  # it may have cost energy
