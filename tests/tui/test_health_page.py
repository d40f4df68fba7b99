"""What happened, how well the profile fits and what explains the failure, as the app shows them."""

from __future__ import annotations

import pytest

from care_core.application.case import Case, Request
from care_core.diagnose.records import Diagnosis, Hypothesis, MissionVerdict
from care_core.ecosystems.findings import WHOLE_LOG, Finding, Health
from care_core.progress import Progress
from care_core.records import replace
from care_core.run import Fit, MissionInfo, OutcomeCheck
from care_tui.app import CareApp
from care_tui.settings import Settings
from tests.tui import sample_diagnosis as sample
from tests.tui.conftest import LOG, MakeApp, fake_engine, settle
from tests.tui.test_walk import answer, index, items, shown, side, step_of, text, title, walk


def pinned(app: CareApp) -> list[str]:
    return answer(app).splitlines()


async def test_the_first_step_tells_what_happened_the_first_cause_first(make_app: MakeApp) -> None:
    app = make_app(sample.crashed())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        assert step_of(app) == 1, "with a critical finding the app opens on it"
        assert title(app) == "What happened: ArduCopter V4.3.6, quad X"
        assert pinned(app)[0].startswith("✗ FAULT  too slow: 187.2 s, limit 150 s")
        lines = [line.split() for line in items(app).splitlines()]
        assert [line[:4] for line in lines[:4]] == [
            ["✗", "CRITICAL", "91.3", "s"],
            ["→", "led", "to", "91.5"],
            ["→", "led", "to", "110.1"],
            ["!", "WARNING", "3.0", "s"],
        ]
        assert [line[0] for line in lines[4:]] == ["vehicle", "arming", "mode", "error"]
        assert "after it was down" in items(app)
        for fact in ("91.3 s to 110.1 s", "output 1950 us", "SERVO2_MAX", "roll does not follow"):
            assert fact in text(app)
        await settle(pilot, "j")
        assert "Explained by  motor 2 lost thrust" in text(app)
        await settle(pilot, "G")
        assert "137.4 s       crash check" in text(app)
        await settle(pilot, "slash", *"arming", "enter")
        assert walk(app).page.choices.shown_count == 1
        await settle(pilot, "escape", "enter")
        assert step_of(app) == 2


async def test_that_nothing_was_found_is_said_plainly(make_app: MakeApp) -> None:
    healthy = replace(sample.all_ok(), health=Health("Rover V4.5", sample.HEALTH.timeline, ()))
    app = make_app(healthy)
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "1")
        assert pinned(app)[0] == "✓ OK  all objectives are within their thresholds"
    little = Finding("log", "too little is recorded", 0.0, 0.0, "info", "", WHOLE_LOG)
    stranger = replace(healthy.profile, fit=Fit("no", ("a rover",)))
    app = make_app(replace(healthy, profile=stranger, objectives=(), health=Health("", (), (little,))))
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "1")
        assert "too little is recorded" in pinned(app)[0]
        assert "This run" in text(app)


async def test_where_no_profile_fits_the_app_opens_on_the_account_and_the_steps_say_why_they_are_empty(
    make_app: MakeApp, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("care_tui.pages.log.what_would_fit", lambda _case: ["for arducopter: record CMD"])
    app = make_app(sample.unfitting())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        assert step_of(app) == 1
        assert pinned(app)[-2].startswith("Next     check motor 2: ")
        assert pinned(app)[-1].startswith("! Profile arducopter does not fit: it is a rover")
        assert "motor 2 lost thrust" in items(app)
        assert "- it is a rover, the profile is of a copter\n" in text(app)
        assert "What would make one fit\n- for arducopter: record CMD\n" in text(app)
        for step in "2345":
            await settle(pilot, step)
            assert "enter Report" in shown(app), "the footer names the page that Enter reaches"
            assert text(app).startswith("No profile fits this log (it is a rover, the profile is of a copter), so ")
            assert items(app) == ""
            await settle(pilot, "a", "d", "space", "equals_sign", "plus", "u", "f", "c", "o")
            assert step_of(app) == int(step)
            await settle(pilot, "enter")
            assert step_of(app) == 6, "what has nothing is passed over"
        await settle(pilot, "6")
        assert text(app) == "report: yaml", "the account is exported all the same"


async def test_what_a_run_without_a_profile_did_is_judged_and_one_without_a_mission_promises_nothing(
    make_app: MakeApp,
) -> None:
    done = replace(sample.unfitting(), objectives=(sample.OK_SUCCESS,))
    app = make_app(done)
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "1")
        await settle(pilot, "enter")
        assert step_of(app) == 2
        assert items(app).startswith("✓ OK")
        await settle(pilot, "v", "escape", "4")
        assert text(app).startswith(
            "No profile fits this log (it is a rover, the profile is of a copter), so no change"
        )
    plain = replace(sample.all_ok(), run=replace(sample.RUN, checks=(OutcomeCheck("no_crash", 1.0, ""),)))
    app = make_app(plain)
    async with app.run_test(size=(80, 24)) as pilot:
        for step in "45":
            await settle(pilot, step)
            assert text(app).startswith("No mission was flown, so ")
            assert items(app) == ""


