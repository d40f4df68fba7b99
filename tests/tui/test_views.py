"""The views beside the walk, on the real sample: graph, messages, signals, profiles, history, and a file on disk."""

from __future__ import annotations

import re
from functools import cache
from itertools import pairwise
from pathlib import Path

import pytest
from textual.widgets import Input, Static

from care_core.application.case import Case, Request
from care_core.application.signals import Signal
from care_core.ecosystems.findings import Event
from care_core.errors import UsageError
from care_core.files import bundled
from care_core.records import replace
from care_tui.app import CareApp
from care_tui.engine import Engine, open_and_warm
from care_tui.pages.history import HistoryPage
from care_tui.pages.messages import folded
from care_tui.pages.plots import signal_name
from care_tui.places import remember
from care_tui.render.plot import dots_across, plot
from care_tui.render.rows import ASCII
from care_tui.screens.case import CaseScreen
from care_tui.screens.confirm import Confirm
from care_tui.settings import Settings
from care_tui.widgets.answer_bar import AnswerBar
from care_tui.widgets.tab_row import TabRow
from tests.made import MadeLog, T
from tests.tui import sample_diagnosis as sample
from tests.tui.conftest import LOG, MakeApp, fake_engine, settle
from tests.tui.test_walk import hints, index, items, shown, side, step_of, text, title, walk

SAMPLE = bundled("samples", "arducopter_failed.BIN")
needs_sample = pytest.mark.skipif(not SAMPLE.is_file(), reason="the sample is not bundled")


REQUEST = Request(SAMPLE, top=10)


@cache
def opened() -> Case:
    """The sample as the app opens it, once for all: what each test looks at are the views of it."""
    return open_and_warm(REQUEST, lambda _step, _share: None)


def real(configs: tuple[str | Path, ...] = ()) -> CareApp:
    engine = Engine() if configs else Engine(lambda _request, _progress: opened())
    return CareApp(replace(REQUEST, configs=configs), engine=engine, settings=Settings(places=()))


@pytest.mark.long
@needs_sample
async def test_every_view_opens_shows_the_run_and_closes() -> None:
    app = real()
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "w")
        assert title(app).startswith("Around mission_time:")
        first = items(app).splitlines()[0]
        assert "enter Go there" in shown(app)
        assert "Back a step" not in shown(app), "it is where it began"
        await settle(pilot, "enter")
        assert f"Around {first.split()[2]}:" in title(app)
        assert "h Back a step" in shown(app)
        await settle(pilot, "h")
        assert title(app).startswith("Around mission_time:")
        await settle(pilot, "escape", "m")
        assert "ArduCopter V4.5.4" in items(app)
        choices = walk(app).page.choices
        assert choices.has_focus, "the list takes the focus when it appears"
        assert choices.index is not None
        assert choices.index > 50
        assert "1207 messages" in title(app)
        assert choices.top > 0, "the moment of failure is in view"
        await settle(pilot, "n", "slash", *"arming")
        assert "arming" in items(app).casefold()
        await settle(pilot, "escape", "escape", "p")
        assert "BAT" in items(app)
        await settle(pilot, "slash", *"bat volt", "enter")
        assert any("\u2800" < sign <= "\u28ff" for sign in text(app)), "a curve is drawn"
        await settle(pilot, "escape", "escape", "b")
        assert "▸ arducopter" in items(app)
        assert "Model card: arducopter" in text(app)
        await settle(pilot, "escape", "y")
        assert "FAULT: too slow: " in items(app)
        assert "LAND_SPEED" in text(app)
        await settle(pilot, "x", "x", "escape")
        assert isinstance(app.screen, CaseScreen)
        await settle(pilot, "v")
        assert "Parameters  1002" in text(app)
        await settle(pilot, "3", "f2")
        assert title(app).startswith("Around LAND_SPEED"), "the graph starts at the cause under the cursor"
        await settle(pilot, "1", "question_mark", "escape", "escape")
        assert isinstance(app.screen, CaseScreen)


