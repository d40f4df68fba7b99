"""Loading, cancelling, failing, and having no log at all."""

from __future__ import annotations

import os
import threading
from pathlib import Path

import pytest
from textual import events

from care_core.application.case import Case, Request
from care_core.errors import CareError, ExitCode, LogError, ProfileError
from care_core.progress import Progress
from care_core.records import replace
from care_tui.app import CareApp
from care_tui.page_names import STEPS, VIEWS
from care_tui.places import as_path, entries, found_logs, is_no_log, is_openable, recent_logs, remember
from care_tui.screens.file_dialog import FileDialog
from care_tui.settings import Settings
from care_tui.threads import DaemonThreads
from tests.tui import sample_diagnosis as sample
from tests.tui.conftest import LOG, MakeApp, fake_engine, settle
from tests.tui.test_walk import answer, items, step_of, text, title, walk


class SlowEngine:
    """Reports its first step, then works on without a word until it is let go."""

    def __init__(self) -> None:
        self.reached = threading.Event()
        self.go_on = threading.Event()
        self.finished = False

    def diagnose(self, request: Request, progress: Progress) -> Case:
        progress("reading \x1b[31m[red]the log", 0.25)
        self.reached.set()
        self.go_on.wait(5)
        self.finished = True
        return Case(sample.faulty(), sample.OPTIONS)


def slow_app() -> tuple[CareApp, SlowEngine]:
    slow = SlowEngine()
    return CareApp(Request(LOG), engine=fake_engine(slow.diagnose), settings=Settings(places=())), slow


async def test_loading_shows_step_and_share_done_on_every_step() -> None:
    app, slow = slow_app()
    async with app.run_test(size=(80, 24)) as pilot:
        slow.reached.wait(5)
        await pilot.pause(0.1)
        assert r"reading \x1b[31m[red]the log" in answer(app)
        assert "25%" in answer(app)
        for step in "23456":
            await pilot.press(step)
            await pilot.pause()
            assert "25%" in answer(app)
        slow.go_on.set()
        await settle(pilot)
        assert step_of(app) == 6, "the operator is left where they are"
        assert text(app).startswith("report: yaml")


async def test_every_page_can_be_looked_at_while_a_log_is_read() -> None:
    for page in (*STEPS, *VIEWS):
        app, slow = slow_app()
        async with app.run_test(size=(120, 40)) as pilot:
            slow.reached.wait(5)
            await pilot.press(page.key)
            await pilot.pause()
            slow.go_on.set()
            await settle(pilot)
            assert walk(app).session.state == "data", page.name


async def test_escape_stops_work_that_never_reports_and_r_starts_again() -> None:
    app, slow = slow_app()
    async with app.run_test(size=(80, 24)) as pilot:
        slow.reached.wait(5)
        await pilot.press("escape")
        await pilot.pause()
        assert "was stopped" in text(app), "at once, whatever the work is doing"
        slow.go_on.set()
        await pilot.pause(0.1)
        assert "was stopped" in text(app), "a late answer is ignored"
        await settle(pilot, "r")
        await settle(pilot)
        assert step_of(app) == 2
        assert app.code == ExitCode.FAULT


async def test_enter_while_reading_does_not_start_the_reading_again(tmp_path: Path) -> None:
    log, asked = tmp_path / "a.BIN", []
    log.write_bytes(b"x")
    slow = SlowEngine()

    def diagnose(request: Request, progress: Progress) -> Case:
        asked.append(request.log)
        return slow.diagnose(request, progress)

    app = CareApp(Request(log), engine=fake_engine(diagnose), settings=Settings(places=(tmp_path,)))
    async with app.run_test(size=(80, 24)) as pilot:
        slow.reached.wait(5)
        await pilot.pause(0.1)
        await pilot.press("L")
        await pilot.pause(0.3)
        assert "a.BIN" in items(app)
        await pilot.press("enter", "enter")
        await pilot.pause(0.1)
        assert "25%" in answer(app), "it goes on where it was"
        assert "being read" in app.title
        slow.go_on.set()
        await settle(pilot)
        assert walk(app).session.state == "data"
        assert walk(app).here == "logs", "the operator is left where they are"
    assert asked == [log]


