"""The walk through the six steps, by keyboard."""

from __future__ import annotations

import html
import re
from asyncio import gather
from collections.abc import Iterator, Mapping
from pathlib import Path
from threading import Event

import pytest
from textual.dom import DOMNode
from textual.pilot import Pilot
from textual.widgets import Input, Static

from care_core.application.case import Case
from care_core.diagnose.records import Circumstance, Diagnosis, Fault, Odds, PathNode
from care_core.errors import CareError, ExitCode
from care_core.records import replace
from care_core.variables import Variable
from care_tui.app import CareApp
from care_tui.page_names import NAMES, PAGES
from care_tui.pages.making import page_class
from care_tui.render.causes import statistics_rows
from care_tui.render.fix import OptionColumns, option_change, option_item
from care_tui.render.rows import UNICODE
from care_tui.screens.case import CaseScreen
from care_tui.screens.confirm import Confirm
from care_tui.screens.export import ExportDialog
from care_tui.screens.file_dialog import FileDialog
from care_tui.screens.help import HelpScreen
from care_tui.screens.prompt import Prompt
from care_tui.settings import Settings
from care_tui.widgets.answer_bar import AnswerBar
from care_tui.widgets.choices import Choices
from care_tui.widgets.filter_bar import FilterBar
from care_tui.widgets.keys import Keys
from care_tui.widgets.reader import Reader
from care_tui.widgets.tab_row import TabRow
from tests.tui import sample_diagnosis as sample
from tests.tui.conftest import DOUBT, MakeApp, settle


def walk(app: CareApp) -> CaseScreen:
    assert isinstance(app.screen, CaseScreen)
    return app.screen


def step_of(app: CareApp) -> int:
    """The step in view, 0 for a view beside them."""
    here = walk(app).here
    return NAMES.index(here) + 1 if here in NAMES else 0


def index(app: CareApp) -> int | None:
    return walk(app).page.choices.index


def title(app: CareApp) -> str:
    return walk(app).page.title


def text(app: CareApp) -> str:
    return walk(app).page.reader.plain


def side(app: CareApp) -> str:
    """The pane beside a figure, empty where it is hidden."""
    reader = walk(app).page.query_one("#side", Reader)
    return reader.plain if reader.display else ""


def items(app: CareApp) -> str:
    choices = walk(app).page.choices
    return choices.plain if choices.display else ""


def answer(app: CareApp) -> str:
    """What is pinned under the tabs."""
    return str(walk(app).query_one(AnswerBar).content)


def hints(app: CareApp) -> str:
    """The keys in the last line, and what was said in passing."""
    return "\n".join([str(app.screen.query_one(Keys).content), app.title])


def shown(app: CareApp) -> str:
    """The whole screen as text."""
    picture = re.sub(r"<style>.*?</style>", "", app.export_screenshot(simplify=True), flags=re.S)
    return html.unescape(re.sub(r"<[^>]*>", "", picture)).replace("\xa0", " ")


async def test_enter_leads_from_the_objective_to_the_export(make_app: MakeApp) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        assert step_of(app) == 2
        assert index(app) == 1, "starts at the first fault"
        visited = []
        for _ in range(4):
            await settle(pilot, "enter")
            visited.append(step_of(app))
        assert visited == [3, 4, 5, 6]
        await settle(pilot, "enter")
        assert isinstance(app.screen, ExportDialog)
        await settle(pilot, "escape", "escape", "escape")
        assert step_of(app) == 4


async def test_digits_and_sideways_keys_move_between_steps(make_app: MakeApp) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "5")
        assert step_of(app) == 5
        await settle(pilot, "h", "left")
        assert step_of(app) == 3
        await settle(pilot, "l", "right", "right", "right", "right")
        assert step_of(app) == 6
        for number in range(1, 7):
            await settle(pilot, str(number))
            assert step_of(app) == number
            assert walk(app).query_one("#step-tabs", TabRow).here == NAMES[number - 1]


