"""What the app remembers, and the page that shows it."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from care_core.application.case import Case, Request
from care_core.application.history_writing import remember_triage
from care_core.diagnose.records import Diagnosis
from care_core.errors import CareError
from care_core.history.store import History
from care_core.records import replace
from care_tui.app import CareApp
from care_tui.settings import Settings
from tests.tui import sample_diagnosis as sample
from tests.tui.conftest import LOG, fake_engine, settle
from tests.tui.test_walk import items, text, title


def run_of(number: int, mission_time: float, land_speed: float) -> Diagnosis:
    """One of several runs: another log, another time, another landing speed."""
    run = sample.RUN
    log = replace(run.log, path=f"/flights/{number:08}.BIN", sha256=f"{number:064}", recording=f"{number}")
    return replace(
        sample.faulty(),
        run=replace(run, log=log, config={**run.config, "LAND_SPEED": land_speed}),
        objectives=(sample.OK_SUCCESS, replace(sample.SLOW, value=mission_time), sample.NO_PATH),
    )


def store() -> History:
    return History(Path(os.environ["CARE_HISTORY"]))


def remembering_app() -> CareApp:
    engine = replace(fake_engine(lambda _request, _progress: Case(run_of(42, 187.0, 16.0))), remember=remember_triage)
    return CareApp(Request(LOG), engine=engine, settings=Settings(places=()))


async def test_what_the_app_judges_is_remembered_as_by_triage() -> None:
    async with remembering_app().run_test(size=(80, 24)) as pilot:
        await settle(pilot)
    (triaged,) = store().triages()
    assert triaged.log_path == "/flights/00000042.BIN"
    assert triaged.document["schema"] == "care.triage/1"


async def test_a_history_that_cannot_be_used_costs_a_sentence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    damaged = tmp_path / "history.sqlite3"
    damaged.write_bytes(b"no database at all, but long enough to be looked at" * 50)
    monkeypatch.setenv("CARE_HISTORY", str(damaged))
    app = remembering_app()
    async with app.run_test(size=(120, 24)) as pilot:
        await settle(pilot)
        assert "The history cannot be used" in app.title
        assert "mission_time" in items(app), "the diagnosis is there all the same"
        await settle(pilot, "y")
        assert "The history cannot be used" in text(app)
        assert "Move the file away" in text(app)


def test_a_history_that_is_switched_off_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CARE_HISTORY", "off")
    assert remember_triage(sample.faulty()) is None
    monkeypatch.setenv("CARE_HISTORY", "/proc/no/such/place")
    assert isinstance(remember_triage(sample.faulty()), CareError)


async def test_past_runs_show_trends_and_two_are_compared() -> None:
    for number, (time_s, speed) in enumerate([(140.0, 50.0), (150.0, 40.0)], start=1):
        assert remember_triage(run_of(number, time_s, speed)) is None
    app = remembering_app()
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "y")
        assert title(app).startswith("3 runs")
        assert [line.split()[2] for line in items(app).splitlines()] == [
            "00000042.BIN", "00000002.BIN", "00000001.BIN",
        ]  # fmt: skip
        assert "mission_time" in text(app)
        assert "▁▂█  140 to 187" in text(app)
        await settle(pilot, "x", "j", "j")
        assert "Compared with 00000042.BIN" in title(app)
        times, speeds = (
            next(line.split() for line in text(app).splitlines() if line.startswith(name))
            for name in ("mission_time", "LAND_SPEED")
        )
        assert times[1:] == ["140", "187"]
        assert speeds[1:] == ["50", "16"]
        assert "WPNAV_SPEED" not in text(app), "options that are alike are left out"
        await settle(pilot, "k", "k", "x")
        assert title(app).startswith("3 runs"), "x on the marked run takes the mark away"


async def test_enter_puts_a_run_and_the_marked_one_side_by_side_in_full() -> None:
    for number, (time_s, speed) in enumerate([(140.0, 50.0), (150.0, 40.0)], start=1):
        assert remember_triage(run_of(number, time_s, speed)) is None
    asked: list[tuple[Request, Request]] = []

    def compare(a: Request, b: Request, _progress: object) -> str:
        asked.append((a, b))
        if len(asked) > 1:
            raise CareError("No such file.", where=str(b.log))
        return "First  at 2.6 s throttle goes apart"

    engine = replace(fake_engine(lambda _request, _progress: Case(run_of(42, 187.0, 16.0))), compare=compare)
    app = CareApp(Request(LOG), engine=replace(engine, remember=remember_triage), settings=Settings(places=()))
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "y", "j", "x", "k")
        assert "both in full" in title(app)
        await settle(pilot, "enter")
        assert [one.log.name for one in asked[0]] == ["00000002.BIN", "00000042.BIN"], "the marked one is A"
        assert "at 2.6 s throttle goes apart" in text(app)
        await settle(pilot, "j", "j")
        assert "mission_time" in text(app), "of another pair what the history knows comes first"
        await settle(pilot, "enter")
        assert "No such file." in text(app)


async def test_enter_opens_the_log_of_a_past_run() -> None:
    for number in (1, 2):
        assert remember_triage(run_of(number, 140.0, 50.0)) is None
    asked: list[Path] = []

    def diagnose(request: Request, _progress: object) -> Case:
        asked.append(request.log)
        return Case(run_of(42, 187.0, 16.0))

    app = CareApp(Request(LOG), engine=fake_engine(diagnose), settings=Settings(places=()))
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "y", "j", "enter")
        assert asked == [LOG, Path("/flights/00000001.BIN")]
        assert "mission_time" in items(app), "the objectives of that log are shown"
