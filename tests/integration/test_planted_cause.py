"""Faults planted in a robot whose mechanisms are known: the engine must name them, and its fix must work for real."""

from __future__ import annotations

import re
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path

import pytest

from care_core.diagnose.judging import judge
from care_core.diagnose.records import Diagnosis
from care_core.diagnose.triage import diagnose
from care_core.ecosystems.findings import NOTHING_SEEN, Finding, Severity
from care_core.learn.train import train
from care_core.profile.model import write_model
from care_core.profile.store import Profile
from care_core.records import replace
from care_core.run import ProfileChoice, Run, Unavailable
from care_core.variables import Extract, Role, Variable
from tests.planted import (
    CALM,
    DEFAULTS,
    OPTIONS,
    SCHEMA,
    SETTINGS,
    fly,
    fly_many,
    planted_query,
    planted_run,
    with_variable,
)

CHOICE = ProfileChoice("planted", "1", "Simulated robot", "named by the test")
BY_NAME = {option.name: option for option in OPTIONS}
CASES: tuple[tuple[str, float, str], ...] = (
    ("min_sats", 13, "success"),
    ("radius", 0.95, "success"),
    ("radius", 0.1, "success"),
    ("speed", 1.5, "time"),
    ("planner", 2, "time"),
    ("reserve", 58, "time"),
    ("accel", 3.9, "energy"),
)


def diagnosed(run: Run, profile: Profile, keep: tuple[str, ...] = (), **thresholds: float) -> Diagnosis:
    return diagnose(judge(run, profile.schema, profile.model, thresholds), profile, CHOICE, keep=keep)


def repaired(diagnosis: Diagnosis, noise: Mapping[str, float] = CALM) -> bool:
    """Whether the run meets every threshold when the fix is flown in the true robot."""
    assert diagnosis.fix is not None
    config = {**diagnosis.run.config, **{c.option.name: c.suggested for c in diagnosis.fix.changes}}
    outcome = fly(config, noise)
    return all(o.threshold is not None and o.threshold.met(outcome[o.name]) for o in SCHEMA.objectives)


def test_a_way_to_fail_that_training_never_met_has_no_answer(planted: Profile, tmp_path: Path) -> None:
    summaries = dict(planted.model.summaries)
    summaries["armed"] = replace(summaries["armed"], quantiles=(1.0, 1.0))
    write_model(replace(planted.model, summaries=summaries), tmp_path)
    diagnosis = diagnosed(planted_run(min_sats=13), Profile(tmp_path, planted.schema))
    assert diagnosis.abstained is not None
    assert diagnosis.abstained.startswith("armed is 0, as in no training mission")
    assert (diagnosis.faults[0].causes, diagnosis.fix, diagnosis.tell_more) == ((), None, ())


def test_what_the_training_runs_cannot_tell_is_said_and_never_ranked(planted: Profile, tmp_path: Path) -> None:
    effects = dict(planted.model.effects)
    effects["speed", "time"] = replace(effects["speed", "time"], identified=False)
    write_model(replace(planted.model, effects=effects), tmp_path)
    blind = Profile(tmp_path, planted.schema)
    told = "not ranked, as the training runs cannot tell their effect on time: speed"

    alone = diagnosed(planted_run(speed=1.5), blind)
    assert alone.abstained is not None
    assert told in alone.notes
    assert any(advice.startswith("change only speed to") for advice in alone.tell_more)

    seen, rivalled = (
        diagnosed(planted_run(planner=2), blind),
        diagnosed(planted_run(planner=2, speed=DEFAULTS["speed"] + 0.01), blind),
    )
    for diagnosis, confidence in ((seen, "high"), (rivalled, "medium")):
        (cause, *_) = diagnosis.faults[0].causes
        assert (cause.option.name, cause.confidence) == ("planner", confidence)
    assert told in rivalled.notes
    assert told not in seen.notes


