"""Logs that are too large to be read whole: the same tables, out of few of the bytes, with words on the way."""

from __future__ import annotations

import hashlib
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from care_core import limits
from care_core.application import progress_estimate as watched
from care_core.application.progress_estimate import watching
from care_core.logs.digest import SAMPLED, hashing, log_digest
from care_core.logs.file_windows import FileBytes
from care_core.logs.mcap_records import ENTRY
from care_core.logs.message_index import MessageIndex
from care_core.logs.opening import open_log
from care_core.logs.ros_log import RosLog
from care_core.numbers import Bools

PICTURES, SMALL = 12, 5
FLIGHT = Path(__file__).parents[2] / "samples" / "arducopter_failed.BIN"
FIELDS = {"/odom": ("pose.pose.position.x",)}


def with_pictures(path: Path, packed: str) -> Path:
    """A bag or MCAP file: a few odometry messages before each large picture, one chunk each."""
    from mcap.writer import CompressionType
    from mcap.writer import Writer as McapWriter
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    types = store.types
    header = types["std_msgs/msg/Header"](0, types["builtin_interfaces/msg/Time"](0, 0), "odom")
    point, turn = types["geometry_msgs/msg/Point"], types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
    zero = types["geometry_msgs/msg/Vector3"](0.0, 0.0, 0.0)
    none = np.zeros(36)
    noise = np.random.default_rng(0).integers(0, 256, 400_000, dtype=np.uint8)
    picture = types["sensor_msgs/msg/Image"](header, 1, len(noise), "mono8", 0, len(noise), noise)
    messages = []
    for i in range(PICTURES):
        for k in range(SMALL):
            pose = types["geometry_msgs/msg/PoseWithCovariance"](
                types["geometry_msgs/msg/Pose"](point(float(i * SMALL + k), 0.0, 0.0), turn), none
            )
            twist = types["geometry_msgs/msg/TwistWithCovariance"](types["geometry_msgs/msg/Twist"](zero, zero), none)
            odom = types["nav_msgs/msg/Odometry"](header, "base", pose, twist)
            messages.append(("/odom", odom, i * 1_000_000_000 + k * 1000))
        messages.append(("/camera", picture, i * 1_000_000_000 + 500_000_000))
    described = {kind: store.generate_msgdef(kind) for kind in {message.__msgtype__ for _, message, _ in messages}}
    if path.suffix == ".bag":
        writer = Writer(path)
        writer.chunk_threshold = 300_000
        if packed:
            writer.set_compression(Writer.CompressionFormat[packed.upper()])
        with writer:
            known = {
                topic: writer.add_connection(topic, kind, msgdef=described[kind][0], md5sum=described[kind][1])
                for topic, kind in {topic: message.__msgtype__ for topic, message, _ in messages}.items()
            }
            for topic, message, time_ns in messages:
                writer.write(known[topic], 10**18 + time_ns, bytes(store.serialize_ros1(message, message.__msgtype__)))
        return path
    with path.open("wb") as stream:
        mcap = McapWriter(stream, chunk_size=300_000, compression=CompressionType[(packed or "none").upper()])
        mcap.start(profile="ros1", library="test")
        channels: dict[str, int] = {}
        for topic, message, time_ns in messages:
            kind = message.__msgtype__
            if topic not in channels:
                schema = mcap.register_schema(kind.replace("/msg/", "/"), "ros1msg", described[kind][0].encode())
                channels[topic] = mcap.register_channel(topic, "ros1", schema)
            raw = bytes(store.serialize_ros1(message, kind))
            mcap.add_message(channels[topic], 10**18 + time_ns, raw, 10**18 + time_ns)
        mcap.finish()  # type: ignore[no-untyped-call]
    return path


