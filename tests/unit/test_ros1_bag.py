"""The ROS 1 bag reader against rosbags message by message, on bags written here, cut, and damaged."""

from __future__ import annotations

import struct
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rosbags.interfaces import Nodetype
from rosbags.rosbag1 import Reader, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from care_core.errors import LogError
from care_core.logs.opening import open_log
from care_core.logs.ros1_bag import Ros1Bag
from care_core.logs.ros_message import parse_definition
from tests.whole import examples

STORE = get_typestore(Stores.ROS1_NOETIC)

START_NS = 1_600_000_000_000_000_000
SECOND_NS = 1_000_000_000
MESSAGES = 40


def make(name: str, *values: Any) -> Any:
    return STORE.types[name](*values)


def header(time_ns: int, frame: str) -> Any:
    stamp = make("builtin_interfaces/msg/Time", time_ns // SECOND_NS, time_ns % SECOND_NS)
    return make("std_msgs/msg/Header", 0, stamp, frame)


def imu(row: int, time_ns: int) -> Any:
    vector = make("geometry_msgs/msg/Vector3", float(row), -0.5 * row, 2.0)
    turn = make("geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0)
    square = np.arange(9, dtype=np.float64) + row
    return make("sensor_msgs/msg/Imu", header(time_ns, "x" * (row % 3)), turn, square, vector, square, vector, square)


def config(**doubles: float) -> Any:
    names = [make("dynamic_reconfigure/msg/DoubleParameter", name, value) for name, value in doubles.items()]
    return make(
        "dynamic_reconfigure/msg/Config",
        [make("dynamic_reconfigure/msg/BoolParameter", "use_it", True)],
        [make("dynamic_reconfigure/msg/IntParameter", "samples", 6)],
        [make("dynamic_reconfigure/msg/StrParameter", "frame", "odom")],
        names,
        [],
    )


class Recorder:
    """Writes a bag message by message."""

    def __init__(self, path: Path, compression: str = "none", chunk_bytes: int = 1024) -> None:
        self.writer = Writer(path)
        if compression != "none":
            self.writer.set_compression(Writer.CompressionFormat[compression.upper()])
        self.writer.chunk_threshold = chunk_bytes
        self.connections: dict[tuple[str, str], Any] = {}

    def __enter__(self) -> Recorder:
        self.writer.open()
        return self

    def __exit__(self, *_: object) -> None:
        self.writer.close()

    def write(self, topic: str, message: Any, time_ns: int) -> None:
        kind = message.__msgtype__
        if (topic, kind) not in self.connections:
            self.connections[topic, kind] = self.writer.add_connection(topic, kind, typestore=STORE)
        raw = bytes(STORE.serialize_ros1(message, kind))
        self.writer.write(self.connections[topic, kind], time_ns, raw)


def write_sample(path: Path, compression: str = "none") -> None:
    with Recorder(path, compression) as bag:
        for row in range(MESSAGES):
            time_ns = START_NS + row * SECOND_NS // 10
            bag.write("/imu", imu(row, time_ns), time_ns)
            bag.write("/note", make("std_msgs/msg/String", f"message {row} é"), time_ns + 1)


@pytest.fixture(scope="module")
def sample(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("bags") / "sample.bag"
    write_sample(path)
    return path


WANTED = {
    "/imu": ("header.stamp", "header.frame_id", "linear_acceleration.x", "linear_acceleration_covariance", "nothing"),
    "/note": ("data",),
    "/absent": ("x",),
}


@pytest.mark.parametrize("compression", ["none", "bz2", "lz4"])
def test_values_are_those_of_rosbags(tmp_path: Path, compression: str) -> None:
    path = tmp_path / "a.bag"
    write_sample(path, compression)
    tables = Ros1Bag(path).read(WANTED)
    assert set(tables) == {"/imu", "/note"}
    assert "nothing" not in tables["/imu"].columns
    with Reader(path) as reader:
        expected = [
            (STORE.deserialize_ros1(raw, connection.msgtype), (time_ns - START_NS) / 1e9)
            for connection, time_ns, raw in reader.messages()
            if connection.topic == "/imu"
        ]
    imus: list[Any] = [message for message, _ in expected]
    table = tables["/imu"]
    np.testing.assert_array_equal(table.t, [time_s for _, time_s in expected])
    np.testing.assert_allclose(table["header.stamp"], table.t, atol=1e-9)
    np.testing.assert_array_equal(table["linear_acceleration.x"], [one.linear_acceleration.x for one in imus])
    assert table["linear_acceleration.x"].dtype == np.float64
    assert table["header.frame_id"].tolist() == [one.header.frame_id for one in imus]
    np.testing.assert_array_equal(
        np.stack(table["linear_acceleration_covariance"].tolist()),
        np.stack([one.linear_acceleration_covariance for one in imus]),
    )
    assert tables["/note"]["data"].tolist() == [f"message {row} é" for row in range(MESSAGES)]


def rosbags_name(name: str) -> str:
    return {"time": "builtin_interfaces/msg/Time", "duration": "builtin_interfaces/msg/Duration"}.get(
        name, name.replace("/", "/msg/")
    )


@pytest.mark.parametrize("name", sorted(STORE.fielddefs))
def test_definitions_mean_what_rosbags_reads_in_them(name: str) -> None:
    text, _ = STORE.generate_msgdef(name, ros_version=1)
    expected = []
    described: Any = get_types_from_msg(text, name)[name][1]
    for field, (kind, detail) in described:
        size = None
        if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE):
            (inner_kind, inner), count = detail
            size = count if kind == Nodetype.ARRAY else -1
        else:
            inner_kind, inner = kind, detail
        expected.append((field.rstrip("_"), inner[0] if inner_kind == Nodetype.BASE else inner, size))
    ros1_name = name.replace("/msg/", "/")
    fields = parse_definition(ros1_name, text)[ros1_name]
    assert [(one.name.rstrip("_"), rosbags_name(one.type), one.size) for one in fields] == expected


def test_what_a_bag_says_of_itself(sample: Path) -> None:
    bag = open_log(sample)
    assert isinstance(bag, Ros1Bag)
    assert bag.start == "2020-09-13T12:26:40+00:00"
    assert bag.duration_s == pytest.approx((MESSAGES - 1) / 10, abs=1e-6)
    assert bag.damage == ()
    channels = {channel.name: channel for channel in bag.channels()}
    assert channels["/imu"].type == "sensor_msgs/Imu"
    assert channels["/imu"].count == MESSAGES
    assert channels["/imu"].rate_hz == pytest.approx(10)


def test_a_simulated_clock_is_no_wall_clock(tmp_path: Path) -> None:
    with Recorder(tmp_path / "a.bag") as bag:
        bag.write("/note", make("std_msgs/msg/String", "x"), 13 * SECOND_NS)
    assert Ros1Bag(tmp_path / "a.bag").start is None


def test_unset_stamp_is_nan(tmp_path: Path) -> None:
    with Recorder(tmp_path / "a.bag") as bag:
        bag.write("/imu", imu(0, 0), START_NS)
    assert np.isnan(Ros1Bag(tmp_path / "a.bag").read({"/imu": ("header.stamp",)})["/imu"]["header.stamp"]).all()


def test_publishers_of_different_types_share_a_table(tmp_path: Path) -> None:
    with Recorder(tmp_path / "a.bag") as bag:
        bag.write("/mixed", make("std_msgs/msg/String", "first"), START_NS)
        bag.write("/mixed", make("geometry_msgs/msg/Vector3", 1.0, 2.0, 3.0), START_NS + SECOND_NS)
        bag.write("/mixed", make("std_msgs/msg/String", "last"), START_NS + 2 * SECOND_NS)
    table = Ros1Bag(tmp_path / "a.bag").read({"/mixed": ("data", "y")})["/mixed"]
    assert table.t.tolist() == [0.0, 1.0, 2.0]
    assert table["data"].tolist() == ["first", None, "last"]
    np.testing.assert_array_equal(table["y"], [np.nan, 2.0, np.nan])


def test_settings_keep_every_value_and_its_bounds(tmp_path: Path) -> None:
    with Recorder(tmp_path / "a.bag") as bag:
        description = make(
            "dynamic_reconfigure/msg/ConfigDescription", [], config(a=9.0), config(a=float("-inf")), config(a=0.25)
        )
        bag.write("/move_base/P/parameter_descriptions", description, START_NS)
        for second, value in enumerate((0.5, 0.5, 0.75)):
            bag.write("/move_base/P/parameter_updates", config(a=value), START_NS + second * SECOND_NS)
    found = Ros1Bag(tmp_path / "a.bag").settings()
    first, second_value = found["/move_base/P/a"]
    assert (first.value, first.changed_at_s, first.default, first.low, first.high) == (0.5, None, 0.25, None, 9.0)
    assert (second_value.value, second_value.changed_at_s) == (0.75, 2.0)
    assert first.source == "/move_base/P/parameter_updates"
    assert [one.value for one in found["/move_base/P/use_it"]] == ["true"]
    assert [one.value for one in found["/move_base/P/samples"]] == [6.0]
    assert [one.value for one in found["/move_base/P/frame"]] == ["odom"]


def test_unclosed_bag_is_read_and_reported(sample: Path, tmp_path: Path) -> None:
    raw = bytearray(sample.read_bytes())
    at = raw.index(b"index_pos=") + len(b"index_pos=")
    (index_pos,) = struct.unpack_from("<Q", raw, at)
    raw[at : at + 8] = bytes(8)
    path = tmp_path / "unclosed.bag"
    path.write_bytes(raw[:index_pos])
    bag = Ros1Bag(path)
    assert len(bag.read(WANTED)["/imu"]) == MESSAGES
    assert "no index" in bag.damage[0].what


def chunks_of(raw: bytes) -> list[tuple[int, int]]:
    """Where the size of each chunk's data stands, and where the data ends."""
    found, pos = [], len(b"#ROSBAG V2.0\n")
    while pos < len(raw):
        data = pos + 4 + struct.unpack_from("<I", raw, pos)[0]
        end = data + 4 + struct.unpack_from("<I", raw, data)[0]
        found += [(data, end)] if b"op=\x05" in raw[pos:data] else []
        pos = end
    return found


def test_what_was_written_of_a_chunk_before_its_recorder_died_is_read(sample: Path, tmp_path: Path) -> None:
    raw = bytearray(sample.read_bytes())
    at = raw.index(b"index_pos=") + len(b"index_pos=")
    raw[at : at + 8] = bytes(8)
    path = tmp_path / "died.bag.active"
    for size_at, end in chunks_of(bytes(raw))[:3]:
        path.write_bytes(raw[:end])
        known = Ros1Bag(path).read(WANTED)
        path.write_bytes(raw[:size_at] + bytes(4) + raw[size_at + 4 : end])
        found = Ros1Bag(path).read(WANTED)
        assert {topic: len(table) for topic, table in found.items()} == {
            topic: len(one) for topic, one in known.items()
        }
        assert len(found["/imu"]) > 0


@pytest.mark.parametrize("compression", ["none", "bz2", "lz4"])
@given(share=st.floats(0.0, 0.999))
@settings(max_examples=examples(25), deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_cut_bag_gives_what_comes_before_the_cut(
    tmp_path_factory: pytest.TempPathFactory, compression: str, share: float
) -> None:
    folder = tmp_path_factory.mktemp("cut")
    write_sample(folder / "whole.bag", compression)
    raw = (folder / "whole.bag").read_bytes()
    whole = Ros1Bag(folder / "whole.bag").read(WANTED)
    cut = folder / "cut.bag"
    cut.write_bytes(raw[: int(len(raw) * share)])
    try:
        bag = Ros1Bag(cut)
    except LogError:
        assert len(raw) * share < 20
        return
    tables = bag.read(WANTED)
    assert bag.damage
    for topic, table in tables.items():
        assert len(table) <= len(whole[topic])
        for name, column in table.columns.items():
            if name != "linear_acceleration_covariance":
                np.testing.assert_array_equal(column, whole[topic][name][: len(table)])


@pytest.mark.parametrize("compression", ["none", "bz2", "lz4"])
@given(where=st.integers(0, 100_000), value=st.integers(0, 255))
@settings(max_examples=examples(60), deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_a_flipped_byte_never_raises_but_our_error(
    tmp_path_factory: pytest.TempPathFactory, compression: str, where: int, value: int
) -> None:
    path = tmp_path_factory.mktemp("flip") / "a.bag"
    write_sample(path, compression)
    raw = bytearray(path.read_bytes())
    raw[where % len(raw)] = value
    path.write_bytes(raw)
    with suppress(LogError):
        bag = Ros1Bag(path)
        bag.read(WANTED)
        bag.settings()
        bag.channels()


@pytest.mark.parametrize("raw", [b"", b"#ROSBAG V1.2\nx", b"hello", b"#ROSBAG V2.0\n"])
def test_what_is_no_bag(tmp_path: Path, raw: bytes) -> None:
    path = tmp_path / "a.bag"
    path.write_bytes(raw)
    if raw == b"#ROSBAG V2.0\n":
        assert Ros1Bag(path).damage
    else:
        with pytest.raises(LogError):
            Ros1Bag(path)


def test_no_such_file(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="No such file"):
        Ros1Bag(tmp_path / "none.bag")


def test_bags_from_elsewhere(recorded: Path) -> None:
    bags = recorded / "logs" / "ros1_bag"
    counts = {
        name: sum(channel.count for channel in Ros1Bag(bags / f"{name}.bag").channels())
        for name in ("unindexed", "unsorted_chunks", "no_messages", "husky_imu_odom_gps_bz2", "turtlesim_lz4")
    }
    assert counts == {
        "unindexed": 14, "unsorted_chunks": 3, "no_messages": 0, "husky_imu_odom_gps_bz2": 16806, "turtlesim_lz4": 8647,
    }  # fmt: skip
    poses = [
        Ros1Bag(bags / f"turtlesim_{kind}.bag").read({"/turtle1/pose": ("x", "theta")})["/turtle1/pose"]
        for kind in ("none", "lz4")
    ]
    np.testing.assert_array_equal(poses[0]["x"], poses[1]["x"])
    assert np.all(np.diff(Ros1Bag(bags / "unsorted_chunks.bag").read({"foo": ("data",)})["foo"].t) >= 0)


def test_a_bag_says_which_nodes_send_a_topic(tmp_path: Path) -> None:
    writer = Writer(tmp_path / "two.bag")
    with writer:
        for topic, node in (("/a", "/left"), ("/a", "/right"), ("/b", "/right"), ("/c", None)):
            connection = writer.add_connection(topic, TEXT, typestore=STORE, callerid=node)
            writer.write(connection, START_NS, bytes(STORE.serialize_ros1(make(TEXT, "hello"), TEXT)))
    log = open_log(tmp_path / "two.bag")
    assert isinstance(log, Ros1Bag)
    both, one = frozenset({"/left", "/right"}), frozenset({"/right"})
    assert log.publishers() == {"/a": both, "/b": one, "/c": frozenset()}


TEXT = "std_msgs/msg/String"
