"""Report and next run -> what became of the promise: core, files, command."""

from __future__ import annotations

import json
import re
from pathlib import Path

import jsonschema
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ruamel.yaml import YAML

import care_core
from care_core.configs.driven import same_value
from care_core.diagnose.judging import judge
from care_core.diagnose.records import Diagnosis, Hypothesis, Need
from care_core.diagnose.verify import PromisedSet, ReportedObjective, ReportedPromise, Verification, _notes, verify
from care_core.ecosystems.findings import Finding, Health, Severity
from care_core.errors import ConfigError
from care_core.records import replace
from care_core.report.document import build_document
from care_core.report.reading import read_report
from care_core.report.writers import to_json, to_yaml
from care_core.run import FITS, Fit, ProfileChoice, Robot, Run, Setting, Unavailable
from care_core.variables import Extract, Role, Threshold, Variable
from tests.conftest import Care
from tests.made import made_diagnosis
from tests.planted import DEFAULTS, ENERGY, SCHEMA, SUCCESS, TIME, planted_run

SLOW = {**DEFAULTS, "speed": 2.0}
PROMISED = PromisedSet({"speed": (2.0, 5.0)}, 0.9, {"time": (130.0, 150.0), "energy": (12.0, 20.0)})


def promise(*others: PromisedSet) -> ReportedPromise:
    return ReportedPromise(
        sha256="",
        start=None,
        version="1",
        config=SLOW,
        objectives={
            "success": ReportedObjective(1.0, "ok", SUCCESS.threshold),
            "time": ReportedObjective(230.0, "fault", TIME.threshold),
            "energy": ReportedObjective(15.0, "ok", ENERGY.threshold),
        },
        sets=(PROMISED, *others),
    )


def triaged(run: Run, *findings: Finding, fit: Fit = FITS) -> Diagnosis:
    """A run as triage judges it, with what its health checks found."""
    judged = judge(run, SCHEMA, None)
    choice = ProfileChoice("planted", "1", "", "", fit)
    return Diagnosis(choice, judged.run, judged.results, (), None, health=Health("", (), findings))


def checked(*others: PromisedSet, **options: float) -> Verification:
    return verify(promise(*others), triaged(planted_run(**options)), SCHEMA)


def test_a_change_that_was_made_and_did_what_it_promised() -> None:
    found = checked(speed=5.0)
    assert found.verdict == "fixed_as_promised"
    assert found.worked is True
    assert [change.made for change in found.changes] == ["made"]
    assert {check.variable.name: check.outcome for check in found.objectives} == {
        "success": "kept", "time": "recovered", "energy": "kept",
    }  # fmt: skip


def test_another_version_of_the_profile_and_an_older_log_are_told() -> None:
    run = replace(planted_run(), log=replace(planted_run().log, start="2024-05-01T10:00:00+00:00"))
    assert list(_notes(promise(), run, SCHEMA, (), {})) == []
    (told,) = _notes(replace(promise(), version="0"), run, SCHEMA, (), {})
    assert told == "the report was written with version 0 of the profile, not 1"
    (told,) = _notes(replace(promise(), start="2024-05-02T10:00:00+00:00"), run, SCHEMA, (), {})
    assert told == "this log is older than the one of the report"


def test_a_change_that_was_not_made() -> None:
    found = checked(speed=2.0)
    assert found.verdict == "change_not_made"
    assert found.changes[0].made == "not_made"
    assert found.worked is None
    assert "speed" in found.sentence


def test_another_value_is_neither_made_nor_left() -> None:
    found = checked(speed=2.5)
    assert found.changes[0].made == "other_value"
    assert found.changes[0].driven == 2.5
    assert found.verdict == "change_not_made"
    assert found.sentence.startswith("Another value was driven than promised (speed 2.5 instead of 5), and ")
    assert "was not made" not in found.sentence


def test_a_change_that_did_not_help() -> None:
    found = checked(speed=5.0, planner=2.0)
    assert found.verdict == "not_fixed"
    assert found.worked is False
    assert [other.option.name for other in found.others] == ["planner"]
    time = next(check for check in found.objectives if check.variable is TIME)
    assert time.outcome == "better"
    assert time.inside is False


