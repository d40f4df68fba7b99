"""Every key on every page: it does what it says, or nothing; it never fails, and Esc and q always lead out."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path

import pytest
from textual.binding import Binding, BindingType
from textual.pilot import Pilot
from textual.screen import ModalScreen

from care_tui.app import CareApp
from care_tui.page_names import NAMES, PAGES
from care_tui.pages.making import page_class
from care_tui.screens.case import CaseScreen
from care_tui.settings import Settings
from care_tui.widgets.choices import Choices
from care_tui.widgets.filter_bar import FilterBar
from tests.tui import sample_diagnosis as sample
from tests.tui.conftest import MakeApp, quiet, settle
from tests.whole import one_in

pytestmark = pytest.mark.long

LEADS_OUT = {"q", "ctrl+c"}
VIEWS = ("w", "m", "p", "y", "b", "v", "M", "L")
STEPS = ("1", "2", "3", "4", "5", "6")
APP_MD = Path(__file__).parents[2] / "docs" / "app.md"


def keys_of(*bindings: Iterable[BindingType]) -> list[str]:
    """A key for each of these bindings, each once."""
    keys = [binding.key.split(",")[-1] for part in bindings for binding in part if isinstance(binding, Binding)]
    return [key for key in dict.fromkeys(keys) if key not in LEADS_OUT]


def strangers(page: int) -> list[BindingType]:
    """What the keys of single pages do, one in seven from another on each page: all are pressed on some page."""
    return one_in(7, DOES, first=page % 7)


HERE = (CareApp.BINDINGS, CaseScreen.BINDINGS)
DOES = [binding for page in map(page_class, PAGES) for binding in page.BINDINGS]
"""What the keys of single pages do; on every other page they have to do nothing."""


async def leave_dialogs(pilot: Pilot[int]) -> None:
    while isinstance(pilot.app.screen, ModalScreen) or isinstance(pilot.app.focused, FilterBar):
        await pilot.press("escape")


def here(app: CareApp) -> str:
    """The page in front."""
    assert isinstance(app.screen, CaseScreen)
    return app.screen.here


def own(app: CareApp) -> list[BindingType]:
    """What the keys of the page in front do."""
    assert isinstance(app.screen, CaseScreen)
    return app.screen.page.BINDINGS


@pytest.mark.parametrize(
    ("step", "verdict"), [*((step, "faulty") for step in STEPS), ("3", "abstaining"), ("4", "all_ok")]
)
async def test_no_key_fails_on_a_step(make_app: MakeApp, step: str, verdict: str) -> None:
    app = make_app(getattr(sample, verdict)())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, step)
        for key in keys_of(*HERE, own(app), strangers(int(step))):
            await pilot.press(key)
            await leave_dialogs(pilot)
            assert isinstance(app.screen, CaseScreen), key
            if app.screen.here != NAMES[int(step) - 1]:
                await pilot.press(step)
            assert app.screen.here == NAMES[int(step) - 1]
        await quiet(pilot)
        await settle(pilot, "q")
    assert app.return_value is not None


@pytest.mark.parametrize("view", VIEWS)
async def test_no_key_fails_on_a_view(make_app: MakeApp, view: str) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, view)
        shown = here(app)
        for key in keys_of(*HERE, own(app), strangers(VIEWS.index(view)), Choices.BINDINGS):
            if here(app) != shown:
                await settle(pilot, view)
            await pilot.press(key)
            await leave_dialogs(pilot)
            await quiet(pilot)
        await settle(pilot, "q")
    assert app.return_value is not None


@pytest.mark.parametrize("step", ["1", "4"])
async def test_no_key_fails_without_a_log(step: str) -> None:
    app = CareApp(settings=Settings(places=()))
    async with app.run_test(size=(60, 20)) as pilot:
        await settle(pilot, step)
        for key in keys_of(CaseScreen.BINDINGS):
            await pilot.press(key)
            await leave_dialogs(pilot)
            assert isinstance(app.screen, CaseScreen), key
            await pilot.press(step)


def test_the_documentation_names_every_key_of_the_walk_and_the_views() -> None:
    table = APP_MD.read_text(encoding="utf-8")
    written = set(re.findall(r"`([^`]+)`", table)) | set(re.findall(r"F\d", table))
    signs = {"plus": "+", "minus": "-", "equals_sign": "=", "slash": "/"}
    for binding in (*CaseScreen.BINDINGS, *DOES):
        assert isinstance(binding, Binding)
        names = [signs.get(key, key.upper() if re.fullmatch(r"f\d", key) else key) for key in binding.key.split(",")]
        named = written & {*names} or {"space", "left", "right", "enter", "escape", "tab", "shift+tab"} & {*names}
        assert named or str(binding.id).startswith("step."), binding
