"""Which robot a log is of: what it says of its board, its owner's numbers, its recorder's notes; else nobody's."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from care_core.extract.identity import identify, named
from care_core.logs import formats
from care_core.logs.opening import open_log
from care_core.records import field
from care_core.run import Setting
from tests.made import MadeLog, T

BOARD = "CubeOrange 003E0031 3532510E 38303638"


class _Log(MadeLog, eq=False):
    numbers: Mapping[str, float] = field(default_factory=dict)

    def settings(self) -> Mapping[str, tuple[Setting, ...]]:
        return {name: (Setting(name, value, "PARM"),) for name, value in self.numbers.items()}


def saying(*texts: str, facts: Mapping[str, str] | None = None, **numbers: float) -> _Log:
    messages: dict[str, Any] = {"Message": np.array([*texts, *["mode"] * (len(T) - len(texts))], dtype=object)}
    return _Log({"MSG": messages}, facts=facts or {}, numbers=numbers)


@pytest.mark.parametrize(
    ("log", "robot"),
    [
        (saying("ArduCopter V4.5.4 (fd1bcc61)", BOARD, BRD_SERIAL_NUM=7), "003E0031 3532510E 38303638"),
        (saying("Dd1219c7c4c5404aaa1f6d2a48adfda4"), "Dd1219c7c4c5404aaa"),
        (saying("New mission", BRD_SERIAL_NUM=7, SYSID_THISMAV=4), "serial 7"),
        (saying(BRD_SERIAL_NUM=0, SYSID_THISMAV=4), "system 4"),
        (saying(MAV_SYSID=12), "system 12"),
        (saying(facts={"system": "3.1"}), "system 3"),
        (saying(facts={"Hostname": "husky-2 "}), "husky-2"),
        (saying(SYSID_THISMAV=1, BRD_SERIAL_NUM=-1, facts={"system": "1.1", "robot": " "}), None),
    ],
)
def test_the_best_name_a_log_gives(log: MadeLog, robot: str | None) -> None:
    assert sure_id(log) == robot


def test_a_number_that_a_simulator_counted_up_tells_no_vehicle() -> None:
    flown = {hardware: identify(saying(MAV_SYS_ID=3, facts={"stack": "PX4", "hardware": hardware})) for hardware in
             ("PX4_SITL", "PX4_FMU_V6X")}  # fmt: skip
    assert {hardware: robot is not None and robot.is_simulated for hardware, robot in flown.items()} == {
        "PX4_SITL": True, "PX4_FMU_V6X": False,
    }  # fmt: skip


def test_a_name_cannot_steer_a_terminal() -> None:
    assert sure_id(saying(facts={"robot": "\x1b[31mred"})) == "\\x1b[31mred"


def sure_id(log: MadeLog) -> str | None:
    robot = identify(log)
    return robot.id if robot is not None and robot.is_sure else None


class Told(MadeLog, eq=False):
    """A log that holds parameters as well."""

    told: Mapping[str, float | str] = field(default_factory=dict)

    def settings(self) -> Mapping[str, tuple[Setting, ...]]:
        return {name: (Setting(name, value, "here"),) for name, value in self.told.items()}


SYSTEM = {"SYSID_THISMAV": 1.0}
MSG = {"MSG": {"Message": np.array(["hello", "CubeOrange 003F0033 31383430 34383235"] + ["x"] * 199, dtype=object)}}


def uid(*values: int) -> dict[str, dict[str, Any]]:
    cells = np.empty(201, dtype=object)
    cells[:] = [tuple(values)] * 201
    return {"AUTOPILOT_VERSION": {"uid2": cells}}


SERIAL = bytes.fromhex("003F00333138343034383235")


@pytest.mark.parametrize(
    ("tables", "told", "facts", "id", "is_sure"),
    [
        (MSG, SYSTEM, {}, "003F0033 31383430 34383235", True),
        (uid(*SERIAL, *[0] * 6), SYSTEM, {}, "003F0033 31383430 34383235", True),
        (uid(*[0] * 18), {"SYSID_THISMAV": 7.0}, {"firmware": "ArduRover V4.5.4"}, "system 7", True),
        (uid(*range(1, 19)), {"MAV_SYSID": 1.0}, {"firmware": "ArduCopter V4.7.0"}, "copter 1", False),
        (
            {},
            {"MAV_SYS_ID": 3.0},
            {"stack": "PX4", "uuid": "0035002B3434511732343031"},
            "0035002B3434511732343031",
            True,
        ),
        ({}, {}, {"system": "12.1"}, "system 12", True),
        ({}, {}, {}, None, None),
    ],
)
def test_the_board_comes_before_what_people_set(
    tables: dict[str, Any], told: dict[str, float], facts: dict[str, str], id: str | None, is_sure: bool | None
) -> None:
    robot = identify(Told(tables, facts=facts, told=told))
    assert (robot and robot.id, robot and robot.is_sure) == (id, is_sure)


@pytest.mark.parametrize(
    ("types", "facts", "told", "id"),
    [
        ({}, {"robot_name": "husky-3", "distro": "humble"}, {}, "husky-3"),
        ({}, {"recorder.hostname": "spot"}, {"/ns/robot_name": "albert"}, "spot"),
        ({}, {}, {"/ns/robot_name": "albert"}, "albert"),
        ({"/r2/odom": "nav_msgs/msg/Odometry", "/r2/cmd_vel": "geometry_msgs/Twist"}, {}, {}, "r2"),
        ({"/r2/odom": "nav_msgs/Odometry", "/cmd_vel": "geometry_msgs/Twist"}, {}, {}, None),
        ({"/husky_velocity_controller/odom": "nav_msgs/Odometry"}, {}, {}, None),
        ({"/odom": "nav_msgs/Odometry"}, {"robot": "none"}, {"/x/hostname": ""}, None),
    ],
)
def test_a_ros_log_names_its_robot_where_somebody_wrote_it(
    types: dict[str, str], facts: dict[str, str], told: dict[str, str], id: str | None
) -> None:
    log = Told({topic: {} for topic in types}, types=types, facts=facts, told=told, format=formats.MCAP)
    robot = identify(log)
    assert (robot and robot.id) == id


def test_the_model_is_told_and_told_to_be_no_more() -> None:
    text = np.array(["<?xml version='1.0'?><!-- <robot> --><robot xmlns:x='y' name=\"husky\x1b\">"] * 201, dtype=object)
    robot = identify(Told({"/robot_description": {"data": text}}, format=formats.ROS2_DB3))
    assert robot is not None
    assert (robot.name, robot.is_sure) == ("husky\\x1b", False)


def test_a_simulators_machine_is_told_to_be_shared() -> None:
    machine = {"MSG": {"Message": np.array(["Dd1219c7c4c5404aaa1f6d2a48adfda4"] * 201, dtype=object)}}
    made, real = (identify(Told(machine, told={"INS_ACC_ID": id})) for id in (2753028.0, 2621706.0))
    assert made is not None
    assert real is not None
    assert (made.is_simulated, real.is_simulated) == (True, False)
    assert made.source == "id of the machine that simulates it"


def test_the_operator_knows_better() -> None:
    assert named(" no 7\x1b ").id == "no 7\\x1b"


def test_logs_of_real_boards(recorded: Path) -> None:
    logs = recorded / "logs"
    found = {}
    for name in ("dataflash_bin/copter46_cut_80k.bin", "px4_ulg/px4_appended_multiple.ulg"):
        robot = identify(open_log(logs / name))
        found[name] = robot and robot.name
    assert list(found.values()) == ["Pixhawk4 0047002B", "PX4FMU_V4PRO 0035002B"]
