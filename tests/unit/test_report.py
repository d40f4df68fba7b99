"""The published document and its writers: exact keys, clean text, no number that JSON lacks."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import jsonschema
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ruamel.yaml import YAML

from care_core.diagnose.records import Prediction
from care_core.errors import UsageError
from care_core.report import (
    build_document,
    json_schema,
    to_json,
    to_markdown,
    to_text,
    to_yaml,
    write_atomically,
)
from care_core.text import clean
from tests.made import HOSTILE, made_diagnosis

KEYS = ["schema", "profile", "log", "config", "context", "metrics", "objectives", "faults", "fix", "abstained"]


def test_the_document_has_exactly_the_published_keys() -> None:
    document = json.loads(to_json(build_document(made_diagnosis())))
    assert list(document) == KEYS
    assert document["schema"] == "care.triage/1"
    assert list(document["profile"]) == ["name", "version", "platform"]
    assert list(document["log"]) == ["path", "format", "start", "duration_s", "damage", "sha256"]
    assert list(document["objectives"][0]) == ["name", "value", "unit", "kind", "threshold", "status", "reason"]
    assert document["objectives"][2]["reason"] == "no BAT in the log"
    (fault,) = document["faults"]
    (cause,) = fault["causes"]
    assert list(cause) == [
        "rank", "option", "path", "path_ace", "contribution", "current", "suggested", "predicted", "p_fixed",
        "confidence", "edge_support", "in_support", "notes",
    ]  # fmt: skip
    assert cause["path"] == ["land_speed", "land_time", "mission_time"]
    assert cause["predicted"] == {"value": 140.0, "low": 130.0, "high": 149.0}
    assert list(document["fix"]) == ["changes", "p_fixed", "predicted", "alternatives"]
    assert document["fix"]["changes"] == [
        {"option": "land_speed", "parameter": "LAND_SPEED", "from": 16, "to": 50, "reboot_required": False}
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
    schema = json_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    for diagnosis in (made_diagnosis(), replace(made_diagnosis(), fix=None, faults=(), abstained="wind")):
        jsonschema.validate(json.loads(to_json(build_document(diagnosis))), schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({"schema": "care.triage/2"}, schema)


def test_yaml_adds_the_diff_and_its_commands() -> None:
    report = build_document(made_diagnosis())
    data = YAML(typ="safe").load(to_yaml(report))
    assert list(data) == [*KEYS, "diff", "apply"]
    assert {key: data[key] for key in KEYS} == json.loads(to_json(report))
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
    assert text.startswith(
        "# Triage of a.BIN\n\n**Fault**: `mission_time`. Change `land_speed` from 16 to 50: 90% odds"
    )
    assert "land_speed → land_time → mission_time" in text
    assert "```diff\n--- as driven" in text


def test_the_terminal_text_answers_first_and_fits_80_columns() -> None:
    text = to_text(made_diagnosis())
    lines = text.splitlines()
    assert lines[0] == "FAULT: mission_time = 190, wanted <= 150 s"
    assert "land_speed 16 -> 50" in lines[1]
    assert max(map(len, lines)) <= 80
    for part in (
        "OK ",
        "NOT EVALUATED",
        "land_speed -> land_time -> mission_time",
        "+LAND_SPEED,50",
        "high confidence",
    ):
        assert part in text


def test_the_other_headlines() -> None:
    diagnosis = replace(made_diagnosis(), faults=(), fix=None)
    fine = replace(diagnosis, objectives=diagnosis.objectives[:1])
    unknown = replace(diagnosis, objectives=diagnosis.objectives[2:])
    lost = replace(made_diagnosis(), fix=None, abstained="nothing in the profile explains this run")
    assert to_text(fine).startswith("OK: ")
    assert to_text(unknown).startswith("NOT EVALUATED: ")
    assert "No answer: nothing in the profile" in to_text(lost)
    assert "**No fault found.**" in to_markdown(build_document(fine))
    assert "not everything" in to_markdown(build_document(unknown))
    assert "**Fault**: `mission_time`. **No answer**: nothing" in to_markdown(build_document(lost))


def test_markdown_gives_odds_for_a_yes_or_no_objective_and_a_unit_for_a_measured_one() -> None:
    diagnosis = made_diagnosis()
    fix = diagnosis.fix
    assert fix is not None
    name = next(o.variable.name for o in diagnosis.objectives if o.variable.kind == "functional")
    predicted = {**fix.predicted, name: Prediction(0.94, 1.0, 1.0, p_ok=0.94)}
    text = to_markdown(build_document(replace(diagnosis, fix=replace(fix, predicted=predicted))))
    assert f"| `{name}` | 94% odds |" in text
    assert re.search(r"\| `mission_time` \| .* to .*\) s \|", text)


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