@needs_sample
async def test_an_effect_has_the_same_sign_on_its_path_and_in_the_graph() -> None:
    app = real()
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "3")
        path = walk(app).session.causes[0].path
        assert any(node.effect is not None and node.effect < 0 for node in path)
        await settle(pilot, "w")
        for node, after in pairwise(path):
            assert title(app).startswith(f"Around {node.name}")
            (line,) = [line for line in items(app).splitlines() if after.name in line.split()]
            assert f"{node.effect:+.2f}" in line.split()
            await settle(pilot, "slash", *after.name, "enter", "enter")


@needs_sample
async def test_a_message_leads_to_its_moment_in_the_plots_where_what_was_wanted_is_drawn_too() -> None:
    app = real()
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "m", "slash", *"4 WP", "enter")
        assert "62.8 s" in items(app)
        await settle(pilot, "enter")
        assert walk(app).here == "plots"
        assert title(app) == "30.5 s to 195.2 s, at 62.8 s"
        assert "to follow D" in items(app).splitlines()[0]
        assert "(wanted)" in text(app)
        column = {line.index("│") for line in text(app).splitlines() if "│" in line}
        assert len(column) == 1, "the moment is a line from top to bottom"
        await settle(pilot, "plus", "plus")
        assert title(app) == "42.2 s to 83.4 s, at 62.8 s"
        await settle(pilot, "minus", "minus", "minus")
        assert title(app) == "0.0 s to 195.6 s, at 62.8 s", "never more than the log holds"
        await settle(pilot, "v", "m")
        assert items(app).splitlines()[index(app) or 0].split()[0] == "62.8"
        await settle(pilot, "k", "p")
        assert "at 62." in title(app)


async def test_what_happened_is_marked_on_the_axis_of_time_and_n_goes_from_mark_to_mark() -> None:
    marked = Case(sample.crashed(), log=MadeLog({"ATT": {"Roll": T, "DesRoll": T}}))
    app = CareApp(Request(LOG), engine=fake_engine(lambda *_: marked), settings=Settings(places=()))
    async with app.run_test(size=(80, 40)) as pilot:
        await settle(pilot, "m", "p")
        lines = text(app).splitlines()
        axis = next(place for place, line in enumerate(lines) if "60" in line and "180 s" in line)
        assert {"A", "M", "E", "✗"} <= set(lines[axis - 1])
        assert any("motor 2 lost thrust" in line for line in lines[axis:])
        await settle(pilot, "plus", "plus")
        span = title(app).split(",")[0]
        width = float(span.split()[3]) - float(span.split()[0])
        await settle(pilot, "n")
        first = title(app)
        await settle(pilot, "n", "n")
        assert title(app) != first
        assert ", at " in title(app)
        start, end = (float(title(app).split()[place]) for place in (0, 3))
        assert end - start == pytest.approx(width, abs=0.2), "n keeps the zoom"
        await settle(pilot, "1", "p")
        assert title(app).endswith("at 91.3 s"), "p on a finding leads to its onset"
    quiet_run = replace(sample.RUN, evidence=())
    unmarked = Case(replace(sample.all_ok(), run=quiet_run), log=MadeLog({"ATT": {"Roll": T}}))
    app = CareApp(Request(LOG), engine=fake_engine(lambda *_: unmarked), settings=Settings(places=()))
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "p", "n")
        assert "Nothing is marked" in app.title


@needs_sample
async def test_probability_follow_the_value_that_is_typed() -> None:
    app = real()
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "4")
        suggested = walk(app).session.fix
        assert suggested is not None
        await settle(pilot, "equals_sign", *"17", "enter")
        worse = walk(app).session.fix
        assert worse is not None
        assert worse.p_fixed < suggested.p_fixed / 2
        await settle(pilot, "u")
        again = walk(app).session.fix
        assert again is not None
        assert again.p_fixed == pytest.approx(suggested.p_fixed, abs=0.01)


@needs_sample
async def test_the_file_on_disk_is_patched_with_its_comments_kept(tmp_path: Path) -> None:
    file = tmp_path / "robot.param"
    file.write_text("# landing, agreed with Anna\nLAND_SPEED,20  # slow\nWPNAV_SPEED,1000\n")
    app = real((file,))
    async with app.run_test(size=(120, 40)) as pilot:
        await settle(pilot, "5", "f")
        assert "-LAND_SPEED,20  # slow" in text(app)
        fix = walk(app).session.fix
        assert fix is not None
        assert f"+LAND_SPEED,{fix.changes[0].suggested:g}  # slow" in text(app)
        await settle(pilot, "f")
        assert "! LAND_SPEED  16 -> 20" in text(app)
    assert "LAND_SPEED,20" in file.read_text(), "nothing is written"