async def test_the_objectives_tell_all_three_states_and_where_the_run_came_from(make_app: MakeApp) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(120, 40)) as pilot:
        await settle(pilot, "z")
        for fact in ("00000042.BIN", "1 of 2", "arducopter 1.0", "31 of 31", "4.3.6", "byte 1048576", "Land: slow"):
            assert fact in text(app)
        assert "FAULT  too slow: 187.2 s, limit 150 s; too much energy: 11.3 Wh" in answer(app)
        assert title(app) == "Objectives: 2 outside, 1 within, 1 not evaluated"
        for line in ("✓ OK", "✗ FAULT          mission_time", "? NOT EVALUATED  path_error"):
            assert line in items(app)
        await settle(pilot, "G")
        assert "LOG_BITMASK" in text(app)


def test_what_physics_says_was_found_in_no_resample() -> None:
    path = (PathNode("LAND_SPEED", "cm/s", 16.0, 50.0), PathNode("mission_time", "s", 187.25, 139.0))
    told = [row.content.plain for row in statistics_rows(replace(sample.LANDS_SLOWLY, path=path), (), None, UNICODE)]
    assert "LAND_SPEED → mission_time  by physics" in told
    assert not any("resamples" in line or "Usual effect" in line for line in told)


async def test_the_path_follows_the_highlighted_cause(make_app: MakeApp) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "3")
        assert "LAND_SPEED    16 cm/s  (expected 50)" in text(app)
        assert "resamples" not in text(app), "statistics are behind a key"
        await settle(pilot, "z")
        assert "effect -0.81 sd, in 97% of resamples" in text(app)
        assert "outside the training support" in text(app)
        assert "Runner-up     WPNAV_SPEED, lowers the odds by 6 points" in text(app)
        await settle(pilot, "j")
        assert "WPNAV_SPEED" in text(app)
        assert "! few" in text(app)
        await settle(pilot, "G")
        assert "1 (on)  (expected 0 (off))" in text(app)
        await settle(pilot, "down", "g")
        assert "● LAND_SPEED" in text(app)


async def test_o_shows_the_causes_of_the_next_fault(make_app: MakeApp) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "3", "o")
        assert walk(app).page.choices.shown_count == 1
        assert "Causes of energy (2 of 2 faults" in title(app)
        await settle(pilot, "o")
        assert walk(app).page.choices.shown_count == 3


async def test_a_cause_set_aside_leaves_the_fix_and_its_reason_is_in_the_report(make_app: MakeApp) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "3", "d")
        assert isinstance(app.screen, Prompt)
        await settle(pilot, *"slow on purpose", "enter")
        assert "set aside: slow on purpose" in items(app)
        assert "taken out of the fix" in hints(app)
        assert "d Take back" in str(app.screen.query_one(Keys).content)
        await settle(pilot, "6")
        assert text(app) == "report: yaml\n  aside: LAND_SPEED: slow on purpose"
        await settle(pilot, "3", "d")
        assert "set aside" not in items(app)
        assert "back in the fix" in hints(app)
        await settle(pilot, "6")
        assert text(app) == "report: yaml\n  LAND_SPEED: 50", "a second d undoes all that the first did"


async def test_the_keys_are_told_after_a_dialog_that_closed_at_once(make_app: MakeApp) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "2")
        await pilot.press("f1")
        await app.pop_screen()
        await settle(pilot, "3", "d", *"as agreed", "enter")
        assert "d Take back" in str(app.screen.query_one(Keys).content)


async def test_a_cause_that_was_in_no_fix_comes_back_without_being_ticked(make_app: MakeApp) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "3", "j", "d", *"as agreed", "enter", "d")
        assert walk(app).session.dismissed == {}
        assert walk(app).session.basket.ticked == {"LAND_SPEED": 50.0}
        await settle(pilot, "k", "d", "x", "enter", "4", "space", "3", "d")
        assert walk(app).session.basket.ticked == {"LAND_SPEED": 50.0}, "ticked by hand meanwhile: it stays"


