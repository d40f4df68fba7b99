"""Is it getting worse, on which robot, since which change: planted trends are found, chance is not, in good time."""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

from care_core.errors import UsageError
from care_core.history.store import About, History, Triaged
from care_core.history.trends import ALPHA, RobotRuns, by_robot, kendall, pettitt
from care_core.report.document import build_document
from care_core.report.exporting import export_history
from care_core.report.history import HistoryDocument, history_document, history_text
from care_core.report.writers import published
from care_core.run import Robot
from tests.conftest import Care
from tests.made import HOSTILE, made_diagnosis

DOCUMENT = published(build_document(made_diagnosis()))
A, B = Robot("003F 1", "Cube 003F", "serial of the board", True), Robot("copter 1", "copter 1", "system id", False)


def run(
    number: int,
    time_s: float | None,
    robot: Robot | None = A,
    *,
    asked: Mapping[str, float] | None = None,
    settings: Mapping[str, float | str] | None = None,
    firmware: str = "ArduCopter V4.5.4",
    start: str | None = "",
    log: str = "",
) -> Triaged:
    """A remembered run whose log begins on day `number`, with this mission time."""
    document = json.loads(json.dumps(DOCUMENT))
    log = log or f"/logs/{number:08}.BIN"
    begun = f"2026-01-{number + 1:02}T10:00:00+00:00" if start == "" else start
    document["log"].update(path=log, start=begun, sha256=f"{number:064}")
    document["objectives"][1].update(value=time_s, status="fault" if (time_s or 0) > 150 else "ok")
    return Triaged(
        robot,
        asked or {"legs": 5.0, "path_length": 260.0},
        firmware,
        settings or {"WPNAV_SPEED": 500.0},
        at=f"2026-02-{number + 1:02}",
        log_path=log,
        mission=1,
        document=document,
    )


def told(runs: Sequence[Triaged]) -> tuple[RobotRuns, ...]:
    newest_first = list(reversed(runs))
    return by_robot(newest_first, dict.fromkeys(range(len(newest_first)), False))


def times(robots: tuple[RobotRuns, ...], place: int = 0) -> Any:
    return next(t for t in robots[place].missions[0].trends if t.objective == "mission_time")


@pytest.mark.parametrize(
    ("values", "tau", "p"),
    [
        # Kendall's distribution for five values without ties: S = 10 in 1 of 120 orders, S >= 8 in 5 of them.
        ((1, 2, 3, 4, 5), 1.0, 2 / 120),
        ((1, 2, 3, 5, 4), 0.8, 10 / 120),
        ((5, 4, 3, 2, 1), -1.0, 2 / 120),
        # Ten in order, by the approximation of Mann and Kendall: z = 44 / sqrt(125).
        (tuple(range(10)), 1.0, 8.3e-5),
    ],
)
def test_the_rank_test_gives_the_probabilities_of_its_tables(values: Sequence[float], tau: float, p: float) -> None:
    found = kendall(np.array(values, float))
    assert found[0] == pytest.approx(tau)
    assert found[1] == pytest.approx(p, rel=0.01)


def test_the_approximation_agrees_with_drawn_orders_where_values_are_tied() -> None:
    rng = np.random.default_rng(1)
    for n in (9, 20):
        x = np.sort(rng.integers(0, 4, n)).astype(float)
        x[[0, -2]] = x[[-2, 0]]
        tau, p = kendall(x)
        drawn = [abs(kendall(rng.permutation(x))[0]) >= abs(tau) - 1e-9 for _ in range(800)]
        assert p == pytest.approx(float(np.mean(drawn)), abs=0.04)


def test_the_change_is_found_where_it_was_made() -> None:
    rng = np.random.default_rng(2)
    for n, at in ((8, 4), (14, 6), (40, 25)):
        x = rng.normal(0, 1, n) + 6.0 * (np.arange(n) >= at)
        found, p = pettitt(x)
        assert found == at
        assert p < ALPHA


def test_chance_is_seldom_taken_for_a_trend_or_a_change() -> None:
    rng = np.random.default_rng(3)
    for n, draws in ((7, 100), (12, 60)):
        drawn = [rng.normal(size=n) for _ in range(draws)]
        for test in (kendall, pettitt):
            false = np.mean([test(x)[1] < ALPHA for x in drawn])
            assert false <= ALPHA + 3 * np.sqrt(ALPHA * (1 - ALPHA) / len(drawn))