@pytest.mark.parametrize("key", ["q", "ctrl+c"])
async def test_leaving_while_loading_is_an_interruption_and_waits_for_nothing(key: str) -> None:
    app, slow = slow_app()
    async with app.run_test(size=(80, 24)) as pilot:
        slow.reached.wait(5)
        await pilot.press(key)
    assert app.return_value == ExitCode.INTERRUPTED
    assert not slow.finished


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (LogError("Not a log: [red]PK\x1b[31m.", hint="Give the .BIN file.", where="a.BIN"), ExitCode.UNREADABLE),
        (ProfileError("No profile fits the log.", hint="See 'care profiles'."), ExitCode.USAGE),
        (ZeroDivisionError("division by zero"), ExitCode.USAGE),
    ],
)
async def test_an_error_says_what_is_wrong_and_what_to_do(make_app: MakeApp, error: Exception, code: ExitCode) -> None:
    app = make_app(error)
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        for step in "123456":
            await settle(pilot, step)
            assert str(error.args[0]).replace("\x1b", "\\x1b") in text(app)
            assert getattr(error, "hint", "please report it") in text(app)
            await settle(pilot, "a", "d", "space", "plus", "c", "f", "u")
        await pilot.press("q")
    assert app.return_value == code


async def test_a_step_whose_work_fails_shows_that_and_the_others_go_on() -> None:
    def fails(*_: object) -> str:
        raise CareError("No configuration format.", hint="Report it.")

    def diagnose(*_: object) -> Case:
        return Case(sample.faulty(), sample.OPTIONS)

    engine = replace(fake_engine(diagnose), diff=fails)
    app = CareApp(Request(LOG), engine=engine, settings=Settings(places=()))
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "5")
        assert "No configuration format." in text(app)
        await settle(pilot, "6")
        assert text(app).startswith("report: yaml")
    app = CareApp(Request(LOG), engine=replace(engine, predict=fails), settings=Settings(places=()))
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "4", "space")
        assert "No configuration format." in text(app)
        assert "No prediction" in title(app)


async def test_without_a_log_the_first_step_lists_what_there_is(make_app: MakeApp, tmp_path: Path) -> None:
    (tmp_path / "old.BIN").write_bytes(b"x")
    app = CareApp(
        engine=fake_engine(lambda *_: Case(sample.faulty(), sample.OPTIONS)), settings=Settings(places=(tmp_path,))
    )
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        assert walk(app).here == "logs"
        assert "old.BIN" in items(app)
        await settle(pilot, "3")
        assert "No log is open" in text(app)
        (tmp_path / "new.BIN").write_bytes(b"xy")
        await settle(pilot, "L", "R")
        assert "new.BIN" in items(app)
        await settle(pilot, "enter")
        await settle(pilot)
        assert step_of(app) == 2
    assert recent_logs()[0].name in ("old.BIN", "new.BIN")


async def test_with_no_log_anywhere_it_says_where_it_looked(tmp_path: Path) -> None:
    app = CareApp(settings=Settings(places=(tmp_path,)))
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        assert str(tmp_path)[:20] in text(app)
        await settle(pilot, "q")
    assert app.return_value == ExitCode.OK


async def test_o_opens_any_log_by_its_path(make_app: MakeApp, tmp_path: Path) -> None:
    folder = tmp_path / "flights"
    folder.mkdir()
    (folder / "a.BIN").write_bytes(b"x")
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "1", "o", "o")
        assert isinstance(app.screen, FileDialog)
        box = app.screen.query_one("Input")
        box.value = f"{tmp_path}/fli"  # type: ignore[attr-defined]
        await settle(pilot, "tab")
        assert box.value == f"{folder}/"  # type: ignore[attr-defined]
        await settle(pilot, "down", "up", "enter")
        await settle(pilot)
        assert walk(app).session.path == folder / "a.BIN"
        await settle(pilot, "1", "o", "o")
        app.screen.query_one("Input").value = "/nowhere/x.BIN"  # type: ignore[attr-defined]
        await settle(pilot, "enter")
        assert "no such file" in str(app.screen.query_one(".error").content)  # type: ignore[attr-defined]
        await settle(pilot, "escape")
        assert walk(app).here == "logs"


async def test_a_file_dropped_on_the_terminal_is_opened(make_app: MakeApp, tmp_path: Path) -> None:
    log = tmp_path / "with space.BIN"
    log.write_bytes(b"x")
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        app.post_message(events.Paste(str(log).replace(" ", "\\ ")))
        await settle(pilot)
        await settle(pilot)
        assert walk(app).session.path == log