async def test_where_no_profile_fits_what_explains_a_failure_is_ranked_all_the_same(make_app: MakeApp) -> None:
    weighed = (Hypothesis("hardware", sample.MOTOR.title, 0.8), Hypothesis("parameter", "", 0.2))
    app = make_app(replace(sample.unfitting(), hypotheses=weighed))
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "3")
        assert "by what the log shows alone" in title(app)
        assert items(app).split()[0] == "80%"
        assert "motor 2 lost thrust" in items(app).splitlines()[0]
        assert "output 1950 us" in text(app)
        await settle(pilot, "j", "d", "w", "3", "enter")
        assert step_of(app) == 6, "there is no fix and no diff"


async def test_enter_is_no_key_of_a_page_whose_list_is_empty(make_app: MakeApp) -> None:
    app = make_app(sample.unfitting())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        for page in "wy":
            await settle(pilot, page)
            assert items(app) == "", page
            for dead in ("Go there", "Back a step", "Open its log", "Compare"):
                assert dead not in shown(app), (page, dead)


async def test_the_fit_and_the_warnings_stand_under_the_tabs_of_every_step_and_view(make_app: MakeApp) -> None:
    app = make_app(sample.crashed())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        for key in "123456yb":
            await settle(pilot, key)
            fault, cause, change, limits = pinned(app)
            assert fault.startswith("✗ FAULT  too slow: 187.2 s")
            assert cause.startswith("Cause    █████████░  90%  motor 2 lost thrust")
            assert "91%  LAND_SPEED 16 → 50 cm/s" in change
            assert limits.startswith("! Profile arducopter partly fits: the firmware is 4.3.6, ")
            assert all(len(line) <= 78 for line in pinned(app))
    app = make_app(sample.crashed())
    async with app.run_test(size=(80, 32)) as pilot:
        await settle(pilot)
        *_, next_step, rest, fit, warnings = pinned(app)
        assert next_step.startswith("Next     make the change, ")
        assert rest.startswith(" " * 9), "what does not fit on a line stands below it"
        assert fit.startswith("! Profile arducopter partly fits: ")
        assert warnings.startswith("! 142 bytes that are no message")
    app = make_app(replace(sample.all_ok(), profile=sample.fitting("fits")))
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        assert pinned(app)[0].endswith("  profile fits"), "a word in the corner"


async def test_parts_parameters_and_chance_compete_in_one_ranking(make_app: MakeApp) -> None:
    app = make_app(sample.crashed())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "3")
        lines = items(app).splitlines()
        assert [line.split()[0] for line in lines[:3]] == ["90%", "6%", "4%"]
        assert "motor 2 lost thrust" in lines[0]
        assert "from 91.3 s" in lines[0]
        assert "LAND_SPEED  16 → 50 cm/s" in lines[1]
        assert len(lines) == 5, "the causes that the ranking does not name come last"
        assert "output 1950 us" in text(app), "the evidence of the part"
        await settle(pilot, "d")
        assert walk(app).session.dismissed == {}, "only a parameter is set aside"
        await settle(pilot, "w")
        assert walk(app).here == "graph"
        await settle(pilot, "escape", "j")
        assert "● LAND_SPEED" in text(app)
        await settle(pilot, "enter")
        assert step_of(app) == 4


async def test_the_picker_shows_every_mission_with_its_verdict_and_diagnoses_another() -> None:
    first = MissionInfo(1, 2, 12.4, 199.65, ended=True, fits=True)
    second = MissionInfo(2, 2, 210.0, 300.0, ended=False, fits=True)
    missions = (
        MissionVerdict(first, "fault", "mission_time", (sample.OK_SUCCESS, sample.SLOW)),
        MissionVerdict(second, "not_evaluated", "cut", (sample.OK_SUCCESS, sample.NO_PATH)),
    )
    asked: list[int | None] = []

    def diagnose(request: Request, progress: Progress) -> Case:
        asked.append(request.mission)
        mission = replace(sample.RUN.mission, index=request.mission or 1)
        found = replace(sample.faulty(), run=replace(sample.RUN, mission=mission), missions=missions)
        return Case(found, sample.OPTIONS)

    app = CareApp(Request(LOG), engine=fake_engine(diagnose), settings=Settings(places=()))
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "t")
        lines = items(app).splitlines()
        assert lines[0].split() == ["▸", "1", "12.4", "s", "to", "199.7", "s", "✗", "FAULT", "mission_time"]
        assert lines[1].split() == ["2", "210.0", "s", "to", "300.0", "s", "?", "NOT", "EVALUATED", "cut"]
        assert "mission_time" in text(app)
        await settle(pilot, "j")
        assert "the log stops before the mission does" in text(app)
        await settle(pilot, "enter")
        await settle(pilot)
        assert asked == [None, 2]
        assert step_of(app) == 2
        await settle(pilot, "t")
        assert items(app).splitlines()[1].startswith("▸")
        assert index(app) == 1