async def test_a_cause_set_aside_takes_what_brings_nothing_out_of_the_fix(make_app: MakeApp) -> None:
    weak = replace(sample.OTHER_FIX, changes=sample.OTHER_FIX.changes[1:], p_fixed=0.03)
    steps = ("when the cause goes nothing is left", "and its own text")
    made = replace(sample.faulty(), alternatives=(weak,), odds_as_driven=0.02, tell_more=("change LAND_SPEED", *steps))
    app = make_app(made)
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "3", "d", *"as agreed", "enter")
        assert walk(app).session.basket.ticked == {}, "3% where 2% was is worth no change"
        assert "nothing is ticked" in answer(app)
        await settle(pilot, "4", "s")
        assert walk(app).session.basket.ticked == {}
        assert "LAND_SPEED, which was set aside" in hints(app)
        decided = walk(app).session.decided()
        assert decided.tell_more == steps
        assert "LAND_SPEED" not in [cause.option.name for fault in decided.faults for cause in fault.causes]


async def test_what_has_no_statistics_and_what_nothing_matches_is_said(make_app: MakeApp) -> None:
    app = make_app(sample.crashed())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "3")
        page = walk(app).page
        while page.option_name() is not None:  # type: ignore[attr-defined]
            await settle(pilot, "j")
        await settle(pilot, "d")
        assert "Only a parameter of the profile can be set aside" in hints(app)
        await settle(pilot, "z")
        assert "there are no statistics" in hints(app)
        await settle(pilot, "1", "slash", *"zzz")
        assert walk(app).page.choices.line_count == 1
        assert "nothing here holds 'zzz'" in walk(app).page.choices.line(0).plain


async def test_another_file_can_be_named_than_the_one_before(make_app: MakeApp, tmp_path: Path) -> None:
    first, second = tmp_path / "first.parm", tmp_path / "second.parm"
    for file in (first, second):
        file.write_text("LAND_SPEED,16\n", encoding="utf-8")
    app = make_app(sample.faulty(), configs=(first,))
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "5", "F")
        assert isinstance(app.screen, FileDialog)
        app.screen.query_one(Input).value = f"ns={tmp_path}/sec"
        await settle(pilot, "tab")
        assert app.screen.query_one(Input).value == f"ns={second}"
        app.screen.query_one(Input).value = str(second)
        await settle(pilot, "enter")
        case = walk(app).session.case
        assert case is not None
        assert case.configs == (str(second),)


async def test_the_boxes_decide_the_probability_and_what_diff_and_report_hold(make_app: MakeApp) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "4")
        assert "Change   █████████░  91%  LAND_SPEED 16 → 50 cm/s  without 2%" in answer(app)
        assert title(app) == "What to change: 1 change ticked"
        assert "[x] LAND_SPEED   16 → 50 cm/s" in items(app)
        assert "[ ] WPNAV_SPEED  1000 → 1400 cm/s" in items(app)
        await settle(pilot, "space")
        assert "nothing ticked" in title(app)
        assert "[ ] LAND_SPEED" in items(app)
        await settle(pilot, "j", "space")
        assert "45%  WPNAV_SPEED" in answer(app)
        assert "! reboot" in items(app)
        await settle(pilot, "5")
        assert text(app).startswith("--- driven\n+++ suggested\n-WPNAV_SPEED 1000\n+WPNAV_SPEED 1400\n")
        assert "param set WPNAV_SPEED 1400" in text(app)
        await settle(pilot, "6")
        assert text(app) == "report: yaml\n  WPNAV_SPEED: 1400"


async def test_where_nothing_is_advised_a_ticked_change_is_only_asked_about(make_app: MakeApp) -> None:
    app = make_app(replace(sample.faulty(), fix=None, abstained="motor 4 lost thrust"))
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "4", "space")
        assert "Asked    " in answer(app)
        assert "Change   none advised: motor 4 lost thrust" in answer(app)


async def test_u_takes_every_change_of_the_basket_back(make_app: MakeApp) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "4", "space", "j", "space", "plus", "a")
        basket = walk(app).session.basket
        assert basket.values["WPNAV_SPEED"] > 1400
        await settle(pilot, "u", "u", "u", "u")
        assert basket.ticked == {"LAND_SPEED": 50.0}
        await settle(pilot, "u")
        assert "nothing to take back" in hints(app)


