"""`care triage` of several logs and of folders: together where they repeat one configuration, else a line each."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import pytest

from care_core.errors import CareError
from care_core.files import bundled
from care_core.history.store import History, history_path
from care_core.logs.recording import recording_at
from tests.conftest import Care

FAILED, MOTOR, GOOD, STALL = (
    bundled("samples", name)
    for name in ("arducopter_failed.BIN", "arducopter_motor.BIN", "nav2_good.mcap", "nav2_stall.mcap")
)


def verdicts(text: str) -> list[tuple[str, str]]:
    """Verdict and log of each line."""
    return [(line[:13].strip(), line.split()[-1]) for line in text.splitlines()]


def test_logs_of_different_configurations_have_a_line_each(
    care: Care, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for name in ("dask", "distributed", "fsspec", "pandas", "pyarrow"):
        monkeypatch.setitem(sys.modules, name, None)  # a base installation
    broken = tmp_path / "broken.BIN"
    broken.write_bytes(b"\xa3\x95")
    outcome = care("triage", FAILED, GOOD, broken, STALL)
    assert outcome.code == 1
    assert verdicts(outcome.stdout) == [
        ("FAULT", "arducopter_failed.BIN"), ("OK", "nav2_good.mcap"), ("UNREADABLE", "broken.BIN"),
        ("FAULT", "nav2_stall.mcap"),
    ]  # fmt: skip
    assert all(len(line) <= 80 for line in outcome.stdout.splitlines())
    assert "97% LAND_SPEED" in outcome.stdout
    assert "Each is triaged by itself" in outcome.stderr
    path = history_path()
    assert path is not None
    assert len(History(path).triages()) == 3


def test_the_exit_code_is_the_gravest(care: Care, tmp_path: Path) -> None:
    broken = tmp_path / "broken.BIN"
    broken.write_bytes(b"\xa3\x95")
    assert care("triage", GOOD, broken).code == 4
    assert care("triage", broken, GOOD, STALL).code == 1
    assert care("triage", broken).code == 4


def test_a_folder_is_each_log_in_it_unless_they_are_one_recording(care: Care, tmp_path: Path) -> None:
    logs = tmp_path / "logs"
    (logs / "day 1").mkdir(parents=True)
    shutil.copy(FAILED, logs / "1.BIN")
    only = care("triage", logs)
    assert "Change LAND_SPEED 16 -> 40" in only.stdout, "the one log in it"
    shutil.copy(MOTOR, logs / "day 1" / "2.BIN")
    outcome = care("triage", logs)
    assert verdicts(outcome.stdout) == [("FAULT", "1.BIN"), ("FAULT", "2.BIN")]
    assert outcome.code == 1
    refused = care("triage", logs, "--json")
    assert (refused.code, refused.stdout) == (2, "")
    assert "holds several logs" in refused.stderr
    assert care("triage", logs, "--junit").stdout.count("<testsuite ") == 2
    empty = tmp_path / "empty"
    empty.mkdir()
    assert care("triage", empty).code == 4


def test_a_folder_of_unlike_recordings_is_not_one_split_recording(care: Care, tmp_path: Path) -> None:
    for name in ("drive_0.mcap", "drive_1.mcap"):
        shutil.copy(GOOD, tmp_path / name)
    assert [path.name for path in recording_at(tmp_path).files] == ["drive_0.mcap", "drive_1.mcap"]
    shutil.copy(STALL, tmp_path / "other.mcap")
    with pytest.raises(CareError, match="holds 3 recordings"):
        recording_at(tmp_path)
    assert len(care("triage", tmp_path).stdout.splitlines()) == 3


def test_a_name_of_a_log_cannot_steer_the_terminal(care: Care, tmp_path: Path) -> None:
    strange = tmp_path / "a\x1b[31m\nb.BIN"
    shutil.copy(FAILED, strange)
    outcome = care("triage", strange, MOTOR)
    assert "\x1b" not in outcome.stdout
    assert len(outcome.stdout.splitlines()) == 2


def test_a_log_and_its_cut_copy_are_triaged_each_by_itself(care: Care, tmp_path: Path) -> None:
    cut = tmp_path / "cut.BIN"
    cut.write_bytes(FAILED.read_bytes()[:250_000])
    outcome = care("triage", FAILED, cut)
    assert outcome.code == 1
    assert verdicts(outcome.stdout) == [("FAULT", "arducopter_failed.BIN"), ("NOT EVALUATED", "cut.BIN")]
    assert "The same recording is no repeat. Each is triaged by itself." in outcome.stderr
    path = history_path()
    assert path is not None
    assert {one.terms for one in History(path).triages()} == {""}, "each is remembered as judged by itself"
    as_json = care("triage", FAILED, cut, "--json")
    assert (as_json.code, "Name it once." in as_json.stderr) == (2, True)


def test_a_report_of_another_vehicle_is_said_to_be(care: Care, tmp_path: Path) -> None:
    report = tmp_path / "report.yaml"
    care("triage", FAILED, "--out", report)
    outcome = care("verify", report, bundled("samples", "ardurover_failed.BIN"))
    assert outcome.code == 2
    assert "The report is of profile 'arducopter': give a later log of the robot that it is of." in outcome.stderr
    assert "--profile" not in outcome.stderr
