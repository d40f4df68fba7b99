"""A new robot's hour: scaffold, check, ingest, train, triage of a failure that was planted, by command line alone."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from care_core.profile.store import load_profile
from tests.conftest import Care
from tests.courier import SPEED, USUAL, configured, deliver

RUNS = 28


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("courier_logs")
    rng = np.random.default_rng(0)
    for number in range(3):
        deliver(folder / f"good{number}.mcap", dict(USUAL), rng, "Parameter /planner/retries set to 4")
    for number in range(RUNS):
        deliver(folder / f"run{number:02d}.mcap", configured(rng), rng)
    return folder


@pytest.mark.long
def test_a_new_robot_from_its_logs_to_a_diagnosis(care: Care, logs: Path, tmp_path: Path) -> None:
    robot, table = tmp_path / "courier", tmp_path / "courier.csv"
    made = care("profiles", "new", logs, "--out", robot)
    assert made.code == 0
    assert "parameters  5 (0 with a guessed range)" in made.stdout
    checked = care("profiles", "check", robot)
    assert checked.code == 0
    assert f"{RUNS + 3} runs are enough to train with" in checked.stdout

    assert care("ingest", logs, "--out", table, "--profile", robot, "--workers", "1").code == 0
    assert care("train", table, "--schema", robot / "profile.yaml", "--out", robot, "--resamples", "2").code == 0
    assert care("profiles", "check", robot).code == 0

    slow = deliver(tmp_path / "slow.mcap", {**USUAL, SPEED: 0.25}, np.random.default_rng(9))
    answer = care("triage", slow, "--profile", robot, "--json")
    assert answer.code == 1
    report = json.loads(answer.stdout)
    assert {fault["objective"] for fault in report["faults"]} == {"mission_time", "energy"}
    assert report["faults"][0]["causes"][0]["option"] == "max_vel_x"
    (change,) = report["fix"]["changes"]
    assert change["option"] == "max_vel_x"
    assert change["to"] > 0.3


def test_few_good_logs_say_what_is_missing(care: Care, logs: Path, tmp_path: Path) -> None:
    robot = tmp_path / "courier"
    goods = sorted(logs.glob("good*.mcap"))
    assert care("profiles", "new", *goods, "-o", robot).code == 0
    text = (robot / "profile.yaml").read_text()
    assert "/planner/retries (4)" in text
    assert "at their default in every log: /controller_server.goal_checker.xy_goal_tolerance" in text
    assert "/controller_server.use_sim_time" in text
    names = {option.name for option in load_profile(robot).schema.options}
    assert names == {"max_vel_x", "inflation_radius", "rate", "samples"}
    checked = care("profiles", "check", robot)
    assert checked.code == 0
    assert "3 runs, a model needs at least 30" in checked.stdout
    assert "no option varies" in checked.stdout
    assert care("triage", goods[0], "--profile", robot).code == 2


def test_runs_that_lack_something_are_named(care: Care, logs: Path, tmp_path: Path) -> None:
    robot, table = tmp_path / "courier", tmp_path / "runs.csv"
    care("profiles", "new", *sorted(logs.glob("*.mcap"))[-4:], "-o", robot)
    header, *rows = (robot / "runs.csv").read_text().splitlines()
    columns = header.split(",")
    place = columns.index("rate")
    still = [",".join("20" if i == place else cell for i, cell in enumerate(row.split(","))) for row in rows]
    table.write_text("\n".join([header, *still]) + "\n")
    checked = care("profiles", "check", robot, "--runs", table)
    assert "options that never vary, of which nothing can be learned (1): rate" in checked.stdout


def test_what_cannot_become_a_profile_is_refused(care: Care, logs: Path, tmp_path: Path) -> None:
    log = next(logs.glob("good*.mcap"))
    nothing = tmp_path / "nothing.mcap"
    nothing.write_bytes(b"not a log")
    assert care("profiles", "new", nothing, "-o", tmp_path / "a").code == 4
    assert not (tmp_path / "a").exists()
    assert care("profiles", "new", tmp_path / "absent.bag", "-o", tmp_path / "a").code == 2
    assert care("profiles", "new", log, "-o", tmp_path / "deep" / "a").code == 2
    assert care("profiles", "new", log, "-o", tmp_path / "a name").code == 2
    assert care("profiles", "new", log, nothing, "-o", tmp_path / "a").code == 3
    again = care("profiles", "new", log, "-o", tmp_path / "a")
    assert again.code == 2
    assert "There is a profile already" in again.stderr
    assert care("profiles", "new", log, "-o", tmp_path / "a", "--force").code == 0
    assert care("profiles", "check", tmp_path / "a", "--runs", tmp_path / "absent.csv").code == 2
