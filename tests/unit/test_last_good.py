"""The last good run of a robot in the history, and what was changed since."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import pytest

from care_core.application.last_good import last_good
from care_core.diagnose.outside.off import off_parameters
from care_core.diagnose.records import ObjectiveResult
from care_core.ecosystems.findings import Finding, Health
from care_core.ecosystems.vehicles.vehicle import Vehicle
from care_core.history.store import About, History
from care_core.logs.opening import open_log
from care_core.records import replace
from care_core.report.document import build_document
from care_core.report.writers import published
from care_core.run import LogInfo, Robot, Setting
from tests.conftest import Care
from tests.made import TIME, made_diagnosis

ROVER = Robot("R7", "R7", "named by the operator", is_sure=True)
LOG = LogInfo("/logs/now.BIN", "dataflash-bin", "2026-05-02T10:00:00Z", 100.0, "f" * 64)
RUN = replace(made_diagnosis().run, log=LOG, settings={})
FINE = ObjectiveResult(TIME, 100.0, TIME.threshold, "ok")
ROOT = Path(__file__).parents[2]
UNTOLD = About()
NONE: Mapping[str, float] = MappingProxyType({})


@pytest.fixture
def history(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> History:
    path = tmp_path / "history.sqlite3"
    monkeypatch.setenv("CARE_HISTORY", str(path))
    return History(path)


def remember(
    history: History, number: int, *, day: int = 1, robot: Robot = ROVER, result: ObjectiveResult = FINE,
    findings: tuple[Finding, ...] = (), settings: Mapping[str, float] = NONE, about: About = UNTOLD,
) -> None:  # fmt: skip
    """Puts a run of a day in May into the history."""
    made = made_diagnosis()
    log = replace(made.run.log, start=f"2026-05-{day:02d}T10:00:00Z", sha256=f"{number:064d}", recording=str(number))
    diagnosis = replace(
        made, run=replace(made.run, log=log), objectives=(result,), faults=(), fix=None, hypotheses=(),
        health=Health("", (), findings), missions=(),
    )  # fmt: skip
    document: dict[str, Any] = json.loads(json.dumps(published(build_document(diagnosis))))
    history.add_triage(document, 1, replace(about, robot=robot, settings=settings))


def test_the_last_run_before_the_log_in_which_nothing_failed_counts(history: History) -> None:
    late = ObjectiveResult(TIME, 190.0, TIME.threshold, "fault")
    crash = Finding("crash", "it hit the ground", 1.0, 2.0, "critical", "", "MSG")
    remember(history, 1, settings={"WP_JERK": 0.0})
    remember(history, 2, settings={"WP_JERK": 1.0})
    remember(history, 3, result=late, settings={"WP_JERK": 50.0})
    remember(history, 4, findings=(crash,), settings={"WP_JERK": 60.0})
    remember(history, 5, day=9, settings={"WP_JERK": 70.0})  # after it
    remember(history, 6, robot=replace(ROVER, id="R8"), settings={"WP_JERK": 80.0})
    remember(history, 7)  # its log held no parameters
    by_own_limit = replace(UNTOLD, judged_with="--threshold mission_time=900")
    remember(history, 8, settings={"WP_JERK": 90.0}, about=by_own_limit)
    found = last_good(ROVER, RUN)
    assert found is not None
    assert found["WP_JERK"].value == 1.0


def test_without_a_good_run_of_this_very_robot_nothing_is_known(
    history: History, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert last_good(ROVER, RUN) is None  # there is no history
    remember(history, 1, settings={"WP_JERK": 0.0})
    assert last_good(None, RUN) is None
    assert last_good(replace(ROVER, is_sure=False), RUN) is None
    assert last_good(ROVER, replace(RUN, log=replace(LOG, sha256=f"{1:064d}"))) is None  # the same log
    history.path.write_bytes(b"no database")
    assert last_good(ROVER, RUN) is None
    monkeypatch.setenv("CARE_HISTORY", "off")
    assert last_good(ROVER, RUN) is None


VEHICLE = {"INS_ACC_ID": 2621706.0, "COMPASS_DEV_ID": 592905.0, "FRAME_CLASS": 1.0} | {
    f"{name}_{axis}": 0.1 for name in ("INS_ACCOFFS", "COMPASS_OFS") for axis in "XYZ"
}
CHOSEN = {f"P{number}": float(number) for number in range(300)}


@pytest.mark.parametrize(
    ("firmware", "belongs", "changed", "is_same"),
    [
        ("ArduRover V4.5.4", {}, {"WP_JERK": 2.0}, True),
        ("", {}, {}, True),
        ("ArduRover V4.6.0", {}, {}, False),
        ("ArduCopter V4.5.4", {}, {}, False),
        ("ArduRover V4.5.4", {"FRAME_CLASS": 3.0}, {}, False),
        ("ArduRover V4.5.4", {"INS_ACC_ID": 2753028.0}, {}, False),
        ("ArduRover V4.5.4", {"COMPASS_OFS_X": 250.0}, {}, True),
        ("ArduRover V4.5.4", {f"COMPASS_OFS_{axis}": 250.0 for axis in "XYZ"}, {}, True),
        ("ArduRover V4.5.4", dict.fromkeys(list(VEHICLE)[3:], 7.0), {}, False),
        ("ArduRover V4.5.4", {}, dict.fromkeys(list(CHOSEN)[:15], -1.0), True),
        ("ArduRover V4.5.4", {}, dict.fromkeys(list(CHOSEN)[:60], -1.0), False),
    ],
)
def test_a_good_run_is_of_this_vehicle_by_more_than_its_id(
    history: History, firmware: str, belongs: Mapping[str, float], changed: Mapping[str, float], is_same: bool
) -> None:
    now = {name: Setting(name, value, "PARM") for name, value in {**CHOSEN, **VEHICLE}.items()}
    run = replace(RUN, log=replace(LOG, facts={"firmware": "ArduRover V4.5.4"}), settings=now)
    about = About(firmware=firmware, individual={**VEHICLE, **belongs})
    remember(history, 1, settings={**CHOSEN, **changed}, about=about)
    assert (last_good(ROVER, run) is not None) == is_same


def test_what_a_machine_simulates_is_no_very_robot(history: History) -> None:
    remember(history, 1, settings={"WP_JERK": 0.0})
    assert last_good(replace(ROVER, is_simulated=True), RUN) is None


def test_a_triage_leaves_what_tells_the_vehicle_from_others(history: History, care: Care) -> None:
    care("triage", str(ROOT / "samples/ardurover_failed.BIN"))
    (past,) = history.triages()
    assert past.robot is not None
    assert past.robot.is_simulated
    assert past.individual["INS_ACC_ID"] == 2753028
    assert "INS_GYROFFS_X" not in past.individual, "measured at every start"


def test_what_a_vehicle_writes_itself_is_not_known_to_have_changed() -> None:
    vehicle = Vehicle("copter", "quad X", "ArduCopter V4.5.4", (4, 5, 4))
    names = ("COMPASS_OFS_X", "RTL_LOIT_TIME")
    settings = {name: Setting(name, 60.0, "PARM", 0.0) for name in names}
    changed = {one.name: one.is_changed for one in off_parameters(settings, vehicle, (), {})}
    assert changed == {"COMPASS_OFS_X": None, "RTL_LOIT_TIME": True}


def test_what_changed_since_the_good_run_of_the_history_is_told(history: History, care: Care) -> None:
    sample = ROOT / "samples/ardurover_failed.BIN"
    driven = {name: one[-1].value for name, one in open_log(sample).settings().items()}
    before = {name: value for name, value in driven.items() if isinstance(value, float)}

    def told() -> tuple[list[str], list[str]]:
        document = json.loads(care("triage", str(sample), "--robot", "R7", "--json").stdout)
        return [one["name"] for one in document["outside"]], [note for note in document["notes"] if "history" in note]

    assert told() == ([], [])
    remember(history, 1, settings=before)
    assert told() == ([], [])
    remember(history, 2, settings={**before, "WP_JERK": before["WP_JERK"] + 5.0})
    names, notes = told()
    assert names == ["WP_JERK"]
    assert notes == ["what was changed since this robot's last good run in the history counts as evidence"]
