"""Which fix is advised: one that adds enough to the odds of running the mission again, and none where something failed
that no parameter repairs."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import pytest

from care_core.diagnose.advice import failsafes_held
from care_core.diagnose.circumstances import battery_is_low
from care_core.diagnose.parts import mend_first, unmended
from care_core.diagnose.records import Fix, Hypothesis, ObjectiveResult, Prediction
from care_core.diagnose.worth import (
    adds_enough,
    by_chance,
    explained,
    falls_short,
    nearest,
    no_stand_out,
    outweighed,
)
from care_core.ecosystems.findings import CAME_DOWN, UNCHARGED, Finding, FindingKind, Severity, SuspectKind
from care_core.profile.store import load_profile
from care_core.records import replace
from care_core.run import Unavailable, Value
from care_core.variables import Threshold
from tests.made import LAND_SPEED, TIME, made_diagnosis, made_run

LATE = ObjectiveResult(TIME, 190.0, Threshold("<=", 100.0), "fault")
ALONE = (Hypothesis("parameter", "land_speed", 0.9), Hypothesis("chance", "", 0.1))


def fix_with(probability: float) -> Fix:
    fix = made_diagnosis().fix
    assert fix is not None
    return replace(fix, p_fixed=probability)


def motor(probability: float) -> tuple[Hypothesis, ...]:
    rest = 1.0 - probability
    return Hypothesis("hardware", "motor 2 lost thrust", probability), Hypothesis("parameter", LAND_SPEED.name, rest)


def test_a_change_is_advised_by_what_it_adds() -> None:
    assert outweighed(ALONE) is None
    assert falls_short(fix_with(0.8), [LATE], as_driven=0.1) is None
    assert falls_short(fix_with(0.35), [LATE], as_driven=0.02) is None
    assert falls_short(fix_with(0.59), [LATE], as_driven=0.49) is not None


def test_each_change_has_its_cost() -> None:
    assert adds_enough(0.3, 0.1, changes=1)
    assert not adds_enough(0.3, 0.1, changes=3)


def test_where_missions_fail_by_chance_it_is_said_how_often_to_run() -> None:
    said = by_chance(fix_with(0.8), now=0.5, odds=0.7)
    assert said is not None
    assert "this configuration fails 1 in 2, with the change 1 in 5; run it 3 times to know" in said
    assert "no few runs tell" in str(by_chance(fix_with(0.51), now=0.5, odds=0.7))
    assert by_chance(fix_with(0.4), now=0.1, odds=0.95) is None


def test_a_change_that_adds_too_little_is_named_and_not_advised() -> None:
    fix = replace(fix_with(0.4), predicted={"mission_time": Prediction(118.0, 112.0, 124.0, 0.01)})
    said = falls_short(fix, [LATE], as_driven=0.3)
    assert said is not None
    assert "land_speed 16 -> 50, has 40%, as driven 30%" in said
    assert "mission_time is 90% sure to reach 124 s, the limit of 100 s is out of reach" in said


def test_no_parameter_is_advised_where_a_part_explains_more() -> None:
    said = "motor 2 lost thrust; that explains this failure better than any parameter: look at it first"
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


def test_out_of_reach_is_told_by_the_smallest_change_that_comes_nearest() -> None:
    far, near = fix_with(0.01), fix_with(0.01)
    far = replace(far, predicted={"mission_time": Prediction(190.0, 180.0, 200.0, 0.0)})
    near = replace(near, predicted={"mission_time": Prediction(160.0, 155.0, 166.0, 0.0)})
    both = replace(near, changes=(*near.changes, *near.changes))
    assert nearest([far, both, near], [LATE]) is near
    assert nearest([], [LATE]) is None


def part(
    kind: FindingKind,
    title: str,
    probability: float,
    *,
    onset_s: float = 60.0,
    severity: Severity = "critical",
    suspect: SuspectKind = "hardware",
) -> Finding:
    return Finding(kind, title, onset_s, 90.0, severity, "", "", suspect, probability)


SWINGS = part("tuning", "roll oscillates", 0.85, onset_s=35.0, suspect="parameter")


@pytest.mark.parametrize(
    "broken",
    [
        part("motor", "motor 2 lost thrust", 0.3),
        part("thrust", "too little thrust", 0.3),
        part("crash", CAME_DOWN, 0.0),
        part("laser", "the laser falls silent", 0.9),
        part("battery", UNCHARGED, 0.9, severity="warning"),
        part("prearm", "arming was refused: Battery 1 low voltage failsafe", 0.3, suspect="parameter"),
        part("prearm", "arming was refused: Battery below minimum arming voltage", 0.3, suspect="parameter"),
    ],
    ids=lambda one: one.title,
)
def test_a_part_that_failed_comes_before_any_parameter(broken: Finding) -> None:
    assert mend_first([broken]) == broken
    assert "nothing is changed until" in unmended(broken)


@pytest.mark.parametrize(
    "other",
    [
        part("imu", "the gyros are noisy", 0.9, severity="warning"),
        part("battery", "the battery sags under its load", 0.25),
        part("crash", "it crashed", 0.1),
        part("prearm", "arming was refused: Battery 1 voltage failsafe critical >= low", 0.3, suspect="parameter"),
        part("thrust", "too little thrust", 0.1, suspect="parameter"),
        part("blocked", "something blocks the way", 0.9, suspect="world"),
        replace(part("barometer", "the barometer drifts", 0.9), mission_lost=0.05),
        replace(part("motor", "motor 2 lost thrust", 0.9), after_impact=True),
    ],
    ids=lambda one: one.title,
)
def test_what_is_no_failed_part_does_not(other: Finding) -> None:
    assert mend_first([other]) is None


def test_a_battery_that_held_is_no_matter_beside_a_parameter_that_is_wrong_in_itself() -> None:
    wrong = replace(
        part("compass", "the compass reads nothing", 0.9, suspect="parameter"), parameters=("COMPASS_MOT_X",)
    )
    assert mend_first([wrong, part("battery", UNCHARGED, 0.9, severity="warning")]) is None
    empty = part("battery", UNCHARGED, 0.9)
    assert mend_first([wrong, empty]) == empty


def test_motors_at_their_limit_for_an_oscillation_are_no_failed_part_but_a_sure_one_is() -> None:
    assert mend_first([SWINGS, part("motor", "motor 2 lost thrust", 0.3)]) is None
    sure = part("motor", "motor 2 lost thrust", 0.9)
    assert mend_first([SWINGS, sure]) == sure
    assert mend_first([replace(SWINGS, consequences=(part("crash", CAME_DOWN, 0.0),))]) is None
    fell = part("crash", CAME_DOWN, 0.0)
    assert mend_first([replace(part("vibration", "strong vibration", 0.3), consequences=(fell,))]) == fell


def test_a_battery_is_charged_before_anything_is_changed() -> None:
    assert "charge or replace the battery" in unmended(part("battery", UNCHARGED, 0.9))


def test_a_change_of_what_does_not_stand_above_chance_is_not_advised() -> None:
    chance = (Hypothesis("chance", "", 0.6), Hypothesis("parameter", LAND_SPEED.name, 0.4))
    assert "nothing in this run says that it was the cause" in str(no_stand_out(fix_with(0.9), 0.2, chance, 0.9))
    unnamed = (Hypothesis("parameter", "other", 0.9), Hypothesis("chance", "", 0.1))
    assert no_stand_out(fix_with(0.9), 0.2, unnamed, 0.9) is not None


def test_a_cause_that_is_less_likely_than_what_the_profile_does_not_know_is_not_changed() -> None:
    others = (
        Hypothesis("parameter", "", 0.4),
        Hypothesis("parameter", LAND_SPEED.name, 0.35),
        Hypothesis("chance", "", 0.25),
    )
    assert no_stand_out(fix_with(0.9), 0.2, others, necessary=0.9) is not None


def test_another_parameter_than_the_likeliest_cause_is_changed_only_where_it_was_necessary_and_says_why() -> None:
    others = (
        Hypothesis("parameter", "other", 0.5),
        Hypothesis("parameter", LAND_SPEED.name, 0.4),
        Hypothesis("chance", "", 0.1),
    )
    assert no_stand_out(fix_with(0.9), 0.2, others, necessary=0.1) is not None
    assert no_stand_out(fix_with(0.9), 0.2, others, necessary=0.2) is None
    assert explained(fix_with(0.9), 0.2, others, ()).startswith("other is the likelier cause (50%), but")
    assert explained(fix_with(0.9), 0.2, ALONE, ()) == ""


def test_a_likely_cause_whose_change_adds_little_is_explained() -> None:
    said = explained(fix_with(0.6), 0.3, ALONE, ())
    assert said == "land_speed explains 90%, but a run as driven may go well by chance"
    said = explained(fix_with(0.4), 0.02, ALONE, ())
    assert said == "land_speed explains 90%, but its change may not be all that it takes"


@pytest.mark.parametrize(
    ("volts", "is_low"), [(12.6, False), (12.5, False), (12.2, True), (16.1, False), (Unavailable("no BAT"), None)]
)
def test_a_battery_below_what_every_training_flight_began_with_is_not_full(volts: Value, is_low: bool | None) -> None:
    profile = load_profile("arducopter")
    run = replace(made_run(), context={"start_voltage": volts})
    assert battery_is_low(run, profile.model, profile.schema) is is_low


@pytest.mark.parametrize(
    ("volts", "finding", "is_held"),
    [
        (12.6, None, False),
        (12.2, None, True),
        (12.6, part("battery", "battery failsafe", 0.1, suspect="parameter"), False),
        (12.6, part("battery", "battery failsafe", 0.1, suspect="operation"), True),
        (12.6, part("battery", "the battery sags under its load", 0.25), True),
    ],
)
def test_a_battery_failsafe_is_lowered_for_no_battery_that_may_not_be_full(
    volts: float, finding: Finding | None, *, is_held: bool
) -> None:
    profile = load_profile("arducopter")
    run = replace(made_run(), context={"start_voltage": volts})
    case = SimpleNamespace(run=run, query=SimpleNamespace(model=profile.model), profile=profile)
    held = failsafes_held(cast(Any, case), [] if finding is None else [finding])
    assert held == (frozenset({"BATT_LOW_VOLT"}) if is_held else frozenset())
