"""Real logs broken where it hurts: `python -m benchmarks.tools.mutating LOG... [--count 3000] [--seed 0] [--kept DIR]`.

The fuzzer breaks small files byte by byte; here whole recordings are taken apart by their own format and put together
again with one to three things wrong that a sound file never has: declared lengths, counts, types and texts, stamps,
values that are no numbers or a thousand times too large, messages left out or said twice. Checksums are made right
again, so that what is wrong gets past them. Each is triaged or inspected by the command, in a process with limits.

Printed are, for each format, how many there were, how they ended, the most memory and time that one took, and whatever
is a finding: a traceback, an error called unexpected, a death, more than 1 GB or 20 s of the processor. A log that
failed and is called fine after the change is listed too, for somebody to look at: where the change took the failure
out, it is right.
"""

from __future__ import annotations

import argparse
import bz2
import os
import resource
import shutil
import sqlite3
import struct
import sys
import tempfile
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from importlib import import_module
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import lz4.frame  # type: ignore[import-untyped]
import numpy as np
import zstandard

import care_core
from care_core.errors import CareError, ExitCode
from care_core.files import bundled
from care_core.logs import formats, mavlink_packets
from care_core.logs.dataflash import DataFlashLog, Format
from care_core.logs.file_windows import FileArray
from care_core.logs.formats import LogFormat
from care_core.logs.opening import open_log

MOST_MB, MOST_S = 1000, 20
COMMANDS = (("triage", "--no-history"), ("triage", "--no-history", "--json"), ("inspect",))
NUMBERS = (0, 1, -1, 3, 127, 255, 1 << 15, 1 << 16, (1 << 31) - 1, -(1 << 31), 1 << 32, (1 << 63) - 1)
FRACTIONS = (np.nan, np.inf, -np.inf, 0.0, -1.0, 1e-300, 1e30, -1e30, 1e300)
TEXTS = (
    "",
    "\x1b]52;c;aGk=\x07",
    "[bold red]x[/]",
    "a" * 60,
    "/",
    "..",
    "\0",
    "nan",
    "%s{0}",
    "\u202e\u2028",
    "-",
    "9" * 40,
)

Rng = np.random.Generator
Clock = Callable[[int], int]


class Broken(NamedTuple):
    """A file's new bytes and what was done to it."""

    data: bytes
    what: str


def pick(rng: Rng, values: Sequence[Any]) -> Any:
    return values[int(rng.integers(len(values)))]