async def test_a_and_s_load_the_alternatives_and_the_suggestion(make_app: MakeApp) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "4", "a")
        assert walk(app).session.basket.ticked == {"LAND_SPEED": 45.0, "WPNAV_SPEED": 1400.0}
        assert "alternative 1 of 1" in hints(app)
        await settle(pilot, "a")
        assert walk(app).session.basket.ticked == {"LAND_SPEED": 50.0}
        await settle(pilot, "space", "s")
        assert walk(app).session.basket.ticked == {"LAND_SPEED": 50.0}


async def test_values_are_nudged_and_typed_and_only_acceptable_ones_taken(make_app: MakeApp) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "4", "minus")
        assert walk(app).session.basket.ticked["LAND_SPEED"] < 50
        assert "past its reference" not in text(app)
        await settle(pilot, "plus", "plus")
        assert walk(app).session.basket.ticked["LAND_SPEED"] > 50
        assert "past its reference, 50: a suggestion stops there" in " ".join(text(app).split())
        await settle(pilot, "equals_sign", "x", "enter")
        assert isinstance(app.screen, Prompt)
        assert "from 30 to 200 cm/s" in str(app.screen.query_one(".error").content)  # type: ignore[attr-defined]
        for typed in ("999", "-5"):
            await settle(pilot, *["backspace"] * 3, *typed, "enter")
            assert isinstance(app.screen, Prompt), typed
            assert f"'{typed}' cannot be taken." in str(app.screen.query_one(".error").content)  # type: ignore[attr-defined]
        await settle(pilot, *["backspace"] * 2, *"70", "enter")
        assert walk(app).session.basket.ticked["LAND_SPEED"] == 70
        await settle(pilot, "i", "escape")
        assert walk(app).session.basket.ticked["LAND_SPEED"] == 70


async def test_a_value_of_ones_own_has_odds_of_its_own_also_beside_other_changes(make_app: MakeApp) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(120, 40)) as pilot:
        await settle(pilot, "4", "minus")
        tried = walk(app).session.alone()
        assert ("LAND_SPEED", walk(app).session.basket.ticked["LAND_SPEED"]) in tried
        await settle(pilot, "j", "plus")
        ticked = walk(app).session.basket.ticked
        assert len(ticked) == 2
        assert set(ticked.items()) <= set(walk(app).session.alone())
        assert walk(app).page.choices.plain.count("%") == 2


async def test_a_wide_fix_draws_the_odds_over_the_values_of_a_parameter_and_asks_once(make_app: MakeApp) -> None:
    app, asked = make_app(sample.faulty()), []
    real = app.workspace.engine.odds_over

    def count(case: Case, option: Variable, beside: Mapping[str, float]) -> Iterator[Odds]:
        asked.append((option.name, dict(beside)))
        return real(case, option, beside)

    app.workspace.engine = replace(app.workspace.engine, odds_over=count)
    async with app.run_test(size=(120, 40)) as pilot:
        await settle(pilot, "4")
        assert text(app).startswith("LAND_SPEED, cm/s")
        assert {"16 as driven", "50 ticked"} <= {line.strip(" ▲") for line in text(app).splitlines()}
        assert "dotted: no training run came near, a guess" in text(app)
        await settle(pilot, "plus")
        assert "ticked" in text(app)
        assert "50 ticked" not in text(app)
        assert asked == [("LAND_SPEED", {})]  # what it is set to itself changes nothing of its curve
        await settle(pilot, "down")
        assert text(app).startswith("WPNAV_SPEED, cm/s")
        assert [name for name, beside in asked if "LAND_SPEED" in beside] == ["WPNAV_SPEED"]
        await pilot.resize_terminal(80, 24)
        await settle(pilot)
        assert "mission_time" in text(app)  # where it is narrow the prediction has the pane, until z turns it
        await settle(pilot, "z")
        assert text(app).startswith("WPNAV_SPEED, cm/s")
        assert "z Prediction" in hints(app)
        await settle(pilot, "z")
        assert "mission_time" in text(app)


