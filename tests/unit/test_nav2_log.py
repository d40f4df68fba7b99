"""A Nav2 drive recorded as a ROS 2 bag: from the file to the run, its configuration and its report."""

from __future__ import annotations

from pathlib import Path

import pytest
from rosbags.rosbag2 import StoragePlugin

from care_core.configs.formats import format_for, write_params
from care_core.configs.loading import read_configs, resolve
from care_core.ecosystems.registry import run_model
from care_core.extract.read import read_run
from care_core.logs.opening import open_log
from care_core.run import is_known
from tests.nav2_drive import MAX_VEL, recorded, schema

pytest.importorskip("care_core.logs.ros2_db3", reason="this version reads no ROS 2 logs")


@pytest.mark.parametrize("plugin", [StoragePlugin.SQLITE3, StoragePlugin.MCAP])
def test_a_recorded_nav2_drive(tmp_path: Path, plugin: StoragePlugin) -> None:
    log = open_log(recorded(tmp_path / "drive", plugin))
    params = tmp_path / "nav2.yaml"
    params.write_text("/**: {ros__parameters: {FollowPath: {max_vel_x: 0.26}}}\n")
    run = read_run(run_model(log), schema(), overrides=resolve(read_configs([params]), [MAX_VEL]))
    values = {name: run.value(name) for name in schema().variables}
    assert all(is_known(value) for value in values.values()), values
    assert values == pytest.approx(
        {
            "max_vel_x": 0.26,
            "recoveries": 1,
            "controller_errors": 1,
            "planned": 4,
            "driven": 4,
            "left": 0,
            "success": 1,
        },
        abs=0.06,
    )
    assert run.mission.ended
    assert run.mission.fits
    assert run.sources == {"max_vel_x": f"{params}:1"}
    assert [one.text for one in run.evidence] == [
        "recovery Spin",
        "controller_server: Failed to make progress",
    ]
    assert write_params(run.settings, format_for(log.format.name, run.settings)) == (
        "/controller_server:\n  ros__parameters:\n    FollowPath:\n      max_vel_x: 0.26\n"
    )