@pytest.mark.parametrize(
    ("robustness", "strongest", "confidence", "share"),
    [(0.6, 0.2, "medium", 1 - (0.2 / 0.8**0.5) / (0.6 / 0.4**0.5)), (0.1, 0.2, "low", 0.0), (None, None, "low", 0.0)],
)
def test_where_operators_chose_no_cause_is_sure_and_the_promise_says_what_it_rests_on(
    planted: Profile,
    tmp_path: Path,
    robustness: float | None,
    strongest: float | None,
    confidence: str,
    share: float,
) -> None:
    effects = {
        pair: replace(effect, robustness=robustness, strongest=strongest)
        for pair, effect in planted.model.effects.items()
    }
    write_model(replace(planted.model, effects=effects), tmp_path)
    run = planted_run(speed=1.5)
    diagnosis = diagnosed(run, Profile(tmp_path, replace(planted.schema, observational=True)))
    (cause, *_) = diagnosis.faults[0].causes
    assert (cause.option.name, cause.confidence) == ("speed", confidence)
    assert any(note.text.startswith("operators chose it") for note in cause.notes)
    assert diagnosis.fix is not None
    now = float(planted_query(planted, speed=1.5).probability([run.config])[0])
    left = now + share * (diagnosis.fix.p_fixed - now)
    told = [note for note in diagnosis.notes if note.startswith("operators chose the parameters")]
    assert len(told) == 1
    assert f"the fix has {diagnosis.fix.p_fixed:.0%} if" in told[0]
    assert f", {left:.0%} if something" in told[0]
    assert any("a change that nobody chose for a reason" in advice for advice in diagnosis.tell_more)
    drawn = diagnosed(run, planted)
    assert drawn.faults[0].causes[0].confidence == "high"
    assert not any("operators chose" in note for note in drawn.notes)


@pytest.mark.parametrize(("option", "value", "objective"), CASES)
def test_the_planted_option_is_named_and_its_fix_works(
    planted: Profile, option: str, value: float, objective: str
) -> None:
    run = planted_run(**{option: value})
    diagnosis = diagnosed(run, planted)
    assert diagnosis.abstained is None
    assert [f.objective.variable.name for f in diagnosis.faults] == [objective]
    cause = diagnosis.faults[0].causes[0]
    assert (cause.rank, cause.option.name, cause.current) == (1, option, value)
    names = [node.name for node in cause.path]
    assert (names[0], names[-1]) == (option, objective)
    assert all(edge in planted.model.edges for edge in pairwise(names))
    assert diagnosis.fix is not None
    assert option in {c.option.name for c in diagnosis.fix.changes}
    for change in diagnosis.fix.changes:
        assert change.current == run.config[change.option.name]
        assert change.option.accepts(change.suggested)
        assert planted.model.supports(change.option.name, change.suggested)
    assert diagnosis.fix.p_fixed > 0.5
    assert repaired(diagnosis)


def test_two_planted_causes_are_both_named_and_both_moved(planted: Profile) -> None:
    diagnosis = diagnosed(planted_run(speed=1.4, planner=2), planted)
    (fault,) = diagnosis.faults
    assert {cause.option.name for cause in fault.causes[:2]} == {"speed", "planner"}
    assert diagnosis.fix is not None
    assert {c.option.name for c in diagnosis.fix.changes} == {"speed", "planner"}
    assert repaired(diagnosis)


def test_faults_of_two_objectives_are_fixed_together(planted: Profile) -> None:
    diagnosis = diagnosed(planted_run(reserve=58, accel=3.9), planted)
    assert {f.objective.variable.name: f.causes[0].option.name for f in diagnosis.faults} == {
        "time": "reserve",
        "energy": "accel",
    }
    assert repaired(diagnosis)


def test_an_innocent_option_off_its_default_is_not_blamed_first(planted: Profile) -> None:
    diagnosis = diagnosed(planted_run(reserve=58, inert=0.02, filter=0, accel=1.2), planted)
    (fault,) = diagnosis.faults
    assert fault.causes[0].option.name == "reserve"
    assert "inert" not in {c.option.name for c in fault.causes}
    assert "filter" not in {c.option.name for c in fault.causes}


def test_a_refused_mission_is_explained_by_its_stage(planted: Profile) -> None:
    run = planted_run(min_sats=13, radius=0.8)
    assert isinstance(run.metrics["tracking_error"], Unavailable)
    diagnosis = diagnosed(run, planted)
    status = {o.variable.name: o.status for o in diagnosis.objectives}
    assert status == {"success": "fault", "time": "not_evaluated", "energy": "not_evaluated"}
    (fault,) = diagnosis.faults
    assert [node.name for node in fault.causes[0].path] == ["min_sats", "armed", "success"]
    assert repaired(diagnosis)


@pytest.mark.parametrize(("met", "is_blamed"), [(1.0, True), (0.0, False)])
def test_a_refusal_for_what_the_profile_does_not_know_blames_no_option(
    planted: Profile, tmp_path: Path, met: float, is_blamed: bool
) -> None:
    """The profile tells one complaint apart; where the vehicle made another, what options do in flight is no cause."""
    complaint = Variable("bad_angle", Role.METRIC, "bool", extract=Extract("arming_refused", {"text": "ANGLE_MAX"}))
    schema = with_variable(planted.schema, complaint)
    write_model(replace(planted.model, schema_digest=schema.digest), tmp_path)
    profile = Profile(tmp_path, schema)
    run = planted_run(min_sats=13, speed=1.4)
    judged = judge(replace(run, metrics={**run.metrics, "bad_angle": met}), schema, profile.model, {})
    said = Finding("prearm", "arming was refused: no motors", 0.0, 1.0, "critical", "no motors", "MSG", "parameter")
    diagnosis = diagnose(judged, profile, CHOICE, health=replace(NOTHING_SEEN, findings=(said,)))
    assert bool(diagnosis.faults[0].causes) is is_blamed
    if not is_blamed:
        assert diagnosis.fix is None
        assert diagnosis.abstained is not None
        assert diagnosis.abstained.startswith("arming was refused: no motors")


