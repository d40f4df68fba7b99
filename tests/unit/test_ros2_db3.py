"""ROS 2 bags in SQLite: folders, splits, packing, journals, parameters, and a file that is never written to."""

from __future__ import annotations

import os
import shutil
import sqlite3
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import CompressionMode
from ruamel.yaml import YAML

from care_core.configs.compare import Side, compare
from care_core.configs.formats import write_params
from care_core.configs.loading import read_config
from care_core.ecosystems.ros.dialect import ROS2_YAML
from care_core.errors import LogError
from care_core.logs import formats
from care_core.logs.base import Log
from care_core.logs.digest import log_digest
from care_core.logs.opening import open_log
from care_core.logs.ros2_db3 import _Database
from tests.ros_samples import IMU, MESSAGES, ROS2, SECOND_NS, START_NS, TEXT, WANTED, make, recording, stamp, write_db3


def check(log: Log) -> None:
    assert log.format is formats.ROS2_DB3
    tables = log.read(WANTED)
    np.testing.assert_allclose(tables["/imu"].t, np.arange(MESSAGES) / 10, atol=1e-9)
    np.testing.assert_allclose(tables["/imu"]["header.stamp"], tables["/imu"].t, atol=1e-9)
    np.testing.assert_array_equal(tables["/imu"]["linear_acceleration.x"], np.arange(MESSAGES))
    assert tables["/note"]["data"].tolist() == [f"message {row} é" for row in range(MESSAGES)]
    assert {channel.name: channel.type for channel in log.channels()} == {"/imu": IMU, "/note": TEXT}
    assert log.damage == ()


@pytest.mark.parametrize("mode", [CompressionMode.NONE, CompressionMode.FILE, CompressionMode.MESSAGE])
def test_folder_and_file_with_and_without_packing(tmp_path: Path, mode: CompressionMode) -> None:
    file = write_db3(tmp_path / "bag", mode=mode)
    before = {path.name: path.read_bytes() for path in file.parent.iterdir()}
    check(open_log(file.parent))
    check(open_log(file))
    (file.parent / "metadata.yaml").unlink()
    check(open_log(file.parent))
    before.pop("metadata.yaml")
    assert {path.name: path.read_bytes() for path in file.parent.iterdir()} == before


def test_definitions_missing_from_the_file(tmp_path: Path) -> None:
    file = write_db3(tmp_path / "bag")
    with sqlite3.connect(file) as database:
        database.execute("DROP TABLE message_definitions")
    check(open_log(file))


def test_first_messages_that_are_not_there(tmp_path: Path) -> None:
    file = write_db3(tmp_path / "bag")
    lost = 7
    with sqlite3.connect(file) as database:
        database.execute("DROP TABLE message_definitions")
        database.execute("UPDATE messages SET data = '' WHERE id <= ?", (2 * lost,))
    table = open_log(file).read(WANTED)["/imu"]
    np.testing.assert_array_equal(table["linear_acceleration.x"], np.arange(lost, MESSAGES))