@pytest.mark.parametrize("room", [55, 62, 80, 110])
def test_names_are_cut_before_odds_are(room: int) -> None:
    long = replace(sample.WPNAV_SPEED, name="inflation_radius_of_the_global_costmap", reboot_required=False)
    change = option_change(long, 1000.0, False, 1400.0, True, UNICODE)
    columns = OptionColumns.sharing(room, len(long.name), change.cell_length)
    line = option_item(long, change, True, 0.45, columns, UNICODE).plain
    assert len(line) <= room
    assert "45%" in line
    assert change.plain in line
    assert re.search(r"\[x\] infl.*….*costmap ", line), "of a name both ends tell most"


async def test_odds_that_come_after_the_cursor_has_left_are_kept_under_their_own_parameter(make_app: MakeApp) -> None:
    app, asked, may_answer = make_app(sample.faulty()), [], Event()
    real = app.workspace.engine.odds_over

    def slow(case: Case, option: Variable, beside: Mapping[str, float]) -> Iterator[Odds]:
        asked.append(option.name)
        if option.name == "WPNAV_SPEED":
            may_answer.wait(10)
        return real(case, option, beside)

    app.workspace.engine = replace(app.workspace.engine, odds_over=slow)
    async with app.run_test(size=(120, 40)) as pilot:
        await settle(pilot, "4")
        drawn = text(app)
        assert drawn.startswith("LAND_SPEED, cm/s")
        await pilot.press("j")
        while "WPNAV_SPEED" not in asked:
            await pilot.pause(0.01)
        await pilot.press("k")
        may_answer.set()
        await settle(pilot)
        assert text(app) == drawn, "the odds of the one below are not drawn here"
        await settle(pilot, "j")
        assert text(app).startswith("WPNAV_SPEED, cm/s")
        assert asked == ["LAND_SPEED", "WPNAV_SPEED"], "nor are they asked for again"


async def test_no_odds_are_asked_for_of_what_a_held_key_passes_over(
    make_app: MakeApp, monkeypatch: pytest.MonkeyPatch
) -> None:
    app, asked = make_app(sample.faulty()), []

    def count(_case: Case, option: Variable, _beside: Mapping[str, float]) -> Iterator[Odds]:
        asked.append(option.name)
        raise CareError("There is no model.")

    app.workspace.engine = replace(app.workspace.engine, odds_over=count)
    monkeypatch.setattr("care_tui.pages.fix.REST_S", 1.0)
    async with app.run_test(size=(120, 40)) as pilot:
        await settle(pilot)
        await pilot.press("4", "j", "k", "j")
        assert "Asking what each value would bring..." in text(app)
        await settle(pilot)
        assert asked == ["WPNAV_SPEED"]
        assert "mission_time" in text(app), "without a model the prediction has the pane"
        await settle(pilot, "k")
        assert asked == ["WPNAV_SPEED"]


async def test_a_wide_diff_tells_what_is_known_of_each_parameter_and_what_is_predicted(make_app: MakeApp) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(120, 40)) as pilot:
        await settle(pilot, "4", "a", "5")  # the alternative
        assert "-LAND_SPEED 16" in text(app)
        assert "LAND_SPEED  16 → 45 cm/s" in side(app)
        assert re.search(r"What +descent speed of the final stage of landing", side(app))
        assert re.search(r"Restart +needed", side(app))
        assert "! Caution" in side(app), "one of the causes is not sure"
        assert "mission_time" in side(app)
        await pilot.resize_terminal(80, 24)
        await settle(pilot)
        assert side(app) == ""
        await settle(pilot, "4", "space", "j", "space", "5")
        assert "No change is ticked" in text(app)


async def test_slash_filters_and_escape_clears(make_app: MakeApp) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "4", "slash", *"wpn")
        assert walk(app).page.choices.shown_count == 1
        assert "WPNAV_SPEED" in text(app), "the text follows what is left"
        await settle(pilot, "enter", "space")
        assert "WPNAV_SPEED" in walk(app).session.basket.ticked, "keys work on what is left"
        await settle(pilot, "escape")
        assert walk(app).page.choices.shown_count == 3
        assert step_of(app) == 4
        await settle(pilot, "5", "slash", *"suggested")
        assert text(app) == "+++ suggested"
        await settle(pilot, "escape")
        assert "-LAND_SPEED 16" in text(app)
        assert app.screen.query_one(FilterBar).display is False