@needs_sample
async def test_the_change_is_put_into_the_file_that_is_asked_for_and_the_old_one_is_kept(tmp_path: Path) -> None:
    file = tmp_path / "robot.param"
    before = "# landing, agreed with Anna\nLAND_SPEED,16  # slow\nWPNAV_SPEED,1000\n"
    file.write_text(before)
    app = real()
    async with app.run_test(size=(120, 40)) as pilot:
        await settle(pilot, "5", "A")
        app.screen.query_one(Input).value = str(tmp_path / "none.param")
        await settle(pilot, "enter")
        assert "no such file" in str(app.screen.query_one(".error", Static).content)
        app.screen.query_one(Input).value = str(file)
        await settle(pilot, "enter")
        assert isinstance(app.screen, Confirm), "the file that it is to be applied to was asked for"
        await settle(pilot, "n")
        assert "+LAND_SPEED,40  # slow" in text(app)
        assert file.read_text() == before, "nothing is written unasked"
        await settle(pilot, "A", "y")
        assert "the old one is robot.param.bak" in " ".join(text(app).split()), "where it is can still be read"
        await settle(pilot, "4", "plus", "5")
        assert "the old one is robot.param.bak" not in text(app), "this change was not written"
        await settle(pilot, "4", "u", "5", "A")
        assert not isinstance(app.screen, Confirm), "there is nothing to ask"
        assert "holds these values already" in app.title
    assert file.read_text() == before.replace("16", "40")
    assert (tmp_path / "robot.param.bak").read_text() == before


@needs_sample
async def test_a_folder_lists_its_logs_with_verdicts_and_enter_opens_one(tmp_path: Path) -> None:
    (tmp_path / "flight.BIN").write_bytes(SAMPLE.read_bytes())
    (tmp_path / "broken.BIN").write_bytes(b"x" * 100)
    remember(SAMPLE)
    app = CareApp(Request(tmp_path, top=10), settings=Settings(places=()))
    async with app.run_test(size=(120, 40)) as pilot:
        await settle(pilot)
        assert walk(app).here == "logs"
        assert title(app).startswith("2 logs in "), "none that was opened elsewhere"
        told = {line.split()[-1] if "UNREADABLE" in line else "flight": line for line in items(app).splitlines()}
        assert any("FAULT" in line and "too slow" in line for line in told.values())
        assert any("UNREADABLE" in line for line in told.values())
        await settle(pilot, "slash", *"flight", "enter", "enter")
        await settle(pilot)
        assert walk(app).here == "objectives"
        await settle(pilot, "escape", "escape")
        assert walk(app).here == "logs"


@needs_sample
@pytest.mark.parametrize("size", [(80, 24), (60, 20), (120, 40)])
async def test_the_path_of_a_cause_is_in_view_however_low_the_terminal(size: tuple[int, int]) -> None:
    app = real()
    async with app.run_test(size=size) as pilot:
        await settle(pilot, "3")
        for line in ("LAND_SPEED    16 cm/s", "landing_time  66.13 s", "mission_time  164.7 s", "limit <= 145.1 s"):
            assert line in shown(app)


async def test_a_wide_screen_shows_what_an_objective_is_measured_on_and_where_a_moment_was() -> None:
    app = CareApp(Request(bundled("samples", "px4_failed.ulg")), settings=Settings(places=()))
    async with app.run_test(size=(120, 40)) as pilot:
        await settle(pilot, "2")
        assert "● track" in text(app), "of the way the map shows most"
        assert "o its corners" in text(app)
        assert "Threshold" in side(app)
        await settle(pilot, "up", "up")
        assert "position down" in text(app), "of the time a signal"
        await settle(pilot, "1", "G")
        assert "@ here" in text(app)
        await settle(pilot, "z")
        assert "@ here" not in text(app), "the details have the room"
        await pilot.resize_terminal(80, 24)
        await settle(pilot, "z", "2")
        assert "Threshold" in text(app), "a narrow screen has how it was judged"


