from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from care_core.causal.counterfactual import CounterfactualQuery
from care_core.constraints import Constraint, parse_constraint
from care_core.diagnose.fixes import (
    MAX_CHANGES,
    NEARLY,
    _ranked,
    best_alone,
    candidate_values,
    change_notes,
    prediction,
    search,
    settled,
    smallest_good,
    to_fix,
)
from care_core.diagnose.judging import judge
from care_core.diagnose.judging import query_of as query_of_run
from care_core.profile.store import Profile
from care_core.records import replace
from care_core.variables import Role, Variable
from tests.planted import DEFAULTS, OPTIONS, planted_query, planted_run, query_of
from tests.whole import examples

BY_NAME = {option.name: option for option in OPTIONS}
QUICK = settings(deadline=None, max_examples=examples(40))


def candidates(planted: Profile, option: Variable, current: float, reference: float) -> tuple[float, ...]:
    name = option.name
    here = CounterfactualQuery(
        planted.model, {name: current}, {}, {}, reference={name: reference}, variables={name: option}
    )
    return candidate_values(here, name)


@given(data=st.data(), option=st.sampled_from(OPTIONS))
def test_every_candidate_is_acceptable_supported_and_a_change(
    planted: Profile, data: st.DataObject, option: Variable
) -> None:
    low, high = option.range or (-1.0, 3.0)
    current, reference = (data.draw(st.floats(low - (high - low), high + (high - low))) for _ in range(2))
    values = candidates(planted, option, current, reference)
    assert len(set(values)) == len(values)
    for value in values:
        assert value != current
        assert option.accepts(value)
        assert planted.model.supports(option.name, value)


@given(current=st.integers(0, 80))
def test_a_safety_option_only_moves_towards_its_default(planted: Profile, current: int) -> None:
    values = candidates(planted, BY_NAME["reserve"], float(current), 20.0)
    assert all(value >= 20 for value in values) or current < 20
    assert all(min(current, 20) <= value <= max(current, 20) for value in values if current >= 10)


def test_of_a_safety_options_codes_only_the_default_is_left(planted: Profile) -> None:
    assert candidates(planted, replace(BY_NAME["planner"], safety=True), 2.0, 1.0) == (1.0,)
    assert candidates(planted, replace(BY_NAME["planner"], safety=True), 1.0, 1.0) == ()


@pytest.mark.parametrize(
    ("name", "current", "first"), [("speed", 1.5, 5.0), ("planner", 2, 1), ("filter", 0, 1), ("accel", 4.0, 1.5)]
)
def test_the_reference_comes_first(planted: Profile, name: str, current: float, first: float) -> None:
    assert candidates(planted, BY_NAME[name], current, DEFAULTS[name])[0] == first


def test_a_ratio_is_walked_in_ratios(planted: Profile) -> None:
    gain = Variable("gain", Role.OPTION, range=(0.01, 10.0), default=0.1)
    assert candidates(planted, gain, 10.0, 0.1) == (0.1, 0.25, 0.63, 1.6, 4.0)


def test_one_planted_cause_needs_one_change(planted: Profile) -> None:
    here = planted_query(planted, reserve=58)
    found = search(here, ["reserve", "speed"])
    assignment, probability = found[smallest_good(found)]
    assert set(assignment) == {"reserve"}
    assert probability == pytest.approx(here.probability([{**here.config, **assignment}])[0])


def test_two_planted_causes_need_two(planted: Profile) -> None:
    here = planted_query(planted, speed=1.4, planner=2)
    found = search(here, ["planner", "radius", "speed"])
    assert set(found[smallest_good(found)][0]) == {"speed", "planner"}


@QUICK
@given(driven=st.fixed_dictionaries({o.name: st.floats(*o.range).map(o.snap) for o in OPTIONS if o.range is not None}))
def test_sets_grow_by_one_and_stay_inside(planted: Profile, driven: dict[str, float]) -> None:
    here = planted_query(planted, **driven)
    free = sorted(name for name in driven if driven[name] != DEFAULTS[name])
    found = search(here, free)
    assert [len(assignment) for assignment, _ in found] == list(range(1, 1 + min(len(found), MAX_CHANGES)))
    for assignment, probability in found:
        assert set(assignment) <= set(free)
        assert 0 <= probability <= 1
        assert all(BY_NAME[name].accepts(value) for name, value in assignment.items())
        assert all(planted.model.supports(name, value) for name, value in assignment.items())


def test_of_changes_that_do_the_same_the_smallest_is_first_and_what_does_more_is_before_both(planted: Profile) -> None:
    here = planted_query(planted, inert=0.5, reserve=58)
    ranked = _ranked(here, [{"inert": 0.0}, {"inert": 0.4}, {"reserve": 20.0}])
    assert [next(iter(assignment.items())) for assignment, _ in ranked] == [
        ("reserve", 20.0), ("inert", 0.4), ("inert", 0.0),
    ]  # fmt: skip


def test_nothing_free_nothing_found(planted: Profile) -> None:
    assert search(planted_query(planted, reserve=58), []) == []
    assert best_alone(planted_query(planted), "reserve") is None


