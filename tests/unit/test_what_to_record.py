"""What `care record` says and runs, and that what it leaves is read: parameters at the start, each change, faults."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import care_core
from care_core.application.recording import recorder_words, what_to_record
from care_core.configs.loading import read_configs
from care_core.ecosystems.dictionary import find_message
from care_core.ecosystems.registry import ecosystem_of
from care_core.extract.read import reading_plan
from care_core.logs.formats import format_named
from care_core.logs.opening import open_log
from care_core.profile.store import load_profile
from tests.conftest import Care
from tests.nav2_drive import MAX_VEL, recorded

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("name", ["nav2", "move_base", "arducopter", "ardurover"])
def test_everything_that_a_profile_reads_is_recorded(name: str) -> None:
    found = what_to_record(name)
    assert reading_plan(load_profile(name).schema).keys() <= set(found.recording.channels)


def test_a_ros_2_recorder_hears_hidden_topics_and_changes_of_parameters() -> None:
    words = recorder_words(what_to_record("nav2", ["/camera/info"]), Path("out"))
    assert words[:5] == ["ros2", "bag", "record", "-o", "out"]
    assert {"--include-hidden-topics", "/parameter_events", "/navigate_to_pose/_action/status", "/camera/info"} < {
        *words
    }
    assert "--topics" not in recorder_words(what_to_record("nav2"), Path("out"), is_humble=True)


def test_of_any_robot_what_health_checks_read_is_recorded() -> None:
    assert {"/odom", "/cmd_vel", "/battery_state", "/imu", "/scan", "/rosout"} < {*what_to_record("ros").topics}


def test_a_ros_1_recorder_hears_dynamic_reconfigure(care: Care) -> None:
    outcome = care("record", "move_base", "-o", "out")
    assert outcome.code == 0
    assert "rosbag record --lz4 -O out -e '^(" in outcome.stdout
    assert "/.*/parameter_(descriptions|updates)" in outcome.stdout


@pytest.mark.parametrize(
    ("name", "suffix", "settings"),
    [
        ("arducopter", ".param", {"LOG_BITMASK": 176127, "LOG_DISARMED": 1}),
        ("ardurover", ".param", {"LOG_BITMASK": 65535, "LOG_DISARMED": 1}),
        ("px4", ".params", {"SDLOG_MODE": 1, "SDLOG_PROFILE": 1}),
    ],
)
def test_a_vehicle_gets_a_file_that_its_ground_station_reads(
    care: Care, tmp_path: Path, name: str, suffix: str, settings: dict[str, float]
) -> None:
    out = tmp_path / f"log{suffix}"
    assert care("record", name, "-o", out).code == 0
    (file,) = read_configs([str(out)])
    assert {key: file.settings[key].value for key in settings} == settings
    if suffix == ".params":
        assert "\tSDLOG_MODE\t1\t6\n" in out.read_text(encoding="utf-8"), "an INT32, as PX4 has it"
    assert care("record", name, "-o", out).code == 0, "its own file is replaced"
    assert care("record", name, "--run").code == 2


def test_the_log_has_every_message_that_the_profile_reads() -> None:
    found, messages = what_to_record("arducopter"), ecosystem_of(format_named("dataflash-bin")).messages()
    known = [message for name in found.recording.channels if (message := find_message(messages, name)) is not None]
    bits = int(found.recording.settings["LOG_BITMASK"])
    assert len(known) > 10
    assert all(bits & one.log_bits == one.log_bits for one in known)


def test_what_cannot_be_recorded_is_said(care: Care) -> None:
    assert "There is no profile 'nav'. Did you mean 'nav2'?" in care("record", "nav").stderr
    assert care("record", "husky-care").code in (0, 2)
    assert care("record", "move_base", "--run").code == 2


FAKE = """#!/bin/bash
case "$1 $2" in
  "bag record")
    if [ "$3" = --help ]; then echo "--topics"; exit; fi
    mkdir "$4"; echo "$@" > "$4/words"; trap 'echo told >> "$PWD/indexed"; sleep 0.3; exit 0' INT
    while true; do sleep 0.05; done ;;
  "node list") printf '%s\\n' /controller_server /planner_server /silent ;;
  "param dump")
    case "$3" in
      /controller_server) printf '/controller_server:\\n  ros__parameters:\\n    FollowPath.max_vel_x: 0.2\\n' ;;
      /planner_server) printf '/planner_server:\\n  ros__parameters:\\n    GridBased:\\n      tolerance: 0.5\\n' ;;
      *) echo "Node not found" >&2; exit 1 ;;
    esac ;;
