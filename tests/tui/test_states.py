"""Loading, cancelling and failing."""

from __future__ import annotations

import threading

import pytest
from textual.widgets import Static

from care_core.diagnose.records import Diagnosis
from care_core.errors import CareError, ExitCode, LogError, ProfileError
from care_tui.app import CareApp
from care_tui.jobs import Engine, Progress, Request
from care_tui.screens.diagnosis import DiagnosisScreen
from care_tui.screens.loading import ErrorScreen, LoadingScreen
from care_tui.widgets.lines import Lines
from tests.tui import sample_diagnosis as sample
from tests.tui.conftest import LOG, MakeApp, fake_diff, fake_report, settle


class SlowEngine:
    """Reports its first step, then waits to be let go, and reports again."""

    def __init__(self) -> None:
        self.reached = threading.Event()
        self.go_on = threading.Event()
        self.finished = False

    def diagnose(self, request: Request, progress: Progress) -> Diagnosis:
        progress("reading \x1b[31m[red]the log", 0.25)
        self.reached.set()
        assert self.go_on.wait(5)
        progress("ranking the causes", 0.7)
        self.finished = True
        return sample.faulty()


def slow_app() -> tuple[CareApp, SlowEngine]:
    slow = SlowEngine()
    return CareApp(Request(LOG), engine=Engine(slow.diagnose, fake_diff, fake_report)), slow


async def test_loading_shows_step_and_share_done() -> None:
    app, slow = slow_app()
    async with app.run_test(size=(80, 24)) as pilot:
        slow.reached.wait(5)
        await pilot.pause()
        assert isinstance(app.screen, LoadingScreen)
        assert str(app.screen.query_one("#step", Static).content) == r"reading \x1b[31m[red]the log"
        assert "25 %" in str(app.screen.query_one("#progress", Static).content)
        slow.go_on.set()
        await settle(pilot)
        assert isinstance(app.screen, DiagnosisScreen)


async def test_escape_cancels_and_r_starts_again() -> None:
    app, slow = slow_app()
    async with app.run_test(size=(80, 24)) as pilot:
        slow.reached.wait(5)
        await pilot.press("escape")
        assert isinstance(app.screen, ErrorScreen)
        slow.go_on.set()
        await pilot.pause(0.1)
        assert isinstance(app.screen, ErrorScreen), "a late answer is ignored"
        assert not slow.finished
        await settle(pilot, "r")
        await settle(pilot)
        assert isinstance(app.screen, DiagnosisScreen)
        assert app.code == ExitCode.FAULT


@pytest.mark.parametrize("key", ["q", "ctrl+c"])
async def test_leaving_while_loading_is_an_interruption(key: str) -> None:
    app, slow = slow_app()
    async with app.run_test(size=(80, 24)) as pilot:
        slow.reached.wait(5)
        await pilot.press(key)
        slow.go_on.set()
    assert app.return_value == ExitCode.INTERRUPTED
    assert not slow.finished


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (LogError("Not a log: [red]PK\x1b[31m.", hint="Give the .BIN file.", where="a.BIN"), ExitCode.UNREADABLE),
        (ProfileError("No profile fits the log.", hint="See 'care profiles'."), ExitCode.USAGE),
    ],
)
async def test_an_error_says_what_is_wrong_and_what_to_do(make_app: MakeApp, error: CareError, code: ExitCode) -> None:
    app = make_app(error)
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        text = app.screen.query_one("#error", Lines).plain
        assert error.hint in text
        assert error.message.replace("\x1b", "\\x1b") in text
        await pilot.press("q")
    assert app.return_value == code


async def test_a_defect_is_shown_not_thrown(make_app: MakeApp) -> None:
    app = make_app(ZeroDivisionError("division by zero"))
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        assert "ZeroDivisionError" in app.screen.query_one("#error", Lines).plain
        await pilot.press("q")
    assert app.return_value == ExitCode.USAGE


async def test_a_diff_that_fails_is_shown_in_its_step() -> None:
    def no_diff(run: object, fix: object) -> str:
        raise CareError("No configuration format.", hint="Report it.")

    app = CareApp(Request(LOG), engine=Engine(lambda *_: sample.faulty(), no_diff, fake_report))
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "4")
        assert "No configuration format." in app.screen.query_one("#diff", Lines).plain
