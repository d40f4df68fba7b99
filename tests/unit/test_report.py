"""The published document and its writers: exact keys, clean text, no number that JSON lacks."""

from __future__ import annotations

import json
import re
from pathlib import Path

import jsonschema
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ruamel.yaml import YAML

from care_core.diagnose.records import (
    Fault,
    Hypothesis,
    ObjectiveResult,
    ParameterChange,
    PathNode,
    Prediction,
    Since,
)
from care_core.diagnose.since import with_evidence
from care_core.diagnose.triage import unjudged
from care_core.ecosystems.findings import NOTHING_SEEN, Event, Finding
from care_core.errors import UsageError
from care_core.files import write_atomically
from care_core.records import replace
from care_core.report.document import TriageDocument, build_document
from care_core.report.health import telling
from care_core.report.html import to_html
from care_core.report.markdown import to_markdown
from care_core.report.terminal import to_text
from care_core.report.writers import to_json, to_yaml
from care_core.run import Damage, Evidence, Fit, ProfileChoice
from care_core.text import clean
from tests.made import DRIVEN, ENERGY, HOSTILE, LAND_SPEED, made_diagnosis

KEYS = ["schema", "fit", "profile", "log", "config", "context", "metrics", "objectives", "faults", "fix", "abstained"]
HAPPENED = ["account", "findings", "hypotheses"]
ADDED = [*HAPPENED, "notes", "sources", "since", "missions", "evidence", "rivals", "tell_more", "dismissed",
         "odds_as_driven", "headline", "next_step", "outside", "status"]  # fmt: skip


def test_the_document_has_exactly_the_published_keys() -> None:
    document = json.loads(to_json(build_document(made_diagnosis())))
    assert list(document) == [*KEYS, *ADDED]
    assert (document["schema"], document["status"]) == ("care.triage/1", "fault")
    assert list(document["profile"]) == ["name", "version", "platform"]
    assert list(document["log"]) == ["path", "format", "start", "duration_s", "damage", "sha256"]
    assert list(document["objectives"][0]) == [
        "name", "value", "unit", "kind", "threshold", "needs", "basis", "status", "reason"
    ]  # fmt: skip
    assert document["objectives"][2]["reason"] == "no BAT in the log"
    (fault,) = document["faults"]
    (cause,) = fault["causes"]
    assert list(cause) == [
        "rank", "option", "path", "path_ace", "contribution", "current", "assumed", "suggested", "predicted", "p_fixed",
        "confidence", "edge_support", "in_support", "notes",
    ]  # fmt: skip
    assert cause["path"] == ["land_speed", "land_time", "mission_time"]
    assert cause["predicted"] == {"value": 140.0, "low": 130.0, "high": 149.0}
    keys = ["changes", "p_fixed", "guess", "shown_by", "predicted", "by_hand", "why_this", "alternatives"]
    assert list(document["fix"]) == keys
    assert document["fix"]["changes"] == [
        {
            "option": "land_speed",
            "parameter": "LAND_SPEED",
            "from": 16,
            "to": 50,
            "assumed": False,
            "reboot_required": False,
        }
    ]
    assert document["fix"]["predicted"]["mission_time"]["status"] == "ok"


def test_what_is_not_a_number_becomes_null() -> None:
    text = to_json(build_document(made_diagnosis()))
    document = json.loads(text, parse_constant=pytest.fail)
    assert document["context"] == {"wind": None}
    assert document["metrics"] == {"land_time": 60.0, "broken": None}
    assert document["faults"][0]["causes"][0]["edge_support"] == [0.97, None]
    assert "energy" not in document["fix"]["predicted"]


