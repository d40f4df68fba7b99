"""Frames and the link to the terminal: none is drawn before the last one was shown, and nothing is lost by that."""

from __future__ import annotations

import time

import pytest
from rich.console import Console
from rich.segment import Segment
from rich.style import Style
from textual.events import CursorPosition
from textual.geometry import Region
from textual.strip import Strip

from care_tui.app import CareApp
from care_tui.link import ASK, Link
from care_tui.screens.base import CareScreen, _sent
from tests.tui import sample_diagnosis as sample
from tests.tui.conftest import MakeApp, settle


def test_a_terminal_that_answers_is_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    written: list[str] = []
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    link = Link(written.append, lambda: 0)
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


def test_what_was_not_even_sent_is_waited_for_at_any_terminal() -> None:
    waiting = [2]
    link = Link(lambda _text: None, lambda: waiting[0])
    assert link.is_busy
    waiting[0] = 0
    assert not link.is_busy


@pytest.mark.parametrize(
    ("style", "erased"),
    [
        (None, True),
        (Style(bold=True), True),
        (Style(bgcolor="default"), True),
        (Style(bgcolor="red"), False),
        (Style(reverse=True), False),
        (Style(underline=True), False),
    ],
)
def test_blanks_at_the_end_of_a_change_are_erased_where_they_show_nothing(style: Style | None, erased: bool) -> None:
    console = Console(color_system="truecolor")
    line = Strip([Segment("words"), Segment(" " * 30, style)])
    told = _sent(line, console)
    assert told.startswith("words")
    assert told.endswith("\x1b[30X") is erased
    assert (" " * 30 in told) is not erased
    assert _sent(Strip([]), console) == ""
    assert _sent(Strip([Segment("a   ", style)]), console) == Strip([Segment("a   ", style)]).render(console)


async def test_changes_gather_while_a_frame_is_under_way(make_app: MakeApp, monkeypatch: pytest.MonkeyPatch) -> None:
    app = make_app(sample.faulty())
    drawn: list[object] = []
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "3")
        await pilot.pause(0.1)
        original = CareScreen._compositor_refresh

        def refresh(screen: CareScreen) -> None:
            drawn.append(screen)
            original(screen)

        monkeypatch.setattr(CareScreen, "_compositor_refresh", refresh)
        app.link.answered()
        app.link.drawn()
        for key in "jkjkj":
            await pilot.press(key)
        await pilot.pause(0.1)
        assert not drawn
        app.post_message(CursorPosition(0, 0))
        await pilot.pause(0.1)
        assert 1 <= len(drawn) <= 2, "five moves in one frame"


async def test_what_is_laid_out_while_sizes_settle_is_drawn_all_the_same(make_app: MakeApp) -> None:
    """A terminal whose size changes twice at once: the second layout stops the timer that the first one waits for."""
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "3")
        screen = app.screen
        assert isinstance(screen, CareScreen)
        screen._is_settling = True
        screen._compositor._dirty_regions.add(Region(0, 0, 1, 1))
        screen._refresh_layout()
        await pilot.pause(0.2)
        assert not screen._compositor._dirty_regions
        assert not screen._is_settling


async def test_leaving_waits_for_the_last_answer(make_app: MakeApp) -> None:
    app: CareApp = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        app.link.answered()
        app.link.drawn()
        await pilot.press("q")
        await pilot.pause(0.1)
        assert app.return_value is None
        app.link.answered()
        await pilot.pause(0.2)
        assert app.return_value is not None