esac
"""


@pytest.mark.skipif(os.name != "posix", reason="the recorder's stand-in is a shell script")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_the_recorder_is_run_and_ended_with_the_parameters_beside_it(tmp_path: Path, number: signal.Signals) -> None:
    tools = tmp_path / "bin"
    tools.mkdir()
    (tools / "ros2").write_text(FAKE, encoding="utf-8")
    (tools / "ros2").chmod(0o755)
    code = "from care_tui.start import main; main()"
    words = [sys.executable, "-c", code, "record", "nav2", "--run", "-o", "out"]
    environment = {**os.environ, "PATH": f"{tools}{os.pathsep}{os.environ['PATH']}", "PYTHONPATH": str(ROOT)}
    running = subprocess.Popen(
        words, cwd=tmp_path, env=environment, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    kept = tmp_path / "out" / "care_parameters.yaml"
    until_s = time.monotonic() + 20
    while not kept.exists() and time.monotonic() < until_s:
        time.sleep(0.02)
    assert "FollowPath.max_vel_x: 0.2" in kept.read_text(encoding="utf-8"), "at once, not when it ends"
    time.sleep(0.2)
    os.killpg(running.pid, number)  # as a terminal does
    running.communicate(timeout=20)
    told = (tmp_path / "indexed").read_text(encoding="utf-8")
    assert told == "told\n", "the recorder was told once, and wrote its index"
    assert "/parameter_events" in (tmp_path / "out" / "words").read_text(encoding="utf-8")
    assert "tolerance: 0.5" in kept.read_text(encoding="utf-8")


def test_without_ros_it_is_said_what_to_do(care: Care, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    outcome = care("record", "nav2", "--run", "-o", tmp_path / "out")
    assert outcome.code == 2
    assert "There is no 'ros2' here." in outcome.stderr


def test_parameters_beside_a_recording_are_those_of_its_start(tmp_path: Path) -> None:
    bag = recorded(tmp_path / "run", StoragePlugin.MCAP)
    assert MAX_VEL not in open_log(bag).settings()
    node, _, parameter = MAX_VEL.partition(".")
    texts = (
        f"{node}:\n  ros__parameters:\n    {parameter}: 0.2\n",
        "/planner:\n  ros__parameters:\n    tolerance: 0.5\n",
    )
    (bag / "care_parameters.yaml").write_text("".join(texts), encoding="utf-8")
    settings = open_log(bag).settings()
    assert settings[MAX_VEL][0].value == pytest.approx(0.2)
    assert settings[MAX_VEL][0].source == "recording metadata, care_parameters.yaml"
    assert settings["/planner.tolerance"][0].value == pytest.approx(0.5)


def test_a_change_while_it_is_recorded_follows_the_value_of_the_start(tmp_path: Path) -> None:
    store = get_typestore(Stores.ROS2_JAZZY)
    kind = "rcl_interfaces/msg/ParameterEvent"
    empty = np.array([], dtype=np.uint8)
    value = store.types["rcl_interfaces/msg/ParameterValue"](
        type=3, bool_value=False, integer_value=0, double_value=0.1, string_value="", byte_array_value=empty,
        bool_array_value=empty.astype(bool), integer_array_value=empty.astype(np.int64),
        double_array_value=empty.astype(float), string_array_value=[],
    )  # fmt: skip
    changed = store.types["rcl_interfaces/msg/Parameter"](name="speed", value=value)
    zero = store.types["builtin_interfaces/msg/Time"](sec=0, nanosec=0)
    event = store.types[kind](
        stamp=zero, node="/base", new_parameters=[], changed_parameters=[changed], deleted_parameters=[]
    )
    with Writer(tmp_path / "run", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topic = writer.add_connection("/parameter_events", kind, typestore=store)
        other = writer.add_connection("/speed", "std_msgs/msg/Float64", typestore=store)
        for time_s in range(10):
            message = store.types["std_msgs/msg/Float64"](data=1.0)
            writer.write(other, time_s * 10**9, store.serialize_cdr(message, "std_msgs/msg/Float64"))
        writer.write(topic, 4 * 10**9, store.serialize_cdr(event, kind))
    text = "/base:\n  ros__parameters:\n    speed: 0.5\n    other: 1\n"
    (tmp_path / "run" / "care_parameters.yaml").write_text(text, encoding="utf-8")
    settings = open_log(tmp_path / "run").settings()
    assert [(one.value, one.changed_at_s) for one in settings["/base.speed"]] == [(0.5, None), (0.1, 4.0)]
    assert [one.value for one in settings["/base.other"]] == [1.0]


FAULT = """string fault_code
uint8 severity
string description
builtin_interfaces/Time first_occurred
builtin_interfaces/Time last_occurred
builtin_interfaces/Time last_passed
uint32 occurrence_count
string status
string[] reporting_sources
"""
FAULT_EVENT = "string event_type\nros2_medkit_msgs/Fault fault\nbuiltin_interfaces/Time timestamp\n"


def black_box(folder: Path, plugin: StoragePlugin) -> Path:
    """The few seconds around a fault as ros2_medkit writes them: a folder of ROS 2 named by the fault."""
    store = get_typestore(Stores.ROS2_JAZZY)
    types = get_types_from_msg(FAULT, "ros2_medkit_msgs/msg/Fault")
    store.register({**types, **get_types_from_msg(FAULT_EVENT, "ros2_medkit_msgs/msg/FaultEvent")})

    def made(kind: str, **fields: Any) -> Any:
        return store.types[kind](**fields)

    zero = made("builtin_interfaces/msg/Time", sec=0, nanosec=0)

    def event(kind: str, status: str) -> Any:
        fault = made(
            "ros2_medkit_msgs/msg/Fault", fault_code="MOTOR_OVERHEAT", severity=3, description="motor at 96 C",
            first_occurred=zero, last_occurred=zero, last_passed=zero, occurrence_count=1, status=status,
            reporting_sources=["/powertrain/motor"],
        )  # fmt: skip
        return made("ros2_medkit_msgs/msg/FaultEvent", event_type=kind, fault=fault, timestamp=zero)

    twist = made("geometry_msgs/msg/Vector3", x=0.2, y=0.0, z=0.0)
    with Writer(folder, version=9, storage_plugin=plugin) as writer:
        topics = {
            name: writer.add_connection(name, kind, typestore=store)
            for name, kind in (
                ("/cmd_vel", "geometry_msgs/msg/Twist"),
                ("/fault_manager/events", "ros2_medkit_msgs/msg/FaultEvent"),
            )
        }

        def write(time_s: float, topic: str, message: Any) -> None:
            kind = topics[topic].msgtype
            writer.write(topics[topic], 10**18 + round(time_s * 1e9), store.serialize_cdr(message, kind))

        for tick in range(60):
            write(tick / 10, "/cmd_vel", made("geometry_msgs/msg/Twist", linear=twist, angular=twist))
        write(5.0, "/fault_manager/events", event("fault_confirmed", "CONFIRMED"))
        write(5.5, "/fault_manager/events", event("fault_updated", "CONFIRMED"))
    return folder


@pytest.mark.parametrize("plugin", [StoragePlugin.MCAP, StoragePlugin.SQLITE3], ids=("mcap", "db3"))
def test_a_black_box_of_ros2_medkit_tells_its_fault(tmp_path: Path, plugin: StoragePlugin) -> None:
    bag = black_box(tmp_path / "fault_MOTOR_OVERHEAT_1735830000", plugin)
    document = care_core.inspect(bag)
    (told,) = [one for one in document.account if "MOTOR_OVERHEAT" in one.text]
    assert told.text == 'ros2_medkit ERROR MOTOR_OVERHEAT of /powertrain/motor: "motor at 96 C"'
    (found,) = [one for one in document.findings if "MOTOR_OVERHEAT" in one.title]
    assert found.severity == "critical"
    assert found.onset_s == pytest.approx(5.0, abs=0.01)
    assert care_core.triage(bag).report().startswith("FAULT: ros2_medkit: MOTOR_OVERHEAT")
