"""Drives along goals that no training run had: what was asked, what it is judged by, and what is said of it."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from care_core.causal.mechanisms import Averaging
from care_core.diagnose.judging import Judged, judge, read_and_judge
from care_core.diagnose.triage import triage
from care_core.ecosystems.registry import run_model
from care_core.errors import ProfileError
from care_core.extract.read import read_run
from care_core.extract.select import choose_profile
from care_core.logs.opening import open_log
from care_core.profile.reading import parse_schema
from care_core.profile.store import Profile, load_profile
from care_core.records import replace
from care_core.run import Unavailable
from tests.goal_drives import GOAL_S, drive

SQUARE = ((6.0, 0.0), (6.0, 6.0), (0.0, 6.0))
"""Three goals, 6 m each: two right angles to turn, none on the spot at the first."""


@pytest.fixture(scope="module")
def profile() -> Profile:
    return load_profile("move_base")


def judged(path: Path, profile: Profile, **thresholds: float) -> Judged:
    return read_and_judge(run_model(open_log(path)), profile, thresholds=thresholds)


def verdicts(one: Judged) -> dict[str, str]:
    return {result.variable.name: result.status for result in one.results}


def test_what_was_asked_is_read_from_the_goals(tmp_path: Path, profile: Profile) -> None:
    run = read_run(run_model(open_log(drive(tmp_path / "a.bag", SQUARE))), profile.schema)
    asked = {name: run.context[name] for name in ("goals_asked", "goal_distance", "goal_turn")}
    assert asked == pytest.approx({"goals_asked": 3, "goal_distance": 6, "goal_turn": math.pi / 3}, abs=0.01)
    assert run.metrics["traveled_distance"] == pytest.approx(1.0, rel=0.02)
    assert run.metrics["goals_reached"] == 1
    assert run.metrics["first_goal_time"] == pytest.approx((GOAL_S + 6 / 0.5) / 6, rel=0.02)


def test_a_given_up_drive_of_the_profiles_own_goals_was_asked_for_all(tmp_path: Path, profile: Profile) -> None:
    own = [(goal[0], goal[1]) for goal in profile.schema.mission["goals"]]
    run = read_run(run_model(open_log(drive(tmp_path / "a.bag", own[:2]))), profile.schema)
    assert run.mission.fits
    assert run.context["goals_asked"] == 5
    assert run.context["goal_distance"] == pytest.approx(2.916, abs=0.01)
    assert run.metrics["goals_reached"] == pytest.approx(0.4)


def test_a_drive_at_the_reference_is_fine_on_other_goals(tmp_path: Path, profile: Profile) -> None:
    found = judged(drive(tmp_path / "a.bag", SQUARE), profile)
    assert set(verdicts(found).values()) == {"ok"}
    time = next(result for result in found.results if result.variable.name == "mission_time")
    assert time.need is not None
    assert time.need.value == pytest.approx(3 * (GOAL_S + 6 / 0.5), rel=0.3)
    assert "the reference configuration needs" in time.basis


def test_a_slow_drive_is_laid_to_the_speed_with_low_confidence(tmp_path: Path, profile: Profile) -> None:
    log = open_log(drive(tmp_path / "a.bag", SQUARE, speed=0.25))
    diagnosis = triage(read_and_judge(run_model(log), profile), profile, choose_profile(log, [profile])[1])
    assert "mission_time" in {fault.objective.name for fault in diagnosis.faults}
    causes = [cause for fault in diagnosis.faults for cause in fault.causes]
    assert causes[0].option.name == "max_vel_trans"
    assert {cause.confidence for cause in causes} == {"low"}
    assert any("distance from goal to goal" in reason for reason in diagnosis.profile.fit.reasons)


def test_the_operators_bound_comes_before_the_ratio(tmp_path: Path, profile: Profile) -> None:
    path = drive(tmp_path / "a.bag", SQUARE, speed=0.25)
    assert verdicts(judged(path, profile, mission_time=200, energy=5)) == {
        "mission_success": "ok", "mission_time": "ok", "energy": "ok"
    }  # fmt: skip
    assert verdicts(judged(path, profile, mission_time=50))["mission_time"] == "fault"


def test_a_goal_far_away_may_take_longer(tmp_path: Path, profile: Profile) -> None:
    found = judged(drive(tmp_path / "a.bag", ((10.0, 0.0), (50.0, 0.0))), profile)
    assert verdicts(found)["mission_success"] == "ok"


def test_without_odometry_nothing_says_what_was_asked(tmp_path: Path, profile: Profile) -> None:
    found = judged(drive(tmp_path / "a.bag", SQUARE, without=["/odom"]), profile)
    assert isinstance(found.run.context["goal_distance"], Unavailable)
    assert verdicts(found)["mission_time"] == "not_evaluated"


def test_a_breach_that_the_log_cannot_tell_is_none(tmp_path: Path, profile: Profile) -> None:
    own = [(goal[0], goal[1]) for goal in profile.schema.mission["goals"]]
    run = read_run(run_model(open_log(drive(tmp_path / "a.bag", own))), profile.schema)

    def energy(value: float, **thresholds: float) -> tuple[str, str]:
        one = judge(replace(run, objectives={**run.objectives, "energy": value}), profile.schema, None, thresholds)
        return next((r.status, r.reason) for r in one.results if r.variable.name == "energy")

    assert energy(1.79) == ("ok", "")
    assert energy(1.82)[0] == "ok"
    assert "less than the 3.0%" in energy(1.82)[1]
    assert energy(1.87)[0] == "fault"
    assert energy(1.82, energy=1.8)[0] == "fault"


def test_fewer_goals_are_known_less_well(profile: Profile) -> None:
    mechanism = profile.model.mechanisms["mission_time"]
    averaging = mechanism.averaging
    assert isinstance(averaging, Averaging)
    assert averaging.usual == 5
    assert 0 < averaging.share <= 1
    config = {v.name: v.default or 0.0 for v in profile.schema.options} | {"goal_distance": 3.0, "goal_turn": 0.5}
    rows = [[{**config, "goals_asked": n}[name] for name in mechanism.inputs] for n in (1.0, 5.0, 20.0)]
    one, usual, many = (float(sd) for sd in mechanism.noise_at(np.array(rows)))
    assert one > usual == pytest.approx(mechanism.noise_sd)
    assert many < usual


def test_the_events_of_a_sum_are_declared_whole() -> None:
    text = """
schema_version: 1
name: a
version: "1"
platform: made up
variables:
  goals: {role: context, about: mission}
  distance: {role: context, about: mission}
  turn: {role: context, about: mission}
  variation: {role: metric}
  time:
    role: objective
    kind: non-functional
    threshold: {op: "<=", value: 80, ratio: 1.3}
    nominal: {kind: goals_time}
    events: {count: goals, variation: VARIATION}
"""
    schema = parse_schema(text.replace("VARIATION", "variation"), Path("a.yaml"))
    time = schema.variables["time"]
    assert (time.fixed is not None, time.relative is not None, schema.travels) == (True, True, True)
    with pytest.raises(ProfileError, match="'events' names"):
        parse_schema(text.replace("VARIATION", "varation"), Path("a.yaml"))
