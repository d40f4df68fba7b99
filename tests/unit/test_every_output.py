"""What holds of every output, whatever its format: the fit stands behind the verdict, no number without its caveat."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import pytest

import care_core
from care_core.application.case import Case
from care_core.application.open_run import Reading
from care_core.diagnose.records import Diagnosis, Fix, MissionVerdict
from care_core.diagnose.whatif import question
from care_core.history.store import Triaged
from care_core.records import replace
from care_core.report.document import build_document
from care_core.report.history import history_document, history_text
from care_core.report.html import to_html
from care_core.report.markdown import to_markdown
from care_core.report.terminal import to_text
from care_core.report.whatif import whatif_document, whatif_text
from care_core.report.writers import published, to_json, to_yaml
from care_core.run import Damage, Fit, FitVerdict
from care_tui.render.answer import answer_lines
from care_tui.render.causes import cause_item, worth_rows
from care_tui.render.fix import option_change, outcome_rows
from care_tui.render.rows import UNICODE
from care_tui.session import Session
from tests.made import LAND_SPEED, made_diagnosis

SAMPLE = Path(__file__).parents[2] / "samples" / "arducopter_failed.BIN"
OPTION = "LAND_SPEED"


@pytest.fixture(scope="module")
def reading() -> Reading:
    found = care_core.triage(SAMPLE).reading
    assert found is not None
    return found


def outputs(diagnosis: Diagnosis) -> Mapping[str, str]:
    """Every format of a diagnosis."""
    report = build_document(diagnosis)
    history = history_document(
        [Triaged(at="2026-01-01T00:00:00", log_path="/a.BIN", mission=1, document=published(report))], []
    )
    return {
        "text": to_text(diagnosis),
        "json": to_json(report),
        "yaml": to_yaml(report),
        "markdown": to_markdown(report),
        "html": to_html(report),
        "history": history_text(history),
        "history json": history.to_json(),
    }


def opened(diagnosis: Diagnosis) -> Session:
    """The app's session with this diagnosis."""
    session = Session()
    session.take(Case(diagnosis, (LAND_SPEED,)))
    return session


@pytest.mark.parametrize(
    ("verdict", "said"), [("fits", "fits"), ("partly", "partly fits: old firmware"), ("no", "does not fit: a rover")]
)
def test_every_output_says_how_well_the_profile_fits_behind_its_verdict(
    reading: Reading, verdict: FitVerdict, said: str
) -> None:
    made = made_diagnosis()
    reasons = (said.partition(": ")[2],) if ": " in said else ()
    choice = replace(made.profile, fit=Fit(verdict, reasons))
    shown = outputs(replace(made, profile=choice))
    expected = f"Profile arducopter {said}"
    assert shown["text"].startswith("FAULT: ")
    assert f"\n{expected}\n" in shown["text"].partition("\n\n")[0] + "\n"
    assert f"\n# {expected}\n" in shown["yaml"]
    assert shown["markdown"].split("\n\n")[4].startswith(expected)
    assert f"<p>{expected}.</p>" in shown["html"].partition("<h1>")[2].partition("<dl")[0]
    assert list(json.loads(shown["json"]))[:2] == ["schema", "fit"]
    assert expected.partition(":")[0].removeprefix("Profile ") in shown["history"].splitlines()[0]
    assert json.loads(shown["history json"])["triages"][0]["fit"] == verdict
    pinned = [line.plain for line in answer_lines(opened(replace(made, profile=choice)), UNICODE, 79, is_low=False)]
    if verdict == "fits":
        assert pinned[0].endswith("  profile fits"), "a word in the corner"
    else:
        assert any(line.startswith(f"! {expected}") for line in pinned)
    asked = replace(reading.question, profile=replace(reading.choice, fit=choice.fit))
    answer = asked.ask({OPTION: 40.0})
    assert whatif_text(asked, answer).startswith(expected)
    assert list(json.loads(whatif_document(asked, answer).to_json()))[:2] == ["schema", "fit"]


def test_the_app_pins_the_next_step_and_the_worse_mission_and_one_line_of_limits() -> None:
    made = made_diagnosis()
    limited = replace(made.profile, fit=Fit("partly", ("old firmware",)))
    own = made.run.mission
    worse = MissionVerdict(replace(own, index=own.index + 1, count=2), "fault", "it crashed")
    run = replace(made.run, log=replace(made.run.log, damage=(Damage("3 bytes are no packets"),)))
    session = opened(replace(made, run=run, profile=limited, missions=(worse,)))

    def pinned(*, is_low: bool, is_tall: bool) -> list[str]:
        lines = answer_lines(session, UNICODE, 119, is_low=is_low, is_tall=is_tall)
        return [line.plain for line in lines]

    usual = pinned(is_low=False, is_tall=False)
    assert not any(line.startswith("Next") for line in usual)  # the change says it
    assert any(line.startswith("Next     make the change") for line in pinned(is_low=False, is_tall=True))
    (limits,) = (line for line in usual if line.startswith("! "))
    assert limits.startswith(f"! FAULT in mission {own.index + 1} of this log, too (t); Profile arducopter partly fits")
    tall = [line for line in pinned(is_low=False, is_tall=True) if line.startswith("! ")]
    assert len(tall) == 3
    assert tall[0].endswith("too (t): it crashed")
    assert not any(line.startswith("Next") for line in pinned(is_low=True, is_tall=False))


