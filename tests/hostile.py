"""Small files that claim, or unpack to, far more than they hold. Each maker writes one into a folder and names it."""

from __future__ import annotations

import bz2
import io
import json
import shutil
import sqlite3
import struct
import zipfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import IO

import lz4.frame  # type: ignore[import-untyped]
import numpy as np
import zstandard

from care_core.files import bundled
from tests.ros_samples import ROS2, START_NS, TEXT, McapFile, cdr, make, write_db3, write_mcap

Maker = Callable[[Path], Path]

MEGABYTE = 1_000_000
FLIGHT = bundled("samples", "arducopter_failed.BIN")


def aliases(depth: int = 30) -> str:
    """YAML of some 600 bytes that stands for 2**30 values."""
    lines = [f"a{n}: &a{n} [*a{n - 1},*a{n - 1}]" for n in range(1, depth)]
    return "\n".join(["a0: &a0 [x,x]", *lines, ""])


NESTED = "[" * 200_000


def ros1_record(data: bytes, **fields: bytes) -> bytes:
    header = b"".join(
        struct.pack("<I", len(name) + 1 + len(value)) + name.encode() + b"=" + value for name, value in fields.items()
    )
    return struct.pack("<I", len(header)) + header + struct.pack("<I", len(data)) + data


def ros1_connection(number: int, topic: str, kind: str, definition: str) -> bytes:
    pairs = (b"topic=" + topic.encode(), b"type=" + kind.encode(), b"message_definition=" + definition.encode())
    described = b"".join(struct.pack("<I", len(one)) + one for one in pairs)
    return ros1_record(described, op=b"\x07", conn=struct.pack("<I", number), topic=topic.encode())


def ros1_message(number: int, data: bytes) -> bytes:
    return ros1_record(data, op=b"\x02", conn=struct.pack("<I", number), time=struct.pack("<II", 1_600_000_000, number))


def ros1_chunk(compression: str, packed: bytes, size: int) -> bytes:
    return ros1_record(packed, op=b"\x05", compression=compression.encode(), size=struct.pack("<I", size))


def write_ros1(path: Path, records: Iterable[bytes]) -> Path:
    head = ros1_record(b" " * 4027, op=b"\x03", index_pos=bytes(8), conn_count=bytes(4), chunk_count=bytes(4))
    path.write_bytes(b"".join([b"#ROSBAG V2.0\n", head, *records]))
    return path


def bag_of_bombs(compression: str, chunks: int, size: int, *, honest: bool) -> Maker:
    """Chunks of zeros behind one message, the same again and again."""

    def write(folder: Path) -> Path:
        plain = ros1_message(0, b"") + bytes(size)
        packed = bz2.compress(plain, 1) if compression == "bz2" else bytes(lz4.frame.compress(plain))
        chunk = ros1_chunk(compression, packed, len(plain) if honest else 100)
        topic = ros1_connection(0, "/rosout", "rosgraph_msgs/Log", "string msg")
        return write_ros1(folder / "bomb.bag", [topic, *[chunk] * chunks])

    return write


def doubling_definition(folder: Path) -> Path:
    """40 topics whose message doubles at each of 40 levels."""
    parts = [f"MSG: p/T{n}\nT{n + 1} a\nT{n + 1} b\n" for n in range(40)] + ["MSG: p/T40\nuint8 a\n"]
    text = "p/T0 a\n" + "".join("=" * 80 + f"\n{part}" for part in parts)
    kind = "dynamic_reconfigure/Config"
    topics = [ros1_connection(n, f"/n{n}/parameter_updates", kind, f"# {n}\n{text}") for n in range(40)]
    plain = b"".join([*topics, *(ros1_message(n, bytes(8)) for n in range(40))])
    return write_ros1(folder / "doubling.bag", [ros1_chunk("none", plain, len(plain))])


def long_array_definition(folder: Path) -> Path:
    """An array whose declared length has 5000 digits."""
    kind = "dynamic_reconfigure/Config"
    topic = ros1_connection(0, "/move_base/parameter_updates", kind, f"uint8[{'9' * 5000}] a")
    plain = topic + ros1_message(0, bytes(8))
    return write_ros1(folder / "digits.bag", [ros1_chunk("none", plain, len(plain))])


