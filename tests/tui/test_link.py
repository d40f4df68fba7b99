"""Frames and the link to the terminal: none is drawn before the last one was shown, and nothing is lost by that."""

from __future__ import annotations

import time

import pytest
from textual.events import CursorPosition

from care_tui.app import CareApp
from care_tui.link import ASK, Link
from tests.tui import sample_diagnosis as sample
from tests.tui.conftest import MakeApp, settle
from tests.tui.test_walk import index, step_of


def made(written: list[str], *, is_full: bool = False) -> Link:
    link = Link(lambda: is_full)
    link.write = written.append
    return link


def test_a_terminal_that_answers_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    written: list[str] = []
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    link = made(written)
    link.drawn()
    assert written == [ASK]
    assert not link.is_busy, "nobody knows yet whether it answers"
    link.drawn()
    assert written == [ASK], "one question at a time"
    link.answered()
    link.drawn()
    assert link.is_busy
    link.answered()
    assert not link.is_busy
    link.drawn()
    now[0] = 3.0
    assert not link.is_busy, "an answer that was lost holds nothing up"
    link.drawn()
    assert written == [ASK] * 4
    assert link.is_busy


def test_a_terminal_that_takes_nothing_is_waited_for_whether_or_not_it_answers() -> None:
    assert made([], is_full=True).is_busy
    assert not made([]).is_busy
    assert not Link(lambda: True).is_busy, "there is none"


async def test_changes_gather_while_a_frame_is_under_way(make_app: MakeApp) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "3")
        await pilot.pause(0.2)
        app.link.write = lambda _text: None
        app.link.answered()
        app.post_display_hook()
        for key in "jkjkj":
            await pilot.press(key)
        await pilot.pause(0.1)
        assert index(app) == 1, "keys are taken all the same"
        assert app.is_held
        app.post_message(CursorPosition(0, 0))
        await pilot.pause(0.1)
        assert not app.is_held or app.link.is_busy
        await settle(pilot, "4")
        assert step_of(app) == 4, "and what was held back goes on"


async def test_a_new_screen_is_drawn_though_a_frame_is_under_way(make_app: MakeApp) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "3")
        app.link.write = lambda _text: None
        app.link.answered()
        app.post_display_hook()
        assert app.is_held
        await pilot.press("question_mark")
        await pilot.pause()
        assert app.screen.query("#help")


async def test_leaving_waits_for_the_last_answer(make_app: MakeApp) -> None:
    app: CareApp = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        app.link.write = lambda _text: None
        app.link.answered()
        app.link.drawn()
        await pilot.press("q")
        await pilot.pause(0.1)
        assert app.return_value is None
        app.link.answered()
        await pilot.pause(0.2)
        assert app.return_value is not None
