"""The fleet as table, document and Parquet: 80 columns, nothing that steers a terminal, one exit code."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from care_core.diagnose.records import Status
from care_core.errors import ExitCode, UsageError
from care_core.fleet.fleet_report import Fleet, together
from care_core.fleet.rows import Row, by_folder, row_of, unreadable
from care_core.records import replace
from care_core.report.fleet import FleetDocument, check_parquet_path, fleet_document, short_names, write_parquet
from care_core.run import Robot
from care_tui.render.fleet import MOST_ROWS, fleet_text
from tests.made import HOSTILE, made_diagnosis


def made_row(number: int, status: Status = "fault") -> Row:
    """The row of a diagnosis whose every text tries to steer a terminal."""
    diagnosis = made_diagnosis()
    robot = Robot(f"id {number}", f"robot {number}", "made", is_sure=True)
    log = replace(diagnosis.run.log, robot=robot, recording=f"{number}", start="2026-11-12T09:00:00+00:00")
    row = row_of(f"{number}{HOSTILE}.BIN", replace(diagnosis, run=replace(diagnosis.run, log=log)))
    return replace(row, status=status, profile="")


def made_fleet() -> Fleet:
    return together([made_row(1), made_row(2), replace(made_row(2), log="copy.BIN"), unreadable("x.bag", HOSTILE)])


def test_the_row_of_a_diagnosis() -> None:
    row = made_row(1)
    assert (row.robot, row.called, row.kind) == ("id 1", "robot 1", "dataflash-bin")
    assert row.main is not None
    assert (row.main.what, row.main.name) == ("parameter", "land_speed")
    assert [cause.option for cause in row.causes] == ["land_speed"]
    assert row.breaches == ("mission_time",)
    assert row.objectives == {"success": 1.0, "mission_time": 190.0}
    assert row.change == {"land_speed": 50.0}
    assert [finding.kind for finding in row.findings] == ["motor"]


def test_a_robot_that_is_only_guessed_is_none_and_its_folder_may_stand_for_it() -> None:
    diagnosis = made_diagnosis()
    unsure = replace(diagnosis.run.log, robot=Robot("vehicle 1", "vehicle 1", "as delivered", is_sure=False))
    row = row_of("a.BIN", replace(diagnosis, run=replace(diagnosis.run, log=unsure)))
    assert row.robot is None
    assert by_folder(replace(row, folder="husky-3")).robot == "husky-3"
    assert by_folder(replace(made_row(1), folder="husky-3")).robot == "id 1"


def test_the_text_has_80_columns_and_steers_nothing() -> None:
    text = fleet_text(made_fleet())
    assert max(map(len, text.splitlines())) <= 80
    assert all(character.isprintable() or character == "\n" for character in text.replace("\u00a0", " "))
    assert text.splitlines()[0] == "4 logs of 2 robots: 3 with a fault, 1 unreadable, 1 copy counted once"
    assert "a copy of" in text
    assert "UNREADABLE" in text


def test_the_document_is_by_its_schema() -> None:
    jsonschema = pytest.importorskip("jsonschema")
    document = json.loads(fleet_document(made_fleet()).to_json())
    jsonschema.validate(document, FleetDocument.json_schema())
    assert document["schema"] == "care.fleet/1"
    assert [row["status"] for row in document["rows"]] == ["fault", "fault", "fault", "unreadable"]
    assert document["rows"][2]["copy_of"] == document["rows"][1]["log"]
    assert document["shared"][0]["affected"] == ["id 1", "id 2"]


def test_of_a_large_fleet_those_that_need_a_look_come_first() -> None:
    rows = [made_row(number, "ok") for number in range(MOST_ROWS + 5)]
    text = fleet_text(together([*rows, made_row(999)]))
    assert "and 6 more" in text
    assert text.index("999") < text.index("and 6 more")


def test_parquet_holds_a_row_a_log_and_replaces_no_recording(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    import pandas as pd

    path = tmp_path / "rows.parquet"
    check_parquet_path(path)
    write_parquet(path, made_fleet())
    frame = pd.read_parquet(path)
    assert frame["robot"].tolist()[:3] == ["id 1", "id 2", "id 2"]
    assert frame["robot"].isna().tolist()[3]
    assert frame["cause"].tolist()[:3] == ["land_speed"] * 3
    assert frame["objective.mission_time"].tolist()[:2] == [190.0, 190.0]
    assert list(frame["breaches"][0]) == ["mission_time"]
    assert [entry.name for entry in tmp_path.iterdir() if entry.name != "home"] == ["rows.parquet"]
    with pytest.raises(UsageError, match="parquet"):
        check_parquet_path(tmp_path / "rows.csv")
    with pytest.raises(UsageError, match="folder"):
        check_parquet_path(tmp_path / "none" / "rows.parquet")


@pytest.mark.parametrize(
    ("statuses", "code"),
    [
        (["ok", "ok"], ExitCode.OK),
        (["ok", "fault", "unreadable"], ExitCode.FAULT),
        (["ok", "not_evaluated"], ExitCode.NOT_EVALUATED),
        (["ok", "unreadable"], ExitCode.NOT_EVALUATED),
        (["unreadable", "unreadable"], ExitCode.UNREADABLE),
    ],
)
def test_the_exit_code_is_that_of_the_worst(statuses: list[str], code: ExitCode) -> None:
    rows = [replace(unreadable(f"{n}.BIN", "why"), status=status) for n, status in enumerate(statuses)]
    assert Fleet(tuple(rows), (), ()).exit_code == code


def test_robots_are_called_as_people_do_or_by_number() -> None:
    one, other = made_row(1), made_row(2)
    assert short_names([one, other]) == {"id 1": "robot 1", "id 2": "robot 2"}
    same = [replace(one, called="CubeOrange"), replace(other, called="CubeOrange")]
    assert short_names(same) == {"id 1": "robot 1", "id 2": "robot 2"}