def test_a_run_that_became_worse_or_broke_something_else() -> None:
    found = checked(speed=1.0, accel=4.0)
    outcomes = {check.variable.name: check.outcome for check in found.objectives}
    assert outcomes["time"] == "worse"
    assert outcomes["energy"] == "broken"


@pytest.mark.parametrize(
    ("time_s", "outcome"),
    [(230.0, "unchanged"), (215.0, "unchanged"), (245.0, "unchanged"), (205.0, "better"), (255.0, "worse")],
    ids=str,
)
def test_a_move_within_what_runs_differ_by_is_none(time_s: float, outcome: str) -> None:
    """Half of the promised interval, 20 s here, either way."""
    run = planted_run(speed=5.0)
    driven = replace(run, objectives={**run.objectives, "time": time_s})
    within = replace(PROMISED, intervals={"time": (130.0, 170.0)})
    found = verify(replace(promise(), sets=(within,)), triaged(driven), SCHEMA)
    assert {check.variable.name: check.outcome for check in found.objectives}["time"] == outcome


def test_a_longer_mission_is_held_against_what_it_needs_itself() -> None:
    """The mission that failed was given up half-way: the reference needed 60 s for it, and 120 s for the next."""
    half = {"time": ReportedObjective(None, "not_evaluated", Threshold("<=", 87.5), need=60.0)}
    within = replace(PROMISED, intervals={"time": (65.0, 75.0)})
    judged = triaged(planted_run(speed=5.0))
    time = next(result for result in judged.objectives if result.variable is TIME)
    now = replace(judged, objectives=(replace(time, need=Need(120.0, 110.0, 130.0)),))
    found = verify(replace(promise(), objectives=half, sets=(within,)), now, SCHEMA)
    (check,) = found.objectives
    assert check.interval == (130.0, 150.0)
    assert found.verdict == "fixed_as_promised"


def test_a_recovery_with_other_changes_says_so() -> None:
    found = checked(speed=5.0, accel=1.0)
    assert found.verdict == "fixed_although"
    assert "accel was changed too" in found.sentence


def test_a_mission_that_failed_otherwise_is_not_fixed() -> None:
    found = checked(speed=5.0, min_sats=14)
    assert found.verdict == "not_fixed"
    assert {check.variable.name: check.outcome for check in found.objectives}["time"] == "unknown"


def test_a_part_that_failed_before_the_fault_could_be_judged_tells_nothing_of_the_change() -> None:
    motor = Hypothesis("hardware", "motor 2 lost thrust", 0.9, 0.9)
    failed = replace(triaged(planted_run(speed=5.0, min_sats=14)), hypotheses=(motor,))
    found = verify(promise(), failed, SCHEMA)
    assert found.verdict == "cannot_tell"
    assert found.sentence == "Cannot tell: motor 2 lost thrust, before time could be judged."
    slow = replace(triaged(planted_run(speed=2.0)), hypotheses=(motor,))
    assert verify(promise(), slow, SCHEMA).verdict == "change_not_made"


def test_a_failure_of_another_vehicle_tells_nothing_of_the_change() -> None:
    run = planted_run(speed=5.0, min_sats=14)
    said = replace(promise(), format=run.log.format, frame="QUAD/X")
    found = verify(said, triaged(replace(run, log=replace(run.log, facts={"frame": "HEXA/X"}))), SCHEMA)
    assert found.verdict == "cannot_tell"
    assert "its frame is HEXA/X" in found.sentence


def test_what_was_not_evaluated_or_is_another_mission_cannot_be_told() -> None:
    run = planted_run(speed=5.0)
    run = replace(run, objectives={**run.objectives, "time": Unavailable("the log ends early")})
    found = verify(promise(), triaged(run), SCHEMA)
    assert found.verdict == "cannot_tell"
    assert "the log ends early" in found.sentence
    run = planted_run(speed=5.0)
    elsewhere = replace(run, mission=replace(run.mission, mismatch="the mission has 3 waypoints"))
    found = verify(promise(), triaged(elsewhere), SCHEMA)
    assert found.verdict == "cannot_tell"
    assert "3 waypoints" in found.sentence


