"""Where ground stations and recorders put logs: the newest one is found there, and reported by one command."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

from care_tui import places
from care_tui.commands.opening import newest_log
from care_tui.places import found_logs, usual_places
from tests.conftest import Care

ROOT = Path(__file__).parents[2]
SAMPLE = ROOT / "samples" / "arducopter_failed.BIN"
OF_STATIONS = {
    "Mission Planner": "home/Documents/Mission Planner/logs/QUADROTOR/1/2026-11-20 10-12-13.BIN",
    "Mission Planner on Mono": "home/Mission Planner/logs/QUADROTOR/1/2026-11-20 10-12-13.tlog",
    "Mission Planner from WSL": "windows/ada/Documents/Mission Planner/logs/ROVER/1/2026-11-20 10-12-13.bin",
    "QGroundControl": "home/Documents/QGroundControl/Logs/log_3_2026-11-20-10-12-13.bin",
    "QGroundControl's telemetry": "home/Documents/QGroundControl/Telemetry/2026-11-20 10-12-13.tlog",
    "QGroundControl in another language": "home/Dokumente/QGroundControl/Logs/log_4_UnknownDate.ulg",
    "MAVProxy": "here/mav.tlog",
    "MAVProxy for an aircraft": "here/logs/2026-11-20/flight3/flight.tlog",
    "MAVProxy for an aircraft, from above it": "here/quad/logs/2026-11-20/flight3/flight.tlog",
    "MAVProxy's dataflash_logger": "here/dataflash/000003.BIN",
}


@pytest.mark.parametrize("path", OF_STATIONS.values(), ids=OF_STATIONS)
def test_the_newest_log_of_a_ground_station_is_found(
    path: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    home, here = tmp_path / "home", tmp_path / "here"
    here.mkdir()
    (home / ".config").mkdir(parents=True, exist_ok=True)
    (home / ".config" / "user-dirs.dirs").write_text('XDG_DOCUMENTS_DIR="$HOME/Dokumente"\n', encoding="utf-8")
    monkeypatch.setattr(places, "WINDOWS_HOMES", tmp_path / "windows")
    monkeypatch.delenv("XDG_DOCUMENTS_DIR", raising=False)
    monkeypatch.chdir(here)
    log = tmp_path / path
    log.parent.mkdir(parents=True, exist_ok=True)
    shutil.copy(SAMPLE, log)
    os.utime(log, (1_700_000_000, 1_700_000_000))
    found = newest_log(usual_places())
    assert found is not None
    assert found.samefile(log)
    assert [one.path.name for one in found_logs(usual_places())] == [log.name], "and once"


def test_a_report_of_the_newest_log_takes_one_command(
    care: Care, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "logs").mkdir()
    for age, name in enumerate(("new.BIN", "old.BIN")):
        shutil.copy(SAMPLE, tmp_path / "logs" / name)
        os.utime(tmp_path / "logs" / name, (1_700_000_000 - age, 1_700_000_000 - age))
    outcome = care("triage", "--out", "report.html")
    assert outcome.code == 1
    assert f"the newest log is {Path('logs', 'new.BIN')}" in outcome.stderr
    assert "<h1>Triage of new.BIN</h1>" in Path("report.html").read_text(encoding="utf-8")


def test_where_there_is_no_log_triage_asks_for_one(care: Care, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("care_tui.commands.opening.logs_in", lambda _: iter(()))
    outcome = care("triage")
    assert outcome.code == 2
    assert "There is no log in the usual places. Name one; looked in this folder, logs, " in outcome.stderr
    assert "Mission Planner/logs" in outcome.stderr
