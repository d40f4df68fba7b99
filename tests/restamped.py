"""Recorded logs with other times or other values in the same records: what a broken clock or a dead sensor leaves."""

from __future__ import annotations

import struct
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from care_core.logs.dataflash import DataFlashLog
from care_core.logs.file_windows import FileArray
from care_core.logs.mavlink_packets import find_packets
from tests.groundstation import write_tlog

Clock = Callable[[int], int]
"""The time that is written, of the one that was."""


def dataflash(source: Path, clock: Clock) -> bytes:
    """A .BIN with other stamps (us)."""
    raw = bytearray(source.read_bytes())
    log = DataFlashLog(source)
    for form in (form for forms in log._formats.values() for form in forms if form.time_field):
        for start in log._offsets[form.type].tolist():
            at = start + form.fields["TimeUS"].offset
            struct.pack_into("<Q", raw, at, clock(struct.unpack_from("<Q", raw, at)[0]))
    return bytes(raw)


def dataflash_with(source: Path, message: str, **values: float) -> bytes:
    """A .BIN whose records of a message all say the same in some fields, as stored."""
    raw = bytearray(source.read_bytes())
    log = DataFlashLog(source)
    (form,) = log._formats[message]
    for name, value in values.items():
        field = form.fields[name]
        stored = np.array(value).astype(field.dtype).tobytes()
        for start in log._offsets[form.type].tolist():
            raw[start + field.offset : start + field.offset + len(stored)] = stored
    return bytes(raw)


def dataflash_times(source: Path, message: str, factor: float, *names: str) -> bytes:
    """A .BIN with some fields of a message in another unit."""
    raw = bytearray(source.read_bytes())
    log = DataFlashLog(source)
    (form,) = log._formats[message]
    for field in (form.fields[name] for name in names):
        for start in log._offsets[form.type].tolist():
            place = slice(start + field.offset, start + field.offset + field.dtype.itemsize)
            raw[place] = (np.frombuffer(raw[place], field.dtype) * factor).astype(field.dtype).tobytes()
    return bytes(raw)


def telemetry(source: Path, clock: Clock) -> bytes:
    """A .tlog with other stamps (us)."""
    raw = bytearray(source.read_bytes())
    for start in find_packets(FileArray.open(source)).start.tolist():
        struct.pack_into(">Q", raw, start, clock(struct.unpack_from(">Q", raw, start)[0]))
    return bytes(raw)


def mcap(source: Path, clock: Clock) -> bytes:
    """A ROS 1 bag as an MCAP file in the ros1 profile, with other log times (ns)."""
    from mcap.writer import CompressionType, Writer
    from rosbags.rosbag1 import Reader

    stream = BytesIO()
    writer = Writer(stream, chunk_size=16 * 1024, compression=CompressionType.LZ4)
    writer.start(profile="ros1", library="test")
    with Reader(source) as bag:
        channels = {}
        for connection in bag.connections:
            kind = connection.msgtype.replace("/msg/", "/")
            schema = writer.register_schema(kind, "ros1msg", connection.msgdef.data.encode())
            channels[connection.id] = writer.register_channel(connection.topic, "ros1", schema)
        for connection, time_ns, raw in bag.messages():
            stamp_ns = clock(time_ns)
            writer.add_message(channels[connection.id], stamp_ns, bytes(raw), stamp_ns)
    writer.finish()  # type: ignore[no-untyped-call]
    return stream.getvalue()


def bag(source: Path, path: Path, topic: str, change: Callable[[Any], None]) -> Path:
    """A ROS 1 bag in which the messages of a topic are changed."""
    from rosbags.rosbag1 import Reader, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    with Reader(source) as read, Writer(path) as write:
        written = {
            one.id: write.add_connection(one.topic, one.msgtype, msgdef=one.msgdef.data, md5sum=one.digest)
            for one in read.connections
        }
        for connection, time_ns, raw in read.messages():
            content: bytes | memoryview = raw
            if connection.topic == topic:
                message = store.deserialize_ros1(raw, connection.msgtype)
                change(message)
                content = store.serialize_ros1(message, connection.msgtype)
            write.write(written[connection.id], time_ns, content)
    return path


CLOCKS: dict[str, Clock] = {
    "constant": lambda stamp: 60_000_000,
    "zero": lambda stamp: 0,
    "milliseconds": lambda stamp: stamp // 1000,
    "a thousand times too fast": lambda stamp: stamp * 1000 % 2**63,
    "standing still half the time": lambda stamp: stamp - stamp % 40_000_000,
}
"""What broken clocks write, in microseconds."""


def written(folder: Path, source: Path, clock: Clock, kind: str) -> Path:
    """A log with other stamps in one of three formats."""
    path = folder / f"log.{kind}"
    if kind == "tlog":
        heard = write_tlog(folder / "heard.tlog", source, np.random.default_rng(0))
        path.write_bytes(telemetry(heard, clock))
    elif kind == "mcap":
        path.write_bytes(mcap(source, lambda time_ns: 1000 * clock(time_ns // 1000)))
    else:
        path.write_bytes(dataflash(source, clock))
    return path