def asking(
    asked: float, before: float, what: str = "legs", kind: str = "mission_asked", *, lost: bool = False
) -> Verification:
    """A run that recovered, of a mission whose legs, or way, were so many when the report was written."""
    way = Variable(name=what, role=Role.CONTEXT, extract=Extract(kind, {"what": what}))
    schema = replace(SCHEMA, variables={**SCHEMA.variables, what: way})
    run = planted_run(speed=5.0)
    run = replace(run, mission=replace(run.mission, asked=((what, asked),)))
    said = replace(promise(), context={what: before})
    if lost:
        said = replace(
            said, objectives={**said.objectives, "success": ReportedObjective(0.0, "fault", SUCCESS.threshold)}
        )
    return verify(said, triaged(run), schema)


def test_another_mission_than_the_reports_proves_nothing() -> None:
    found = asking(7.0, before=5.0)
    assert found.verdict == "cannot_tell"
    assert found.sentence == (
        "Cannot tell: this is another mission than that of the report: legs is 7, it was 5 there."
    )
    assert asking(5.0, before=5.0).verdict == "fixed_as_promised"


def test_what_was_named_as_it_was_begun_is_more_of_the_same_mission_where_it_was_given_up() -> None:
    """PX4 logs an item as it begins it, a ROS robot is sent goal by goal: of a lost mission not all are known."""
    for kind in ("px4_mission_asked", "goals_asked"):
        assert asking(7.0, before=5.0, kind=kind, lost=True).verdict == "fixed_as_promised"
        assert asking(7.0, before=5.0, kind=kind).verdict == "cannot_tell"
    assert asking(7.0, before=5.0, lost=True).verdict == "cannot_tell", "ArduPilot logs the mission whole"


def test_a_vehicle_that_is_put_down_elsewhere_on_its_field_flies_the_same_mission() -> None:
    assert asking(38.0, before=30.0, what="path_length").verdict == "fixed_as_promised"
    assert asking(60.0, before=30.0, what="path_length").verdict == "cannot_tell"


def test_another_vehicle_than_the_reports_proves_nothing() -> None:
    run = planted_run(speed=5.0)

    def verified(frame: str, robot: str, changed: str = "speed") -> Verification:
        log = replace(run.log, facts={"frame": frame}, robot=Robot(robot, robot, "the board", is_sure=True))
        known = Robot("a", "a", "the board", is_sure=True).digest
        said = replace(promise(), format=run.log.format, frame="QUAD/X", robot=known)
        made = {"FRAME_TYPE": (0.0, 1.0)} if changed == "FRAME_TYPE" else {"speed": (2.0, 5.0)}
        said = replace(said, sets=(replace(PROMISED, changes=made),))
        return verify(said, triaged(replace(run, log=log)), SCHEMA)

    assert verified("QUAD/X", "a").verdict == "fixed_as_promised"
    assert "its frame is HEXA/X, that of the report QUAD/X" in verified("HEXA/X", "a").sentence
    assert verified("HEXA/X", "a").verdict == "cannot_tell"
    assert verified("QUAD/X", "b").verdict == "cannot_tell"
    assert verified("QUAD/PLUS", "a", changed="FRAME_TYPE").verdict != "cannot_tell", "that is what was to be changed"


def test_an_alternative_that_was_made_instead_is_what_is_judged() -> None:
    other = PromisedSet({"planner": (1.0, 0.0), "speed": (2.0, 4.0)}, 0.7, {})
    found = checked(other, speed=4.0, planner=0.0)
    assert found.chosen == 1
    assert found.p_fixed == 0.7
    assert [change.made for change in found.changes] == ["made", "made"]


def test_an_option_of_two_keys_is_made_when_both_are() -> None:
    both = PromisedSet({"radius": (0.5, 0.3)}, 0.9, {})
    run = planted_run(radius=0.3)
    for values, made in (((0.3, 0.3), "made"), ((0.3, 0.5), "not_made"), ((0.4, 0.4), "other_value")):
        keys = dict(zip(("/a/radius", "/b/radius"), values, strict=True))
        driven = replace(run, settings={key: Setting(key, value, "log") for key, value in keys.items()})
        found = verify(replace(promise(), sets=(both,)), triaged(driven), SCHEMA)
        assert found.changes[0].made == made
    unread = triaged(replace(run, config={}))
    assert verify(replace(promise(), sets=(both,)), unread, SCHEMA).changes[0].made == "unknown"