def same_message_again(folder: Path) -> Path:
    """An index that names one message of a megabyte 400,000 times."""
    topic = ros1_connection(0, "/rosout", "rosgraph_msgs/Log", "string msg")
    plain = ros1_message(0, struct.pack("<I", MEGABYTE) + bytes(MEGABYTE))
    entries = struct.pack("<III", 1_600_000_000, 0, 0) * 400_000
    count = struct.pack("<I", 400_000)
    index = ros1_record(entries, op=b"\x04", ver=b"\x01\0\0\0", conn=bytes(4), count=count)
    chunk = ros1_chunk("lz4", bytes(lz4.frame.compress(plain)), len(plain))
    return write_ros1(folder / "again.bag", [topic, chunk, index])


def overflow_in_circles(folder: Path) -> Path:
    """A row of 5.9 GB on an overflow page that is followed by itself."""
    path = write_db3(folder / "bag")
    raw = bytearray(path.read_bytes())
    at = raw.index(b"serialization_format TEXT")
    raw[at : at + 4] = b"\xff" * 4
    size = int.from_bytes(raw[16:18], "big")
    pages = len(raw) // size
    blob = 5_900_000_000
    types = b"\0\x01" + _varint(2 * blob + 13)
    header = bytes([len(types) + 1]) + types
    total = len(header) + 1 + blob
    least = (size - 12) * 32 // 255 - 23
    local = least + (total - least) % (size - 4)
    local = local if local <= size - 35 else least
    body = (header + b"\x09").ljust(local, b"x")
    cell = _varint(total) + b"\x7f" + body + (pages + 2).to_bytes(4, "big")
    leaf = bytearray(size)
    place = (size - len(cell)).to_bytes(2, "big")
    leaf[:10] = b"\x0d\0\0\0\x01" + place + b"\0" + place
    leaf[size - len(cell) :] = cell
    circle = (pages + 2).to_bytes(4, "big") + bytes(size - 4)
    path.write_bytes(bytes(raw) + bytes(leaf) + circle)
    return path


def _varint(value: int) -> bytes:
    parts = [value & 0x7F]
    while value := value >> 7:
        parts.append(value & 0x7F | 0x80)
    return bytes(reversed(parts))


def _database(path: Path, messages: str) -> Path:
    database = sqlite3.connect(path)
    database.executescript(f"""
        create table topics (id integer primary key, name text, type text, serialization_format text);
        insert into topics values (1, '/rosout', 'rcl_interfaces/msg/Log', 'cdr');
        {messages}
    """)
    database.close()
    return path


def endless_view(folder: Path) -> Path:
    """A table of messages that is a view of a recursion without end."""
    return _database(folder / "view.db3", """
        create view messages as with recursive n(i) as (select 1 union all select i + 1 from n)
            select i as id, 1 as topic_id, 1600000000000000000 + i as timestamp, zeroblob(100000) as data from n;
    """)  # fmt: skip


def computed_column(folder: Path) -> Path:
    """A message whose data SQLite is to compute when it is read."""
    return _database(folder / "computed.db3", """
        create table messages (id integer primary key, topic_id integer, timestamp integer,
                               data blob generated always as (zeroblob(900000000)));
        insert into messages (topic_id, timestamp) values (1, 1600000000000000000), (1, 1600000001000000000);
    """)  # fmt: skip


def metadata_beside(text: str) -> Maker:
    def write(folder: Path) -> Path:
        path = write_db3(folder / "bag")
        (path.parent / "metadata.yaml").write_text(text)
        return path.parent

    return write


def metadata_inside_db3(text: str) -> Maker:
    def write(folder: Path) -> Path:
        path = write_db3(folder / "bag")
        database = sqlite3.connect(path)
        database.executescript("""
            drop table if exists metadata;
            create table metadata (id integer primary key, metadata_version integer, metadata text);
        """)
        with database:
            database.execute("insert into metadata values (1, 9, ?)", (text,))
        database.close()
        (path.parent / "metadata.yaml").unlink()
        return path

    return write


def metadata_inside_mcap(text: str) -> Maker:
    def write(folder: Path) -> Path:
        path = folder / "meta.mcap"
        with McapFile(path) as log:
            log.add("/note", TEXT, START_NS, cdr(make(ROS2, TEXT, "a")))
            log.writer.add_metadata("rosbag2", {"serialized_metadata": text})
        return path

    return write


