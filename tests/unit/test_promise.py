"""What the next run has: the mechanisms and the causes of this failure, joined."""

from __future__ import annotations

import pytest

from care_core.diagnose.noisy_or import CHANCE, Key, NoisyOr
from care_core.diagnose.promise import Promise
from care_core.profile.store import Profile
from care_core.records import replace
from tests.planted import DEFAULTS, planted_query

SPEED: Key = ("parameter", "speed")
MOTOR: Key = ("hardware", "motor 2 lost thrust")


def promise(planted: Profile, loses: dict[Key, float]) -> Promise:
    return Promise(NoisyOr({CHANCE: 0.02, **loses}), planted_query(planted, speed=1.4), ["time"])


def odds(one: Promise, **changes: float) -> float:
    return float(one.odds([{**one.query.config, **changes}])[0])


def test_a_change_of_the_cause_is_promised_and_a_run_as_driven_is_not(planted: Profile) -> None:
    one = promise(planted, {SPEED: 0.95})
    assert odds(one, speed=DEFAULTS["speed"]) > 0.6
    assert one.as_driven() < 0.1


def test_a_change_away_from_the_reference_takes_no_cause_away(planted: Profile) -> None:
    one = promise(planted, {SPEED: 0.95})
    assert one.query.reference["speed"] == DEFAULTS["speed"]
    assert odds(one, speed=1.6 if DEFAULTS["speed"] < 1.4 else 1.2) <= one.as_driven() + 0.01


def test_what_is_past_the_reference_is_left_to_the_mechanisms(planted: Profile) -> None:
    """Farther from the reference than the run was, on its other side: the cause is gone, and the objectives tell."""
    one = promise(planted, {SPEED: 0.95})
    reference = DEFAULTS["speed"]
    far = reference + 2 * (reference - 1.4)
    kept = one.query.probability([{**one.query.config, "speed": far}])[0]
    assert odds(one, speed=far) == pytest.approx(kept, abs=0.15)


def test_a_failed_part_leaves_a_change_no_more_than_it_does_not_explain(planted: Profile) -> None:
    one = promise(planted, {SPEED: 0.5, MOTOR: 0.9})
    assert odds(one, speed=DEFAULTS["speed"]) <= 1.0 - one.failure.acts(MOTOR) + 1e-9


def test_a_change_adds_no_more_than_what_it_touches_explains(planted: Profile) -> None:
    one = promise(planted, {SPEED: 0.05, MOTOR: 0.3})
    assert odds(one, speed=DEFAULTS["speed"]) <= one.as_driven() + one.failure.acts(SPEED) + 1e-9


def test_a_parameter_that_no_mechanism_knows_is_promised_by_the_causes_alone(planted: Profile) -> None:
    one = promise(planted, {("parameter", "FRAME_TYPE"): 0.9})
    assert one.without(["FRAME_TYPE"], one.query.config) > 0.5
    assert one.without(["RTL_ALT"], one.query.config) < 0.1


def test_necessity_is_the_share_of_failures_that_a_change_takes_away(planted: Profile) -> None:
    one = promise(planted, {SPEED: 0.9})
    driven, back = one.query.config, {**one.query.config, "speed": DEFAULTS["speed"]}
    before = replace(one.query, observed={})
    here, there = 1.0 - before.p_ok("time", [driven, back])
    assert one.necessity(back, driven) == pytest.approx(1.0 - there / here)
    assert one.necessity(back, back) == pytest.approx(0.0)