def clock(rng: Rng) -> tuple[str, Clock]:
    """A clock that is wrong, from the stamp that was to the one that is written."""
    at = int(rng.integers(1, 1 << 62))
    turn = int(rng.integers(20, 200)) * 1_000_000
    clocks: list[tuple[str, Clock]] = [
        ("constant", lambda _: 60_000_000), ("zero", lambda _: 0), ("ms as us", lambda t: t // 1000),
        ("us as ns", lambda t: t * 1000), ("back", lambda t: (1 << 50) - t), ("wraps", lambda t: t % turn),
        ("far", lambda t: t + at), ("at random", lambda _: int(rng.integers(1 << 40))),
        ("doubled", lambda t: 2 * t), ("jumps back", lambda t: t - turn // 2 if t > turn else t),
        ("stands", lambda t: min(t, turn)), ("all bits", lambda _: (1 << 64) - 1),
    ]  # fmt: skip
    return clocks[int(rng.integers(len(clocks)))]


def number_as(dtype: np.dtype[Any], rng: Rng) -> bytes:
    """An extreme of a kind of number as it is stored."""
    if dtype.kind == "S":
        return str(pick(rng, TEXTS)).encode()[: dtype.itemsize].ljust(dtype.itemsize, b"\0")
    if dtype.kind == "f":
        with np.errstate(over="ignore"):
            return np.array(pick(rng, FRACTIONS)).astype(dtype).tobytes()
    value = int(pick(rng, NUMBERS)) % (1 << 8 * dtype.base.itemsize)
    return value.to_bytes(dtype.base.itemsize, "big" if dtype.base.byteorder == ">" else "little") * (
        dtype.itemsize // dtype.base.itemsize
    )


def some(rng: Rng, count: int) -> list[int]:
    """Which of the records of a message: all, those from one on, one, or a few."""
    if not count:
        return []
    kind, at = int(rng.integers(4)), int(rng.integers(count))
    if kind == 0:
        return list(range(count))
    if kind == 1:
        return list(range(at, count))
    return [at] if kind == 2 else sorted({int(n) for n in rng.integers(count, size=min(count, 30))})


# DataFlash


@cache
def _dataflash(path: Path) -> DataFlashLog:
    return DataFlashLog(path)


def dataflash(path: Path, rng: Rng) -> Broken:
    log, raw = _dataflash(path), bytearray(path.read_bytes())
    forms = [found[-1] for found in log._formats.values() if len(log._offsets[found[-1].type])]
    likely = [form for form in forms if form.name in _TELLING]
    form = pick(rng, likely) if likely and rng.random() < 0.7 else pick(rng, forms)
    offsets = log._offsets[form.type].tolist()
    kind = int(rng.integers(9))
    if kind == 0:
        declared = [offset for offset in log._offsets[0x80].tolist() if raw[offset + 3] == form.type]
        return _declaration(raw, form, declared[0] + 3, rng) if declared else Broken(bytes(raw), "nothing")
    if kind in (1, 2):
        name, change = clock(rng)
        for one in forms if kind == 1 else [form]:
            _restamp(raw, one, log._offsets[one.type].tolist(), change)
        return Broken(bytes(raw), f"clock {name} of {form.name if kind == 2 else 'all'}")
    if kind < 7 and form.fields:
        return _values(raw, form, offsets, rng)
    gone = set(some(rng, len(offsets)))
    parts, at = [], 0
    for number, offset in enumerate(offsets):
        if number in gone:
            end = offset + form.length
            parts += [raw[at:offset]] if kind == 7 else [raw[at:end], raw[offset:end]]
            at = end
    what = "left out" if kind == 7 else "twice"
    return Broken(b"".join(map(bytes, [*parts, raw[at:]])), f"{form.name}: {len(gone)} of {len(offsets)} {what}")


_TELLING = frozenset(
    [
        "BAT",
        "POS",
        "ATT",
        "GPS",
        "CMD",
        "MODE",
        "ARM",
        "EV",
        "ERR",
        "MSG",
        "PARM",
        "CTUN",
        "RCOU",
        "XKF4",
        "NKF4",
        "VIBE",
        "MAG",
        "IMU",
    ]
)


def _declaration(raw: bytearray, form: Format, at: int, rng: Rng) -> Broken:
    part = int(rng.integers(5))
    if part == 0:
        raw[at] = int(rng.integers(256))
    elif part == 1:
        raw[at + 1] = pick(rng, [0, 1, 2, 3, 4, 255, (raw[at + 1] + 1) % 256, raw[at + 1] - 1])
    elif part == 2:
        raw[at + 2 : at + 6] = number_as(np.dtype("S4"), rng)
    elif part == 3:
        raw[at + 6 + int(rng.integers(len(form.code) or 1))] = ord(pick(rng, "abBhHiIqQgfdnNZMcCeEL?\0"))
    else:
        raw[at + 22 : at + 86] = number_as(np.dtype("S64"), rng)
    return Broken(bytes(raw), f"FMT of {form.name}, part {part}")


def _restamp(raw: bytearray, form: Format, offsets: Sequence[int], change: Clock) -> None:
    if form.time_field is None:
        return
    field = form.fields[form.time_field[0]]
    size = field.dtype.itemsize
    for offset in offsets:
        place = slice(offset + field.offset, offset + field.offset + size)
        stamp = change(int.from_bytes(raw[place], "little")) & ((1 << 8 * size) - 1)
        raw[place] = stamp.to_bytes(size, "little")


def _values(raw: bytearray, form: Format, offsets: Sequence[int], rng: Rng) -> Broken:
    name = pick(rng, list(form.fields))
    field, way = form.fields[name], pick(rng, ["extreme", "constant", "x1000"])
    rows, stored = some(rng, len(offsets)), number_as(form.fields[name].dtype, rng)
    first = bytes(raw[offsets[0] + field.offset : offsets[0] + field.offset + field.dtype.itemsize])
    for row in rows:
        place = slice(offsets[row] + field.offset, offsets[row] + field.offset + field.dtype.itemsize)
        here = stored if way == "extreme" else first
        if way == "x1000" and field.kind == "number":
            with np.errstate(all="ignore"):
                here = (np.frombuffer(bytes(raw[place]), field.dtype) * 1000).astype(field.dtype).tobytes()
        raw[place] = here
    return Broken(bytes(raw), f"{form.name}.{name} of {len(rows)} of {len(offsets)}: {way} {stored[:8]!r}")


# Text


def text(path: Path, rng: Rng) -> Broken:
    lines = path.read_bytes().split(b"\n")
    heads = Counter(line.partition(b",")[0] for line in lines)
    name = pick(rng, sorted(heads))
    own = [at for at, line in enumerate(lines) if line.partition(b",")[0] == name]
    kind = int(rng.integers(4))
    rows = [own[row] for row in some(rng, len(own))]
    word = str(pick(rng, [*TEXTS, "nan", "inf", "1e999", "-1", "0x1", "1_0", "\u0661"])).encode()
    place = int(rng.integers(1, 12))
    for row in rows:
        values = lines[row].split(b",")
        if kind == 0 and place < len(values):
            values[place] = b" " + word
        elif kind == 1:
            values = values[:place]
        elif kind == 2:
            values.insert(place, word)
        else:
            values = []
        lines[row] = b",".join(values)
    return Broken(
        b"\n".join(lines),
        f"{name!r} {len(rows)} of {len(own)}: {('word', 'short', 'long', 'gone')[kind]} {place} {word!r}",
    )


# MAVLink


def telemetry(path: Path, rng: Rng) -> Broken:
    raw = bytearray(path.read_bytes())
    data = FileArray(BytesIO(raw), path)
    packets = mavlink_packets.find_packets(data)
    if not len(packets):
        return Broken(bytes(raw[: int(rng.integers(len(raw)))]), "cut")
    kind = int(rng.integers(4))
    if kind == 0:
        name, change = clock(rng)
        for start in packets.start.tolist():
            struct.pack_into(">Q", raw, start, change(struct.unpack_from(">Q", raw, start)[0]) & ((1 << 64) - 1))
        return Broken(bytes(raw), f"clock {name}")
    number = pick(rng, np.unique(packets.id).tolist())
    own = packets.where(packets.id == number)
    message = mavlink_packets.definitions()[number]
    rows = some(rng, len(own))
    if kind == 1:
        gone = {(int(own.start[row]), int(own.end[row])) for row in rows}
        parts, at = [], 0
        for low, high in sorted(gone):
            parts.append(raw[at:low])
            at = high
        return Broken(b"".join(map(bytes, [*parts, raw[at:]])), f"{message.name}: {len(rows)} left out")
    field_name = pick(rng, list(message.fields))
    field = message.fields[field_name]
    stored = number_as(field.dtype, rng)
    first, size = mavlink_packets.payloads(data, own.start)
    for row in rows:
        for at, byte in enumerate(stored):
            if field.offset + at < size[row]:
                raw[int(first[row]) + field.offset + at] = byte
    changed = FileArray(BytesIO(raw), path)
    chosen = own.where(np.array(rows, dtype=np.int64))
    summed, _ = mavlink_packets._sums(changed, chosen)
    right = mavlink_packets._step(summed, np.full(len(summed), message.extra, np.uint8))
    tails = first[rows] + size[rows]
    for tail, value in zip(tails.tolist(), right.tolist(), strict=True):
        struct.pack_into("<H", raw, tail, value)
    return Broken(bytes(raw), f"{message.name}.{field_name} of {len(rows)} of {len(own)}: {stored[:8]!r}")


# Messages of ROS, whatever file they are in


def payload(data: bytes, rng: Rng) -> bytes:
    """A serialised message with a length, a number or its end changed."""
    raw = bytearray(data)
    if len(raw) < 5:
        return bytes(raw)
    kind = int(rng.integers(4))
    at = int(rng.integers(len(raw) // 4)) * 4
    if kind == 0:
        raw[at : at + 4] = number_as(np.dtype("<u4"), rng)
    elif kind == 1:
        wide = at // 8 * 8 + 4 * int(rng.integers(2))
        raw[wide : wide + 8] = number_as(np.dtype("<f8"), rng)
    elif kind == 2:
        del raw[at:]
    else:
        raw[at:at] = raw[at : at + 64]
    return bytes(raw)


def definition(said: bytes, rng: Rng) -> bytes:
    """A message definition that says something else."""
    swaps = ((b"uint32", b"string"), (b"string", b"uint8"), (b"float64", b"float64[]"), (b"[]", b"[99999999]"),
             (b"Header", b"Headless"), (b"float32", b"int8"), (b"MSG: ", b"MSG: x/"), (b"\n", b"\nuint8 a\n"),
             (b"time ", b"duration "), (b"[36]", b"[36000000]"), (b"int32", b"wstring"), (b"=", b" "))  # fmt: skip
    old, new = pick(rng, swaps)
    return said.replace(old, new, int(rng.integers(1, 4)))


def ros1_fields(header: bytes) -> dict[bytes, bytes]:
    fields, at = {}, 0
    while at + 4 <= len(header):
        (size,) = struct.unpack_from("<I", header, at)
        name, _, value = header[at + 4 : at + 4 + size].partition(b"=")
        fields[name] = value
        at += 4 + size
    return fields


def ros1_split(data: bytes, at: int = 0) -> Iterator[tuple[dict[bytes, bytes], bytes]]:
    while at + 8 <= len(data):
        (size,) = struct.unpack_from("<I", data, at)
        header = data[at + 4 : at + 4 + size]
        (length,) = struct.unpack_from("<I", data, at + 4 + size)
        yield ros1_fields(header), data[at + 8 + size : at + 8 + size + length]
        at += 8 + size + length


def ros1_joined(fields: dict[bytes, bytes], body: bytes) -> bytes:
    header = b"".join(
        struct.pack("<I", len(name) + 1 + len(value)) + name + b"=" + value for name, value in fields.items()
    )
    return struct.pack("<I", len(header)) + header + struct.pack("<I", len(body)) + body


def ros1(path: Path, rng: Rng) -> Broken:
    """Chunks are opened, changed, and written plain; the index is left out, as after a power cut, or stays wrong."""
    raw = path.read_bytes()
    if not raw.startswith(b"#ROSBAG V2.0\n"):
        return Broken(raw[: int(rng.integers(len(raw)))], "cut")
    kind, index = int(rng.integers(6)), rng.random() < 0.3
    name, change = clock(rng)
    share = pick(rng, [1.0, 0.1, 0.01])
    topic = int(rng.integers(12))
    what = ("message", "definition", "clock", "topic left out", "header field", "type or topic")[kind]
    key = pick(rng, [b"conn", b"time", b"op", b"topic", b"size", b"compression"])

    def changed(fields: dict[bytes, bytes], body: bytes) -> bytes:
        op = fields.get(b"op")
        number = int.from_bytes(fields.get(b"conn", b"\xff"), "little")
        hit = rng.random() < share
        if op == b"\x02" and kind == 0 and hit and number == topic:
            body = payload(body, rng)
        elif op == b"\x02" and kind == 2:
            seconds, nanos = struct.unpack("<II", fields[b"time"])
            stamp = change(seconds * 1_000_000 + nanos // 1000) & ((1 << 51) - 1)
            fields = fields | {b"time": struct.pack("<II", stamp // 1_000_000 & 0xFFFFFFFF, stamp % 1_000_000 * 1000)}
        elif op == b"\x02" and kind == 3 and number == topic:
            return b""
        elif op == b"\x07" and kind == 1 and (hit or number == topic):
            inner = ros1_fields(body)
            inner[b"message_definition"] = definition(inner.get(b"message_definition", b""), rng)
            body = b"".join(struct.pack("<I", len(n) + 1 + len(v)) + n + b"=" + v for n, v in inner.items())
        elif op == b"\x07" and kind == 5 and (hit or number == topic):
            inner = ros1_fields(body)
            inner[pick(rng, [b"type", b"topic", b"md5sum", b"latching"])] = str(pick(rng, TEXTS)).encode()
            body = b"".join(struct.pack("<I", len(n) + 1 + len(v)) + n + b"=" + v for n, v in inner.items())
        elif kind == 4 and rng.random() < share / 20 and key in fields:
            fields = fields | {key: pick(rng, [b"", fields[key][:-1], b"\xff" * len(fields[key]), fields[key] + b"\0"])}
        return ros1_joined(fields, body)

    parts = [b"#ROSBAG V2.0\n"]
    for fields, body in ros1_split(raw, 13):
        op = fields.get(b"op")
        if op == b"\x05":
            plain = {b"bz2": bz2.decompress, b"lz4": lz4.frame.decompress}.get(fields[b"compression"], bytes)(body)
            inside = b"".join(changed(*record) for record in ros1_split(plain))
            parts.append(
                ros1_joined({b"op": b"\x05", b"compression": b"none", b"size": struct.pack("<I", len(inside))}, inside)
            )
        elif index or op not in (b"\x04", b"\x06"):
            parts.append(changed(fields, body))
    return Broken(b"".join(parts), f"{what}, topic {topic}, {share}, {name if kind == 2 else ''} {key!r} index {index}")


def mcap_split(data: bytes, at: int = 0) -> Iterator[tuple[int, bytes]]:
    while at + 9 <= len(data):
        op, size = struct.unpack_from("<BQ", data, at)
        yield op, data[at + 9 : at + 9 + size]
        at += 9 + size


def mcap(path: Path, rng: Rng) -> Broken:
    raw = path.read_bytes()
    kind, index = int(rng.integers(6)), rng.random() < 0.3
    name, change = clock(rng)
    share, topic = pick(rng, [1.0, 0.1, 0.01]), int(rng.integers(1, 12))

    def changed(op: int, body: bytes) -> bytes:
        if op == 5 and len(body) >= 22:
            (number,) = struct.unpack_from("<H", body)
            if kind == 0 and number == topic and rng.random() < share:
                body = body[:22] + payload(body[22:], rng)
            elif kind == 2:
                stamp = change(struct.unpack_from("<Q", body, 6)[0] // 1000) * 1000 & ((1 << 64) - 1)
                body = body[:6] + struct.pack("<QQ", stamp, stamp) + body[22:]
            elif kind == 3 and number == topic:
                return b""
        elif op in (3, 4, 1, 12, 13, 11) and kind in (1, 4) and rng.random() < max(share, 0.1):
            if kind == 1 and op == 3:
                body = definition(body, rng)
            else:
                at = int(rng.integers(max(len(body) - 4, 1)))
                body = body[:at] + number_as(np.dtype("<u4"), rng) + body[at + 4 :]
        elif kind == 5 and rng.random() < 0.05:
            return struct.pack("<BQ", op, int(pick(rng, NUMBERS)) % (1 << 64)) + body
        return struct.pack("<BQ", op, len(body)) + body

    parts = [raw[:8]]
    for op, body in mcap_split(raw[:-8], 8):
        if op == 6:
            start, end, size, _, length = struct.unpack_from("<QQQII", body)
            compression = body[32 : 32 + length]
            packed = body[40 + length :]
            plain = packed
            if compression == b"zstd":
                plain = zstandard.ZstdDecompressor().decompress(packed, max_output_size=size)
            elif compression == b"lz4":
                plain = lz4.frame.decompress(packed)
            inside = b"".join(changed(*record) for record in mcap_split(plain))
            chunk = struct.pack("<QQQII", start, end, len(inside), 0, 0) + struct.pack("<Q", len(inside)) + inside
            parts.append(struct.pack("<BQ", 6, len(chunk)) + chunk)
        elif index or op not in (7, 8, 2, 14):
            parts.append(changed(op, body))
    what = ("message", "schema", "clock", "topic left out", "records", "record lengths")[kind]
    return Broken(
        b"".join(parts) + raw[-8:], f"{what}, topic {topic}, {share}, {name if kind == 2 else ''} index {index}"
    )


def db3(path: Path, rng: Rng) -> Broken:
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(shutil.copyfile(path, Path(folder) / "a.db3"))
        database = sqlite3.connect(copy)
        kind = int(rng.integers(6))
        name, change = clock(rng)
        what = ("message", "topic", "clock", "topic left out", "columns", "pages")[kind]
        try:
            ids = [row[0] for row in database.execute("select id from topics")]
            topic = pick(rng, ids) if ids else 0
            with database:
                if kind == 0:
                    rows = database.execute("select id, data from messages where topic_id = ?", (topic,)).fetchall()
                    chosen = [rows[at] for at in some(rng, len(rows))]
                    database.executemany("update messages set data = ? where id = ?",
                                         [(payload(bytes(data), rng), row) for row, data in chosen])  # fmt: skip
                elif kind == 1:
                    column = pick(rng, ["name", "type", "serialization_format", "offered_qos_profiles"])
                    value = pick(
                        rng, [*TEXTS, None, 5, b"\xff\xfe", "sensor_msgs/msg/LaserScan", "nav_msgs/msg/Odometry"]
                    )
                    database.execute(f"update topics set {column} = ? where id = ?", (value, topic))
                    what += f" {column} {value!r}"
                elif kind == 2:
                    rows = database.execute(
                        "select id, timestamp from messages where typeof(timestamp) = 'integer'"
                    ).fetchall()
                    wrapped = [((change(t // 1000) * 1000 + (1 << 63)) % (1 << 64) - (1 << 63), row) for row, t in rows]
                    database.executemany("update messages set timestamp = ? where id = ?", wrapped)
                    what += f" {name}"
                elif kind == 3:
                    database.execute("delete from messages where topic_id = ?", (topic,))
                elif kind == 4:
                    value = pick(rng, [None, "text", 1.5, b"", -1])
                    column = pick(rng, ["timestamp", "topic_id", "data"])
                    database.execute(f"update or ignore messages set {column} = ? where id % 7 = 0", (value,))
                    what += f" {column} {value!r}"
        except sqlite3.Error as err:
            what += f" ({err})"
        database.close()
        raw = bytearray(copy.read_bytes())
        if kind == 5:
            for _ in range(int(rng.integers(1, 30))):
                at = int(rng.integers(len(raw) // 4096 or 1)) * 4096 + int(rng.integers(16))
                raw[at : at + 2] = number_as(np.dtype(">u2"), rng)
        return Broken(bytes(raw), what)


def ulog(path: Path, rng: Rng) -> Broken:
    raw = path.read_bytes()
    kind, share = int(rng.integers(5)), pick(rng, [1.0, 0.1, 0.005])
    name, change = clock(rng)
    target = ord(pick(rng, "FIPQMABRDLOS"))
    parts, at = [raw[:16]], 16
    while at + 3 <= len(raw):
        size, op = struct.unpack_from("<HB", raw, at)
        body = raw[at + 3 : at + 3 + size]
        at += 3 + size
        hit = op == target and rng.random() < share
        if kind == 0 and op == ord("D") and len(body) >= 10:
            body = (
                body[:2] + struct.pack("<Q", change(struct.unpack_from("<Q", body, 2)[0]) & ((1 << 64) - 1)) + body[10:]
            )
        elif kind == 1 and hit and body:
            place = int(rng.integers(len(body)))
            body = (
                body[:place]
                + number_as(np.dtype(pick(rng, ["<u1", "<u2", "<u4", "<f4", "<f8"])), rng)
                + body[place + 4 :]
            )
        elif kind == 2 and hit:
            continue
        elif kind == 3 and hit:
            body = body[: int(rng.integers(len(body) + 1))]
        if kind == 4 and hit:
            parts.append(struct.pack("<HB", int(rng.integers(1 << 16)), op) + body)
        else:
            parts.append(struct.pack("<HB", len(body) & 0xFFFF, op) + body)
    return Broken(
        b"".join(parts), f"{('clock ' + name, 'bytes', 'left out', 'short', 'length')[kind]} of {chr(target)}, {share}"
    )


WAYS: dict[LogFormat, Callable[[Path, Rng], Broken]] = {
    formats.DATAFLASH_BIN: dataflash, formats.DATAFLASH_TEXT: text, formats.MAVLINK_TLOG: telemetry,
    formats.ROS1_BAG: ros1, formats.ROS2_DB3: db3, formats.MCAP: mcap, formats.PX4_ULG: ulog,
}  # fmt: skip


def broken(source: Path, way: Callable[[Path, Rng], Broken], rng: Rng, folder: Path) -> tuple[Path, str]:
    """A file made of a log by one to three changes."""
    path, said = folder / f"log{source.suffix}", []
    shutil.copyfile(source, path)
    for _ in range(int(rng.integers(1, 4))):
        try:
            data, what = way(path if path.stat().st_size else source, rng)
        except (CareError, ArithmeticError, LookupError, ValueError, struct.error, OSError, EOFError, RuntimeError,
                zstandard.ZstdError) as err:  # it cannot be taken apart any more  # fmt: skip
            said.append(f"({type(err).__name__})")
            break
        finally:
            _dataflash.cache_clear()
        path.write_bytes(data)
        said.append(what)
        if rng.random() < 0.5:
            break
    return path, "; ".join(said)


def warm() -> None:
    """Import what the command will, so that a fork has it."""
    import care_tui.cli  # noqa: F401

    for reader in ("mcap_log", "ros1_bag", "ros2_db3", "px4_ulog", "dataflash_text", "mavlink", "ros_types"):
        import_module(f"care_core.logs.{reader}")
    for sample in ("arducopter_failed.BIN", "move_base_drive.bag"):
        care_core.triage(bundled("samples", sample)).report()


class Answer(NamedTuple):
    code: int
    out: str
    err: str
    mb: float
    seconds: float


def ask(words: Sequence[str], folder: Path) -> Answer:
    """The command in a fork of this process, which has everything imported."""
    out, err = folder / "out", folder / "err"
    process = os.fork()
    if not process:
        code = 70
        try:
            resource.setrlimit(resource.RLIMIT_AS, (3 << 30, 3 << 30))
            resource.setrlimit(resource.RLIMIT_CPU, (3 * MOST_S, 3 * MOST_S))
            for handle, path in ((1, out), (2, err)):
                os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), handle)
            sys.argv = ["care", *words]
            from care_tui.start import main as run

            try:
                run()
                code = 0
            except SystemExit as ended:
                code = ended.code if isinstance(ended.code, int) else 71
            sys.stdout.flush()
        except BaseException:
            import traceback

            os.write(2, traceback.format_exc().encode())
        finally:
            os._exit(code)
    _, status, used = os.wait4(process, 0)
    code = os.waitstatus_to_exitcode(status)
    return Answer(code, out.read_text("utf-8", "replace"), err.read_text("utf-8", "replace"), used.ru_maxrss / 1000,
                  used.ru_utime + used.ru_stime)  # fmt: skip


def wrong(answer: Answer) -> str:
    """What is a finding about an answer; empty where nothing is."""
    if answer.code < 0 or answer.code > ExitCode.UNREADABLE:
        return f"ended with {answer.code}"
    for word in ("Traceback", "nexpected", "Warning", "\x1b]52", "Exception ignored"):
        if word in answer.err or (word != "Warning" and word in answer.out):
            return f"says {word}"
    if answer.mb > MOST_MB or answer.seconds > MOST_S:
        return f"took {answer.mb:.0f} MB and {answer.seconds:.1f} s"
    return ""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("logs", type=Path, nargs="+")
    parser.add_argument("--count", type=int, default=3000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kept", type=Path, default=Path(".fuzz/mutated"), help="where files that are findings go")
    given = parser.parse_args()
    given.kept.mkdir(parents=True, exist_ok=True)
    os.environ.update(OPENBLAS_NUM_THREADS="1", NO_COLOR="1")
    sources: dict[LogFormat, list[Path]] = defaultdict(list)
    for path in given.logs:
        try:
            sources[open_log(path).format].append(path)
        except CareError as err:
            print(f"left out: {path}: {err.message}")
    warm()
    ends: dict[LogFormat, Counter[int]] = defaultdict(Counter)
    most: dict[LogFormat, tuple[float, float]] = defaultdict(lambda: (0.0, 0.0))
    found = 0
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        before: dict[Path, Answer] = {}
        for number in range(given.count):
            rng = np.random.default_rng((given.seed, number))
            kind = pick(rng, sorted(WAYS.keys() & sources.keys(), key=lambda one: one.name))
            source = pick(rng, sources[kind])
            path, what = broken(source, WAYS[kind], rng, folder)
            words = pick(rng, COMMANDS)
            answer = ask([words[0], str(path), *words[1:]], folder)
            ends[kind][answer.code] += 1
            most[kind] = (max(most[kind][0], answer.mb), max(most[kind][1], answer.seconds))
            problem = wrong(answer)
            is_fine = words[0] == "triage" and answer.code == 0
            if is_fine and source not in before:
                before[source] = ask(["triage", "--no-history", str(source)], folder)
            is_fine = is_fine and before[source].code != 0
            if problem or is_fine:
                found += bool(problem)
                shutil.copyfile(path, given.kept / f"{number}{path.suffix}")
                print(f"{'FINDING ' + problem if problem else 'fine now'}: {number} {source.name} [{what}]",
                      *words, answer.err.strip()[-1500:] if problem else "", flush=True)  # fmt: skip
    print(f"{'format':<16}{'files':>6}{'MB':>7}{'s':>6}  exit codes")
    for kind, codes in ends.items():
        said = ", ".join(f"{code}: {count}" for code, count in sorted(codes.items()))
        print(f"{kind.name:<16}{codes.total():>6}{most[kind][0]:>7.0f}{most[kind][1]:>6.1f}  {said}")
    sys.exit(min(found, 1))


if __name__ == "__main__":
    main()