def test_the_odds_without_a_change_are_never_cut_off() -> None:
    made = made_diagnosis()
    made = replace(made, odds_as_driven=0.02, health=replace(made.health, findings=()))
    long = replace(LAND_SPEED, name="/controller_server.FollowPath.use_rotate_to_heading_allowed")
    assert made.fix is not None
    (change,) = made.fix.changes
    session = opened(replace(made, fix=replace(made.fix, changes=(change, replace(change, option=long)))))
    for width in (64, 79, 119):
        (line,) = (one for one in answer_lines(session, UNICODE, width, is_low=False) if one.plain.startswith("Change"))
        assert line.cell_length <= width
        assert line.plain.startswith("Change   █████████░  90%  land_speed")
        assert line.plain.endswith(" and 1 more  without 2%")


def test_a_value_that_no_source_holds_is_shown_as_assumed_in_every_output(reading: Reading) -> None:
    made = made_diagnosis()
    assert made.fix is not None
    (fault,), (change,) = made.faults, made.fix.changes
    fix = replace(made.fix, changes=(replace(change, is_assumed=True),))
    cause = replace(fault.causes[0], is_assumed=True)
    diagnosis = replace(
        made,
        run=replace(made.run, config={}, settings={}),
        faults=(replace(fault, causes=(cause,)),),
        fix=fix,
        alternatives=(fix,),
    )
    shown = outputs(diagnosis)
    for name in ("text", "markdown", "html"):
        changes = [
            line for line in shown[name].replace("\\_", "_").splitlines() if "land_speed" in line and "16" in line
        ]
        assert len(changes) >= 3, f"{name}: headline, cause and alternative"
        assert [line for line in changes if "16 (assumed)" not in line] == [], name
    document = json.loads(shown["json"])
    assert document["faults"][0]["causes"][0]["assumed"] is document["fix"]["changes"][0]["assumed"] is True
    assert shown["yaml"].count("assumed: true") == 3, "the cause, the change and that of the alternative"
    assert "-LAND_SPEED" not in shown["yaml"], "what no source holds is no line of the configuration as driven"
    assert "16 (assumed) → 50" in cause_item(cause, None, None, UNICODE, 80).plain
    assert "16 (assumed) → 50" in option_change(LAND_SPEED, 16.0, True, 50.0, True, UNICODE).plain
    assert "16 cm/s (assumed)" in option_change(LAND_SPEED, 16.0, True, None, False, UNICODE).plain

    judged = reading.judged
    config = {name: value for name, value in judged.run.config.items() if name != OPTION}
    asked = question(replace(judged, run=replace(judged.run, config=config)), reading.profile, reading.choice)
    answer = asked.ask({OPTION: 40.0})
    assert f"{OPTION}  19 (assumed) -> 40 cm/s" in whatif_text(asked, answer)
    assert json.loads(whatif_document(asked, answer).to_json())["changes"][0]["assumed"] is True


def test_no_probability_outside_the_training_runs_stands_without_its_warning(reading: Reading) -> None:
    made = made_diagnosis()
    assert made.fix is not None
    fix = replace(made.fix, changes=tuple(replace(change, in_support=False) for change in made.fix.changes))
    shown = outputs(replace(made, fix=fix, alternatives=(fix,), faults=(), hypotheses=()))
    for name in ("text", "markdown", "html"):
        assert "90% probability" in shown[name].replace("\u00a0", " "), name
        assert unwarned(shown[name], fix) == [], name
    assert json.loads(shown["json"])["fix"]["guess"] is True
    rows = [row.content.plain for row in outcome_rows(fix, made.objectives, UNICODE)]
    assert [row for row in rows if "92%" in row and "a guess" not in row] == []

    answer = reading.question.ask({OPTION: 400.0})
    asked = Fix(answer.changes, answer.p_ok, {str(i): one.predicted for i, one in enumerate(answer.outlooks)})
    assert asked.is_guess
    assert json.loads(whatif_document(reading.question, answer).to_json())["guess"] is True
    assert unwarned(whatif_text(reading.question, answer), asked) == []


def unwarned(text: str, fix: Fix) -> list[str]:
    """Lines with a probability of this fix that do not say that it is a guess."""
    promised = {f"{fix.p_fixed:.0%}", *(f"{one.p_ok:.0%}" for one in fix.predicted.values() if one.p_ok is not None)}
    return [line for line in text.splitlines() if any(one in line for one in promised) and "guess" not in line]


def test_every_promise_stands_beside_the_odds_as_driven() -> None:
    made = made_diagnosis()
    assert made.fix is not None
    diagnosis = replace(made, odds_as_driven=0.05, alternatives=(made.fix,))
    shown = outputs(diagnosis)
    for name in ("text", "markdown", "html"):
        flat = " ".join(shown[name].split())
        assert flat.count("; as driven 5%") >= 3, f"{name}: headline, cause and alternative"
    assert "(90%; as driven 5%)" in shown["history"]
    assert json.loads(shown["json"])["odds_as_driven"] == 0.05
    cause, result = diagnosis.faults[0].causes[0], diagnosis.faults[0].objective
    (odds,) = [row.content.plain for row in worth_rows(cause, result, 0.05, UNICODE) if "90%" in row.content.plain]
    assert odds.endswith("90%  without 5%")