async def test_enter_on_a_cause_opens_the_fix_at_its_option(make_app: MakeApp) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "3", "j", "enter")
        assert step_of(app) == 4
        assert index(app) == 1


@pytest.mark.parametrize(
    ("diagnosis", "causes", "fix"),
    [
        (sample.all_ok(), "nothing to explain", "all objectives are within their thresholds"),
        (sample.abstaining(), "mean lean 19 deg", "mean lean 19 deg"),
        (sample.not_evaluated(), "nothing to explain", "no fault was found"),
    ],
)
async def test_without_a_cause_every_step_says_why(
    make_app: MakeApp, diagnosis: Diagnosis, causes: str, fix: str
) -> None:
    app = make_app(diagnosis)
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "3")
        assert causes in text(app)
        await settle(pilot, "4")
        assert fix in text(app)
        await settle(pilot, "5")
        assert fix in text(app)
        await settle(pilot, "6")
        assert text(app) == "report: yaml"
        await settle(pilot, "c")
        assert "no commands" in hints(app)


async def test_an_objective_that_was_not_evaluated_has_no_causes_but_a_reason(make_app: MakeApp) -> None:
    app = make_app(sample.not_evaluated())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "G", "enter")
        assert "LOG_BITMASK" in text(app)


async def test_enter_on_what_was_not_evaluated_leads_to_the_fault_that_has_causes(make_app: MakeApp) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "G")
        assert "path_error" in items(app).splitlines()[index(app) or 0]
        await settle(pilot, "enter")
        assert title(app).startswith("Causes of mission_time")
        assert "LAND_SPEED" in items(app)
        assert "These are the causes of mission_time" in app.title


async def test_leads_are_no_causes_and_what_would_tell_more_comes_first(make_app: MakeApp) -> None:
    lead = replace(sample.FLIES_SLOWLY, rank=1, is_lead=True, contribution=0.0)
    wind = Circumstance("wind", "wind_proxy", 9.0, "m/s", 0.0, 6.0, 0.01, "stronger than in 99% of the training runs")
    diagnosis = replace(
        sample.abstaining(),
        faults=(Fault(sample.SLOW, (lead,)),),
        rivals=(wind,),
        tell_more=("run the same configuration again",),
    )
    app = make_app(diagnosis)
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "3")
        assert "none found, 1 not ruled out" in title(app)
        assert "not ruled out" in items(app)
        assert "costs" not in text(app)
        lines = text(app).splitlines()
        assert "No change advised" in lines[0]
        assert lines[1:5] == [
            "It may not be a parameter",
            "- wind: stronger than in 99% of the training runs",
            "How to find out more",
            "- run the same configuration again",
        ]


async def test_faults_with_the_same_causes_are_named_together(make_app: MakeApp) -> None:
    drained = replace(
        sample.LANDS_SLOWLY, path=(*sample.LANDS_SLOWLY.path, replace(sample.LANDS_SLOWLY.path[-1], name="energy"))
    )
    both = (Fault(sample.SLOW, (sample.LANDS_SLOWLY,)), Fault(sample.HUNGRY, (drained,)))
    app = make_app(replace(sample.faulty(), faults=both))
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "3")
        assert "Causes of mission_time and energy (1 of 2 faults" in title(app)
        await settle(pilot, "o")
        assert "Causes of energy and mission_time (2 of 2 faults" in title(app)


async def test_f_turns_the_diff_to_the_file_on_disk(make_app: MakeApp) -> None:
    app = make_app(sample.faulty(), configs=(Path("robot.param"),))
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "5")
        keys = {"driven": "f My fileA ", "file": "f My file as drivenA ", "changed": "f As drivenA "}
        for side in ("driven", "file", "changed", "driven"):
            assert f"--- {side}" in text(app)
            assert keys[side] in shown(app), "the key tells what it turns to"
            assert (DOUBT in " ".join(text(app).split())) == (side == "file"), "what speaks against it stands above"
            await settle(pilot, "f")
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "5", "f")
        assert isinstance(app.screen, FileDialog), "the file is asked for"


