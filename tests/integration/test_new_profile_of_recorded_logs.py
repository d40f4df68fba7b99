"""First profiles from recorded logs of every kind: they load, and pass their check."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.conftest import Care
from tests.whole import one_in

LOGS = {
    "bag": ("data/move_base/faults/g55_002.bag", "actionlib_goals"),
    "bin": ("data/arducopter/faults/f77_007.BIN", "ardupilot_flight"),
    "text": ("logs/dataflash_text/mechanical_fail.log", "ardupilot_flight"),
    "tlog": ("logs/mavlink_tlog/copter35_mixed_v1_v2.tlog", "ardupilot_flight"),
    "px4": ("logs/px4_ulg/px4_events.ulg", "px4_flight"),
    "ros2": ("logs/ros2_db3/tb3_gazebo_param_events", "recording"),
    "no parameters": ("logs/ros1_bag/husky_imu_odom_gps_bz2.bag", "recording"),
}


@pytest.mark.parametrize("kind", one_in(2, LOGS))
def test_any_recorded_log_makes_a_profile(care: Care, recorded: Path, tmp_path: Path, kind: str) -> None:
    name, mission = LOGS[kind]
    made = care("profiles", "new", recorded / name, "-o", tmp_path / "robot")
    assert made.code == 0, made.stderr
    assert mission in made.stdout
    checked = care("profiles", "check", tmp_path / "robot")
    assert checked.code == 0
    assert "not trained yet" in checked.stdout
