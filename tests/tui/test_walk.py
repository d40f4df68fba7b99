"""The walk through the steps, by keyboard."""

from __future__ import annotations

import pytest
from textual.widgets import ContentSwitcher

from care_core.diagnose.records import Diagnosis
from care_core.errors import ExitCode
from care_tui.app import CareApp
from care_tui.screens.diagnosis import DiagnosisScreen
from care_tui.screens.help import HelpScreen
from care_tui.widgets.choices import Choices
from care_tui.widgets.lines import Lines
from tests.tui import sample_diagnosis as sample
from tests.tui.conftest import MakeApp, settle


def shown(app: CareApp, selector: str) -> str:
    return app.screen.query_one(selector, Lines).plain


def step(app: CareApp) -> str | None:
    return app.screen.query_one(ContentSwitcher).current


async def test_enter_leads_from_the_objective_to_the_report(make_app: MakeApp) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        assert isinstance(app.screen, DiagnosisScreen)
        assert app.screen.query_one("#objective-list", Choices).highlighted == 1, "starts at the first fault"
        visited = [step(app)]
        for _ in range(4):
            await settle(pilot, "enter")
            visited.append(step(app))
        assert visited == [f"step-{number}" for number in range(1, 6)]
        await settle(pilot, "escape", "escape")
        assert step(app) == "step-3"


async def test_digits_and_sideways_keys_move_between_steps(make_app: MakeApp) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "4")
        assert step(app) == "step-4"
        await settle(pilot, "h", "left")
        assert step(app) == "step-2"
        await settle(pilot, "l", "right", "right", "right", "right")
        assert step(app) == "step-5"
        await settle(pilot, "1")
        assert step(app) == "step-1"
        assert app.focused is app.screen.query_one("#objective-list")


async def test_the_first_step_tells_all_three_states_and_where_the_run_came_from(make_app: MakeApp) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(120, 40)) as pilot:
        await settle(pilot)
        text = shown(app, "#run-summary")
        for fact in ("00000042.BIN", "1 of 2", "arducopter 1.0", "31 of 31", "4.3.6", "byte 1048576", "Land: slow"):
            assert fact in text


async def test_the_path_follows_the_highlighted_cause(make_app: MakeApp) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "2")
        path = shown(app, "#causal-path")
        assert "LAND_SPEED    16 cm/s  (expected 50)" in path
        assert "effect -0.81, in 97 % of resamples" in path
        assert "outside the training support" in path
        await settle(pilot, "j")
        assert "WPNAV_SPEED" in shown(app, "#causal-path")
        assert "! few" in shown(app, "#causal-path")
        await settle(pilot, "G")
        assert "1 (on)  (expected 0 (off))" in shown(app, "#causal-path")
        await settle(pilot, "down", "g")
        assert "LAND_SPEED" in shown(app, "#causal-path")


async def test_o_shows_the_causes_of_the_next_fault(make_app: MakeApp) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "2", "o")
        assert app.screen.query_one("#cause-list", Choices).option_count == 1
        await settle(pilot, "o")
        assert app.screen.query_one("#cause-list", Choices).option_count == 3


async def test_the_chosen_fix_goes_into_diff_and_report(make_app: MakeApp) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "3")
        assert "reboot" not in shown(app, "#fix-detail")
        await settle(pilot, "j")
        assert "! reboot needed" in shown(app, "#fix-detail")
        assert "NOT EVALUATED  no prediction" in shown(app, "#fix-detail")
        await settle(pilot, "4")
        assert "+LAND_SPEED 45" in shown(app, "#diff")
        assert "-WPNAV_SPEED 1000" in shown(app, "#diff")
        await settle(pilot, "5")
        assert shown(app, "#report") == "report: yaml\n  LAND_SPEED: 45\n  WPNAV_SPEED: 1400"


async def test_enter_on_a_cause_opens_the_fix_that_changes_it(make_app: MakeApp) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "2", "j", "enter")
        assert step(app) == "step-3"
        assert app.screen.query_one("#fix-list", Choices).highlighted == 1


@pytest.mark.parametrize(
    ("diagnosis", "causes", "fix"),
    [
        (sample.all_ok(), "nothing to explain", "nothing to change"),
        (sample.abstaining(), "mean lean 19 deg", "mean lean 19 deg"),
        (sample.not_evaluated(), "nothing to explain", "not everything could be evaluated"),
    ],
)
async def test_without_a_cause_every_step_says_why(
    make_app: MakeApp, diagnosis: Diagnosis, causes: str, fix: str
) -> None:
    app = make_app(diagnosis)
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "2")
        assert causes in shown(app, "#causal-path")
        await settle(pilot, "3")
        assert fix in shown(app, "#fix-detail")
        await settle(pilot, "4")
        assert fix in shown(app, "#diff")
        await settle(pilot, "5")
        assert shown(app, "#report") == "report: yaml"


async def test_an_objective_that_was_not_evaluated_has_no_causes_but_a_reason(make_app: MakeApp) -> None:
    app = make_app(sample.not_evaluated())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "G", "enter")
        assert "LOG_BITMASK" in shown(app, "#causal-path")


@pytest.mark.parametrize("key", ["question_mark", "f1"])
async def test_help_lists_the_keys_that_work_here(make_app: MakeApp, key: str) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "5", key)
        assert isinstance(app.screen, HelpScreen)
        assert "Export" in shown(app, "#help")
        await settle(pilot, "escape", "1", key)
        assert "Export" not in shown(app, "#help"), "the first step has nothing to export"
        await settle(pilot, "q")
        assert isinstance(app.screen, DiagnosisScreen)


async def test_tab_moves_between_panes(make_app: MakeApp) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "2", "tab")
        assert app.focused is app.screen.query_one("#causal-path")
        await settle(pilot, "G")
        assert app.screen.query_one("#causal-path", Lines).scroll_y > 0
        await settle(pilot, "tab")
        assert app.focused is app.screen.query_one("#cause-list")


async def test_a_click_on_a_step_opens_it(make_app: MakeApp) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        await pilot.click("StepBar", offset=(18, 0))
        await pilot.pause()
        assert step(app) == "step-2"


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
        await settle(pilot)
        screen = "\n".join(strip.text for strip in app.screen._compositor.render_strips())
        assert r"PreArm: [bold]check[/bold] \x1b[31mfences\x1b[0m\u202e" in screen
        assert "\x1b" not in screen
        assert "\u202e" not in screen


@pytest.mark.parametrize(("size", "too_small"), [((60, 20), False), ((59, 24), True), ((80, 19), True)])
async def test_a_terminal_that_is_too_small_is_said(make_app: MakeApp, size: tuple[int, int], too_small: bool) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=size) as pilot:
        await settle(pilot)
        assert app.screen.query_one("#too-small").display is too_small
        assert app.screen.query_one(ContentSwitcher).display is not too_small


def test_every_binding_has_an_id() -> None:
    for owner in (CareApp, DiagnosisScreen, HelpScreen, Choices, Lines):
        for binding in owner.BINDINGS:
            assert not isinstance(binding, tuple)
            assert binding.id
            assert not {f"ctrl+{letter}" for letter in "sqjimhba"} & set(binding.key.split(","))


@pytest.mark.parametrize("keys", [("1",), ("question_mark",), ("5", "e")])
async def test_ctrl_c_leaves_from_anywhere(make_app: MakeApp, keys: tuple[str, ...]) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, *keys, "ctrl+c")
    assert app.return_value == ExitCode.INTERRUPTED