@pytest.fixture
def read_bytes(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many bytes each read of a file asks for."""
    sizes: list[int] = []
    original = FileBytes._read

    def read(self: FileBytes, low: int, size: int) -> bytes:
        sizes.append(size)
        return original(self, low, size)

    monkeypatch.setattr(FileBytes, "_read", read)
    return sizes


@pytest.mark.parametrize(
    ("name", "packed"),
    [("a.bag", ""), ("a.bag", "lz4"), ("a.bag", "bz2"), ("a.mcap", ""), ("a.mcap", "lz4"), ("a.mcap", "zstd")],
)
def test_a_large_log_gives_the_same_from_few_of_its_bytes(
    name: str, packed: str, tmp_path: Path, read_bytes: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = with_pictures(tmp_path / name, packed)
    whole = open_log(path).read(FIELDS)["/odom"]
    monkeypatch.setattr(limits, "WHOLE_BYTES", 1000)
    read_bytes.clear()
    log = open_log(path)
    part = log.read(FIELDS)["/odom"]
    np.testing.assert_array_equal(part.t, whole.t)
    np.testing.assert_array_equal(part["pose.pose.position.x"], np.arange(PICTURES * SMALL))
    assert log.damage == ()
    # zstd gives nothing before a block of 128 kB is there, bz2 before one of 900 kB.
    assert sum(read_bytes) < {"bz2": 1.1, "zstd": 0.75}.get(packed, 0.3) * path.stat().st_size


def test_a_chunk_is_needed_up_to_the_message_behind_the_last_wanted_one() -> None:
    rng = np.random.default_rng(0)
    chunks = []
    for chunk in range(40):
        places = rng.permutation(1000)[: rng.integers(0, 9) * (chunk % 3)].tolist()
        index = {number: [(0, place) for place in places[number::2]] for number in range(2)}
        chunks.append((chunk, {number: np.array(found, ENTRY).tobytes() for number, found in index.items()}))
    index_of_all = MessageIndex(chunks, ENTRY)
    count = len(index_of_all.times_of([1])[1])
    chosen = list(index_of_all.chosen({1: np.sort(rng.permutation(count)[: count // 2])}))
    assert sum(len(one.rows) for one in chosen) == count // 2
    for one in chosen:
        low, high = index_of_all.bounds[one.chunk : one.chunk + 2]
        assert all(low <= row < high for row in one.rows)
        last = max(index_of_all.offsets[one.rows])
        assert one.needed == min((at for at in index_of_all.offsets[low:high] if at > last), default=0)
    assert not list(index_of_all.chosen({}))


@pytest.mark.parametrize(("name", "packed"), [("a.bag", "lz4"), ("a.mcap", "zstd")])
@pytest.mark.parametrize("whole", [1000, limits.WHOLE_BYTES])
def test_packed_chunks_are_fetched_while_the_one_before_is_unpacked(
    name: str, packed: str, whole: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(limits, "WHOLE_BYTES", whole)
    log = open_log(with_pictures(tmp_path / name, packed))
    happened: list[tuple[str, int, int]] = []
    original = FileBytes._read

    def read(self: FileBytes, low: int, size: int) -> bytes:
        happened.append(("read", low, low + size))
        return original(self, low, size)

    monkeypatch.setattr(FileBytes, "_read", read)
    monkeypatch.setattr(FileBytes, "_fetch", lambda _, low, high: happened.append(("fetch", low, high)))
    log.read(FIELDS)
    fetched = [(low, high) for what, low, high in happened if what == "fetch"]
    assert len(fetched) == PICTURES
    first = next(i for i, (what, low, _) in enumerate(happened) if what == "read" and low)
    assert len([what for what, *_ in happened[:first] if what == "fetch"]) > 1
    for what, low, high in happened[first:]:
        assert what == "fetch" or any(begin <= low and high <= end for begin, end in fetched)


@pytest.mark.parametrize(("name", "packed"), [("a.bag", "lz4"), ("a.mcap", "zstd")])
def test_a_chunk_that_is_broken_before_what_is_asked_for_is_told(
    name: str, packed: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = with_pictures(tmp_path / name, packed)
    monkeypatch.setattr(limits, "WHOLE_BYTES", 1000)
    content = bytearray(path.read_bytes())
    magic = b"\x04\x22\x4d\x18" if packed == "lz4" else b"\x28\xb5\x2f\xfd"
    third = [at for at in range(len(content)) if content[at : at + 4] == magic][2]
    content[third : third + 64] = bytes(64)
    path.write_bytes(content)
    log = open_log(path)
    table = log.read(FIELDS)["/odom"]
    assert len(table) == (PICTURES - 1) * SMALL
    assert any("chunk" in damage.what for damage in log.damage)


def test_settings_are_read_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    reads = []
    original = RosLog.read

    def read(self: RosLog, *args: object) -> object:
        reads.append(args)
        return original(self, *args)  # type: ignore[arg-type]

    monkeypatch.setattr(RosLog, "read", read)
    log = open_log(Path(__file__).parents[1] / "data" / "move_base_good.bag")
    assert log.settings() is log.settings()
    assert len(reads) == 1


def test_the_digest_of_a_large_log_is_marked_and_tells_logs_apart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "log"
    content = bytearray(np.random.default_rng(0).bytes(300_000))
    path.write_bytes(content)
    assert log_digest(path) == hashlib.sha256(content).hexdigest()
    monkeypatch.setattr(limits, "WHOLE_BYTES", 1000)
    first = log_digest(path)
    assert first.startswith(SAMPLED)
    assert first == log_digest(path)
    for change in (0, len(content) - 1):
        path.write_bytes(content[:change] + bytes([content[change] ^ 1]) + content[change + 1 :])
        assert log_digest(path) != first
    path.write_bytes(content + b"\0")
    assert log_digest(path) != first


def test_nobody_waits_for_a_digest_that_is_not_wanted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from care_core.logs import digest

    pieces = []
    begun = threading.Event()

    def whole(stream: object) -> Iterator[bytes]:
        for i in range(60_000):
            pieces.append(i)
            yield b"x"
            begun.set()
            time.sleep(0.001)

    monkeypatch.setattr(digest, "_whole", whole)
    path = tmp_path / "log"
    path.write_bytes(b"content")

    def interrupted() -> None:
        with hashing(path):
            begun.wait(5)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert len(pieces) < 60_000


def test_the_reader_tells_bytes_and_the_time_that_is_left(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[tuple[str, float]] = []
    now = [0.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    with watching(lambda step, share: told.append((step, share))) as progress:
        progress("opening the log", 0.0)
        for second in (0.01, 0.5, 2.0, 2.05):
            now[0] = second
            progress.at(int(second * 1e9), 5_000_000_000)
        progress.at(10, 100)
    assert told == [
        ("opening the log", 0.0),
        ("opening the log: 0.5 of 5.0 GB", 0.0),
        ("opening the log: 2.0 of 5.0 GB, 3 s left", 0.0),
    ]


def test_work_that_is_taken_back_ends_inside_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = with_pictures(tmp_path / "a.bag", "")
    monkeypatch.setattr(watched, "_TELL_S", 0.0)

    class TakenBack(BaseException):
        pass

    def progress(step: str, _share: float) -> None:
        if asked:
            raise TakenBack
        asked.append(step)

    asked: list[str] = []
    with watching(progress) as inner:
        inner("opening the log", 0.0)
        with pytest.raises(TakenBack):
            open_log(path)


def test_what_is_held_of_a_dataflash_log_changes_no_value(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a log that is held whole and of one of which some bytes are: the same times and columns, of all rows, of a
    stretch, of every third, of those of a mask, and of a stretch of these."""
    wanted = {"ATT": ("Roll", "Pitch", "DesRoll"), "XKF4": ("C", "SV"), "MSG": ("Message",), "FMT": ("Name",)}
    held = open_log(FLIGHT).read(wanted)
    for name in ("HELD_BYTES", "VALUES_BYTES", "LEAST_VALUES_BYTES"):
        monkeypatch.setattr(limits, name, 64)
    read = open_log(FLIGHT).read(wanted)
    assert read.keys() == held.keys() == wanted.keys()
    for name, fields in wanted.items():
        own, other = held[name], read[name]
        mask = np.arange(len(own)) % 5 > 1
        rows: list[slice | Bools] = [slice(None), slice(7, 20), slice(2, None, 3), slice(0, 0)]
        rows += [mask, np.zeros(len(own), dtype=bool)]
        pairs = [(own.where(some), other.where(some)) for some in rows]
        pairs.append((own.where(mask).where(slice(3, 9)), other.where(mask).where(slice(3, 9))))
        for one, two in pairs:
            assert len(one) == len(two) == len(two.t)
            np.testing.assert_array_equal(one.t, two.t)
            for field in fields:
                np.testing.assert_array_equal(one[field], two[field])
