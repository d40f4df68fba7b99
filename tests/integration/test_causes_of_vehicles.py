"""Causes that hardly a resample finds: by physics, and by the refusal of a check."""

from __future__ import annotations

from pathlib import Path

import pytest

import care_core
from care_core.diagnose.whatif import question
from care_core.files import bundled

DATA = Path(__file__).parents[1] / "data"


def test_circles_that_are_too_wide_are_the_cause_by_physics_and_their_radius_is_advised() -> None:
    diagnosis = care_core.triage(bundled("samples", "quadplane_failed.BIN")).diagnosis
    assert diagnosis.profile.name == "quadplane"
    first = diagnosis.hypotheses[0]
    assert (first.what, first.name) == ("parameter", "WP_LOITER_RAD")
    assert diagnosis.fix is not None
    (change,) = diagnosis.fix.changes
    assert (change.option.name, change.current, change.suggested) == ("WP_LOITER_RAD", 249.0, 60.0)
    assert {fault.causes[0].option.name for fault in diagnosis.faults} == {"WP_LOITER_RAD"}
    cause = next(fault.causes[0] for fault in diagnosis.faults if fault.objective.variable.name == "mission_time")
    assert [node.name for node in cause.path] == ["WP_LOITER_RAD", "mission_time"]
    assert cause.path[0].support is None, "no resample is asked about physics"
    assert not any("resamples" in note.text or "seen in training" in note.text for note in cause.notes)
    assert cause.p_fixed == pytest.approx(diagnosis.fix.p_fixed)


def test_a_refusal_that_reads_an_option_puts_it_back() -> None:
    """A dive that never armed: the check reads two options that are off, of which one alone refuses by its value."""
    diagnosis = care_core.triage(DATA / "ardusub_refused.BIN").diagnosis
    assert [one.objective.variable.name for one in diagnosis.faults] == ["mission_success"]
    assert diagnosis.hypotheses[0].name == "EK3_VELNE_M_NSE"
    assert diagnosis.fix is not None
    change = next(one for one in diagnosis.fix.changes if one.option.name == "EK3_VELNE_M_NSE")
    assert change.suggested < 1.0


def test_a_refusal_is_heard_where_training_knows_none(monkeypatch: pytest.MonkeyPatch) -> None:
    """The same, with a profile none of whose training missions was refused: what the run shows is put back, without
    odds."""
    monkeypatch.setattr("care_core.diagnose.triage.out_of_reach", lambda _failed, _result: "as in no training mission")
    fix = care_core.triage(DATA / "ardusub_refused.BIN").diagnosis.fix
    assert fix is not None
    assert (fix.shown_by, fix.odds) == ("arming was refused: AHRS: waiting for home", None)
    assert {one.option.name: one.suggested for one in fix.changes} == {"EK3_VELNE_M_NSE": 0.5}


def test_the_odds_of_a_refused_vehicle_count_every_limit_of_the_mission_before_it() -> None:
    """Nothing of that mission could be missed, and an option that makes it slow would still lose it."""
    case = care_core.triage(DATA / "ardusub_refused.BIN")
    assert case.reading is not None
    asked = question(case.reading.judged, case.reading.profile, case.diagnosis.profile, case.diagnosis.health)
    assert asked.query.thresholds.keys() - case.reading.judged.bounds == {"mission_time", "energy"}
    fix = case.diagnosis.fix
    assert fix is not None
    config = {**asked.query.config, **{one.option.name: one.suggested for one in fix.changes}}
    as_advised, crawling = asked.query.probability([config, {**config, "WPNAV_SPEED": 8.0}])
    assert as_advised > 0.8
    assert crawling < 0.1


def test_a_dive_whose_log_begins_once_it_is_armed_is_judged() -> None:
    """As submarines write it that log nothing while disarmed: no record of the arming is in it."""
    diagnosis = care_core.triage(DATA / "ardusub_dive.BIN").diagnosis
    assert diagnosis.profile.name == "ardusub"
    assert {result.variable.name: result.status for result in diagnosis.objectives} == dict.fromkeys(
        ("mission_success", "mission_time", "energy", "path_error_max", "depth_error"), "ok"
    )
