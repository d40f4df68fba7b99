"""Finding logs and writing the table of runs."""

from __future__ import annotations

import csv
from pathlib import Path

import pytest

from care_core.errors import UsageError
from care_core.logs.finding import find_logs
from care_core.tables.rows import ABOUT, check_table_path, write_table
from tests.unit.test_read_run import made_schema


def test_folders_are_searched_and_each_log_comes_once(tmp_path: Path) -> None:
    (tmp_path / "a" / "b").mkdir(parents=True)
    for name in ("a/2.BIN", "a/b/1.bag", "a/notes.txt", "3.bin"):
        (tmp_path / name).touch()
    found = find_logs([tmp_path / "3.bin", tmp_path])
    assert [path.name for path in found] == ["3.bin", "2.BIN", "1.bag"]
    (tmp_path / "a" / "drive").mkdir()
    for name in ("metadata.yaml", "drive_0.db3"):
        (tmp_path / "a" / "drive" / name).touch()
    (tmp_path / "a" / "program.log").write_text("started")
    assert [path.name for path in find_logs([tmp_path / "a"])] == ["2.BIN", "1.bag", "drive"]
    with pytest.raises(UsageError, match="No such file"):
        find_logs([tmp_path / "none"])
    with pytest.raises(UsageError, match="no log there"):
        find_logs([tmp_path / "home"])


def test_what_is_not_known_is_an_empty_cell(tmp_path: Path) -> None:
    out = tmp_path / "runs.csv"
    write_table(out, [{"log": "a.bin", "mission": 1, "speed": 2.0, "energy": None}], made_schema())
    with out.open() as stream:
        (row,) = csv.DictReader(stream)
    assert (row["log"], row["mission"], row["speed"], row["energy"], row["distance"]) == ("a.bin", "1", "2.0", "", "")


def test_a_parquet_table_holds_the_same(tmp_path: Path) -> None:
    pd = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    out = tmp_path / "runs.parquet"
    check_table_path(out)
    write_table(out, [{"log": "a.bin", "mission": 1, "speed": 2.0, "energy": None}], made_schema())
    frame = pd.read_parquet(out)
    assert list(frame.columns) == [*ABOUT, *made_schema().variables]
    assert frame["speed"][0] == 2.0
    assert [path.name for path in tmp_path.iterdir() if path.name != "home"] == ["runs.parquet"]


def test_a_table_that_cannot_be_written_is_refused_early(tmp_path: Path) -> None:
    for name in ("runs.xlsx", "none/runs.csv"):
        with pytest.raises(UsageError):
            check_table_path(tmp_path / name)
