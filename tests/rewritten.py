"""The same flight in another format: a DataFlash log as text, and a small PX4 log."""

from __future__ import annotations

import struct
from pathlib import Path

from care_core.logs.base import Table
from care_core.logs.dataflash import DataFlashLog


def write_text(path: Path, source: Path, *, only: tuple[str, ...] = ()) -> Path:
    """Write a DataFlash log as the ground stations' converters do: scaled values, one message a line."""
    log = DataFlashLog(source)
    lines: list[tuple[float, str]] = []
    head = []
    for name, forms in log._formats.items():
        form = forms[-1]
        head.append(f"FMT, {form.type}, {form.length}, {name}, {form.code}, {','.join(form.fields)}")
        if name != "FMT" and (not only or name in only):
            lines += _lines(name, log.read({name: tuple(form.fields)}).get(name), form.code)
    lines.sort(key=lambda line: line[0])
    path.write_text("\n".join([*head, *(line for _, line in lines)]) + "\n", encoding="utf-8")
    return path


def _lines(name: str, table: Table | None, code: str) -> list[tuple[float, str]]:
    if table is None:
        return []
    columns = [table[field].tolist() for field in table.columns]
    rows = zip(table.t.tolist(), *columns, strict=True)
    return [(t, ", ".join([name, *(_shown(v, c) for v, c in zip(values, code, strict=True))])) for t, *values in rows]


def _shown(value: float | str, code: str) -> str:
    if isinstance(value, float):
        return str(int(value)) if code in "bBhHiIqQM" else repr(value)
    return str(value)


ULOG_MAGIC = b"ULog\x01\x12\x35\x01"


def ulog_record(kind: bytes, body: bytes) -> bytes:
    """A record of a ULog: the length of its body, its kind, its body."""
    return struct.pack("<H", len(body)) + kind + body


def ulog_keyed(kind: bytes, key: bytes, value: bytes) -> bytes:
    """A record with a key, its type and its value: information or a parameter."""
    return ulog_record(kind, bytes([len(key)]) + key + value)


def write_ulog(path: Path, count: int = 100) -> Path:
    """A PX4 log of one topic with `count` messages, two parameters of which one is changed, a text and a dropout."""
    parts = [ULOG_MAGIC + struct.pack("<Q", 1_000_000), ulog_record(b"B", bytes(40))]
    parts.append(ulog_record(b"F", b"battery_status:uint64_t timestamp;float voltage_v;uint8_t id;"))
    parts.append(ulog_keyed(b"I", b"char[8] ver_hw", b"PX4_SITL"))
    parts.append(ulog_keyed(b"P", b"float MC_ROLL_P", struct.pack("<f", 6.5)))
    parts.append(ulog_keyed(b"P", b"int32_t COM_RC_LOSS_T", struct.pack("<i", 3)))
    parts.append(ulog_record(b"A", b"\x00" + struct.pack("<H", 5) + b"battery_status"))
    for number in range(count):
        stamp = 1_000_000 + number * 100_000
        parts.append(ulog_record(b"D", struct.pack("<HQfB", 5, stamp, 12.0 - number / 100, 1)))
        if number == count // 2:
            parts.append(ulog_keyed(b"P", b"float MC_ROLL_P", struct.pack("<f", 0.1)))
            parts.append(ulog_record(b"O", struct.pack("<H", 120)))
            parts.append(ulog_record(b"L", b"6" + struct.pack("<Q", stamp) + b"Takeoff detected"))
    path.write_bytes(b"".join(parts))
    return path