@needs_sample
async def test_a_wide_list_of_missions_shows_the_way_of_each(tmp_path: Path) -> None:
    log = tmp_path / "two.BIN"
    log.write_bytes(bundled("samples", "arducopter_motor.BIN").read_bytes() + SAMPLE.read_bytes())
    app = CareApp(Request(log), settings=Settings(places=()))
    async with app.run_test(size=(120, 40)) as pilot:
        await settle(pilot, "t")
        assert title(app) == "2 missions"
        assert index(app) == 1, "the one that is diagnosed"
        assert "● track" in text(app)
        assert re.search(r"✓ OK +path_error_max +1.232 m +<= 2 m", side(app))
        assert "it came down slowly" in side(app)
        await settle(pilot, "k")
        assert "motor 4 (rear) lost thrust" in side(app)
        assert "it came down slowly" not in side(app)
        ruler = re.search(r"─ (\d+) m", text(app))
        assert ruler is not None
        assert int(ruler[1]) < 100, "the corners of the other mission lie elsewhere"


@needs_sample
async def test_the_map_shows_the_track_and_the_corners_that_were_asked_for() -> None:
    app = real()
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "M")
        assert title(app) == "Track and the way asked for"
        assert text(app).count("o") >= 5
        assert any("\u2800" < sign <= "\u28ff" for sign in text(app))


@needs_sample
async def test_one_key_leads_from_any_view_to_any_other_and_digits_leave_it() -> None:
    app = real()
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "3")
        for key, name in (("m", "Messages"), ("p", "plots"), ("y", "History"), ("w", "Graph"), ("v", "Contents")):
            await settle(pilot, key, key)
            assert walk(app).here == name.lower()
            assert walk(app).query_one("#view-tabs", TabRow).here == name.lower()
            assert not walk(app).query_one("#step-tabs", TabRow).here
        await settle(pilot, "escape", "escape")
        assert walk(app).here == "history", "Esc leads back the way the operator came"
        for digit, name in (("3", "Causes"), ("5", "Diff")):
            await settle(pilot, digit)
            assert walk(app).here == name.lower()
            await settle(pilot, "b")
        await settle(pilot, "escape")
        assert step_of(app) == 5


@needs_sample
async def test_a_view_keeps_its_place_while_another_is_looked_at() -> None:
    app = real()
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "m", "k", "k", "k")
        here = index(app)
        await settle(pilot, "v", "escape")
        assert walk(app).here == "messages"
        assert index(app) == here


async def test_views_of_a_log_need_one_and_the_others_do_not(make_app: MakeApp) -> None:
    app = CareApp(settings=Settings(places=()))
    async with app.run_test(size=(80, 24)) as pilot:
        for key in ("f2", "f3", "f4"):
            await settle(pilot, key)
            assert "Open a log first" in app.title
        await settle(pilot, "f5")
        assert isinstance(walk(app).page, HistoryPage)
        assert "No run was triaged before" in text(app)
        await settle(pilot, "escape", "f6")
        assert "arducopter" in items(app)


async def test_a_log_that_is_cut_off_before_its_mission_tells_what_is_there(tmp_path: Path) -> None:
    log = tmp_path / "cut.BIN"
    log.write_bytes(SAMPLE.read_bytes()[:60_000])
    app = CareApp(Request(log), settings=Settings(places=()))
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        assert step_of(app) == 1
        assert "What would make one fit" in text(app)
        await settle(pilot, "z")
        assert "breaks off inside a record" in text(app)
        for key, name in (("m", "messages"), ("p", "plots"), ("t", "missions")):
            await settle(pilot, key)
            assert walk(app).here == name.lower()
        assert "no mission is judged" in text(app)
        await settle(pilot, "v")
        assert "Format      dataflash-bin" in text(app)
        await settle(pilot, "6")
        assert "schema: care.triage/1" in text(app)


async def test_a_log_whose_diagnosis_failed_can_still_be_looked_into(tmp_path: Path) -> None:
    log = tmp_path / "a.BIN"
    log.write_bytes(SAMPLE.read_bytes()[:60_000])

    def fails(*_: object) -> Case:
        raise UsageError("There is no mission 9.", hint="Name another.")

    app = CareApp(Request(log), engine=fake_engine(fails), settings=Settings(places=()))
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot)
        assert "There is no mission 9." in text(app)
        assert "v shows what the log holds" in text(app)
        await settle(pilot, "m")
        assert "no diagnosis" in app.title
        await settle(pilot, "v")
        assert "Format      dataflash-bin" in text(app)