def test_paths_are_read_as_terminals_write_them(tmp_path: Path) -> None:
    tmp_path = tmp_path / "logs"
    tmp_path.mkdir()
    log = tmp_path / "a b.BIN"
    log.write_bytes(b"x")
    for typed in (str(log), f"'{log}'", f'"{log}"', str(log).replace(" ", "\\ "), f"file://{tmp_path}/a%20b.BIN"):
        assert as_path(f" {typed}\n") == log
    (tmp_path / ".hidden").mkdir()
    (tmp_path / "notes.txt").write_text("x")
    assert entries(f"{tmp_path}/", is_openable) == [log]
    assert entries(f"{tmp_path}/", is_no_log) == [tmp_path / "notes.txt"]


def test_found_logs_are_the_newest_first_with_those_opened_before(tmp_path: Path) -> None:
    other = tmp_path / "other"
    other.mkdir()
    for age, log in enumerate((tmp_path / "a.BIN", tmp_path / "b.bag", other / "c.BIN")):
        log.write_bytes(b"x")
        os.utime(log, (1e9 - age, 1e9 - age))
    remember(other / "c.BIN")
    remember(tmp_path / "gone.BIN")
    assert [(log.path.name, log.is_recent) for log in found_logs([tmp_path, tmp_path / "missing"])] == [
        ("a.BIN", False),
        ("b.bag", False),
        ("c.BIN", True),
    ]


def test_recordings_are_one_log_each_wherever_the_operator_keeps_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    split, alone = tmp_path / "split", tmp_path / "bags" / "monday"
    for folder, parts in ((split, 3), (alone, 1)):
        folder.mkdir(parents=True)
        (folder / "metadata.yaml").write_text("rosbag2_bagfile_information:\n")
        for part in range(parts):
            (folder / f"run_{part}.db3").write_bytes(b"x" * 100)
    (tmp_path / "bags" / "stray.BIN").write_bytes(b"x")
    monkeypatch.chdir(tmp_path)
    found = {log.path.name: log.size for log in found_logs([Path()])}
    assert set(found) == {"split", "monday"}, "of the working folder's folders only what a recorder made"
    assert found["split"] > 300, "all of its files count"
    assert {log.path.name for log in found_logs([tmp_path / "bags"])} == {"monday", "stray.BIN"}


async def test_a_thread_that_was_left_ends_at_its_next_report_and_its_answer_is_dropped(make_app: MakeApp) -> None:
    ended: list[str] = []
    started, go_on, over = threading.Event(), threading.Event(), threading.Event()

    def diagnose(_request: Request, progress: Progress) -> Case:
        started.set()
        go_on.wait(5)
        try:
            progress("on", 0.5)
        except Exception:  # as a reader that takes every error for damage
            ended.append("swallowed")
        finally:
            over.set()
        ended.append("went on")
        return Case(sample.faulty(), sample.OPTIONS)

    app = CareApp(Request(LOG), engine=fake_engine(diagnose), settings=Settings(places=()))
    async with app.run_test(size=(80, 24)) as pilot:
        started.wait(5)
        await pilot.press("escape")
        go_on.set()
        assert over.wait(5)
        await settle(pilot)
        assert ended == []
        assert "was stopped" in text(app)


def test_threads_are_not_waited_for_and_tell_what_went_wrong() -> None:
    let_go = threading.Event()
    threads = DaemonThreads()
    held = threads.submit(let_go.wait, 30)
    with pytest.raises(ZeroDivisionError):
        threads.submit(lambda: 1 // 0).result(5)
    threads.shutdown()
    assert not held.done()
    let_go.set()


async def test_copying_sends_osc_52_and_leaves_a_file(make_app: MakeApp, monkeypatch: pytest.MonkeyPatch) -> None:
    sent: list[str] = []
    app = make_app(sample.faulty())
    monkeypatch.setattr(app, "write_control", sent.append)
    async with app.run_test(size=(120, 24)) as pilot:
        await settle(pilot, "6", "c")
        name = app.title.rsplit(" ", 1)[1]
        assert Path(name).read_text() == "param set LAND_SPEED 50\n"
        Path(name).unlink()
        await settle(pilot, "5", "c")
        Path(app.title.rsplit(" ", 1)[1]).unlink()
    assert len(sent) == 2
    assert sent[0].startswith("\x1b]52;c;")