async def test_a_wide_picker_tells_what_happened_in_the_mission_under_the_cursor(make_app: MakeApp) -> None:
    first, second = MissionInfo(1, 2, 0.0, 70.0, ended=True, fits=True), MissionInfo(2, 2, 71.0, 200.0, True, True)
    missions = (MissionVerdict(first, "fault", "", (sample.SLOW,)), MissionVerdict(second, "ok", "", (sample.SLOW,)))
    app = make_app(replace(sample.crashed(), missions=missions))
    async with app.run_test(size=(120, 40)) as pilot:
        await settle(pilot, "t")
        assert "armed" in text(app)
        assert "motor 2 lost thrust" not in text(app), "that was in the other mission"
        await settle(pilot, "j")
        assert "motor 2 lost thrust" in text(app)
        assert "armed" not in text(app)
        await pilot.resize_terminal(80, 24)
        await settle(pilot)
        assert "motor 2" not in text(app), "a narrow screen has the objectives alone"


async def test_an_objective_is_judged_by_another_threshold() -> None:
    asked: list[dict[str, float]] = []

    def diagnose(request: Request, progress: Progress) -> Case:
        asked.append(dict(request.thresholds))
        found, hungry = sample.faulty(), sample.HUNGRY
        assert hungry.threshold is not None
        bound = replace(hungry.threshold, value=request.thresholds.get("energy", 9.5))
        results = tuple(replace(one, threshold=bound) if one is hungry else one for one in found.objectives)
        return Case(replace(found, objectives=results), sample.OPTIONS)

    app = CareApp(
        Request(LOG, thresholds={"mission_time": 150.0}), engine=fake_engine(diagnose), settings=Settings(places=())
    )
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "j", "equals_sign")
        await settle(pilot, *"2x", "enter")
        assert "not a number" in str(app.screen.query_one(".error").content)  # type: ignore[attr-defined]
        await settle(pilot, "backspace", "backspace", *"12", "enter")
        await settle(pilot)
        assert asked[-1] == {"mission_time": 150.0, "energy": 12.0}
        assert step_of(app) == 2
        assert index(app) == 2, "the cursor is where it was"
        assert "<= 12 Wh" in items(app)
        assert ["mine" in line for line in items(app).splitlines()] == [False, True, True, False], (
            "both limits are mine"
        )
        await settle(pilot, "equals_sign", "backspace", "backspace", "enter")
        await settle(pilot)
        assert asked[-1] == {"mission_time": 150.0}
        await settle(pilot, "g", "equals_sign")
        assert "met or not" in app.title


@pytest.mark.parametrize(
    "size", [(60, 20), (80, 24), *(pytest.param(size, marks=pytest.mark.long) for size in ((120, 40), (200, 60)))]
)
@pytest.mark.parametrize("diagnosis", [sample.crashed(), sample.unfitting()], ids=["crashed", "unfitting"])
async def test_no_pane_is_wider_than_its_terminal(
    make_app: MakeApp, size: tuple[int, int], diagnosis: Diagnosis
) -> None:
    app = make_app(diagnosis)
    async with app.run_test(size=size) as pilot:
        for step in "123456":
            await settle(pilot, step)
            for pane in (walk(app).page.choices, walk(app).page.reader):
                if pane.display:
                    assert pane.size.height >= 2
                    assert all(pane.render_line(y).cell_length <= pane.size.width for y in range(pane.size.height))
            screen = shown(app)
            assert "\x1b" not in screen


async def test_no_odds_are_told_without_what_no_prediction_knows_of(make_app: MakeApp) -> None:
    app = make_app(sample.crashed())
    async with app.run_test(size=(120, 40)) as pilot:
        await settle(pilot, "4")
        assert "unless it happens again" in answer(app)
        assert "Unless      it happens again: motor 2 lost thrust" in side(app)
    note = "the steering oscillates: a gain is too high: LAND_SPEED 60 (reference 50)"
    lost = replace(
        sample.all_ok(),
        health=sample.HEALTH,
        hypotheses=(Hypothesis("parameter", "LAND_SPEED", 0.9), Hypothesis("chance", "", 0.1)),
        notes=(note, "another thing"),
    )
    app = make_app(lost)
    async with app.run_test(size=(120, 40)) as pilot:
        await settle(pilot, "3")
        assert f"Note        {note}" in " ".join(text(app).split("\n"))
        assert "another thing" not in text(app)
        await settle(pilot, "enter")
        assert text(app).startswith("LAND_SPEED, cm/s"), "the cursor is on it"
        assert side(app).startswith("FAULT: motor 2 lost thrust")
        assert "Unless      it happens again: motor 2 lost thrust" in side(app)