@pytest.mark.parametrize("key", ["question_mark", "f1"])
async def test_help_lists_the_keys_that_work_here_with_their_ids(make_app: MakeApp, key: str) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "6", key)
        assert isinstance(app.screen, HelpScreen)
        shown = app.screen.query_one("#help", Reader)
        assert "report.export" in shown.plain
        await settle(pilot, "escape", "2", key)
        assert "report.export" not in app.screen.query_one("#help", Reader).plain
        await settle(pilot, "q")
        assert isinstance(app.screen, CaseScreen)


async def test_tab_moves_between_panes(make_app: MakeApp) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "3", "tab")
        assert app.focused is not None
        assert app.focused.id == "text"
        await settle(pilot, "G")
        assert walk(app).page.reader.top > 0
        await settle(pilot, "g", "j", "k", "pagedown", "pageup")
        assert walk(app).page.reader.top == 0
        await settle(pilot, "tab")
        assert app.focused.id == "list"


async def test_the_mouse_opens_steps_and_items(make_app: MakeApp) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        await click_on(pilot, "#step-tabs", "Causes")
        await settle(pilot)
        assert step_of(app) == 3
        await pilot.click(walk(app).page.choices, offset=(5, 2))
        await settle(pilot)
        assert index(app) == 1
        await pilot.click(walk(app).page.choices, offset=(5, 2))
        await settle(pilot)
        assert step_of(app) == 4


async def test_a_click_on_a_key_of_the_last_line_is_that_key(make_app: MakeApp) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "3")
        for says, at in (("Fix", "fix"), ("Diff", "diff")):
            await click_on(pilot, "Keys", says)
            await settle(pilot)
            assert walk(app).here == at
        await settle(pilot, "3")
        await click_on(pilot, "Keys", "Set aside")
        await settle(pilot)
        assert isinstance(app.screen, Prompt)


async def click_on(pilot: Pilot[int], line: str, words: str) -> None:
    """Click where a line of the screen says this."""
    shown = str(pilot.app.screen.query_one(line, Static).content)
    await pilot.click(line, offset=(shown.index(words), 0))


@pytest.mark.parametrize(
    ("diagnosis", "code"),
    [
        (sample.faulty(), ExitCode.FAULT),
        (sample.abstaining(), ExitCode.FAULT),
        (sample.all_ok(), ExitCode.OK),
        (sample.not_evaluated(), ExitCode.NOT_EVALUATED),
    ],
)
async def test_q_leaves_with_the_verdict_as_exit_code(make_app: MakeApp, diagnosis: Diagnosis, code: ExitCode) -> None:
    app = make_app(diagnosis)
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "q")
    assert app.return_value == code


async def test_text_of_the_log_is_neither_markup_nor_escape_sequence(make_app: MakeApp) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(120, 40)) as pilot:
        await settle(pilot, "z")
        assert r"PreArm: [bold]check[/bold] \x1b[31mfences\x1b[0m\u202e" in text(app)
        screen = shown(app)
        assert "\x1b" not in screen
        assert "\u202e" not in screen


@pytest.mark.parametrize(
    "size", [(60, 20), (80, 24), *(pytest.param(size, marks=pytest.mark.long) for size in ((120, 40), (200, 60)))]
)
async def test_no_page_is_wider_than_its_terminal(make_app: MakeApp, size: tuple[int, int]) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=size) as pilot:
        for step in "123456":
            await settle(pilot, step)
            assert app.screen.query_one("#too-small").display is False
            for pane in (walk(app).page.choices, walk(app).page.reader):
                if pane.display:
                    assert pane.size.height >= 3, "there is room to read"
                    assert all(pane.render_line(y).cell_length <= pane.size.width for y in range(pane.size.height))


@pytest.mark.parametrize("size", [(59, 24), (80, 19)])
async def test_a_terminal_that_is_too_small_is_said(make_app: MakeApp, size: tuple[int, int]) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=size) as pilot:
        await settle(pilot)
        assert app.screen.query_one("#too-small").display
        assert not app.screen.query_one("#pages").display
        await pilot.resize_terminal(80, 24)
        await settle(pilot)
        assert not app.screen.query_one("#too-small").display
        assert "FAULT" in items(app)