@QUICK
@given(speed=st.floats(1.0, 2.0), radius=st.floats(0.75, 1.0))
def test_a_nearer_value_than_the_reference_has_a_step_of_margin(planted: Profile, speed: float, radius: float) -> None:
    here = planted_query(planted, speed=speed, radius=radius)
    back = {"speed": DEFAULTS["speed"], "radius": DEFAULTS["radius"]}
    chosen, probability = settled(here, back)
    floor = here.probability([{**here.config, **back}])[0] - NEARLY
    assert probability >= floor - 1e-12
    name = "radius"  # settled last, so the other one is at its final value
    values = candidate_values(here, name)
    step = values.index(chosen[name])
    if step:
        beyond = {**here.config, **chosen, name: values[step + 1]}
        assert here.probability([beyond])[0] >= floor
    if chosen != back:  # with no help of this run, and the mechanisms at their worst between the reference and there
        before = replace(here, observed={}, repeats=())
        reset = {**here.config, **back}
        at_worst = replace(before, wary_from=reset).probability([{**here.config, **chosen}])[0]
        assert at_worst >= before.probability([reset])[0] - NEARLY


def test_what_is_not_known_between_two_configurations_counts_against_the_second(planted: Profile) -> None:
    here = planted_query(planted, speed=1.4)
    back, between = ({**here.config, "speed": speed} for speed in (5.0, 3.0))
    wary = replace(here, observed={}, wary_from=back)
    plain = replace(here, observed={})
    assert wary.probability([back])[0] == pytest.approx(plain.probability([back])[0])
    assert wary.probability([between])[0] <= plain.probability([between])[0]
    assert wary.predict("time", [between]).value[0] > plain.predict("time", [between]).value[0]


def test_an_option_that_the_model_sees_nothing_of_goes_back_to_its_reference(planted: Profile) -> None:
    chosen, _ = settled(planted_query(planted, inert=0.95, reserve=58), {"inert": DEFAULTS["inert"]})
    assert chosen == {"inert": DEFAULTS["inert"]}


def test_the_best_value_alone(planted: Profile) -> None:
    here = planted_query(planted, reserve=58)
    best = best_alone(here, "reserve")
    assert best is not None
    assert best[1] == pytest.approx(here.probability([{**here.config, "reserve": best[0]}])[0])
    assert best[1] > 0.8


@pytest.mark.parametrize(
    ("probability", "chosen"),
    [
        ([0.8], 0),
        ([0.8, 0.85], 0),
        ([0.5, 0.65], 1),
        ([0.7, 0.82], 0),
        ([0.3, 0.65], 1),
        ([0.3, 0.35, 0.75], 2),
        ([0.3, 0.65, 0.7], 1),
        ([0.02, 0.08], 0),
        ([0.4, 0.3, 0.2], 0),
    ],
)
def test_one_more_change_adds_a_tenth_and_a_quarter(probability: list[float], chosen: int) -> None:
    assert smallest_good([({str(j): 0.0 for j in range(i + 1)}, p) for i, p in enumerate(probability)]) == chosen


def test_a_fix_tells_every_objective_and_the_change_that_does_most_first(planted: Profile) -> None:
    here = planted_query(planted, speed=1.4, planner=2)
    fix = to_fix(here, {"planner": 1.0, "speed": 5.0}, 0.9)
    assert set(fix.predicted) == {"success", "time", "energy"}
    alone = [here.probability([{**here.config, c.option.name: c.suggested}])[0] for c in fix.changes]
    assert alone == sorted(alone, reverse=True)
    assert {c.option.name: (c.current, c.suggested) for c in fix.changes} == {"speed": (1.4, 5.0), "planner": (2, 1.0)}


def test_without_a_threshold_a_prediction_has_no_probability(planted: Profile) -> None:
    run = planted_run()
    p = prediction(query_of(planted, run, {}, {}), "time", run.config)
    assert p.p_ok is None
    assert p.status() == "not_evaluated"
    assert p.low < p.value < p.high


def test_an_operator_is_told_what_a_change_takes() -> None:
    assert change_notes(BY_NAME["accel"]) == ("takes effect after a reboot",)
    assert change_notes(BY_NAME["radius"]) == ("sets 2 keys: /a/radius, /b/radius",)
    assert change_notes(BY_NAME["speed"]) == ()
    thrust = Variable(
        "thrust", Role.OPTION, range=(0.0, 100.0), doc="most thrust in a take-off, 0 takes the general limit"
    )
    assert change_notes(thrust, 0.0) == (thrust.doc,)
    assert change_notes(thrust, 10.0) == ()


def test_what_options_keep_together_no_suggestion_breaks(planted: Profile) -> None:
    """The reference of `reserve` is 20: where it must stay above ten times a speed of 3.5, another value or a pair."""
    kept = parse_constraint("reserve >= 10 * speed", DEFAULTS)
    here = replace(planted_query(planted, reserve=58, speed=3.5), constraints=(kept,))
    alone = best_alone(here, "reserve")
    assert alone is None or alone[0] >= 35.0
    for assignment, probability in search(here, ["reserve"]):
        assert here.allows({**here.config, **assignment})
        chosen, _ = settled(here, assignment)
        assert here.allows({**here.config, **chosen})
        assert 0.0 <= probability <= 1.0


def test_a_constraint_that_the_run_breaks_itself_forbids_nothing(planted: Profile) -> None:
    kept = parse_constraint("reserve <= speed", DEFAULTS)
    here = planted_query(planted, reserve=58)
    assert search(replace(here, constraints=(kept,)), ["reserve"]) == search(here, ["reserve"])


def test_a_constraint_of_an_option_without_a_value_here_binds_nothing(planted: Profile) -> None:
    known, unknown = Constraint("reserve >= speed"), Constraint("nowhere <= speed")
    bound = replace(planted, schema=replace(planted.schema, constraints=(known, unknown)))
    judged = judge(planted_run(reserve=58), bound.schema, bound.model)
    assert query_of_run(judged, bound).constraints == (known,)