def test_a_log_that_several_threads_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Often asked whether to go on, while others wait: neither lock may be held for the other."""
    monkeypatch.setattr("care_core.logs.ros2_db3._STEPS", 50)
    log = open_log(write_db3(tmp_path / "bag"))
    with ThreadPoolExecutor(4) as pool:
        for read in [pool.submit(check, log) for _ in range(20)]:
            read.result()


def test_a_split_recording_holds_no_file_open(tmp_path: Path) -> None:
    log, one = open_log(split(tmp_path)), open_log(write_db3(tmp_path / "bag"))
    check(log)
    check(one)
    held = [os.path.realpath(f"/proc/self/fd/{name}") for name in os.listdir("/proc/self/fd")]
    assert [Path(name).name for name in held if name.startswith(str(tmp_path))] == ["bag.db3"]


def split(tmp_path: Path) -> Path:
    """A recording in three files, numbered beyond nine."""
    folder = tmp_path / "split"
    folder.mkdir()
    everything = list(recording(ROS2))
    names = [f"run_{number}.db3" for number in (9, 10, 11)]
    for part, name in enumerate(names):
        shutil.move(write_db3(tmp_path / f"p{part}", messages=everything[40 * part : 40 * part + 40]), folder / name)
    listed = ", ".join(names)
    (folder / "metadata.yaml").write_text(
        "rosbag2_bagfile_information:\n  message_count: 120\n  ros_distro: iron\n"
        f"  duration: {{nanoseconds: 5900000001}}\n  relative_file_paths: [{listed}]\n"
    )
    return folder


def test_split_recording_is_one_run(tmp_path: Path) -> None:
    folder = split(tmp_path)
    check(open_log(folder))
    assert open_log(folder).facts["distro"] == "iron"
    one = open_log(folder / "run_10.db3")
    assert one.facts["part"] == "2 of 3; name the folder to read all as one run"
    assert one.duration_s == pytest.approx(1.9, abs=1e-6)
    assert one.damage == ()
    digest = log_digest(folder)
    (folder / "metadata.yaml").unlink()
    check(open_log(folder))
    assert log_digest(folder) != digest


def test_missing_and_cut_parts_are_named(tmp_path: Path) -> None:
    folder = split(tmp_path)
    (folder / "run_10.db3").unlink()
    whole = (folder / "run_11.db3").read_bytes()
    (folder / "run_11.db3").write_bytes(whole[: len(whole) * 3 // 4])
    log = open_log(folder)
    assert 20 <= len(log.read({"/note": ("data",)})["/note"]) < 40
    says = " | ".join(damage.what for damage in log.damage)
    assert "run_10.db3 is missing" in says
    assert "run_11.db3: read to " in says


def test_renamed_file_is_read(tmp_path: Path) -> None:
    file = write_db3(tmp_path / "bag")
    file.rename(file.with_name("renamed.db3"))
    check(open_log(tmp_path / "bag"))


def test_fewer_messages_than_recorded(tmp_path: Path) -> None:
    file = write_db3(tmp_path / "bag")
    with sqlite3.connect(file) as database:
        database.execute("DELETE FROM messages WHERE id > 100")
    assert [one.what for one in open_log(tmp_path / "bag").damage] == [
        "100 of the 120 messages that were recorded are there"
    ]


def test_transactions_in_a_journal_are_read_without_touching_it(tmp_path: Path) -> None:
    file = write_db3(tmp_path / "bag")
    live = tmp_path / "live"
    live.mkdir()
    database = sqlite3.connect(file)
    database.execute("PRAGMA journal_mode=WAL")
    database.execute("PRAGMA wal_autocheckpoint=0")
    database.execute("INSERT INTO messages SELECT id + 1000, topic_id, timestamp + 10000000000, data FROM messages")
    database.commit()
    for name in (file.name, f"{file.name}-wal"):
        shutil.copy(file.with_name(name), live / name)
    database.close()
    before = {path.name: path.read_bytes() for path in live.iterdir()}
    log = open_log(live / file.name)
    assert len(log.read(WANTED)["/imu"]) == 2 * MESSAGES
    assert {path.name: path.read_bytes() for path in live.iterdir()} == before
    journal = live / f"{file.name}-wal"
    os.truncate(journal, 1 << 40)
    log = open_log(live / file.name)
    assert len(log.read(WANTED)["/imu"]) == 2 * MESSAGES, "a hole behind the transactions is neither copied nor read"
    for nothing in (b"", bytes(4096)):
        journal.write_bytes(nothing)
        assert len(open_log(live / file.name).read(WANTED)["/imu"]) == MESSAGES


def test_a_message_spread_over_pages_is_salvaged(tmp_path: Path) -> None:
    texts = [f"{row}" * 9000 for row in range(10)]
    messages = [("/note", TEXT, START_NS + row, make(ROS2, TEXT, text)) for row, text in enumerate(texts)]
    file = write_db3(tmp_path / "bag", messages=messages)
    raw = bytearray(file.read_bytes())
    raw[28:32] = (len(raw) // 4096 + 5).to_bytes(4, "big")
    file.write_bytes(raw)
    log = open_log(file)
    assert log.read({"/note": ("data",)})["/note"]["data"].tolist() == texts
    assert "cut at byte" in log.damage[0].what


def event(node: str, row: int, new: list[Any], changed: list[Any]) -> tuple[str, str, int, Any]:
    kind = "rcl_interfaces/msg/ParameterEvent"
    time_ns = START_NS + row * SECOND_NS
    return "/parameter_events", kind, time_ns, make(ROS2, kind, stamp(ROS2, time_ns), node, new, changed, [])


def parameter(name: str, kind: int, value: Any) -> Any:
    values: list[Any] = [
        False, 0, 0.0, "", np.array([], "i1"), np.array([], bool), np.array([], "i8"), np.array([], "f8"), [],
    ]  # fmt: skip
    values[kind - 1] = value
    return make(
        ROS2, "rcl_interfaces/msg/Parameter", name, make(ROS2, "rcl_interfaces/msg/ParameterValue", kind, *values)
    )


def test_parameter_events(tmp_path: Path) -> None:
    new = [
        parameter("FollowPath.max_vel_x", 3, 0.26), parameter("use_sim_time", 1, True), parameter("count", 2, -7),
        parameter("frame", 4, "odom"), parameter("footprint", 8, np.array([1.0, 2.5])),
        parameter("plugins", 9, ["a", "b"]),
    ]  # fmt: skip
    faster = [parameter("FollowPath.max_vel_x", 3, 0.5)]
    file = write_db3(tmp_path / "bag", messages=[
        event("/controller_server", 0, new, []), event("controller_server", 1, [], [new[0]]),
        event("/controller_server", 3, [], faster), event("/ns/amcl", 4, [parameter("a", 2, 1)], []),
    ])  # fmt: skip
    settings = open_log(file).settings()
    first, second = settings["/controller_server.FollowPath.max_vel_x"]
    assert (first.value, first.changed_at_s, first.source) == (0.26, None, "/parameter_events")
    assert (second.value, second.changed_at_s) == (0.5, 3.0)
    assert {name.partition(".")[2]: one[0].value for name, one in settings.items() if len(one) == 1} == {
        "use_sim_time": "true", "count": -7, "frame": "odom", "footprint": "[1.0, 2.5]", "plugins": "['a', 'b']",
        "a": 1,
    }  # fmt: skip
    assert "/ns/amcl.a" in settings


def test_a_file_of_parameters_keeps_the_types_that_they_had(tmp_path: Path) -> None:
    new = [
        parameter("sim", 1, True), parameter("count", 2, 3), parameter("rate", 3, 20.0), parameter("frame", 4, "odom"),
        parameter("footprint", 8, np.array([1.0, 2.5])), parameter("plugins", 9, ["a", "b c"]),
        parameter("flags", 6, np.array([True, False])), parameter("text", 4, "1.0"),
    ]  # fmt: skip
    log = open_log(write_db3(tmp_path / "bag", messages=[event("/n", 0, new, [])]))
    driven = {name: history[-1] for name, history in log.settings().items()}
    file = tmp_path / "as_driven.yaml"
    file.write_text(write_params(driven, ROS2_YAML), encoding="utf-8")
    assert YAML(typ="safe").load(file)["/n"]["ros__parameters"] == {
        "sim": True, "count": 3, "rate": 20.0, "frame": "odom", "footprint": [1.0, 2.5], "plugins": ["a", "b c"],
        "flags": [True, False], "text": "1.0",
    }  # fmt: skip
    assert "count: 3\n" in file.read_text(encoding="utf-8")
    assert "rate: 20.0\n" in file.read_text(encoding="utf-8")
    assert not compare(Side("log", driven), Side("file", read_config(file), ROS2_YAML))


def test_what_is_no_bag(tmp_path: Path) -> None:
    other = tmp_path / "other.db3"
    with sqlite3.connect(other) as database:
        database.execute("CREATE TABLE notes(id INTEGER PRIMARY KEY, text TEXT)")
    with pytest.raises(LogError, match="no ROS 2 bag"):
        open_log(other)
    folder = tmp_path / "folder"
    folder.mkdir()
    (folder / "metadata.yaml").write_text("rosbag2_bagfile_information: {relative_file_paths: [a_0.db3]}")
    with pytest.raises(LogError, match=r"without .db3 or .mcap"):
        open_log(folder)
    (folder / "a.db3").touch()
    (folder / "a.mcap").touch()
    with pytest.raises(LogError, match=r"both .db3 and .mcap"):
        open_log(folder)


def test_a_schema_that_is_no_text(tmp_path: Path) -> None:
    file = write_db3(tmp_path / "bag")
    raw = file.read_bytes()
    at = raw.index(b"serialization_format TEXT")
    file.write_bytes(raw[:at] + b"\xff" * 4 + raw[at + 4 :])
    log = open_log(file)
    assert len(log.read(WANTED)["/note"]) == MESSAGES
    assert "damaged" in log.damage[0].what


def test_an_interruption_that_meets_sqlite_is_no_damage(tmp_path: Path) -> None:
    def read() -> None:
        with _Database(write_db3(tmp_path / "bag"))._connected() as database:
            database.set_progress_handler(lambda: 1, 1)  # as one that an interruption met
            database.execute("SELECT id FROM messages")

    with pytest.raises(KeyboardInterrupt):
        read()