def test_worse_since_the_run_at_which_a_parameter_was_changed() -> None:
    rng = np.random.default_rng(4)
    runs = [
        run(n, 120 + rng.normal() + 30 * (n >= 7),
            settings={"WPNAV_SPEED": 500.0 if n < 7 else 350.0, "PSC_POSZ_P": 1.0 + (n >= 11)},
            firmware="ArduCopter V4.5.4" if n < 7 else "ArduCopter V4.6.0")
        for n in range(14)
    ]  # fmt: skip
    trend = times(told(runs))
    assert trend.direction == "worse"
    assert trend.since is not None
    assert trend.since.run.log_path.endswith("00000007.BIN")
    assert [(one.name, one.before, one.after) for one in trend.since.changed] == [
        ("firmware", "ArduCopter V4.5.4", "ArduCopter V4.6.0"), ("WPNAV_SPEED", 500.0, 350.0),
    ]  # fmt: skip
    text = history_text(history_document(list(reversed(runs)), ()))
    assert "GETS WORSE" in text
    assert "WPNAV_SPEED 500 -> 350" in " ".join(text.split())
    assert "PSC_POSZ_P" not in text
    assert max(map(len, text.splitlines()[14:])) <= 80


def test_one_robot_gets_worse_and_the_other_does_not() -> None:
    rng = np.random.default_rng(5)
    runs = [run(2 * n, 120 + 4 * n + rng.normal()) for n in range(10)]
    runs += [run(2 * n + 1, 120 + rng.normal(), B) for n in range(10)]
    robots = told(runs)
    assert [one.robot and one.robot.id for one in robots] == ["003F 1", "copter 1"]
    assert [times(robots, place).direction for place in (0, 1)] == ["worse", "none"]


def test_missions_are_told_apart_and_too_few_runs_are_said() -> None:
    long = {"legs": 9.0, "path_length": 900.0}
    runs = [run(n, 120.0 + 100 * (n % 2), asked=long if n % 2 else {"legs": 5.0, "path_length": 259.0 + n / 4})
            for n in range(9)]  # fmt: skip
    (robot,) = told(runs)
    assert [len(mission.runs) for mission in robot.missions] == [5, 4]
    assert [mission.trends[1].direction for mission in robot.missions] == ["constant", "too few"]
    document = history_document(list(reversed(runs)), ())
    assert "4 values" in history_text(document, everything=True)
    shown = history_text(document)
    assert "4 values" not in shown
    assert "with fewer than the 5 runs of a trend (--all shows them)" in shown or "Fewer than the 5 runs" in shown
    assert all(len(line) <= 80 for line in shown.splitlines())


def test_runs_are_ordered_by_their_logs_and_a_log_that_grew_counts_once() -> None:
    times_s = [120.0, 125.0, 130.0, 135.0, 140.0, 145.0]
    mixed = [run(n, times_s[n]) for n in (3, 0, 5, 1, 4, 2)]
    assert times(told(mixed)).values == tuple(times_s)
    grown = [*mixed, run(5, 200.0)]
    assert times(told(grown)).values == (*times_s[:-1], 200.0)
    without_clock = [run(n, times_s[n], start=None) for n in (3, 0, 5, 1, 4, 2)]
    assert times(told(without_clock)).values == tuple(times_s[n] for n in (3, 0, 5, 1, 4, 2))


def test_many_robots_make_no_false_alarm_likely() -> None:
    rng = np.random.default_rng(6)
    runs = [run(n, 120 + rng.normal(), Robot(f"r{r}", f"r{r}", "", True), log=f"/{r}/{n}.BIN")
            for r in range(30) for n in range(10)]  # fmt: skip
    directions = [trend.direction for robot in told(runs) for trend in robot.missions[0].trends]
    assert set(directions) <= {"none", "constant", "too few"}