@pytest.mark.parametrize("least", [(59, 24), (80, 12)])
async def test_keys_work_after_a_terminal_was_too_small_for_a_moment(make_app: MakeApp, least: tuple[int, int]) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(120, 40)) as pilot:
        await settle(pilot, "2", "home")
        await pilot.resize_terminal(*least)
        await settle(pilot)
        await pilot.resize_terminal(80, 24)
        await settle(pilot, "down")
        assert index(app) == 1
        assert "Causes" in str(app.screen.query_one(Keys).content), "the footer has the keys of the page"


@pytest.mark.parametrize("step", "23")
async def test_a_page_without_a_list_has_the_whole_width(make_app: MakeApp, step: str) -> None:
    app = make_app(sample.unfitting())
    async with app.run_test(size=(120, 40)) as pilot:
        await settle(pilot, step)
        page = walk(app).page
        assert page.choices.display or page.reader.outer_size.width == 120


def test_every_binding_has_an_id_and_leaves_reserved_keys_alone() -> None:
    owners: tuple[type[DOMNode], ...] = (
        CareApp,
        CaseScreen,
        HelpScreen,
        Choices,
        Reader,
        Prompt,
        FileDialog,
        Confirm,
    )
    for owner in (*owners, *map(page_class, PAGES)):
        for binding in owner.BINDINGS:
            assert not isinstance(binding, tuple)
            assert binding.id
            taken = {f"ctrl+{letter}" for letter in "sqzjimhba"} & set(binding.key.split(","))
            assert taken == ({"ctrl+z"} if binding.id == "app.suspend" else set())


async def test_keys_can_be_remapped_by_id(make_app: MakeApp) -> None:
    app = make_app(sample.faulty(), settings=Settings(places=(), keys={"step.next": "n", "app.quit": "x"}))
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "n")
        assert step_of(app) == 3
        await settle(pilot, "l")
        assert step_of(app) == 3, "the old key is free"
        await settle(pilot, "x")
    assert app.return_value == ExitCode.FAULT


@pytest.mark.parametrize("keys", [("1",), ("question_mark",), ("6", "e"), ("4", "equals_sign"), ("slash",)])
async def test_ctrl_c_leaves_from_anywhere(make_app: MakeApp, keys: tuple[str, ...]) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, *keys, "ctrl+c")
    assert app.return_value == ExitCode.INTERRUPTED


async def test_the_palette_offers_steps_and_actions(make_app: MakeApp) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "4")
        offered = [(command.title, command.help) for command in app.get_system_commands(app.screen)]
    about = dict(offered)
    assert {"Log", "Report", "Map", "Messages", "Alternative", "Undo", "Value", "Theme", "Help", "Quit"} <= about.keys()
    assert len(offered) == len(about)
    told = [help.rpartition(" (")[0] for _, help in offered if help.endswith(")")]
    assert sorted(told) == sorted(set(told)), "no two of them are told alike"
    assert about["Report"].endswith("(6)")
    assert about["Alternative"].endswith("(a)")


async def test_without_colours_and_in_ascii_nothing_is_lost(make_app: MakeApp, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NO_COLOR", "1")
    app = make_app(sample.faulty(), ascii=True)
    async with app.run_test(size=(80, 24)) as pilot:
        for step in "123456":
            await settle(pilot, step)
            screen = shown(app)
            assert screen.isascii(), [c for c in screen if not c.isascii()]
        await settle(pilot, "2")
        assert "x FAULT" in items(app)
        await settle(pilot, "4", "ctrl+p")
        assert "Search for commands..." in shown(app)
        assert shown(app).isascii(), [c for c in shown(app) if not c.isascii()]
        await settle(pilot, "escape")
        told = [command.help for command in app.get_system_commands(app.screen)]
        assert any(one.endswith(" (+ ])") for one in told)


async def test_a_page_that_is_just_being_prepared_is_turned_to_once_it_has_its_parts(make_app: MakeApp) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        screen = walk(app)
        await screen.query("#report-1").remove()
        await gather(screen._made("report"), screen.action_go("report"))
        await settle(pilot)
        assert screen.here == "report"
        assert len(screen.query("#report-1")) == 1
        assert text(app).startswith("report: yaml")