@settings(deadline=None)
@given(st.floats(-1e6, 1e6, allow_subnormal=False))
def test_a_value_is_the_same_after_a_trip_through_32_bits(value: float) -> None:
    import numpy as np

    assert same_value(value, float(np.float32(value))) or abs(value) < 1e-9


# Triage has the last word


def lost(severity: Severity = "critical") -> Finding:
    return Finding("crash", "it hit the ground", 40.0, 41.0, severity, "24 m/s", "EV")


def test_a_run_that_triage_calls_lost_has_not_recovered() -> None:
    found = verify(promise(), triaged(planted_run(speed=5.0), lost()), SCHEMA)
    assert {check.outcome for check in found.objectives} == {"kept", "recovered"}
    assert found.verdict == "not_fixed"
    assert found.worked is False
    assert "it hit the ground" in found.sentence
    assert found.headline.startswith("FAULT")
    warned = verify(promise(), triaged(planted_run(speed=5.0), lost("warning")), SCHEMA)
    assert warned.verdict == "fixed_as_promised"


def test_objectives_that_the_report_leaves_out_count_too() -> None:
    fast = replace(promise(), objectives={"success": ReportedObjective(1.0, "ok", SUCCESS.threshold)})
    found = verify(fast, triaged(planted_run(speed=5.0, planner=2.0)), SCHEMA)
    assert found.verdict == "not_fixed"
    assert "time" in found.sentence


def test_a_run_that_no_profile_fits_or_that_has_no_objective_cannot_be_told() -> None:
    found = verify(promise(), triaged(planted_run(speed=5.0), fit=Fit("no", ("no mission",))), SCHEMA)
    assert found.verdict == "cannot_tell"
    nothing = replace(triaged(planted_run(speed=5.0)), objectives=())
    assert verify(promise(), nothing, SCHEMA).verdict == "cannot_tell"


def test_a_reports_own_limit_counts_where_it_is_stricter_only() -> None:
    def with_limit(bound: float, run: Run, *given: str) -> Verification:
        time = ReportedObjective(230.0, "fault", Threshold("<=", bound))
        said = promise()
        return verify(replace(said, objectives={**said.objectives, "time": time}), triaged(run), SCHEMA, given)

    assert with_limit(50.0, planted_run(speed=5.0)).verdict == "not_fixed"
    assert with_limit(50.0, planted_run(speed=5.0), "time").verdict == "fixed_as_promised", "who gives one decides"
    slow = with_limit(1e9, planted_run(speed=5.0, planner=2.0))
    assert slow.verdict == "not_fixed"
    assert any("--threshold time=1e+09" in note for note in slow.notes)


def unmeasured(report: Path) -> Path:
    """The same report with a change whose odds were not measured, of another log."""
    data = YAML(typ="safe").load(report)
    data["log"]["sha256"] = "0" * 64
    data["fix"] |= {"p_fixed": None, "shown_by": "pitch oscillates"}
    other = report.with_suffix(".json")
    other.write_text(json.dumps(data), encoding="utf-8")
    return other


# Reports on disk


def test_a_report_is_read_back_from_json_and_yaml(tmp_path: Path) -> None:
    report = build_document(made_diagnosis())
    (tmp_path / "r.json").write_text(to_json(report), encoding="utf-8")
    (tmp_path / "r.yaml").write_text(to_yaml(report), encoding="utf-8")
    from_json, from_yaml = read_report(tmp_path / "r.json"), read_report(tmp_path / "r.yaml")
    assert from_json == from_yaml
    assert json.loads(to_json(report)) == json.loads(from_json.to_json())


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "a: [",
        "[1, 2]",
        "schema: care.triage/2",
        "schema: care.triage/1",
        "schema: care.triage/1\nfix: 3",
        "!!python/object:os.system x",
        "\x00",
        "{" * 5000,
        "[" * 5000,
    ],
)
def test_what_is_no_report_is_refused_in_a_sentence(tmp_path: Path, text: str) -> None:
    path = tmp_path / "r.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        read_report(path)
    assert caught.value.where == str(path)
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError):
        read_report(path)
    with pytest.raises(ConfigError):
        read_report(tmp_path / "missing.yaml")


# The command

SAMPLE = Path(__file__).parents[2] / "samples/arducopter_failed.BIN"


