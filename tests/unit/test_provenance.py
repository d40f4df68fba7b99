"""Where a configuration came from: files, disagreements, changes on the way, what changed since a good run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from care_core.configs.driven import configuration, differing, remark
from care_core.configs.loading import read_configs, resolve
from care_core.diagnose import provenance
from care_core.diagnose.judging import judge
from care_core.diagnose.since import compare
from care_core.ecosystems.registry import run_model
from care_core.ecosystems.vehicles.self_written import SELF_WRITTEN, is_self_written
from care_core.logs.base import Log
from care_core.logs.opening import open_log
from care_core.profile.reading import read_schema
from care_core.profile.schema import Schema
from care_core.profile.store import Profile, load_profile
from care_core.records import replace
from care_core.run import Run, Setting
from tests.made import made_run

ROOT = Path(__file__).resolve().parents[2]
SAMPLE = ROOT / "samples" / "arducopter_failed.BIN"


@pytest.fixture(scope="module")
def move_base() -> Schema:
    return read_schema(ROOT / "profiles" / "move_base" / "profile.yaml")


@pytest.fixture(scope="module")
def arducopter() -> Profile:
    return load_profile("arducopter")


def notes(schema: Schema, files: tuple[Any, ...], driven: dict[str, Setting], **changed: Any) -> tuple[str, ...]:
    given = resolve(files, (parameter for option in schema.options for parameter in option.parameters))
    config, sources, settings = configuration(schema.options, driven, given)
    run = replace(made_run(), config=config, sources=sources, settings=settings, **changed)
    return provenance.notes(schema, run, files, given)


def test_a_run_without_recorded_parameters_has_them_from_files_with_their_lines(
    move_base: Schema, tmp_path: Path
) -> None:
    common = tmp_path / "common.yaml"
    common.write_text("transform_tolerance: 0.7\n\nupdate_frequency: 5.0\n")
    planner = tmp_path / "planner.yaml"
    planner.write_text("DWAPlannerROS:\n  occdist_scale: 0.02\n")
    files = read_configs([f"global_costmap={common}", f"local_costmap={common}", f"move_base={planner}"])
    assert notes(move_base, files, {}) == (
        f"not in the log, taken from {common}: update_frequency_global = 5 (line 3), "
        "transform_tolerance_global = 0.7 (line 1), update_frequency_local = 5 (line 3), "
        "transform_tolerance_local = 0.7 (line 1)",
        f"not in the log, taken from {planner}: occdist_scale = 0.02 (line 2)",
    )


def test_a_file_that_contradicts_the_log_or_says_nothing_is_told(move_base: Schema, tmp_path: Path) -> None:
    parameter = "/move_base/DWAPlannerROS/occdist_scale"
    driven = {parameter: Setting(parameter, 0.05, "/move_base/DWAPlannerROS/parameter_updates")}
    planner, amcl, empty = tmp_path / "planner.yaml", tmp_path / "amcl.yaml", tmp_path / "empty.yaml"
    planner.write_text("DWAPlannerROS: {occdist_scale: 0.02}\n")
    amcl.write_text("amcl: {min_particles: 500}\n")
    empty.write_text("# nothing\n")
    assert notes(move_base, read_configs([planner, amcl, empty]), driven) == (
        f"occdist_scale was 0.05 when driven, {planner}:1 says 0.02; the driven value is used",
        f"{amcl} holds nothing that profile move_base knows",
        f"{empty} holds nothing",
    )


def test_a_guess_is_told(move_base: Schema, tmp_path: Path) -> None:
    common = tmp_path / "common.yaml"
    common.write_text("update_frequency: 5.0\n")
    *_, told = notes(move_base, read_configs([common]), {})
    assert "names no namespace" in told
    assert "/move_base/global_costmap/update_frequency, /move_base/local_costmap/update_frequency" in told


def test_an_option_that_changed_on_the_mission_is_told(move_base: Schema) -> None:
    parameter = "/move_base/DWAPlannerROS/occdist_scale"
    history = tuple(
        Setting(parameter, value, "x", changed_at_s=at) for value, at in ((0.01, None), (0.02, 75.0), (0.05, 133.9))
    )
    driven = {parameter: history[1]}
    assert notes(move_base, (), driven, changes={parameter: history, "/other": history}) == (
        "occdist_scale was changed during the mission from 0.01 to 0.02 at 75.0 s, to 0.05 at 133.9 s (2:14);"
        " judged is 0.02, as in most of the mission",
    )


def test_what_a_vehicle_writes_itself_is_left_out_of_changes() -> None:
    assert all(isinstance(pattern, str) for group in SELF_WRITTEN.values() for pattern in group)
    for name in (
        "STAT_RUNTIME",
        "COMPASS_OFS2_X",
        "INS_GYR2OFFS_Z",
        "BARO1_GND_PRESS",
        "MOT_THST_HOVER",
        "BARO1_DEVID",
        "EKF2_MAG_DECL",
        "ASPD_SCALE_1",
    ):
        assert is_self_written(name)
    for name in ("LAND_SPEED", "INS_GYRO_FILTER", "COMPASS_USE", "RC1_OPTION", "BATT_LOW_VOLT", "/move_base/x"):
        assert not is_self_written(name)
    histories = {
        "STAT_RUNTIME": (Setting("STAT_RUNTIME", 1.0, "PARM"), Setting("STAT_RUNTIME", 2.0, "PARM", changed_at_s=9.0)),
        "LAND_SPEED": (Setting("LAND_SPEED", 16.0, "PARM", default=50.0),),
        "RTL_ALT": (Setting("RTL_ALT", 1500.0, "PARM", default=1500.0),),
    }
    assert list(differing(histories)) == ["LAND_SPEED"]
    assert list(differing(histories, everything=True)) == ["STAT_RUNTIME", "LAND_SPEED"]


def test_the_history_of_a_value_in_a_comment() -> None:
    history = (
        Setting("A", 50.0, "PARM", default=50.0),
        Setting("A", 16.0, "PARM", default=50.0, changed_at_s=133.0),
        Setting("A", 20.5, "PARM", default=50.0, changed_at_s=3600.0),
    )
    assert (
        remark(history, source=True)
        == "50 -> 16 at 133.0 s (2:13) -> 20.5 at 3600.0 s (1:00:00), default 50, from PARM"
    )
    assert remark(history[:1]) == ""


def sample_run(arducopter: Profile, **values: float) -> tuple[Run, Log]:
    from care_core.extract.read import read_run

    log = open_log(SAMPLE)
    run = read_run(run_model(log), arducopter.schema)
    changed = {name: replace(run.settings[name], value=value) for name, value in values.items()}
    return replace(run, settings={**run.settings, **changed}), log


def test_options_come_first_and_what_the_vehicle_wrote_not_at_all(arducopter: Profile) -> None:
    run, log = sample_run(arducopter, LAND_SPEED=30.0, ACRO_RP_RATE=1.0, STAT_RUNTIME=9.0)
    assert arducopter.schema.variables["LAND_SPEED"].threshold is None
    since = compare(judge(run, arducopter.schema, arducopter.model), log, arducopter)
    assert [(change.parameter, change.option is not None, change.text) for change in since.changes] == [
        ("LAND_SPEED", True, "16 -> 30"),
        ("ACRO_RP_RATE", False, "360 -> 1"),
    ]
    same, time, energy = since.warnings
    assert same == "it is the same log"
    assert time.startswith("it has a fault itself: mission_time = 164.7, wanted <= 1")
    assert "x the 1" in time
    assert energy.startswith("it has a fault itself: energy = 15.98, wanted <= 1")


def test_a_good_log_of_another_vehicle_is_told(arducopter: Profile) -> None:
    run, log = sample_run(arducopter)
    facts = {"firmware": "ArduCopter V4.6.0 (00000000)", "frame": run.log.facts["frame"]}
    other = replace(run, log=replace(run.log, format="mavlink-tlog", facts=facts, sha256="0"))
    warnings = compare(judge(other, arducopter.schema, arducopter.model), log, arducopter).warnings
    assert warnings[:2] == (
        "its format is dataflash-bin, this log's is mavlink-tlog",
        f"its firmware is {run.log.facts['firmware']}, this log's is ArduCopter V4.6.0 (00000000)",
    )