@pytest.mark.parametrize("severity", ["warning", "critical"])
def test_what_acts_in_flight_refused_no_arming_though_a_part_led_to_the_refusal(
    planted: Profile, severity: Severity
) -> None:
    refused = Finding("prearm", "arming was refused: Check mag field", 2.0, 3.0, severity, "", "MSG", "operation")
    part = Finding("compass", "the compass is wrong", 1.0, 3.0, "critical", "", "MAG", probability=0.6)
    judged = judge(planted_run(min_sats=13, speed=1.4), planted.schema, planted.model, {})

    def named(*findings: Finding) -> set[str]:
        diagnosis = diagnose(judged, planted, CHOICE, health=replace(NOTHING_SEEN, findings=findings))
        return {one.name for one in diagnosis.hypotheses if one.what == "parameter"} - {""}

    led = replace(part, consequences=(refused,))
    assert named(part)
    assert named(led) == set()
    diagnosis = diagnose(judged, planted, CHOICE, health=replace(NOTHING_SEEN, findings=(led,)))
    assert not any(fault.causes for fault in diagnosis.faults), "nor is any tried out in flight"


def test_a_mission_that_armed_is_not_blamed_on_arming(planted: Profile) -> None:
    (fault,) = diagnosed(planted_run(CALM | {"sats": 2.5}, min_sats=12, radius=0.95), planted).faults
    assert fault.causes[0].option.name == "radius"


def test_a_pinned_option_stays_and_is_still_named(planted: Profile) -> None:
    diagnosis = diagnosed(planted_run(speed=1.4, planner=2), planted, keep=("speed",))
    changed = {c.option.name for f in (diagnosis.fix, *diagnosis.alternatives) if f for c in f.changes}
    assert "speed" not in changed
    pinned = next(c for c in diagnosis.faults[0].causes if c.option.name == "speed")
    assert pinned.suggested is None
    assert pinned.p_fixed is None
    assert any("--keep" in note.text for note in pinned.notes)


def test_with_the_only_cause_pinned_the_engine_abstains(planted: Profile) -> None:
    diagnosis = diagnosed(planted_run(min_sats=14), planted, keep=("min_sats",))
    assert diagnosis.fix is None
    assert diagnosis.abstained
    assert diagnosis.faults[0].causes[0].option.name == "min_sats"


def test_a_safety_option_never_goes_past_its_default(planted: Profile) -> None:
    """Less reserve would be faster still, in truth and in the model."""
    diagnosis = diagnosed(planted_run(speed=1.9, reserve=40), planted, time=140)
    fixes = [fix for fix in (diagnosis.fix, *diagnosis.alternatives) if fix is not None]
    moves = [c.suggested for fix in fixes for c in fix.changes if c.option.name == "reserve"]
    moves += [c.suggested for f in diagnosis.faults for c in f.causes if c.option.name == "reserve" and c.suggested]
    assert moves
    assert min(moves) >= DEFAULTS["reserve"]


def test_an_option_at_its_default_is_never_moved(planted: Profile) -> None:
    diagnosis = diagnosed(planted_run(reserve=58), planted)
    assert diagnosis.fix is not None
    assert {c.option.name for c in diagnosis.fix.changes} == {"reserve"}


def test_a_fault_that_no_option_explains_abstains(planted: Profile) -> None:
    """Every option at its default, and a wind that the profile does not know."""
    diagnosis = diagnosed(planted_run(CALM | {"error": 9.0}), planted)
    assert diagnosis.objectives[0].status == "fault"
    assert diagnosis.abstained is not None
    assert "no parameter" in diagnosis.abstained
    assert diagnosis.fix is None
    assert diagnosis.alternatives == ()


def test_a_threshold_out_of_reach_abstains(planted: Profile) -> None:
    diagnosis = diagnosed(planted_run(reserve=58), planted, time=50)
    assert diagnosis.fix is None
    assert "no run of the profile's training met time <= 50 s" in (diagnosis.abstained or "")
    assert [fault.causes for fault in diagnosis.faults] == [()]


def test_where_only_a_safety_option_would_do_the_engine_says_so(planted: Profile) -> None:
    """Nothing is off its default; only waiting with less in reserve than that makes the mission this much quicker."""
    diagnosis = diagnosed(planted_run(), planted, time=132)
    assert diagnosis.fix is None
    assert "only 'reserve' past its default" in (diagnosis.abstained or "")