@pytest.fixture(scope="module")
def written() -> str:
    return care_core.triage(SAMPLE).report("yaml")


@pytest.fixture
def report(written: str, tmp_path: Path) -> Path:
    path = tmp_path / "report.yaml"
    path.write_text(written, encoding="utf-8")
    return path


def test_the_log_of_the_report_itself_tells_nothing(care: Care, report: Path) -> None:
    code, out, _ = care("verify", report, SAMPLE)
    assert code == 3
    assert "NOT MADE" in out


def test_a_run_that_still_fails_ends_with_1(care: Care, report: Path) -> None:
    data = YAML(typ="safe").load(report)
    data["log"]["sha256"] = "0" * 64
    other = report.with_suffix(".json")
    other.write_text(json.dumps(data), encoding="utf-8")
    code, out, _ = care("verify", other, SAMPLE, "--json")
    _, schema, _ = care("schema", "verify")
    document = json.loads(out)
    jsonschema.validate(document, json.loads(schema))
    assert code == 1
    assert document["verdict"] == "change_not_made"
    assert document["worked"] is None


def test_the_odds_as_driven_stand_beside_the_promise(care: Care, report: Path) -> None:
    assert re.search(r"\(promised at \d+%; as driven \d+%\)", care("verify", report, SAMPLE).stdout)


def test_odds_that_were_not_measured_promise_nothing(care: Care, report: Path) -> None:
    code, out, _ = care("verify", unmeasured(report), SAMPLE)
    assert code == 1
    assert "Changes (odds not measured)" in out
    document = json.loads(care("verify", unmeasured(report), SAMPLE, "--json").stdout)
    assert document["p_fixed"] is None


def test_a_report_for_people_is_told_from_one_for_programs(care: Care, tmp_path: Path) -> None:
    told = tmp_path / "report.md"
    care("triage", SAMPLE, "--out", told)
    code, _, err = care("verify", told, SAMPLE)
    assert code == 2
    assert "is for people to read" in err
    assert "--out report.yaml" in err


def test_a_run_is_judged_against_the_reference_of_the_triage(care: Care, report: Path, tmp_path: Path) -> None:
    """Who vouches for a slow landing is wanted no faster a mission, then and afterwards."""
    slow = tmp_path / "ours.param"
    slow.write_text("LAND_SPEED,16\n", encoding="utf-8")

    def bound(*more: object) -> float:
        _, out, _ = care("verify", report, SAMPLE, "--json", *more)
        (time,) = (one for one in json.loads(out)["objectives"] if one["after"]["name"] == "mission_time")
        return float(time["after"]["threshold"]["value"])

    _, out, _ = care("triage", SAMPLE, "--reference", slow, "--json")
    (judged,) = (one for one in json.loads(out)["objectives"] if one["name"] == "mission_time")
    assert bound("--reference", slow) == judged["threshold"]["value"] > bound()
    assert care("whatif", SAMPLE, "--set", "LAND_SPEED=40", "--reference", slow).code == 0


@pytest.mark.parametrize("log", ["samples/arducopter_motor.BIN", "tests/data/arducopter_good.BIN"])
def test_it_ends_as_triage_of_the_run_does(care: Care, report: Path, log: str) -> None:
    run = Path(__file__).parents[2] / log
    assert care("verify", report, run).code == care("triage", run).code


def test_what_cannot_be_verified_is_refused(care: Care, report: Path, tmp_path: Path) -> None:
    assert care("verify", tmp_path / "none.yaml", SAMPLE).code == 2
    assert care("verify", report, tmp_path / "none.BIN").code == 4
    data = YAML(typ="safe").load(report)
    data["fix"], data["abstained"] = None, "nothing explains it"
    report.write_text(json.dumps(data), encoding="utf-8")
    code, _, err = care("verify", report, SAMPLE)
    assert code == 2
    assert "nothing explains it" in err


def test_another_fault_of_the_same_vehicle_is_no_recovery(care: Care, recorded: Path, tmp_path: Path) -> None:
    faults = recorded / "data/arducopter/faults"
    path = tmp_path / "report.json"
    care("triage", faults / "f77_005.BIN", "--json", "--out", path)
    code, out, _ = care("verify", path, faults / "f77_007.BIN")
    assert code == 1
    assert "LAND_SPEED" in out
    assert "also changed" in out
