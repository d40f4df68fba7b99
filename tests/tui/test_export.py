"""Writing the report to a file from the app."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from textual.widgets import Input, Static

from care_core.application.case import Case
from care_core.records import replace
from care_core.report.formats import FORMATS
from care_tui.engine import preview_of
from care_tui.screens.case import CaseScreen
from care_tui.screens.confirm import Confirm
from care_tui.screens.export import ExportDialog
from tests.made import made_diagnosis
from tests.tui import sample_diagnosis as sample
from tests.tui.conftest import MakeApp, settle
from tests.tui.test_walk import text, title


@pytest.fixture(autouse=True)
def _in_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize(
    ("formats", "name", "format", "shown"),
    [
        ([], "00000042.care.yaml", "yaml", "yaml"),
        (["f"], "00000042.care.md", "markdown", "markdown"),
        (["f", "f"], "00000042.care.html", "html", "text"),
        (["f", "f", "f"], "00000042.care.json", "json", "json"),
        (["f", "f", "f", "f"], "00000042.care.xml", "junit", "junit"),
        (["f", "f", "f", "f", "f"], "00000042.care.patch", "patch", "patch"),
    ],
)
async def test_export_writes_the_format_in_view_beside_the_operator(
    make_app: MakeApp, tmp_path: Path, formats: list[str], name: str, format: str, shown: str
) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(120, 24)) as pilot:
        await settle(pilot, "6", *formats)
        assert text(app).startswith(f"report: {shown}")
        await settle(pilot, "e", "enter")
        assert isinstance(app.screen, CaseScreen)
        assert (tmp_path / name).read_text().startswith(f"report: {format}")
        assert f"written to {name}" in title(app)


async def test_a_file_whose_name_chose_another_format_is_what_is_shown(make_app: MakeApp, tmp_path: Path) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(120, 24)) as pilot:
        await settle(pilot, "6", "e", "ctrl+u", *"other.md", "enter")
        assert (tmp_path / "other.md").read_text().startswith("report: markdown")
        assert "Report as Markdown: written to other.md" in title(app)
        assert text(app).startswith("report: markdown")


@pytest.mark.parametrize(("answer", "replaced"), [("y", True), ("n", False), ("escape", False)])
async def test_an_existing_file_is_replaced_only_when_asked_for(
    make_app: MakeApp, tmp_path: Path, answer: str, replaced: bool
) -> None:
    target = tmp_path / "00000042.care.yaml"
    target.write_text("precious")
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "6", "e")
        await pilot.press("enter")
        await pilot.pause()
        assert isinstance(app.screen, Confirm)
        await pilot.press(answer)
        await settle(pilot)
        assert isinstance(app.screen, CaseScreen if replaced else ExportDialog)
    assert (target.read_text() != "precious") is replaced


async def test_another_name_can_be_given_and_a_wrong_one_is_explained(make_app: MakeApp, tmp_path: Path) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "6", "e")
        box = app.screen.query_one(Input)
        box.value = "report.txt"
        await settle(pilot, "enter")
        assert ".yaml, .md, .html" in str(app.screen.query_one(".error", Static).content)
        box.value = "missing/folder.md"
        await settle(pilot, "enter")
        assert "No such file" in str(app.screen.query_one(".error", Static).content)
        box.value = "mine.json"
        await settle(pilot, "enter")
        assert isinstance(app.screen, CaseScreen)
    assert [path.name for path in tmp_path.iterdir() if path.is_file()] == ["mine.json"]


async def test_escape_leaves_without_writing(make_app: MakeApp, tmp_path: Path) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "6", "e", "escape")
        assert isinstance(app.screen, CaseScreen)
    assert not [path for path in tmp_path.iterdir() if path.is_file()]


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() == 0, reason="root may write everywhere")
async def test_a_folder_without_permission_is_said_and_another_can_be_given(make_app: MakeApp, tmp_path: Path) -> None:
    closed = tmp_path / "closed"
    closed.mkdir(mode=0o555)
    await _write_to(make_app, tmp_path, closed / "mine.yaml", "Permission denied")


async def test_a_folder_that_refuses_is_said_and_another_can_be_given(make_app: MakeApp, tmp_path: Path) -> None:
    (tmp_path / "folder.yaml").mkdir()
    await _write_to(make_app, tmp_path, tmp_path / "folder.yaml", "This is a folder")


async def _write_to(make_app: MakeApp, tmp_path: Path, target: Path, problem: str) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "6", "e")
        box = app.screen.query_one(Input)
        box.value = str(target)
        await settle(pilot, "enter")
        assert isinstance(app.screen, ExportDialog)
        assert problem in str(app.screen.query_one(".error", Static).content)
        box.value = str(tmp_path / "mine.yaml")
        await settle(pilot, "enter")
        assert (tmp_path / "mine.yaml").read_text().startswith("report: yaml")


async def test_the_name_of_a_log_does_not_steer_the_terminal(make_app: MakeApp) -> None:
    hostile = "a\x1b]52;c;aGk=\x07b"
    faulty = sample.faulty()
    app = make_app(
        replace(faulty, run=replace(faulty.run, log=replace(faulty.run.log, path=f"/flights/{hostile}.BIN")))
    )
    async with app.run_test(size=(120, 24)) as pilot:
        await settle(pilot, "6", "e")
        box = app.screen.query_one(Input)
        assert box.value == "a\\x1b]52;c;aGk=\\x07b.care.yaml"
        box.value = hostile
        await settle(pilot)
        drawn = "".join(segment.text for y in range(box.size.height) for segment in box.render_line(y))
        assert "\x1b" not in drawn
        assert "\x07" not in drawn


async def test_what_was_decided_since_a_file_was_written_is_not_what_it_holds(make_app: MakeApp) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(120, 24)) as pilot:
        await settle(pilot, "6", "e", "enter", "4", "space", "6")
        assert "not what 00000042.care.yaml holds" in title(app)
        await settle(pilot, "4", "space", "6")
        assert "written to 00000042.care.yaml" in title(app)


def test_the_text_of_a_page_is_shown_without_the_escapes_of_markdown() -> None:
    case = Case(made_diagnosis())
    shown = preview_of(case, FORMATS["html"])
    assert "too slow: 190 s, limit 150 s" in shown
    assert "\\x1b\\[31m" in case.report("markdown")
    assert "\\x1b[31m" in shown
    assert preview_of(case, FORMATS["markdown"]) == case.report("markdown")
