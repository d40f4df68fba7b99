"""ROS messages made at random, the same recording in every container, and all that rosbags reads in a message."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from mcap.writer import CompressionType, Writer
from rosbags.interfaces import Nodetype
from rosbags.rosbag1 import Writer as BagWriter
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Writer as Ros2Writer
from rosbags.typesys import Stores, get_typestore

ROS1 = get_typestore(Stores.ROS1_NOETIC)
ROS2 = get_typestore(Stores.ROS2_HUMBLE)

START_NS = 1_600_000_000_000_000_000
SECOND_NS = 1_000_000_000
MESSAGES = 60

IMU, TEXT = "sensor_msgs/msg/Imu", "std_msgs/msg/String"
WANTED = {
    "/imu": ("header.stamp", "header.frame_id", "linear_acceleration.x", "linear_acceleration_covariance", "nothing"),
    "/note": ("data",),
    "/absent": ("x",),
}
_TIMES = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")


def make(store: Any, name: str, *values: Any) -> Any:
    return store.types[name](*values)


def stamp(store: Any, time_ns: int) -> Any:
    return make(store, "builtin_interfaces/msg/Time", time_ns // SECOND_NS, time_ns % SECOND_NS)


def imu(store: Any, row: int, time_ns: int) -> Any:
    frame = "x" * (row % 5)
    first = (0,) if store is ROS1 else ()
    header = make(store, "std_msgs/msg/Header", *first, stamp(store, time_ns), frame)
    vector = make(store, "geometry_msgs/msg/Vector3", float(row), -0.5 * row, 2.0)
    turn = make(store, "geometry_msgs/msg/Quaternion", 0.0, 0.0, 0.0, 1.0)
    square = np.arange(9, dtype=np.float64) + row
    return make(store, IMU, header, turn, square, vector, square, vector, square)


def recording(store: Any) -> Iterator[tuple[str, str, int, Any]]:
    """Topic, type, record time and message."""
    for row in range(MESSAGES):
        time_ns = START_NS + row * SECOND_NS // 10
        yield "/imu", IMU, time_ns, imu(store, row, time_ns)
        yield "/note", TEXT, time_ns + 1, make(store, TEXT, f"message {row} é")


def cdr(message: Any, *, little: bool = True) -> bytes:
    return bytes(ROS2.serialize_cdr(message, message.__msgtype__, little_endian=little))


def definition(name: str, store: Any = ROS2) -> str:
    text, _ = store.generate_msgdef(name, ros_version=1 if store is ROS1 else 2)
    return str(text)


class McapFile:
    """Writes an MCAP file message by message; `options` go to the writer of the mcap library."""

    def __init__(self, path: Path, *, profile: str = "ros2", **options: Any) -> None:
        self.writer = Writer(str(path), **{"compression": CompressionType.NONE, "chunk_size": 1024, **options})
        self.writer.start(profile, "tests")
        self.channels: dict[tuple[str, str], int] = {}

    def __enter__(self) -> McapFile:
        return self

    def __exit__(self, *_: object) -> None:
        self.writer.finish()  # type: ignore[no-untyped-call]

    def add(
        self, topic: str, kind: str, time_ns: int, data: bytes, *, text: str | None = None, language: str = "ros2msg",
        encoding: str = "cdr",
    ) -> None:  # fmt: skip
        if (topic, kind) not in self.channels:
            schema = self.writer.register_schema(kind, language, (definition(kind) if text is None else text).encode())
            self.channels[topic, kind] = self.writer.register_channel(topic, encoding, schema)
        self.writer.add_message(self.channels[topic, kind], time_ns, data, time_ns)


def write_mcap(path: Path, **options: Any) -> None:
    with McapFile(path, **options) as log:
        for topic, kind, time_ns, message in recording(ROS2):
            log.add(topic, kind, time_ns, cdr(message))


def write_ros1_mcap(path: Path, messages: Sequence[tuple[str, str, int, Any]] | None = None) -> None:
    with McapFile(path, profile="ros1", compression=CompressionType.LZ4) as log:
        for topic, kind, time_ns, message in messages or list(recording(ROS1)):
            data = bytes(ROS1.serialize_ros1(message, kind))
            name = kind.replace("/msg/", "/")
            log.add(topic, name, time_ns, data, text=definition(kind, ROS1), language="ros1msg", encoding="ros1")


def write_db3(
    folder: Path,
    *,
    mode: CompressionMode = CompressionMode.NONE,
    custom: Mapping[str, str] | None = None,
    messages: Sequence[tuple[str, str, int, Any]] | None = None,
    plugin: StoragePlugin = StoragePlugin.SQLITE3,
) -> Path:
    """A bag folder; the answer is its database file."""
    writer = Ros2Writer(folder, version=9, storage_plugin=plugin)
    if mode is not CompressionMode.NONE:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    for key, value in (custom or {}).items():
        writer.set_custom_data(key, value)
    with writer:
        connections: dict[str, Any] = {}
        for topic, kind, time_ns, message in messages or list(recording(ROS2)):
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=ROS2)
            writer.write(connections[topic], time_ns, cdr(message))
    return next(path for path in sorted(folder.iterdir()) if path.name != "metadata.yaml")


def write_bag(path: Path, rows: range = range(MESSAGES), *, chunk_bytes: int = 1024, later_s: int = 0) -> None:
    writer = BagWriter(path)
    writer.chunk_threshold = chunk_bytes
    with writer:
        connections: dict[str, Any] = {}
        for topic, kind, time_ns, message in list(recording(ROS1))[2 * rows.start : 2 * rows.stop]:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=ROS1)
            writer.write(connections[topic], time_ns + later_s * SECOND_NS, bytes(ROS1.serialize_ros1(message, kind)))


def leaves(store: Any, name: str) -> Iterator[str]:
    """Dotted paths of all fields of a type that hold no further message."""
    for field, (kind, detail) in store.fielddefs[name][1]:
        inner = detail[0] if kind in (Nodetype.ARRAY, Nodetype.SEQUENCE) else (kind, detail)
        if inner[0] == Nodetype.NAME and inner[1] not in _TIMES:
            yield from (f"{field}.{rest}" for rest in leaves(store, inner[1]))
        else:
            yield field


def value_at(message: Any, path: str, zero_ns: int) -> Any:
    """What a reader is to answer for a path of a message that rosbags has read."""
    if isinstance(message, list) and (path or not message or hasattr(message[0], "__msgtype__")):
        return [value_at(one, path, zero_ns) for one in message]
    if path:
        field, _, rest = path.partition(".")
        return value_at(getattr(message, field), rest, zero_ns)
    kind = getattr(message, "__msgtype__", "")
    if kind == _TIMES[0]:
        time_ns = message.sec * SECOND_NS + message.nanosec
        return (time_ns - zero_ns) / 1e9 if time_ns else math.nan
    return message.sec + message.nanosec / 1e9 if kind == _TIMES[1] else message


def is_same(found: Any, expected: Any) -> bool:
    if isinstance(expected, (list, np.ndarray)):
        return len(found) == len(expected) and all(map(is_same, found, expected))
    if isinstance(expected, str):
        return bool(found == expected)
    return math.isclose(found, expected, rel_tol=1e-12, abs_tol=1e-9) or (math.isnan(found) and math.isnan(expected))


def random_message(store: Any, name: str, rng: np.random.Generator) -> Any:
    """A message of any type with random values; sequences have up to three elements."""
    fields = store.fielddefs[name][1]
    return make(store, name, *(_random(store, kind, detail, rng) for _, (kind, detail) in fields))


def _random(store: Any, kind: Nodetype, detail: Any, rng: np.random.Generator) -> Any:
    if kind == Nodetype.NAME:
        return random_message(store, detail, rng)
    if kind == Nodetype.BASE:
        return _random_value(detail[0], rng)
    (inner, inner_detail), count = detail
    size = count if kind == Nodetype.ARRAY else int(rng.integers(0, min(count or 3, 3) + 1))
    values = [_random(store, inner, inner_detail, rng) for _ in range(size)]
    if inner == Nodetype.NAME or inner_detail[0] == "string":
        return values
    return np.array(values, {"byte": "i1", "char": "u1", "octet": "u1"}.get(inner_detail[0], inner_detail[0]))


def _random_value(kind: str, rng: np.random.Generator) -> Any:
    if kind == "string":
        return "é" * int(rng.integers(0, 6))
    if kind == "bool":
        return bool(rng.integers(0, 2))
    if kind.startswith("float"):
        return float(np.float32(rng.normal()))
    limits = np.iinfo({"byte": "i1", "char": "u1", "octet": "u1"}.get(kind, kind))
    if kind == "byte":  # unsigned in ROS 2, but rosbags reads it as signed
        return int(rng.integers(0, limits.max, endpoint=True))
    return int(rng.integers(limits.min, limits.max, dtype=limits.dtype, endpoint=True))
