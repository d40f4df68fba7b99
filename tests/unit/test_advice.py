"""Which fix is advised: none that is less likely than not, but where the reference fails by chance too, and none where
something failed that no parameter repairs."""

from __future__ import annotations

import pytest

from care_core.diagnose.advice import believed, by_chance, falls_short, nearest, outweighed
from care_core.diagnose.records import Fix, Hypothesis, ObjectiveResult, Prediction
from care_core.ecosystems.findings import Finding
from care_core.records import replace
from care_core.variables import Threshold
from tests.made import LAND_SPEED, TIME, made_diagnosis

LATE = ObjectiveResult(TIME, 190.0, Threshold("<=", 100.0), "fault")
ALONE = (Hypothesis("parameter", "land_speed", 0.9), Hypothesis("chance", "", 0.1))


def fix_with(probability: float) -> Fix:
    fix = made_diagnosis().fix
    assert fix is not None
    return replace(fix, p_fixed=probability)


def motor(probability: float) -> tuple[Hypothesis, ...]:
    rest = 1.0 - probability
    return Hypothesis("hardware", "motor 2 lost thrust", probability), Hypothesis("parameter", LAND_SPEED.name, rest)


def test_a_likely_change_is_advised() -> None:
    assert outweighed(ALONE) is None
    assert falls_short(fix_with(0.8), [LATE], odds=1.0) is None


def test_where_missions_fail_by_chance_a_change_need_not_be_surer_than_the_reference() -> None:
    fix = fix_with(0.4)
    assert falls_short(fix, [LATE], odds=0.95) is not None
    assert falls_short(fix, [LATE], odds=0.75) is not None
    assert falls_short(fix, [LATE], odds=0.5) is None
    said = by_chance(fix, now=0.1, odds=0.5)
    assert said is not None
    assert "the reference meets every limit in 50% of them, this change in 40%, the run as it was in 10%" in said
    assert by_chance(fix, now=0.1, odds=0.95) is None


def test_a_change_less_likely_than_not_is_named_and_not_advised() -> None:
    fix = replace(fix_with(0.4), predicted={"mission_time": Prediction(118.0, 112.0, 124.0, 0.01)})
    said = falls_short(fix, [LATE], odds=1.0)
    assert said is not None
    assert "land_speed 16 -> 50, has 40%" in said
    assert "mission_time is 90 % sure to reach 124 s, the limit of 100 s is out of reach" in said


def test_no_parameter_is_advised_where_a_part_explains_more() -> None:
    said = "motor 2 lost thrust, which explains this failure better than any parameter: look at it first"
    assert outweighed(motor(0.7)) == said
    assert outweighed(motor(0.3)) is None


def test_a_part_that_failed_well_after_a_sign_of_how_it_was_set_is_not_what_to_look_at_first() -> None:
    shaking = Finding("tuning", "roll oscillates", 35.2, 265.8, "warning", "", "RATE", "parameter")
    part = Finding("motor", "motor 2 lost thrust", 52.0, 246.9, "critical", "", "RCOU", probability=0.3)
    said = outweighed(motor(0.7), (part, shaking))
    assert said is not None
    assert said.startswith("roll oscillates from 35 s on, before motor 2 lost thrust")
    sooner = replace(shaking, onset_s=51.0)
    assert outweighed(motor(0.7), (part, sooner)) == outweighed(motor(0.7), (part,))
    assert outweighed(motor(0.3), (part, shaking)) is None


def test_a_part_that_left_no_trace_stops_no_advice() -> None:
    unseen = (
        Hypothesis("hardware", "", 0.4),
        Hypothesis("parameter", "land_speed", 0.3),
        Hypothesis("chance", "", 0.3),
    )
    assert outweighed(unseen) is None


def test_what_no_parameter_repairs_comes_off_the_promise() -> None:
    (fix,) = believed([fix_with(0.9)], motor(0.2))
    assert fix.p_fixed == pytest.approx(0.9 * 0.8)


def test_out_of_reach_is_told_by_the_smallest_change_that_comes_nearest() -> None:
    far, near = fix_with(0.01), fix_with(0.01)
    far = replace(far, predicted={"mission_time": Prediction(190.0, 180.0, 200.0, 0.0)})
    near = replace(near, predicted={"mission_time": Prediction(160.0, 155.0, 166.0, 0.0)})
    both = replace(near, changes=(*near.changes, *near.changes))
    assert nearest([far, both, near], [LATE]) is near
    assert nearest([], [LATE]) is None
