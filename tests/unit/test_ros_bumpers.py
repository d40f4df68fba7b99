"""Bumpers: whose messages tell of them, when they are pressed, and what is said of it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from care_core.ecosystems.findings import Health
from care_core.ecosystems.registry import run_model
from care_core.ecosystems.ros import ECOSYSTEM, bumpers
from care_core.logs.base import Channel, Table
from care_core.logs.opening import open_log
from care_core.logs.ros_message import MalformedMessageError
from care_core.logs.ros_types import cdr_types
from tests.ros_drives import Drive
from tests.ros_samples import ROS2, make

BOOL = "std_msgs/msg/Bool"


@pytest.mark.parametrize(
    ("name", "type", "tells"),
    [
        ("/bump", "std_msgs/msg/Int8MultiArray", True),
        ("/front_bumper", "std_msgs/msg/Bool", True),
        ("/enabled", "std_msgs/msg/Bool", False),
        ("/mobile_base/events/bumper", "kobuki_msgs/BumperEvent", True),
        ("/bump", "neato_node/Bump", True),
        ("/hazard_detection", "irobot_create_msgs/msg/HazardDetectionVector", True),
        ("/bump", "my_msgs/msg/Bump", False),
        ("/bumper", "gazebo_msgs/msg/ContactsState", False),
        ("/bumper/pose", "geometry_msgs/msg/PoseStamped", False),
    ],
)
def test_topics_of_bumpers(name: str, type: str, tells: bool) -> None:
    assert bumpers.is_bumper(Channel(name, type, 5)) is tells


def spans(**columns: list[Any]) -> list[tuple[float, float]]:
    fields: dict[str, np.ndarray[Any, Any]] = {}
    for name, values in columns.items():
        column = np.empty(len(values), object)
        column[:] = values
        fields[name.replace("__", ".")] = column
    t = np.arange(len(next(iter(columns.values()))), dtype=np.float64)
    return list(bumpers.contacts(Table(t, fields), 20.0))


def test_a_bumper_is_pressed_until_the_next_message_without() -> None:
    assert spans(state=[0, 1, 0, 0]) == [(1.0, 2.0)]
    assert spans(leftFront=[0, 0, 0, 0], rightSide=[0, 1, 1, 0]) == [(1.0, 3.0)]
    assert spans(data=[[0, 0], [0, 1], [0, 0]]) == [(1.0, 2.0)]
    assert spans(data=[False, False, True]) == [(2.0, 20.0)]


def test_of_hazards_only_a_bump_is_a_contact() -> None:
    assert spans(detections__type=[[], [2, 3], [5, 1], []]) == [(2.0, 3.0)]


def test_a_switch_that_is_always_pressed_tells_nothing() -> None:
    assert spans(is_left_pressed=[True] * 12) == []
    assert spans(nothing=[1, 1, 0]) == []


class Bumping(Drive):
    """A drive whose bumper is pressed from 20 s on for a time."""

    for_s: float = 5.0

    def messages(self) -> Iterator[tuple[str, str, float, Any]]:
        yield from super().messages()
        for tick in range(400):
            t = tick / 10
            yield "/bumper", BOOL, t, make(ROS2, BOOL, 20.0 <= t < 20.0 + self.for_s)


def looked_at(drive: Drive, tmp_path: Path) -> Health:
    return ECOSYSTEM.examine(run_model(open_log(drive.write(tmp_path / "drive.mcap"))))


@pytest.mark.parametrize(
    ("for_s", "title", "severity"),
    [
        (5.0, "the robot stays against something: its bumper is pressed", "warning"),
        (0.4, "the robot touches something: its bumper is pressed", "info"),
    ],
)
def test_a_pressed_bumper_is_told(for_s: float, title: str, severity: str, tmp_path: Path) -> None:
    health = looked_at(Bumping(for_s=for_s), tmp_path)
    (finding,) = health.findings
    assert (finding.title, finding.severity) == (title, severity)
    assert finding.onset_s == pytest.approx(20.0, abs=0.2)
    assert "1 contact told by /bumper: 20.0 s" in [event.text for event in health.timeline]


def test_a_bumper_that_nobody_presses_is_no_finding(tmp_path: Path) -> None:
    assert looked_at(Bumping(for_s=0.0), tmp_path).findings == ()


def test_types_that_a_recording_of_humble_does_not_define_are_known() -> None:
    pressed = bytes.fromhex("0001000001000100")
    types, _ = cdr_types("neato2_interfaces/msg/Bump", "", "", "humble", pressed)
    assert [one.name for one in types["neato2_interfaces/Bump"]][:2] == ["left_front", "left_side"]
    hazards, _ = cdr_types("irobot_create_msgs/msg/HazardDetectionVector", "", "", "humble", b"")
    assert [one.name for one in hazards["irobot_create_msgs/HazardDetection"]] == ["header", "type"]
    with pytest.raises(MalformedMessageError):
        cdr_types("my_msgs/msg/Bump", "", "", "humble", pressed)