def packed_zeros(stream: IO[bytes], first: bytes, size: int) -> None:
    with zstandard.ZstdCompressor().stream_writer(stream, closefd=False) as packer:
        packer.write(first)
        for _ in range(size // (10 * MEGABYTE)):
            packer.write(bytes(10 * MEGABYTE))


def packed_mcap(folder: Path) -> Path:
    """Two gigabytes of zeros behind a sound MCAP file, packed into some 70 kB."""
    plain, path = folder / "a.mcap", folder / "a.mcap.zstd"
    write_mcap(plain)
    with path.open("wb") as target:
        packed_zeros(target, plain.read_bytes(), 2_000 * MEGABYTE)
    plain.unlink()
    return path


def mcap_chunk_bomb(folder: Path) -> Path:
    """A chunk that says, and does, unpack to 1.5 GB."""
    path, size = folder / "chunk.mcap", 1_500 * MEGABYTE
    packed = io.BytesIO()
    packed_zeros(packed, b"", size)
    records = packed.getvalue()
    body = struct.pack("<QQQII", START_NS, START_NS, size, 0, 4) + b"zstd" + struct.pack("<Q", len(records)) + records
    header = struct.pack("<I", 4) + b"ros2" + struct.pack("<I", 0)
    top = struct.pack("<BQ", 1, len(header)) + header
    path.write_bytes(b"\x89MCAP0\r\n" + top + struct.pack("<BQ", 6, len(body)) + body)
    return path


TEXT_HEAD = (
    b"FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\nFMT, 1, 75, MSG, QZ, TimeUS,Message\n"
    b"MSG, 1000000, ArduCopter V4.5.4\n"
)


def text_of(filling: bytes) -> Maker:
    def write(folder: Path) -> Path:
        path = folder / "a.log"
        path.write_bytes(TEXT_HEAD + filling)
        return path

    return write


def many_names(folder: Path) -> Path:
    """A text log of 1.6 million lines, nearly each with a name of its own."""
    letters = np.random.default_rng(0).integers(ord("A"), ord("Z") + 1, (1_600_000, 6), dtype=np.uint8)
    letters[:, 4], letters[:, 5] = ord(","), ord("\n")
    return text_of(letters.tobytes())(folder)


def many_types(folder: Path) -> Path:
    """A text log that declares 200,000 types, each with a line."""
    names = (bytes(65 + n // 26**place % 26 for place in range(4)) for n in range(200_000))
    return text_of(b"".join(b"FMT, 1, 9, %s, B, A\n%s, 1\n" % (name, name) for name in names))(folder)


def not_numbers(folder: Path) -> Path:
    """A text log whose numbers are none."""
    declared = (
        b"FMT, 2, 20, BAT, Qfff, TimeUS,Volt,Curr,EnrgTot\nFMT, 3, 12, MODE, QBB, TimeUS,Mode,ModeNum\n"
        b"FMT, 4, 12, ERR, QBB, TimeUS,Subsys,ECode\nFMT, 5, 12, ARM, QB, TimeUS,ArmState\n"
        b"FMT, 6, 12, EV, QB, TimeUS,Id\nFMT, 7, 30, CMD, Qfffff, TimeUS,CNum,CId,Lat,Lng,Alt\n"
        b"FMT, 8, 30, GPS, Qff, TimeUS,GWk,GMS\nFMT, 9, 30, PARM, QNf, TimeUS,Name,Value\n"
    )
    rows = (
        b"BAT, %d, nan, inf, nan\nMODE, %d, nan, nan\nERR, %d, nan, nan\nARM, %d, nan\nEV, %d, nan\n"
        b"CMD, %d, nan, nan, nan, nan, nan\nGPS, %d, nan, nan\nPARM, %d, A, nan\n"
    )
    return text_of(declared + b"".join(rows % ((1_000_000 * n,) * 8) for n in range(20)))(folder)


def profile_with(change: Callable[[Path], object]) -> Maker:
    """The bundled copter profile, changed."""

    def write(folder: Path) -> Path:
        copy = folder / "profile"
        shutil.copytree(bundled("profiles", "arducopter"), copy)
        change(copy)
        return copy

    return write


def yaml_profile(text: str) -> Maker:
    return profile_with(lambda folder: (folder / "profile.yaml").write_text(text))


def array_bomb(folder: Path) -> None:
    """200 MB of zeros in an archive of 0.2 MB."""
    _forget_digest(folder)
    buffer = io.BytesIO()
    np.save(buffer, np.zeros(25_000_000))
    with zipfile.ZipFile(folder / "mechanisms.npz", "a", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("bomb/points.npy", buffer.getvalue())


def array_shape(folder: Path) -> None:
    """Every array claims 1e15 numbers."""
    _forget_digest(folder)
    with zipfile.ZipFile(folder / "mechanisms.npz") as archive:
        names = archive.namelist()
    buffer = io.BytesIO()
    np.lib.format.write_array_header_1_0(buffer, {"descr": "<f8", "fortran_order": False, "shape": (10**15,)})
    with zipfile.ZipFile(folder / "mechanisms.npz", "w") as archive:
        for name in names:
            archive.writestr(name, buffer.getvalue())


def _forget_digest(folder: Path) -> None:
    """As a model of an earlier version, which names no digest."""
    path = folder / "model.json"
    model = json.loads(path.read_text())
    del model["arrays_sha256"]
    path.write_text(json.dumps(model))


INDENTED = "".join(f"    {line}\n" for line in aliases().splitlines())
CUSTOM = f"rosbag2_bagfile_information:\n  custom_data:\n{INDENTED}"
DIGITS = "9" * 400

LOGS: dict[str, Maker] = {
    "bz2 chunks that say what they unpack to": bag_of_bombs("bz2", 60, 100 * MEGABYTE, honest=True),
    "bz2 chunks that say less": bag_of_bombs("bz2", 60, 100 * MEGABYTE, honest=False),
    "a bz2 chunk of 200 MB": bag_of_bombs("bz2", 1, 200 * MEGABYTE, honest=True),
    "lz4 chunks": bag_of_bombs("lz4", 20, 120 * MEGABYTE, honest=True),
    "an mcap chunk of 1.5 GB": mcap_chunk_bomb,
    "an mcap.zstd of 2 GB": packed_mcap,
    "an index that names a message again and again": same_message_again,
    "a definition that doubles": doubling_definition,
    "an array of 5000 digits": long_array_definition,
    "an overflow page that follows itself": overflow_in_circles,
    "a view without end": endless_view,
    "a computed column": computed_column,
    "aliases in metadata.yaml": metadata_beside(aliases()),
    "aliases in custom data": metadata_beside(CUSTOM),
    "brackets in metadata.yaml": metadata_beside(NESTED),
    "a date that no calendar has in metadata.yaml": metadata_beside("a: 2024-13-45\n"),
    "an integer of 400 digits in metadata.yaml": metadata_beside(
        f"rosbag2_bagfile_information:\n  message_count: {DIGITS}\n  duration: {{nanoseconds: {DIGITS}}}\n"
    ),
    "an integer of 400 digits in custom data": metadata_beside(
        f"rosbag2_bagfile_information:\n  custom_data: {{/a.b: '{DIGITS}'}}\n"
    ),
    "aliases in db3 metadata": metadata_inside_db3(CUSTOM),
    "brackets in db3 metadata": metadata_inside_db3(NESTED),
    "aliases in mcap metadata": metadata_inside_mcap(CUSTOM),
    "brackets in mcap metadata": metadata_inside_mcap(NESTED),
    "a text log of line ends": text_of(b"\n" * (9 * MEGABYTE)),
    "a text log of short lines": text_of(b"a\n" * (9 * MEGABYTE // 2)),
    "a text log of names": many_names,
    "a text log of types": many_types,
    "a text log of NaN": not_numbers,
}
"""Logs below 10 MB to triage and to inspect."""

PROFILES: dict[str, Maker] = {
    "aliases": yaml_profile(aliases()),
    "brackets": yaml_profile(NESTED),
    "a date that no calendar has": yaml_profile("a: 2024-13-45\n"),
    "an integer of 400 digits": yaml_profile(f"schema_version: {DIGITS}\n"),
    "an array of 200 MB": profile_with(array_bomb),
    "arrays of huge shape": profile_with(array_shape),
}
"""Profiles to triage the bundled flight with."""