async def test_a_view_that_cannot_read_the_log_says_so(make_app: MakeApp) -> None:
    app = make_app(sample.faulty())
    async with app.run_test(size=(80, 24)) as pilot:
        await settle(pilot, "m")
        assert "no log to look into" in text(app)
        await settle(pilot, "escape", "w")
        assert "no model of this" in text(app)


def test_a_plot_is_as_wide_and_as_high_as_asked_for() -> None:
    columns = [(float(x), float(x)) for x in range(40)]
    braille = [line.plain for line in plot(columns, 0.0, 39.0, 5, ascii=False)]
    assert [len(line) for line in braille] == [20] * 5
    assert braille[0].strip() == braille[0].lstrip()
    assert braille[-1].startswith("⣀") or braille[-1][0] != " "
    stars = plot([None, (0.0, 1.0), (1.0, 1.0)], 0.0, 1.0, 3, ascii=True)
    assert [line.plain for line in stars] == [" **", " * ", " * "]
    assert dots_across(20, ascii=False) == 40
    assert dots_across(20, ascii=True) == 20


def test_signals_of_a_narrow_list_are_told_apart_by_their_fields() -> None:
    fields = [f"accelerometer_m_s2[{axis}]" for axis in range(3)]
    names = [signal_name(Signal("sensor_combined", field), 30, ASCII) for field in fields]
    assert len(set(names)) == 3
    assert all(len(name) <= 30 and name.endswith(field) for name, field in zip(names, fields, strict=True))
    assert signal_name(Signal("battery_status", "voltage_v"), 30, ASCII) == "battery_status voltage_v"
    assert len(signal_name(Signal("a", "long_" * 20), 30, ASCII)) == 30


@needs_sample
async def test_the_next_mark_is_the_one_after_what_is_shown_and_several_signals_are_kept_in_view() -> None:
    app = real()
    async with app.run_test(size=(120, 40)) as pilot:
        await settle(pilot, "3", "p")
        window = title(app).split(", at")[0]
        await settle(pilot, "n")
        assert title(app).startswith(f"{window}, at 194.7 s"), "what was drawn is drawn still"
        await settle(pilot, "x", "j", "x", "j", "j", "x")
        drawn = [
            line for line in text(app).splitlines() if line.startswith(("height", "latitude", "speed", "longitude"))
        ]
        assert len(drawn) == 3, "each has a plot of its own"
        await settle(pilot, "x")
        assert items(app).count("\u25cf") == 2, "and is let go again"
    app = real()
    async with app.run_test(size=(80, 20)) as pilot:
        await settle(pilot, "p", "x")
        assert "no room for a second plot" in hints(app)


def test_what_is_said_running_is_told_once_until_something_else_is_said() -> None:
    said = [Event(float(i), "event", words, "EV") for i, words in enumerate(["a", "b", "b", "b", "a"])]
    assert [(one.message.text, one.count, one.end_s) for one in folded(said)] == [
        ("a", 1, 0.0),
        ("b", 3, 3.0),
        ("a", 1, 4.0),
    ]


@needs_sample
async def test_what_is_of_the_size_of_the_screen_follows_it() -> None:
    app = real()
    async with app.run_test(size=(120, 40)) as pilot:
        await settle(pilot, "v", "2", "v")
        assert len(text(app).splitlines()) > 20
        assert not any(len(line.strip()) == 1 for line in text(app).splitlines()), (
            "it was asked for while it was hidden"
        )
        pinned = shown_above(app)
        assert "Next" in pinned
        assert SAMPLE.name in pinned
        await pilot.resize_terminal(59, 20)
        await settle(pilot)
        await pilot.resize_terminal(120, 40)
        await settle(pilot)
        assert shown_above(app) == pinned
        await pilot.resize_terminal(60, 20)
        await settle(pilot)
        assert not str(app.screen.query_one("#log-name", Static).content), "there is no room for it"


def shown_above(app: CareApp) -> str:
    """The name of the log and the pinned answer."""
    screen = app.screen
    return f"{screen.query_one('#log-name', Static).content} {screen.query_one(AnswerBar).content}"
