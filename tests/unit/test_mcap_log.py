"""MCAP files of every make, against rosbags; encodings that are not decoded; what the recorder noted."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import CompressionType, IndexType
from rosbags.rosbag2 import StoragePlugin

from care_core.ecosystems.examine import examine
from care_core.ecosystems.registry import run_model
from care_core.logs import formats
from care_core.logs.file_windows import opened
from care_core.logs.mcap_log import McapLog
from care_core.logs.mcap_records import MAGIC, read_contents
from care_core.logs.opening import open_log
from tests.ros_samples import (
    IMU,
    MESSAGES,
    ROS1,
    ROS2,
    SECOND_NS,
    START_NS,
    TEXT,
    WANTED,
    McapFile,
    cdr,
    imu,
    make,
    recording,
    write_db3,
    write_mcap,
    write_ros1_mcap,
)  # fmt: skip

PLAIN = {"index_types": IndexType.NONE, "use_statistics": False, "repeat_channels": False, "repeat_schemas": False,
         "use_summary_offsets": False}  # fmt: skip


JSON: dict[str, Any] = {"text": "{}", "language": "jsonschema", "encoding": "json"}


def check(path: Path) -> McapLog:
    """Every value is the one that was written; answers the log."""
    log = open_log(path)
    assert isinstance(log, McapLog)
    assert log.format is formats.MCAP
    tables = log.read(WANTED)
    assert set(tables) == {"/imu", "/note"}
    table = tables["/imu"]
    written: list[Any] = [message for topic, _, _, message in recording(ROS2) if topic == "/imu"]
    np.testing.assert_allclose(table.t, np.arange(MESSAGES) / 10, atol=1e-9)
    np.testing.assert_allclose(table["header.stamp"], table.t, atol=1e-9)
    assert table["header.frame_id"].tolist() == [one.header.frame_id for one in written]
    np.testing.assert_array_equal(table["linear_acceleration.x"], [one.linear_acceleration.x for one in written])
    np.testing.assert_array_equal(
        np.stack(table["linear_acceleration_covariance"].tolist()),
        np.stack([one.linear_acceleration_covariance for one in written]),
    )
    assert "nothing" not in table.columns
    assert tables["/note"]["data"].tolist() == [f"message {row} é" for row in range(MESSAGES)]
    assert log.damage == ()
    return log


@pytest.mark.parametrize("compression", list(CompressionType))
@pytest.mark.parametrize("options", [{}, {"use_chunking": False}, PLAIN, {"enable_crcs": False}])
def test_files_of_every_make(tmp_path: Path, compression: CompressionType, options: dict[str, Any]) -> None:
    path = tmp_path / "a.bin"
    write_mcap(path, compression=compression, **options)
    raw = path.read_bytes()
    log = check(path)
    assert log.start == "2020-09-13T12:26:40+00:00"
    assert log.duration_s == pytest.approx((MESSAGES - 1) / 10, abs=1e-6)
    channels = {channel.name: channel for channel in log.channels()}
    assert (channels["/imu"].type, channels["/imu"].count) == (IMU, MESSAGES)
    assert channels["/imu"].rate_hz == pytest.approx(10)
    assert path.read_bytes() == raw


def test_ros1_messages(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    write_ros1_mcap(path)
    assert check(path).facts["ros"] == "1"


def test_dynamic_reconfigure_in_mcap(tmp_path: Path) -> None:
    def config(value: float) -> Any:
        double = make(ROS1, "dynamic_reconfigure/msg/DoubleParameter", "vel", value)
        return make(ROS1, "dynamic_reconfigure/msg/Config", [], [], [], [double], [])

    kind = "dynamic_reconfigure/msg/Config"
    path = tmp_path / "a.mcap"
    write_ros1_mcap(path, [("/P/parameter_updates", kind, START_NS + n * SECOND_NS, config(v)) for n, v in
                           enumerate((0.5, 0.5, 0.75))])  # fmt: skip
    assert [(one.value, one.changed_at_s) for one in open_log(path).settings()["/P/vel"]] == [(0.5, None), (0.75, 2.0)]


def test_a_chunk_that_does_not_match_its_checksum_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    write_mcap(path)
    raw = bytearray(path.read_bytes())
    at = raw.index("message 30 é".encode())
    raw[at : at + 7] = b"massage"
    path.write_bytes(raw)
    log = open_log(path)
    assert log.read(WANTED)["/note"]["data"][30] == "massage 30 é"
    (damage,) = log.damage
    assert "checksum" in damage.what
    assert damage.byte is not None
    assert damage.byte < at
    assert damage.time_s == pytest.approx(3.0, abs=0.5)


def test_a_broken_record_costs_one_chunk(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    write_mcap(path)
    raw = bytearray(path.read_bytes())
    at = raw.index("message 30 é".encode())
    chunk = max(n for n in range(at) if raw[n : n + 1] == b"\x06" and raw[n + 4 : n + 9] == bytes(5))
    raw[chunk + 1] ^= 0x40
    path.write_bytes(raw)
    log = open_log(path)
    table = log.read(WANTED)["/note"]
    assert MESSAGES - 6 < len(table) < MESSAGES
    assert table["data"][-1] == f"message {MESSAGES - 1} é"
    assert log.damage[0].byte == chunk
    assert log.damage[0].time_s is not None


def test_a_cut_in_a_chunks_index_costs_no_message(tmp_path: Path) -> None:
    """The chunk itself is whole: topics whose part of the index is gone are found in it."""
    path = tmp_path / "a.mcap"
    write_mcap(path)
    raw = path.read_bytes()
    with opened(path, MAGIC, "an MCAP file") as log:
        end = read_contents(log).chunks[-1].end
    for size in range(end, len(raw), 31):
        path.write_bytes(raw[:size])
        assert {channel.name: channel.count for channel in open_log(path).channels()} == {"/imu": 60, "/note": 60}


def test_encodings_that_are_not_decoded(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with McapFile(path) as log_file:
        log_file.add("/json", "x.Log", START_NS, b"{}", text="{}", language="jsonschema", encoding="json")
        log_file.add("/proto", "x.Odometry", START_NS, b"\x08\x01", text="", language="protobuf", encoding="protobuf")
        log_file.add("/note", TEXT, START_NS, cdr(make(ROS2, TEXT, "hello")))
    log = open_log(path)
    assert [(channel.name, channel.count) for channel in log.channels()] == [("/json", 1), ("/note", 1), ("/proto", 1)]
    assert log.facts["not decoded (protobuf)"] == "/proto"
    assert set(log.read({"/proto": ("a",), "/note": ("data",)})) == {"/note"}
    assert [damage.what for damage in log.damage] == ["/proto: its messages cannot be decoded: they are protobuf"]


def test_messages_in_json_are_read_as_any_others(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    said = {"level": 4, "message": "no device", "timestamp": {"sec": START_NS // 10**9, "nsec": 5 * 10**8}}
    scan = {"header": {"stamp": {"sec": 0, "nanosec": 0}}, "ranges": [1.5, None, 2], "info": [{"id": "a"}, {"id": "b"}]}
    with McapFile(path) as log_file:
        for row, (topic, name, message) in enumerate(
            (("/log", "foxglove.Log", said), ("/scan", "sensor_msgs/msg/LaserScan", scan), ("/log", "foxglove.Log", {}))
        ):
            raw = json.dumps(message).encode()
            log_file.add(topic, name, START_NS + row * 10**9, raw, **JSON)
        log_file.add("/log", "foxglove.Log", START_NS + 3 * 10**9, b"{broken", **JSON)
    log = open_log(path)
    wanted = {"/log": ("level", "message", "timestamp", "name"), "/scan": ("ranges", "info.id", "header.stamp")}
    tables = log.read(wanted)
    words = tables["/log"]
    assert set(words.columns) == {"level", "message", "timestamp"}
    assert words["message"].tolist() == ["no device", ""]
    np.testing.assert_array_equal(words["level"], [4.0, np.nan])
    assert words["timestamp"][0] == pytest.approx(0.5 + START_NS // 10**9 - START_NS / 1e9, abs=1e-6)
    np.testing.assert_array_equal(tables["/scan"]["ranges"][0], [1.5, np.nan, 2.0])
    assert tables["/scan"]["info.id"][0] == ["a", "b"]
    assert np.isnan(tables["/scan"]["header.stamp"][0])
    assert "it is no JSON" in log.damage[0].what


def test_a_file_with_nothing_to_decode_still_tells_when_its_messages_came(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with McapFile(path) as log_file:
        log_file.add("/proto", "x.Odometry", START_NS, b"\x08\x01", text="", language="protobuf", encoding="protobuf")
    log = open_log(path)
    assert [(channel.name, channel.count) for channel in log.channels()] == [("/proto", 1)]
    health = examine(run_model(log))
    assert health.too_little == "its messages are (protobuf), not ROS 1, CDR or JSON: only when they came is known"
    assert health.robot == "robot without messages of ROS"
    assert "ros" not in log.facts


def test_a_service_event_does_not_hide_the_rest(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with McapFile(path) as log_file:
        log_file.add("/s/_service_event", "p/srv/Add_Event", START_NS, bytes(12), text="int64 a\n---\nint64 sum\n")
        log_file.add("/note", TEXT, START_NS, cdr(make(ROS2, TEXT, "hello")))
    log = open_log(path)
    assert set(log.read({"/s/_service_event": ("request.a",), "/note": ("data",)})) == {"/note"}
    assert "not understood" in log.damage[0].what


def test_what_the_recorder_noted(tmp_path: Path) -> None:
    write_db3(tmp_path / "bag", plugin=StoragePlugin.MCAP, custom={
        "driver": "Ada",
        "/controller_server.FollowPath.max_vel_x": "0.26",
        "params": "controller_server:\n  ros__parameters:\n    use_sim_time: false\n    FollowPath: {sim_time: 1.7}\n",
    })  # fmt: skip
    log = check(tmp_path / "bag")
    settings = log.settings()
    assert {name: history[0].value for name, history in settings.items()} == {
        "/controller_server.FollowPath.max_vel_x": 0.26,
        "/controller_server.FollowPath.sim_time": 1.7,
        "/controller_server.use_sim_time": 0.0,
    }
    assert settings["/controller_server.use_sim_time"][0].source == "recording metadata, params"
    assert log.facts["driver"] == "Ada"
    path = tmp_path / "a.mcap"
    with McapFile(path) as log_file:
        log_file.writer.add_metadata("rosbag2", {"serialized_metadata": "ros_distro: jazzy\ncustom_data: {a: b}\n"})
        log_file.writer.add_metadata("robot", {"name": "husky"})
        log_file.add("/behavior_tree_log", TEXT, START_NS, cdr(make(ROS2, TEXT, "x")))
    facts = open_log(path).facts
    assert facts == {"ros": "2", "stack": "nav2", "distro": "jazzy", "a": "b", "robot.name": "husky"}


def test_clock_that_was_set_and_stray_times(tmp_path: Path) -> None:
    def write(path: Path, times_s: list[float]) -> None:
        with McapFile(path) as log_file:
            for time_s in times_s:
                data = cdr(imu(ROS2, 0, START_NS))
                log_file.add("/imu", IMU, START_NS + int(time_s * SECOND_NS), data)

    steady = [n / 10 for n in range(200)]
    write(tmp_path / "set.mcap", [*steady, 1e6, 1e6 + 1])
    write(tmp_path / "set2.mcap", [*steady[:100], *(one + 1e6 for one in steady)])
    write(tmp_path / "back.mcap", [*steady[:100], *steady[50:]])
    stray = open_log(tmp_path / "set.mcap")
    assert stray.duration_s == pytest.approx(19.9)
    assert [channel.count for channel in stray.channels()] == [200]
    assert [one.what for one in stray.damage] == ["2 messages with impossible times are left out"]
    jump = open_log(tmp_path / "set2.mcap")
    assert jump.duration_s > 1e6
    assert jump.damage[0].what == "the clock jumps: no message for 11.6 days"
    assert jump.damage[0].time_s == pytest.approx(9.9)
    back = open_log(tmp_path / "back.mcap")
    assert "sorted by time: up to 4.9 s out of order (/imu)" in back.damage[0].what
    table = back.read({"/imu": ("linear_acceleration.x",)})["/imu"]
    assert np.all(np.diff(table.t) >= 0)
