"""What makes up a recording: split ROS 1 bags, folders, and a folder's digest; and every ROS log from elsewhere."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zstandard

from care_core.errors import LogError
from care_core.logs.compression import CannotUnpackError, PlainFile, Unpacker
from care_core.logs.digest import log_digest
from care_core.logs.finding import find_logs
from care_core.logs.opening import open_log
from care_core.logs.ros_log import RosLog
from tests.ros_samples import MESSAGES, WANTED, is_same, leaves, value_at, write_bag, write_db3, write_mcap


def write_split(folder: Path, names: tuple[str, ...]) -> None:
    folder.mkdir(exist_ok=True)
    step = MESSAGES // len(names)
    for part, name in enumerate(names):
        write_bag(folder / name, range(part * step, (part + 1) * step))


@pytest.mark.parametrize(
    "names",
    [
        ("run_0.bag", "run_1.bag", "run_2.bag"),
        ("2024-05-01-10-00-00_0.bag", "2024-05-01-10-00-02_1.bag", "2024-05-01-10-00-04_2.bag.active"),
    ],
)
def test_the_parts_of_a_split_bag_are_one_run(tmp_path: Path, names: tuple[str, ...]) -> None:
    folder = tmp_path / "bags"
    write_split(folder, names)
    log = open_log(folder)
    tables = log.read(WANTED)
    assert tables["/note"]["data"].tolist() == [f"message {row} é" for row in range(MESSAGES)]
    np.testing.assert_allclose(tables["/imu"]["header.stamp"], tables["/imu"].t, atol=1e-9)
    assert (log.damage, log.format.name) == ((), "ros1-bag")
    one = open_log(folder / names[1])
    assert one.facts["part"] == "2 of 3; name the folder to read all as one run"
    assert len(one.read(WANTED)["/note"]) == MESSAGES // 3
    (folder / names[1]).unlink()
    assert [one.what for one in open_log(folder).damage] == ["1 parts are missing, the first is number 1"]


def test_a_bag_that_is_still_recorded(tmp_path: Path) -> None:
    write_bag(tmp_path / "a.bag.active")
    assert len(open_log(tmp_path / "a.bag.active").read(WANTED)["/imu"]) == MESSAGES
    assert find_logs([tmp_path]) == (tmp_path / "a.bag.active",)


def test_a_folder_of_separate_bags_is_no_run(tmp_path: Path) -> None:
    write_bag(tmp_path / "a.bag")
    assert len(open_log(tmp_path).read(WANTED)["/imu"]) == MESSAGES
    write_bag(tmp_path / "b.bag")
    with pytest.raises(LogError, match="2 recordings"):
        open_log(tmp_path)


def test_a_folder_without_a_log_is_not_sent_to_triage_again(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("no log")
    with pytest.raises(LogError, match="A folder, not a log") as caught:
        open_log(tmp_path)
    assert caught.value.hint == "No log lies right in it; name a log file."


def test_digest_of_a_folder(tmp_path: Path) -> None:
    write_split(tmp_path / "bags", ("run_0.bag", "run_1.bag"))
    both = (tmp_path / "bags" / "run_0.bag").read_bytes() + (tmp_path / "bags" / "run_1.bag").read_bytes()
    assert log_digest(tmp_path / "bags") == hashlib.sha256(both).hexdigest()


def test_a_packed_log_that_is_cut(tmp_path: Path) -> None:
    write_bag(tmp_path / "a.bag")
    packed = zstandard.ZstdCompressor().compress(
        (tmp_path / "a.bag").read_bytes() + np.random.default_rng(0).bytes(400_000)
    )
    path = tmp_path / "a.bag.zstd"
    path.write_bytes(packed[: len(packed) // 2])
    plain = PlainFile(path)
    assert plain.is_cut
    assert 0 < plain.path.stat().st_size < 400_000
    copy = plain.path
    del plain
    assert not copy.exists()


def test_unpacking_is_bounded() -> None:
    bomb = zstandard.ZstdCompressor().compress(bytes(1 << 26))
    assert len(Unpacker(1000)("zstd", bomb, 1000)) == 1000
    for compression in ("zstd", "lz4", "bz2", "xz"):
        with pytest.raises(CannotUnpackError):
            Unpacker(1000)(compression, b"no such thing", 1000)


def ros_logs(recorded: Path) -> Iterator[Path]:
    for kind in ("ros1_bag", "ros2_db3", "ros2_mcap"):
        for path in sorted((recorded / "logs" / kind).iterdir()):
            yield path
            if path.is_dir():
                yield from (file for file in sorted(path.iterdir()) if file.suffix in (".db3", ".mcap", ".zstd"))


def test_every_log_from_elsewhere_is_read_or_refused_with_a_sentence(recorded: Path) -> None:
    refused = {}
    for path in ros_logs(recorded):
        try:
            log = open_log(path)
        except LogError as err:
            refused[path.name] = f"{err.message} {err.hint}"
            continue
        assert all(channel.type for channel in log.channels())
        assert log.settings() is not None
    assert set(refused) == {"rosrecord_v1_2.bag"}
    assert "format 1.x" in refused["rosrecord_v1_2.bag"]


def test_ros2_logs_from_elsewhere_are_read_as_rosbags_reads_them(recorded: Path) -> None:
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    compared = 0
    for name in ("ros2_db3/battery_imu_pose", "ros2_db3/split_5_files", "ros2_db3/tb3_gazebo_param_events",
                 "ros2_mcap/crazyflie_pitch45", "ros2_mcap/no_statistics", "ros2_mcap/rosout_diagnostics_zstd.mcap",
                 "ros2_mcap/nav2_collision_monitor_zstd_file"):  # fmt: skip
        path = recorded / "logs" / name
        log = open_log(path)
        with AnyReader([path], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader:
            known = [one for one in reader.connections if one.msgtype in reader.typestore.fielddefs]
            paths = {one.topic: tuple(leaves(reader.typestore, one.msgtype)) for one in known}
            read = log.read(paths)
            zero_ns = min(reader.start_time, min((t for _, t, _ in reader.messages()), default=0))
            expected: dict[str, list[Any]] = {one.topic: [] for one in known}
            for connection, _, raw in reader.messages(connections=known):
                expected[connection.topic].append(reader.deserialize(raw, connection.msgtype))
        for topic, messages in expected.items():
            assert len(read[topic]) == len(messages)
            for row in range(0, len(messages), 23):
                for field in paths[topic]:
                    assert is_same(read[topic][field][row], value_at(messages[row], field, zero_ns)), (topic, field)
                    compared += 1
    assert compared > 5_000


def test_misconfigured_and_healthy_robot_tell_their_parameters(recorded: Path) -> None:
    folder = recorded / "logs" / "ros2_db3"
    healthy = open_log(folder / "tb3_gazebo_param_events")
    settings = healthy.settings()
    before, after = settings["/turtlebot3_imu.use_sim_time"]
    assert (before.value, before.changed_at_s, after.value) == ("false", None, "true")
    assert after.changed_at_s == pytest.approx(4.034, abs=1e-3)
    assert len(settings) > 40
    counts = {channel.name: channel.count for channel in open_log(folder / "tb3_gazebo_scan_qos_mismatch").channels()}
    assert (counts["/scan"], counts["/odom"]) == (0, 766)
    texts = open_log(folder / "no_metadata_yaml.db3").read({"/text": ("data",)})["/text"]["data"]
    assert isinstance(texts[0], str)


def test_settings_and_digest_of_a_folder_in_a_table_of_runs(recorded: Path) -> None:
    folder = recorded / "logs" / "ros2_db3" / "split_5_files"
    assert find_logs([folder]) == (folder,)
    assert len(log_digest(folder)) == 64


@pytest.mark.parametrize("container", ["bag", "mcap", "db3"])
def test_of_many_messages_every_third_is_decoded(tmp_path: Path, container: str) -> None:
    file = tmp_path / f"log.{container}"
    if container == "db3":
        write_db3(tmp_path / "folder").rename(file)
    else:
        (write_bag if container == "bag" else write_mcap)(file)
    log = open_log(file)
    assert isinstance(log, RosLog)
    whole, some = log.read(WANTED), log.read(WANTED, {"/imu": MESSAGES // 3})
    assert len(some["/imu"]) == MESSAGES // 3
    for topic, table in some.items():
        step = 3 if topic == "/imu" else 1
        assert table.t.tolist() == whole[topic].t[::step].tolist()
        assert all(is_same(column[0], whole[topic][path][0]) for path, column in table.columns.items())
        assert all(is_same(column[-1], whole[topic][path][::step][-1]) for path, column in table.columns.items())


def test_bags_that_are_numbered_by_hand_are_no_parts_of_a_run(tmp_path: Path) -> None:
    write_bag(tmp_path / "run_1.bag", range(20))
    write_bag(tmp_path / "run_2.bag", range(20, 40))
    assert open_log(tmp_path / "run_2.bag").facts["part"] == "2 of 2; name the folder to read all as one run"
    (tmp_path / "run_2.bag").unlink()
    write_bag(tmp_path / "run_2.bag", range(20, 40), later_s=300)
    assert "part" not in open_log(tmp_path / "run_1.bag").facts