def test_a_fix_weighs_every_objective(planted: Profile) -> None:
    """Going fast again fixes the time; with this acceleration it would break the energy, so both change."""
    diagnosis = diagnosed(planted_run(speed=1.4, accel=3.9), planted)
    assert diagnosis.fix is not None
    assert {c.option.name for c in diagnosis.fix.changes} == {"speed", "accel"}
    assert repaired(diagnosis)


def test_whole_numbers_and_codes_stay_what_they_are(planted: Profile) -> None:
    diagnosis = diagnosed(planted_run(min_sats=13, planner=2), planted)
    assert diagnosis.fix is not None
    moves = {c.option.name: c.suggested for c in diagnosis.fix.changes}
    assert moves["min_sats"] == int(moves["min_sats"])
    assert moves["planner"] in {0.0, 1.0}


@pytest.mark.parametrize("bound", [0.0, -1.0])
def test_a_threshold_that_no_value_can_meet_abstains_without_a_warning(planted: Profile, bound: float) -> None:
    diagnosis = diagnosed(planted_run(reserve=58), planted, time=bound)
    assert diagnosis.fix is None
    assert diagnosis.abstained is not None


def test_nothing_faulty_nothing_to_fix(planted: Profile) -> None:
    diagnosis = diagnosed(planted_run(), planted)
    assert {o.status for o in diagnosis.objectives} == {"ok"}
    assert diagnosis.faults == ()
    assert diagnosis.fix is None
    assert diagnosis.abstained is None


def test_an_operators_threshold_makes_the_fault(planted: Profile) -> None:
    run = planted_run(accel=2.2)
    assert diagnosed(run, planted).faults == ()
    (fault,) = diagnosed(run, planted, energy=17.5).faults
    assert fault.causes[0].option.name == "accel"


def test_a_value_outside_the_support_lowers_the_confidence(planted: Profile) -> None:
    cause = diagnosed(planted_run(reserve=90), planted).faults[0].causes[0]
    assert cause.option.name == "reserve"
    assert not cause.in_support
    assert cause.confidence == "low"
    assert any(note.kind == "outside_training" for note in cause.notes)


def test_options_that_no_source_holds_are_assumed_and_said_so(planted: Profile) -> None:
    run = planted_run(reserve=58)
    run = replace(run, config={name: value for name, value in run.config.items() if name != "accel"})
    diagnosis = diagnosed(run, planted)
    assert any("accel" in note for note in diagnosis.notes)
    assert diagnosis.faults[0].causes[0].option.name == "reserve"


@pytest.mark.long
def test_the_same_seed_gives_the_same_files_and_the_same_diagnosis(tmp_path: Path) -> None:
    first, again = tmp_path / "first", tmp_path / "again"
    for folder in (first, again):
        folder.mkdir()
        write_model(train(fly_many(60), SCHEMA, SETTINGS), folder)
    for name in ("model.json", "mechanisms.npz"):
        assert (first / name).read_bytes() == (again / name).read_bytes()
    run = planted_run(speed=1.4, planner=2)
    assert diagnosed(run, Profile(first, SCHEMA)) == diagnosed(run, Profile(again, SCHEMA))


def test_a_safety_option_with_codes_never_takes_a_looser_one(planted: Profile) -> None:
    schema = with_variable(SCHEMA, replace(BY_NAME["planner"], safety=True))
    diagnosis = diagnosed(planted_run(planner=2), Profile(planted.path, schema))
    assert diagnosis.fix is not None
    assert [c.suggested for c in diagnosis.fix.changes] == [DEFAULTS["planner"]]


def test_where_no_few_changes_are_enough_everything_is_put_back(planted: Profile) -> None:
    """Five options break what they can: no four of them repair it."""
    run = planted_run(speed=1.5, accel=3.9, radius=0.95, reserve=58, planner=2)
    diagnosis = diagnosed(run, planted, time=150)
    assert diagnosis.fix is None
    told = diagnosis.tell_more[0]
    assert told.startswith("put all 5 parameters back that are off their reference and run again: ")
    odds = re.search(r"(\d+)% probability that all objectives are met", told)
    assert odds is not None
    assert int(odds.group(1)) > 60


def test_what_is_pinned_is_not_put_back_with_everything_else(planted: Profile) -> None:
    run = planted_run(speed=1.5, accel=3.9, radius=0.95, reserve=58, planner=2)
    diagnosis = diagnosed(run, planted, keep=("radius",), time=150)
    assert not any("put all" in one for one in diagnosis.tell_more), "without the radius the rest repairs nothing"
