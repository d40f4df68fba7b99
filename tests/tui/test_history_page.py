"""What the app remembers, and the page that shows it."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from care_core.application.case import Case, Request
from care_core.application.history_writing import remember_triage
from care_core.application.viewing import past_runs
from care_core.diagnose.records import Diagnosis, MissionVerdict
from care_core.errors import CareError
from care_core.history.store import History
from care_core.records import replace
from care_core.report.history import history_document, history_text
from care_core.run import Robot, Setting
from care_tui.app import CareApp
from care_tui.render.plot import AXIS
from care_tui.render.rows import ASCII
from care_tui.render.trend import trend_rows
from care_tui.settings import Settings
from tests.tui import sample_diagnosis as sample
from tests.tui.conftest import LOG, fake_engine, settle
from tests.tui.test_walk import items, shown, side, text, title

ROOT = Path(__file__).parents[2]


def run_of(number: int, mission_time: float, land_speed: float) -> Diagnosis:
    """One of several runs: another log, another time, another landing speed."""
    run = sample.RUN
    robot = Robot("vehicle 7", "vehicle 7", "the board", is_sure=True)
    log = replace(run.log, path=f"/flights/{number:08}.BIN", sha256=f"{number:064}", recording=f"{number}", robot=robot)
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
        assert "Parameter " in text(app)
        assert "was judged by" not in text(app), "they are runs of one robot"
        await settle(pilot, "k", "k", "x")
        assert title(app).startswith("3 runs"), "x on the marked run takes the mark away"


async def test_runs_that_nothing_tells_the_robot_of_are_held_against_no_other() -> None:
    for number in (1, 2):
        made = run_of(number, 140.0, 50.0)
        log = replace(made.run.log, robot=None)
        assert remember_triage(replace(made, run=replace(made.run, log=log))) is None
    assert [past.before for past in past_runs()] == ["", ""]
    app = remembering_app()
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "y", "j")
        assert "1 run up to it" in text(app)


async def test_a_wide_history_draws_objectives_over_the_runs_and_tells_what_was_set_anew() -> None:
    for number, (time_s, speed) in enumerate([(140.0, 50.0), (150.0, 40.0), (160.0, 40.0)], start=1):
        made = run_of(number, time_s, speed)
        settings = {"LAND_SPEED": Setting("LAND_SPEED", speed, "PARM")}
        assert remember_triage(replace(made, run=replace(made.run, settings=settings))) is None
    app = remembering_app()
    async with app.run_test(size=(120, 40)) as pilot:
        await settle(pilot, "y")
        signs, changed = text(app).splitlines()[:2]
        assert signs.split() == ["verdict", *"✗✗✗✗"]
        assert [at for at, sign in enumerate(changed) if sign == "P"] == [
            at for at, sign in enumerate(signs) if sign == "✗"
        ][1::2], "of the second and the last run"
        assert "mission_time  187 s  limit <= 150 s (dotted)" in text(app)
        assert "4 of 4 runs" in text(app)
        assert "LAND_SPEED         40 → 16" in side(app)
        assert "Advice" in side(app)
        await settle(pilot, "j")
        assert "mission_time  160 s" in text(app)
        assert "Changed since 00000002.BIN, the run before" in side(app)
        assert "no parameter that both logs hold" in side(app)
        await settle(pilot, "G")
        assert "Changed since" not in side(app)
        await pilot.resize_terminal(80, 24)
        await settle(pilot, "g")
        assert "140 to 187" in text(app), "a narrow screen has a line for each objective"


@pytest.mark.parametrize("here", [0, 7, 59])
def test_of_more_runs_than_fit_those_are_drawn_that_hold_the_one_pointed_at(here: int) -> None:
    for number in range(3):
        assert remember_triage(run_of(number, 140.0 + number, 50.0)) is None
    runs = [replace(one, at=f"{place:010}") for place, one in enumerate(20 * past_runs())]
    rows = [row.content.plain for row in trend_rows(runs, here, 30 + AXIS, 20, ASCII)]
    assert max(map(len, rows)) <= 30 + AXIS
    assert all(" " <= sign <= "~" for sign in "".join(rows))
    pointer = rows[-1]
    assert f"{here:010}, {here + 1} of 60 runs" in pointer
    assert pointer.index("^") - AXIS == (29 if here == 59 else 0)


async def test_a_wide_history_tells_what_happened_in_a_run_and_what_became_of_its_advice() -> None:
    motor = replace(sample.crashed(), run=run_of(1, 187.0, 16.0).run)
    assert remember_triage(motor) is None
    sha256 = motor.run.log.sha256
    sentence = "The change was made, and \x1b[31mit worked."
    told = {"report_log": {"sha256": sha256}, "log": {"path": "/flights/2.BIN", "sha256": "2"}, "sentence": sentence}
    profile = {"name": "arducopter", "version": "1.0"}
    store().add_verification({**told, "p_fixed": 0.9, "worked": True, "profile": profile})
    store().add_verification({"report_log": {"sha256": "3"}, "log": {"sha256": "4"}, "p_fixed": 0.9, "worked": True,
                              "profile": profile})  # fmt: skip
    app = CareApp(Request(LOG), engine=fake_engine(lambda *_: Case(sample.faulty())), settings=Settings(places=()))
    async with app.run_test(size=(120, 40)) as pilot:
        await settle(pilot, "y")
        assert "2.BIN: The change was made, and \\x1b[31mit worked." in side(app)
        assert "motor 2 lost thrust" in text(app), "a single run is no trend"
        assert "→ led to" in text(app)
        assert "AUTO PreArm: [bold]" in text(app)


async def test_runs_that_two_profiles_judged_are_said_to_be() -> None:
    made = run_of(1, 140.0, 50.0)
    assert remember_triage(replace(made, profile=replace(made.profile, name="nav2"))) is None
    app = remembering_app()
    async with app.run_test(size=(120, 40)) as pilot:
        await settle(pilot, "y", "x", "j")
        assert "this run was judged by nav2, the other by" in " ".join(text(app).split())


async def test_enter_puts_a_run_and_the_marked_one_side_by_side_in_full() -> None:
    for number, (time_s, speed) in enumerate([(140.0, 50.0), (150.0, 40.0)], start=1):
        assert remember_triage(run_of(number, time_s, speed)) is None
    asked: list[tuple[Request, Request]] = []

    def compare(a: Request, b: Request, _progress: object) -> Callable[[int], str]:
        asked.append((a, b))
        if len(asked) > 1:
            raise CareError("No such file.", where=str(b.log))
        return lambda width: f"First  at 2.6 s throttle goes apart\n{'-' * width}"

    engine = replace(fake_engine(lambda _request, _progress: Case(run_of(42, 187.0, 16.0))), compare=compare)
    app = CareApp(Request(LOG), engine=replace(engine, remember=remember_triage), settings=Settings(places=()))
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "y", "j", "x", "k")
        assert "both in full" in title(app)
        assert "enter Both in full" in shown(app)
        await settle(pilot, "enter")
        assert [one.log.name for one in asked[0]] == ["00000002.BIN", "00000042.BIN"], "the marked one is A"
        assert "at 2.6 s throttle goes apart" in text(app)
        assert all(line.strip() != "-" for line in shown(app).splitlines()), "made as wide as the pane: wrapped once"
        await settle(pilot, "j")
        assert "enter Open its log" in shown(app), "of the marked one itself"
        await settle(pilot, "j")
        assert "mission_time" in text(app), "of another pair what the history knows comes first"
        await settle(pilot, "enter")
        assert "No such file." in text(app)


async def test_c_tells_whether_the_change_of_a_past_run_was_made_and_what_it_brought() -> None:
    assert remember_triage(run_of(1, 187.0, 16.0)) is None
    after = run_of(42, 120.0, 50.0)
    kept = tuple(
        replace(one, status="ok", value=120.0) if one.name == "mission_time" else one for one in after.objectives
    )
    engine = fake_engine(lambda _request, _progress: Case(replace(after, objectives=kept, faults=(), fix=None)))
    app = CareApp(Request(LOG), engine=replace(engine, remember=remember_triage), settings=Settings(places=()))
    async with app.run_test(size=(120, 40)) as pilot:
        await settle(pilot, "y")
        assert "Check its change" not in shown(app), "of the open log itself"
        await settle(pilot, "j")
        assert "Advice" in side(app)
        await settle(pilot, "c")
        assert re.search(r"NOT MADE +LAND_SPEED +16 -> 50 \(16 was", text(app))
        assert re.search(r"OK +mission_time +187(.0)? -> 120", text(app))
        assert len(store().verifications()) == 1, "it is remembered as by care verify"
        await settle(pilot, "c")
        assert text(app).startswith(" verdict")


async def test_enter_opens_the_mission_of_a_past_run() -> None:
    done = run_of(1, 140.0, 50.0)
    two = [MissionVerdict(replace(done.run.mission, index=index), "ok", "") for index in (1, 2)]
    assert remember_triage(replace(done, missions=tuple(two))) is None
    asked: list[tuple[Path, int | None]] = []

    def diagnose(request: Request, _progress: object) -> Case:
        asked.append((request.log, request.mission))
        return Case(run_of(42, 187.0, 16.0))

    app = CareApp(Request(LOG), engine=fake_engine(diagnose), settings=Settings(places=()))
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "y", "j", "enter")
        assert asked == [(LOG, None), (Path("/flights/00000001.BIN"), 1)]
        assert "mission_time" in items(app), "the objectives of that log are shown"


def asking_app(request: Request) -> tuple[CareApp, list[Request]]:
    """An app that remembers what it judges, and what was asked of it."""
    asked: list[Request] = []

    def diagnose(request: Request, _progress: object) -> Case:
        asked.append(request)
        return Case(run_of(int(request.log.stem), 187.0, 16.0))

    engine = replace(fake_engine(diagnose), remember=remember_triage)
    return CareApp(request, engine=engine, settings=Settings(places=())), asked


async def test_options_belong_to_the_log_that_they_were_given_for(tmp_path: Path) -> None:
    assert remember_triage(run_of(1, 140.0, 50.0)) is None
    site, good = tmp_path / "site.yaml", Path("/flights/good.BIN")
    site.write_text("limits: {}\n")
    given = Request(LOG, keep=("LAND_SPEED",), thresholds={"mission_time": 20.0}, since=good, site=site, top=10)
    app, asked = asking_app(given)
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "y", "j", "enter")
        assert asked[-1] == Request(Path("/flights/00000001.BIN"), site=site, top=10)
        assert "your limits and the good run stayed with 00000042.BIN" in app.title
        await settle(pilot, "y", *"/0042", "enter", "enter")
        assert asked[-1] == given, "back at the log that they were given for they hold"


async def test_a_verdict_by_limits_of_ones_own_is_marked_in_history_and_logs() -> None:
    with_limit = Request(LOG, thresholds={"mission_time": 20.0})
    app, _ = asking_app(with_limit)
    async with app.run_test(size=(120, 24)) as pilot:
        await settle(pilot, "y")
        assert "(with --threshold) " in items(app)
        assert "with --threshold mission_time=20, not by its own limits" in side(app)
    (remembered,) = store().triages()
    assert remembered.judged_with == "--threshold mission_time=20"
    assert "(judged with --threshold mission_time=20)" in history_text(history_document(store().triages(), ()))


async def test_a_verdict_by_other_options_is_not_that_of_a_folder(tmp_path: Path) -> None:
    (tmp_path / "00000042.BIN").write_bytes((ROOT / "samples" / "arducopter_failed.BIN").read_bytes())
    app, asked = asking_app(Request(tmp_path, thresholds={"mission_time": 20.0}, top=10))
    log = replace(run_of(42, 187.0, 16.0).run.log, path=str(tmp_path / "00000042.BIN"))
    plain = run_of(42, 187.0, 16.0)
    assert remember_triage(replace(plain, run=replace(plain.run, log=log))) is None
    async with app.run_test(size=(120, 24)) as pilot:
        await settle(pilot)
        assert [request.thresholds for request in asked] == [{"mission_time": 20.0}]
        assert "(with --threshold) " in items(app)