def test_the_document_keeps_its_published_schema() -> None:
    schema = TriageDocument.json_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    for diagnosis in (made_diagnosis(), replace(made_diagnosis(), fix=None, faults=(), abstained="wind")):
        jsonschema.validate(json.loads(to_json(build_document(diagnosis))), schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({"schema": "care.triage/2"}, schema)


def test_yaml_adds_the_diff_and_its_commands() -> None:
    report = build_document(made_diagnosis())
    data = YAML(typ="safe").load(to_yaml(report))
    assert list(data) == [*KEYS, *ADDED, "diff", "apply"]
    assert {key: data[key] for key in (*KEYS, *ADDED)} == json.loads(to_json(report))
    assert "+LAND_SPEED,50" in data["diff"]
    assert data["apply"] == ["param set LAND_SPEED 50"]


def test_what_differs_from_the_profile_stands_beside_each_cause() -> None:
    report = build_document(made_diagnosis())
    assert any(note.startswith("firmware") for note in report.faults[0].causes[0].notes)


def test_no_text_of_a_log_can_steer_a_terminal_or_a_table() -> None:
    diagnosis = made_diagnosis()
    report = build_document(diagnosis)
    for text in (to_json(report), to_yaml(report), to_markdown(report), to_text(diagnosis)):
        assert not set(text) & {"\x1b", "\x07", "\u202e"}
    assert "\\[bold\\]\\|red\\|" in to_markdown(report)


def test_markdown_can_be_pasted_into_a_ticket() -> None:
    text = to_markdown(build_document(made_diagnosis()))
    assert text.startswith("# Triage of a.BIN\n\n**FAULT**: too slow: 190 s, limit 150 s")
    assert "\n\nProfile arducopter partly fits: firmware" in text
    answer = text.replace("\\", "")
    assert "\n\n**FAULT**: too slow: 190 s, limit 150 s; motor 2" in answer
    assert "\n\nChange land_speed 16 -> 50 (70% the cause): 90% probability that all objectives are met" in answer
    assert "land_speed → land_time → mission_time" in text
    assert "```diff\n--- as driven" in text


def test_the_terminal_text_answers_first_and_fits_80_columns() -> None:
    text = to_text(made_diagnosis())
    lines = text.splitlines()
    assert lines[0].startswith("FAULT: too slow: 190 s, limit 150 s; motor 2")
    assert "land_speed 16 -> 50" in lines[2]
    assert any(line.startswith("Profile arducopter partly fits: firmware Arm:") for line in lines[3:9])
    assert max(map(len, lines)) <= 80
    for part in (
        "OK ",
        "NOT EVALUATED",
        "land_speed -> land_time -> mission_time",
        "+LAND_SPEED,50",
        "high confidence",
    ):
        assert part in text


def test_faults_that_move_together_are_shown_once_and_others_apart() -> None:
    diagnosis = made_diagnosis()
    (late,) = diagnosis.faults
    (cause,) = late.causes
    drained = ObjectiveResult(ENERGY, 15.0, ENERGY.threshold, "fault")
    onward = replace(cause, path=(*cause.path, PathNode("energy", "Wh", 15.0, 11.0)))
    elsewhere = replace(cause, path=(cause.path[0], PathNode("energy", "Wh", 15.0, 11.0)))
    for causes, headings in (((onward,), ["mission_time and energy"]), ((elsewhere,), ["mission_time", "energy"])):
        both = replace(diagnosis, faults=(late, Fault(drained, causes)))
        text, document = to_text(both), build_document(both)
        assert [line[10:] for line in text.splitlines() if line.startswith("Causes of ")] == headings
        assert to_markdown(document).count("## Causes of") == to_html(document).count("<h2>Causes of") == len(headings)
        assert [fault.objective for fault in document.faults] == ["mission_time", "energy"]


def test_a_cause_that_hardly_acted_is_named_and_no_more() -> None:
    made = made_diagnosis()
    told = replace(made, fix=None, alternatives=(), hypotheses=(Hypothesis("parameter", "land_speed", 0.04, 0.04),))
    text = to_text(told)
    assert "Causes of mission_time\n  below 5%: land_speed\n" in text
    assert "land_speed -> land_time" not in text
    likely = replace(told, hypotheses=(Hypothesis("parameter", "land_speed", 0.03, 0.2),))
    assert "land_speed -> land_time" in to_text(likely)
    assert build_document(told).faults == build_document(likely).faults


def test_what_a_finding_cites_and_each_landing_stand_in_what_happened() -> None:
    early = [Event(float(n), "message", f"chatter {n}", "MSG") for n in range(40)]
    cited = Event(67.2, "topic", "the vertical speed is reset", "estimator_status")
    landed = Event(67.4, "flight", "landed", "vehicle_land_detected")
    late = [Event(70.0 + n, "message", f"noise {n}", "MSG") for n in range(10)]
    idle = Finding("motor", "the motors stopped", 67.3, 68.0, "critical", "idle; a reset at 67.2 s", "outputs")
    shown = telling([*early, cited, landed, *late], 10, [idle])
    assert cited in shown
    assert landed in shown
    assert shown == sorted(shown, key=lambda one: one.time_s)
    assert cited not in telling([*early, cited, landed, *late], 10)


def test_a_message_that_stands_elsewhere_is_not_repeated() -> None:
    made = made_diagnosis()
    happened = Event(60.0, "error", "WARN /move_base: Rotation cmd in collision (30 times, until 67.5 s)", "/rosout")
    evidence = (
        Evidence(60.0, "Rotation cmd in collision (30 times)", "planner"),
        Evidence(67.0, "goal 1 aborted after 15 s", "abort", is_concluded=True),
        Evidence(68.0, "Thrust loss", "thrust", ("land_speed",), "the motors were at their limit"),
    )
    health = replace(made.health, timeline=(happened,))
    told = replace(made, run=replace(made.run, evidence=evidence), health=health)
    assert "Messages of this run" not in to_text(told)
    alone = replace(told, health=replace(health, timeline=()))
    assert to_text(alone).count("Rotation cmd in collision (30 times)") == 1
    assert "goal 1 aborted" not in to_text(alone)
    assert len(build_document(told).evidence) == len(evidence)


def test_a_refusal_is_no_evidence_of_itself() -> None:
    made = made_diagnosis()
    why = "AHRS: waiting for home"
    refused = Finding("prearm", f"arming was refused: {why}", 1.0, 9.0, "critical", f"{why}; A is 2 (default 1)", "MSG")
    text = to_text(replace(made, health=replace(made.health, findings=(refused,))))
    assert "            A is 2 (default 1)\n" in text


def test_alternatives_are_offered_with_their_probability() -> None:
    diagnosis = made_diagnosis()
    assert "or land_speed 16 -> 50: 90% probability" in to_text(diagnosis)
    assert "- land\\_speed 16 -\\> 50: 90% probability" in to_markdown(build_document(diagnosis))


def test_the_other_headlines() -> None:
    diagnosis = replace(made_diagnosis(), faults=(), fix=None, health=NOTHING_SEEN)
    fine = replace(diagnosis, objectives=diagnosis.objectives[:1])
    unknown = replace(diagnosis, objectives=diagnosis.objectives[2:])
    lost = replace(made_diagnosis(), fix=None, abstained="nothing in the profile explains this run")
    assert to_text(fine).startswith("OK: ")
    assert to_text(unknown).startswith("NOT EVALUATED: ")
    assert "No change advised: nothing in the profile" in to_text(lost)
    assert "**OK**: all objectives are within their thresholds." in to_markdown(build_document(fine))
    assert "**NOT EVALUATED**: no BAT in the log." in to_markdown(build_document(unknown))
    assert "No change advised: nothing in the profile explains this run" in to_markdown(build_document(lost))


def test_a_crash_is_never_called_fine() -> None:
    diagnosis = replace(made_diagnosis(), faults=(), fix=None)
    fine = replace(diagnosis, objectives=diagnosis.objectives[:1])
    assert "FAULT: motor 2" in to_text(fine)
    assert "**FAULT**: motor 2" in to_markdown(build_document(fine))
    assert "<strong>FAULT</strong>: motor 2" in to_html(build_document(fine))


def test_what_the_model_says_of_an_explanation_has_six_digits() -> None:
    told = (Hypothesis("parameter", "LAND_SPEED", 0.903142857142857, 0.93314285714285716),)
    entry = build_document(replace(made_diagnosis(), hypotheses=told)).hypotheses[0]
    assert (entry.probability, entry.acts) == (0.903143, 0.933143)


def test_a_log_without_a_profile_tells_what_happened() -> None:
    made = made_diagnosis()
    choice = ProfileChoice("", "", "", "", Fit("no", ("none of the 5 installed profiles reads px4-ulg",)))
    diagnosis = unjudged(made.run.log, made.run.settings, choice, made.health)
    document = json.loads(to_json(build_document(diagnosis)))
    jsonschema.validate(document, TriageDocument.json_schema())
    assert document["profile"] is None
    assert document["fit"] == {"verdict": "no", "reasons": ["none of the 5 installed profiles reads px4-ulg"]}
    assert document["objectives"] == document["faults"] == []
    assert document["findings"][0]["kind"] == "motor"
    assert sum(one["probability"] for one in document["hypotheses"]) == pytest.approx(1.0)
    text = to_text(diagnosis)
    assert text.startswith("FAULT: motor 2")
    assert "\nNo profile fits this log: no limits for time and energy, no causes by parameters\n" in text
    assert to_markdown(build_document(diagnosis)).count("**FAULT**: motor 2") == 1


def test_what_explains_the_failure_comes_before_the_parameters() -> None:
    text = to_text(made_diagnosis())
    explained, found, happened, causes = map(text.index, ("What explains it", "Findings", "What happened", "Causes of"))
    assert explained < found < happened < causes
    assert "led to: control was lost" in text


def test_markdown_gives_probability_for_a_yes_or_no_objective_and_a_unit_for_a_measured_one() -> None:
    diagnosis = made_diagnosis()
    fix = diagnosis.fix
    assert fix is not None
    name = next(o.variable.name for o in diagnosis.objectives if o.variable.kind == "functional")
    predicted = {**fix.predicted, name: Prediction(0.94, 1.0, 1.0, p_ok=0.94)}
    text = to_markdown(build_document(replace(diagnosis, fix=replace(fix, predicted=predicted))))
    assert f"`{name}` 94% probability" in text
    assert re.search(r"`mission_time` .* to .*\) s, 92% probability$", text, re.MULTILINE)


@pytest.mark.parametrize(("path", "span"), [("a_b*.BIN", "`a_b*.BIN`"), ("a``b`.BIN", "``` a``b`.BIN ```")])
def test_a_path_in_markdown_is_shown_as_it_is(path: str, span: str) -> None:
    diagnosis = made_diagnosis()
    log = replace(diagnosis.run.log, path=path)
    text = to_markdown(build_document(replace(diagnosis, run=replace(diagnosis.run, log=log))))
    assert f"Log {span}, " in text


@given(st.text())
def test_clean_text_is_one_printable_line(text: str) -> None:
    shown = clean(text)
    assert all(character.isprintable() or character.isspace() for character in shown)
    assert len(shown.splitlines()) <= 1
    assert clean(shown) == shown


def test_clean_text_shows_what_was_there() -> None:
    assert clean("a\x1b[31mb\nc") == "a\\x1b[31mb c"
    assert clean(HOSTILE).isprintable()
    assert clean("größe 5 m²") == "größe 5 m²"


def test_a_file_is_whole_or_not_there(tmp_path: Path) -> None:
    path = tmp_path / "report.json"
    write_atomically(path, "old")
    write_atomically(path, "new")
    assert path.read_text() == "new"
    assert list(tmp_path.glob(".report*")) == []
    with pytest.raises(UsageError, match="No such file"):
        write_atomically(tmp_path / "none" / "report.json", "x")
    with pytest.raises(UsageError):
        write_atomically(tmp_path / "home", "a folder is in its place")


def test_what_changed_since_the_good_run_is_in_every_format() -> None:
    many = tuple(ParameterChange(f"A{n:02d}", None, 1.0, 2.0) for n in range(30))
    since = Since("/flights/good.BIN", (ParameterChange("LAND_SPEED", LAND_SPEED, 50.0, DRIVEN), *many), (HOSTILE,))
    diagnosis = with_evidence(made_diagnosis(), since)
    report = build_document(diagnosis)
    document = json.loads(to_json(report))
    jsonschema.validate(document, TriageDocument.json_schema())
    assert document["since"]["changes"][0] == {
        "parameter": "LAND_SPEED", "option": "land_speed", "from": 50.0, "to": 16.0
    }  # fmt: skip
    assert len(document["since"]["changes"]) == 31
    assert "changed since good.BIN: 50 -> 16" in document["faults"][0]["causes"][0]["notes"]
    assert "- `LAND_SPEED` (land_speed): 50 → 16" in to_markdown(report)
    text = to_text(diagnosis)
    assert "Changed since good.BIN" in text
    assert "LAND_SPEED (land_speed)  50 -> 16" in text
    assert "A19  1 -> 2" in text
    assert "and 10 more" in text
    assert "\x1b" not in text + to_markdown(report)


def test_a_long_list_of_damage_is_folded() -> None:
    diagnosis = made_diagnosis()
    log = replace(diagnosis.run.log, damage=tuple(Damage(f"lost {n}", n) for n in range(9)))
    diagnosis = replace(diagnosis, run=replace(diagnosis.run, log=log))
    assert "lost 4" in to_text(diagnosis)
    assert "lost 5" not in to_text(diagnosis)
    assert "and 4 more places" in to_text(diagnosis)
    assert len(build_document(diagnosis).log.damage) == 9
