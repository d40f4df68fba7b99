"""What the app looks like, as SVG. After a wanted change: pytest tests/tui --snapshot-update, and look at them."""

from __future__ import annotations

import sys
from collections.abc import Awaitable, Callable
from typing import Any

import pytest
from textual.pilot import Pilot

from care_core import triage
from care_core.application.case import Case, Request
from care_core.errors import LogError
from care_core.files import bundled
from care_tui.app import CareApp
from care_tui.settings import Settings
from tests.tui import sample_diagnosis as sample
from tests.tui.conftest import MakeApp, fake_engine, settle

SIZES = {"60x20": (60, 20), "80x24": (80, 24), "120x40": (120, 40), "170x45": (170, 45)}
SAMPLE = bundled("samples", "arducopter_failed.BIN")
SnapCompare = Callable[..., bool]

EVERY_SIZE = pytest.mark.parametrize(
    "size",
    [pytest.param(size, marks=pytest.mark.long if name == "170x45" else (), id=name) for name, size in SIZES.items()],
)
"""The widest is for `make long`."""

pytestmark = pytest.mark.skipif(sys.version_info[:2] != (3, 11), reason="snapshots are made on Python 3.11 only")


def press(*keys: str) -> Callable[[Pilot[Any]], Awaitable[None]]:
    async def walk(pilot: Pilot[Any]) -> None:
        await settle(pilot, *keys)

    return walk


@EVERY_SIZE
@pytest.mark.parametrize(
    "keys",
    [("1",), ("2",), ("3",), ("4", "j"), ("5",), ("6",)],
    ids=["log", "objectives", "causes", "fix", "diff", "report"],
)
def test_steps(snap_compare: SnapCompare, make_app: MakeApp, size: tuple[int, int], keys: tuple[str, ...]) -> None:
    assert snap_compare(make_app(sample.faulty()), terminal_size=size, run_before=press(*keys))


@pytest.mark.parametrize("kind", ["all_ok", "abstaining", "not_evaluated"])
def test_other_verdicts(snap_compare: SnapCompare, make_app: MakeApp, kind: str) -> None:
    diagnosis = getattr(sample, kind)()
    assert snap_compare(make_app(diagnosis), terminal_size=(80, 24), run_before=press())


@EVERY_SIZE
@pytest.mark.parametrize(("kind", "step"), [("crashed", "1"), ("crashed", "3"), ("unfitting", "1")])
def test_what_happened(
    snap_compare: SnapCompare, make_app: MakeApp, kind: str, step: str, size: tuple[int, int]
) -> None:
    assert snap_compare(make_app(getattr(sample, kind)()), terminal_size=size, run_before=press(step))


@pytest.fixture(scope="module")
def flight() -> Case:
    return triage(SAMPLE)


@pytest.mark.parametrize("size", [(80, 24), (120, 40)], ids=["80x24", "120x40"])
@pytest.mark.parametrize("key", ["m", "p", "M", "w", "t"], ids=["messages", "plots", "map", "graph", "missions"])
def test_views(snap_compare: SnapCompare, flight: Case, size: tuple[int, int], key: str) -> None:
    app = CareApp(Request(SAMPLE), engine=fake_engine(lambda *_: flight), settings=Settings(places=()))
    assert snap_compare(app, terminal_size=size, run_before=press("1", key))


def test_smallest_terminal(snap_compare: SnapCompare, make_app: MakeApp) -> None:
    assert snap_compare(make_app(sample.faulty()), terminal_size=(60, 20), run_before=press("3"))


def test_too_small_terminal(snap_compare: SnapCompare, make_app: MakeApp) -> None:
    assert snap_compare(make_app(sample.faulty()), terminal_size=(50, 15), run_before=press())


def test_ascii(snap_compare: SnapCompare, make_app: MakeApp) -> None:
    assert snap_compare(make_app(sample.faulty(), ascii=True), terminal_size=(80, 24), run_before=press("3"))


def test_no_colour(snap_compare: SnapCompare, make_app: MakeApp, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NO_COLOR", "1")
    assert snap_compare(make_app(sample.faulty()), terminal_size=(80, 24), run_before=press())


def test_help(snap_compare: SnapCompare, make_app: MakeApp) -> None:
    assert snap_compare(make_app(sample.faulty()), terminal_size=(80, 24), run_before=press("3", "question_mark"))


def test_export_dialog(snap_compare: SnapCompare, make_app: MakeApp) -> None:
    assert snap_compare(make_app(sample.faulty()), terminal_size=(80, 24), run_before=press("6", "e"))


def test_error(snap_compare: SnapCompare, make_app: MakeApp) -> None:
    error = LogError("Not a DataFlash log: the first bytes are PK.", hint="Give the .BIN file.", where="a.BIN")
    assert snap_compare(make_app(error), terminal_size=(80, 24), run_before=press())
