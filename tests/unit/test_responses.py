"""How the odds answer to the value of a parameter: in a page, and of a real run."""

from __future__ import annotations

import re

import pytest

import care_core
from care_core.application.open_run import OpenRun, question_of
from care_core.application.responses import odds_over, responses_of
from care_core.diagnose.records import Odds
from care_core.files import bundled
from care_core.report.axes import Scale
from care_core.report.document import build_document
from care_core.report.html import to_html
from care_core.report.plots import Drawing
from care_core.report.responses import Response
from care_core.variables import Role, Variable
from tests.made import made_diagnosis
from tests.unit.test_report_html import HOSTILE, Seen

SPEED = Variable("speed", Role.OPTION, unit=HOSTILE, range=(0.1, 10.0))
ODDS = tuple(Odds(value, value / 20, value > 5) for value in SPEED.across(9))


@pytest.fixture(scope="module")
def failed() -> OpenRun:
    return care_core.triage(bundled("samples", "arducopter_failed.BIN"))


def test_a_page_draws_a_curve_that_is_broken_where_it_is_a_guess_and_no_text_is_markup() -> None:
    curve = Response(SPEED, ODDS, ((0.2, "as driven"), (4.0, f"suggested {HOSTILE}")))
    page = to_html(build_document(made_diagnosis()), Drawing(responses=(curve,)))
    seen = Seen()
    seen.feed(page)
    assert not seen.open
    assert "script" not in seen.tags
    figure = page[page.index('id="odds1"') : page.index("</figure>", page.index('id="odds1"'))]
    known, guessed = re.findall(r'class="line (\w+)" d="M([^"]+)"', figure)
    assert (known[0], guessed[0]) == ("line1", "wanted")
    assert guessed[1].split("L")[0] == known[1].split("L")[-1]  # no gap between them
    assert "broken where no training run came near" in figure
    assert "0.2 as driven" in figure


def test_few_values_are_rows_of_a_table() -> None:
    planner = Variable("planner", Role.OPTION, "enum", labels=((0, "straight"), (1, "curved")))
    few = Response(planner, (Odds(0, 0.2, False), Odds(1, 0.8, True)), ((0.0, "as driven"),))
    page = to_html(build_document(made_diagnosis()), Drawing(responses=(few,)))
    assert 'id="odds1"' not in page
    assert few.rows() == [("0 (straight)", "20%", "as driven"), ("1 (curved)", "80%", "a guess")]
    assert all(word in page for word in ("1 (curved)", "80%", "a guess"))


def test_a_page_of_a_failed_run_has_the_curve_of_its_change(failed: OpenRun) -> None:
    fix = failed.diagnosis.fix
    assert fix is not None
    (curve,) = responses_of(failed)
    assert curve.option.name == "LAND_SPEED"
    assert {words for _, words in curve.marks} == {"as driven", "suggested", "reference"}
    by_value = {one.value: one.p_ok for one in curve.odds}
    driven, suggested = by_value[curve.scale.low], max(by_value.values())
    assert driven < 0.1 < fix.odds - 0.05 <= suggested  # type: ignore[operator]


def test_what_the_profile_does_not_model_has_no_curve(failed: OpenRun) -> None:
    option = failed.options[0]
    assert list(odds_over(failed, Variable("FRAME_TYPE", Role.OPTION, range=(0, 3)), {})) == []
    assert list(odds_over(failed, option, {"FRAME_TYPE": 1.0})) == []


@pytest.mark.parametrize("name", ["arducopter_failed.BIN", "px4_failed.ulg"])
def test_the_odds_of_a_curve_are_those_of_single_questions(name: str) -> None:
    case = care_core.triage(bundled("samples", name))
    (option,) = (change.option for change in case.diagnosis.fix.changes)  # type: ignore[union-attr]
    other = next(one for one in case.options if one.name != option.name and one.range)
    for beside in ({}, {other.name: other.across(5)[1]}):
        single = [(value, one.p_ok, one.is_guess) for value, one in question_of(case).over(option.name, beside)]
        odds = list(odds_over(case, option, beside))
        assert [(one.value, one.is_guess) for one in odds] == [(value, is_guess) for value, _, is_guess in single]
        assert [one.p_ok for one in odds] == pytest.approx([p_ok for _, p_ok, _ in single])


@pytest.mark.parametrize("scale", [Scale(0.5, 50.0, is_log=True), Scale(-2.0, 3.0)])
def test_round_values_stand_in_order_between_the_ends(scale: Scale) -> None:
    shares = [scale.share(value) for value in (scale.low, *scale.ticks(), scale.high)]
    assert shares == sorted(shares)
    assert (shares[0], shares[-1]) == (0.0, 1.0)
    assert len(shares) > 4
