"""A copy of a recording, whatever its file is called, how long it is and how it is written, is no run of its own."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

import care_core
from care_core.application.baselining import baseline
from care_core.application.case import Request
from care_core.application.history_writing import about_run
from care_core.diagnose.records import Diagnosis
from care_core.ecosystems.registry import run_model
from care_core.errors import UsageError
from care_core.files import bundled
from care_core.fleet.rows import Row, copies_of, distinct
from care_core.history.store import History
from care_core.logs.identity import recording_of
from care_core.logs.opening import open_log
from care_core.report.document import build_document
from care_core.report.writers import published
from tests.restamped import mcap
from tests.rewritten import write_text

SAMPLES = bundled("samples")
COPTER, DRIVE = SAMPLES / "arducopter_failed.BIN", SAMPLES / "move_base_drive.bag"
Copy = Callable[[Path, Path], Path]


def longer(source: Path, path: Path) -> Path:
    path.write_bytes(source.read_bytes() + b"\0")
    return path


def shorter(source: Path, path: Path) -> Path:
    data = source.read_bytes()
    path.write_bytes(data[: len(data) * 2 // 3])
    return path


def in_words(source: Path, path: Path) -> Path:
    return write_text(path.with_suffix(".log"), source)


def converted(source: Path, path: Path) -> Path:
    path = path.with_suffix(".mcap")
    path.write_bytes(mcap(source, lambda t: t))
    return path


def recording(path: Path) -> str:
    log = open_log(path)
    return recording_of(log, run_model(log).tables)


@pytest.mark.parametrize(
    ("source", "copy"),
    [(COPTER, longer), (COPTER, shorter), (COPTER, in_words), (DRIVE, longer), (DRIVE, converted)],
)
def test_a_copy_is_the_same_recording(tmp_path: Path, source: Path, copy: Copy) -> None:
    assert recording(copy(source, tmp_path / f"copy{source.suffix}")) == recording(source) != ""


def test_no_two_samples_are_the_same_recording() -> None:
    logs = [path for path in sorted(SAMPLES.iterdir()) if path.suffix in (".BIN", ".bag", ".mcap", ".tlog")]
    assert len({recording(path) for path in logs}) == len(logs) > 5


@pytest.fixture(scope="module")
def twice(tmp_path_factory: pytest.TempPathFactory) -> tuple[Diagnosis, Diagnosis, Path]:
    copy = longer(COPTER, tmp_path_factory.mktemp("copies") / "another.BIN")
    return care_core.triage(COPTER).diagnosis, care_core.triage(copy).diagnosis, copy


def test_a_copy_is_no_repeat(twice: tuple[Diagnosis, Diagnosis, Path]) -> None:
    with pytest.raises(UsageError, match="same recording is no repeat"):
        care_core.triage(Request(COPTER, repeats=(twice[2],)))


def test_the_history_counts_a_recording_once(twice: tuple[Diagnosis, Diagnosis, Path], tmp_path: Path) -> None:
    history = History(tmp_path / "history.sqlite3")
    for one in twice[:2]:
        history.add_triage(published(build_document(one)), one.run.mission.index, about_run(one.run))
    (only,) = history.triages()
    assert only.log_path == str(twice[2])


def test_a_fleet_counts_a_recording_once() -> None:
    rows = [
        Row("a.BIN", "ok", sha256="1", recording="r", mission=1),
        Row("b.BIN", "ok", sha256="2", recording="r", mission=1),
        Row("c.BIN", "ok", sha256="3", recording="s", mission=1),
        Row("d.BIN", "unreadable"),
    ]
    assert distinct(rows) == (rows[0], rows[2], rows[3])
    assert copies_of(rows) == {1: "a.BIN"}


def test_a_baseline_takes_a_recording_once(tmp_path: Path) -> None:
    good = SAMPLES / "nav2_good.mcap"
    copy = longer(good, tmp_path / "nav2_copy.mcap")
    found = baseline([good, copy], None, lambda *_: None)
    assert [one.reason for one in found.refused] == ["the same recording as nav2_good.mcap"]