def test_the_document_fits_its_schema_and_steers_no_terminal() -> None:
    hostile = Robot("x", f"bot {HOSTILE}", HOSTILE, True)
    runs = [run(n, 120.0 + n, hostile, settings={HOSTILE: float(n)}, log=f"/{HOSTILE}{n}.BIN") for n in range(10)]
    document = history_document(list(reversed(runs)), ())
    text = document.to_json()
    jsonschema.validate(json.loads(text), HistoryDocument.json_schema())
    for shown in (history_text(document), history_text(document, ascii=True)):
        assert all(line.isprintable() for line in shown.splitlines())
    assert history_text(document, ascii=True).isascii()


def test_what_is_remembered_of_a_run_comes_back(tmp_path: Path) -> None:
    history = History(tmp_path / "h.sqlite3")
    about = About(A, {"legs": 5.0}, "ArduCopter V4.5.4", {"A": 1.0, "B": "text"})
    history.add_triage(DOCUMENT, 1, about)
    (found,) = history.triages()
    assert (found.robot, found.asked, found.firmware, found.settings) == (
        about.robot, about.asked, about.firmware, about.settings,
    )  # fmt: skip


def test_a_history_of_the_first_version_is_taken_over(tmp_path: Path) -> None:
    import sqlite3

    path = tmp_path / "h.sqlite3"
    with sqlite3.connect(path) as connection:
        connection.executescript(
            "create table triages (id integer primary key, at text not null, profile text not null,"
            " version text not null, log_sha256 text not null, log_path text not null, mission integer not null,"
            " document text not null, unique (log_sha256, mission, profile) on conflict replace);"
            "create table verifications (id integer primary key, at text not null, profile text not null,"
            " version text not null, report_sha256 text not null, log_sha256 text not null, p_fixed real not null,"
            " worked integer, document text not null, unique (report_sha256, log_sha256, profile) on conflict replace);"
            "pragma user_version = 1;"
        )
        connection.execute(
            "insert into triages values (1, '2025-01-01T00:00:00', 'p', '1', 's', '/a.BIN', 1, ?)",
            (json.dumps(DOCUMENT),),
        )
    history = History(path)
    history.add_triage({**DOCUMENT, "log": {**DOCUMENT["log"], "sha256": "1" * 64}}, 1, About(A))
    assert [one.robot for one in history.triages()] == [A, None]
    document = history_document(history.triages(), ())
    assert "Robot not known" in history_text(document, everything=True)
    folded = "Fewer than the 5 runs of a trend (--all shows them): robot not known (1 run)"
    assert folded in " ".join(history_text(document).split())


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_the_table_has_a_row_a_run(tmp_path: Path, suffix: str) -> None:
    pandas = pytest.importorskip("pandas")
    if suffix == ".parquet":
        pytest.importorskip("pyarrow")
    out = tmp_path / f"h{suffix}"
    assert export_history(out, [run(1, 130.0), run(0, 190.0, None)]) == 2
    table = pandas.read_csv(out) if suffix == ".csv" else pandas.read_parquet(out)
    assert list(table["objective.mission_time"]) == [190.0, 130.0]
    assert list(table["objective.mission_time.status"]) == ["fault", "ok"]
    assert table["robot"].iloc[1] == "003F 1"
    assert table["option.land_speed"].iloc[0] == 16.0


def test_the_command_picks_a_robot_and_exports(care: Care, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "h.sqlite3"
    monkeypatch.setenv("CARE_HISTORY", str(path))
    for number, robot in enumerate((A, A, B)):
        one = run(number, 130.0)
        History(path).add_triage(one.document, 1, About(robot))
    document = json.loads(care("history", "--robot", "cube 003f", "--json").stdout)
    assert [(one["robot"]["id"], one["runs"]) for one in document["robots"]] == [("003F 1", 2)]
    outcome = care("history", "--robot", "cube 003e")
    assert outcome.code == 2
    assert "Cube 003F" in outcome.stderr
    assert care("history", "--export", tmp_path / "h.csv").code == 0
    with (tmp_path / "h.csv").open() as stream:
        assert len(list(csv.DictReader(stream))) == 3
    assert care("history", "--export", tmp_path / "h.xlsx").code == 2


def test_without_pyarrow_the_way_to_it_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from care_core.tables.rows import check_table_path

    monkeypatch.setattr("importlib.util.find_spec", lambda _name: None)
    with pytest.raises(UsageError, match="pip install"):
        check_table_path(tmp_path / "h.parquet")
