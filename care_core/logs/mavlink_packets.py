"""MAVLink packets in a file of bytes: found by marker and checksum, decoded by pymavlink's message definitions.

A telemetry log puts eight bytes of time (microseconds since 1970, big-endian) before each packet. A packet is believed
when its checksum, which covers its message's definition too, is right, so packets are found however broken the file is
between them. Everything works on whole arrays: nothing here loops over packets.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from io import BytesIO
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from care_core.logs.ardupilot import text_of
from care_core.logs.clock import since_start
from care_core.logs.file_windows import Bytes, FileArray
from care_core.numbers import Floats
from care_core.records import Record

Offsets = NDArray[np.int64]

STAMP_BYTES = 8
V1, V2 = 0xFE, 0xFD
_SIGNED = 0x01
_SIGNATURE_BYTES = 13
_BOOT_TIME = "time_boot_ms"
"""A time so much earlier than the one before is of another start of the vehicle; less is a message overtaken."""
_HEAD_BYTES, _LONGEST = 12, 280
"""Bytes of the shortest packet, and of the longest: head, 255 of payload, checksum, signature."""
_CHUNK = 1 << 22
_BATCH = 1 << 17
_KINDS = {
    "char": "S1", "int8_t": "i1", "uint8_t": "u1", "int16_t": "<i2", "uint16_t": "<u2", "int32_t": "<i4",
    "uint32_t": "<u4", "int64_t": "<i8", "uint64_t": "<u8", "float": "<f4", "double": "<f8",
}  # fmt: skip


class PacketField(NamedTuple):
    """Where a field lies in a payload and how it is stored: a number, text (`S`), or an array of numbers."""

    offset: int
    dtype: np.dtype[Any]


class Message(Record):
    """One message of the MAVLink definitions. `extra` is what its checksum adds."""

    id: int
    name: str
    extra: int
    fields: Mapping[str, PacketField]


class Packets(Record, eq=False):
    """Packets of a file, arrays of shape (n,): first byte of the stamp, one past the last byte, message, sender."""

    start: Offsets
    end: Offsets
    id: NDArray[np.int32]
    system: Bytes
    component: Bytes

    def __len__(self) -> int:
        return len(self.start)

    def where(self, chosen: NDArray[Any]) -> Packets:
        return Packets(
            self.start[chosen], self.end[chosen], self.id[chosen], self.system[chosen], self.component[chosen]
        )


@cache
def definitions() -> Mapping[int, Message]:
    """Every message of the ArduPilot dialect, which holds the common ones, by number."""
    from pymavlink.dialects.v20 import ardupilotmega

    return {number: _to_message(number, peer) for number, peer in ardupilotmega.mavlink_map.items()}


def _to_message(number: int, peer: Any) -> Message:
    # pymavlink names fields in the order of the definition, the payload has them by size.
    kinds = dict(zip(peer.fieldnames, peer.fieldtypes, strict=True))
    fields, offset = {}, 0
    for name, count in zip(peer.ordered_fieldnames, peer.array_lengths, strict=True):
        one = np.dtype(_KINDS[kinds[name]])
        whole = np.dtype(f"S{max(count, 1)}") if one.kind == "S" else np.dtype((one, (count,))) if count else one
        fields[name] = PacketField(offset, whole)
        offset += whole.itemsize
    return Message(number, peer.msgname, peer.crc_extra, fields)


def find_packets(data: FileArray) -> Packets:
    """Every stamped packet with the right checksum, in the order of the file; none overlaps another."""
    return _sound(data, _candidates(data), STAMP_BYTES)


def stamped(data: FileArray) -> bytes | None:
    """A stream of packets without stamps as the log that a ground station would have written, by the packets' own time.

    Many messages say when the vehicle sent them, in milliseconds since it was started (`time_boot_ms`); those between
    two came between. None where no message of the stream says so.
    """
    padded = np.concatenate((np.zeros(STAMP_BYTES, np.uint8), data.between(0, len(data))))
    stream = FileArray(BytesIO(padded.tobytes()), data.path)
    found = _sound(stream, _candidates(stream, stamped=False), 0)
    seconds = _boot_times(stream, found)
    if seconds is None:
        return None
    marker, sizes = found.start + STAMP_BYTES, found.end - found.start
    ends = np.cumsum(sizes)
    made = np.zeros(int(ends[-1]) if len(ends) else 0, np.uint8)
    whole = (seconds * 1e6).astype(">u8").view(np.uint8).reshape(-1, STAMP_BYTES)
    for low, end, at, stamp in zip((ends - sizes).tolist(), ends.tolist(), marker.tolist(), whole, strict=True):
        made[low : low + STAMP_BYTES] = stamp
        made[low + STAMP_BYTES : end] = padded[at : at + end - low - STAMP_BYTES]
    return made.tobytes()


def _boot_times(data: FileArray, packets: Packets) -> Floats | None:
    """When each packet was sent, seconds since the vehicle started; None where none says so."""
    rows, own = boot_clock(data, packets)
    if not len(rows):
        return None
    return np.asarray(np.interp(np.arange(len(packets)), rows, since_start(own)), np.float64)


def boot_clock(data: FileArray, packets: Packets) -> tuple[NDArray[np.intp], Floats]:
    """Which packets of the sender who does most often say how long ago it was started, and what they say, in s; shapes
    (k,), both empty where nobody does."""
    known = np.full(len(packets), np.nan)
    senders = packets.system.astype(np.int32) << 8 | packets.component
    for number in np.unique(packets.id).tolist():
        field = definitions()[number].fields.get(_BOOT_TIME)
        if field is not None:
            rows = np.flatnonzero(packets.id == number)
            known[rows] = decode(data, packets.start[rows], field) / 1e3
    timed = np.isfinite(known) & (known > 0)
    if not timed.any():
        return np.empty(0, np.intp), np.empty(0)
    speakers, counts = np.unique(senders[timed], return_counts=True)
    rows = np.flatnonzero(timed & (senders == speakers[counts.argmax()]))
    return rows, known[rows]


def _sound(data: FileArray, candidates: Sequence[Offsets], stamp_bytes: int) -> Packets:
    """The candidates with the right checksum, each with so many bytes of stamp of its own; none overlaps another."""
    pieces = [_checked(data, places) for places in candidates]
    found = Packets(*(np.concatenate(parts) for parts in zip(*map(_columns, pieces), strict=True)))
    while len(found):
        # A packet can carry another inside it, and noise can look like one: the earlier stays.
        overlaps = np.append(False, found.start[1:] + STAMP_BYTES - stamp_bytes < found.end[:-1])
        if not overlaps.any():
            break
        found = found.where(~(overlaps & ~np.append(False, overlaps[:-1])))
    return found


def _columns(packets: Packets) -> tuple[NDArray[Any], ...]:
    return packets.start, packets.end, packets.id, packets.system, packets.component


def _candidates(data: FileArray, *, stamped: bool = True) -> list[Offsets]:
    """Places where a packet may begin: a marker, with a stamp before it whose highest byte is zero where `stamped`."""
    found: list[Offsets] = [np.empty(0, dtype=np.int64)]
    for low in range(STAMP_BYTES, len(data), _CHUNK):
        whole = data.between(low - STAMP_BYTES, low + _CHUNK)
        piece, leads = whole[STAMP_BYTES:], whole[:-STAMP_BYTES]
        places = np.flatnonzero(((piece == V2) | (piece == V1)) & ((leads == 0) | (not stamped))) + low
        found += [places[at : at + _BATCH] for at in range(0, len(places), _BATCH)]
    return found


def frames(data: FileArray, places: Offsets) -> Packets:
    """Packets as their headers describe them, unchecked; those that do not fit into the file are left out."""
    places = places[places + _HEAD_BYTES <= len(data)]
    head = data.at(places, (np.uint8, _HEAD_BYTES))
    is_v2 = head[:, 0] == V2
    flags = np.where(is_v2, head[:, 2], 0)
    end = places + np.where(is_v2, 10, 6) + head[:, 1] + 2 + _SIGNATURE_BYTES * (flags & _SIGNED)
    wide = head[:, 7] | head[:, 8].astype(np.int32) << 8 | head[:, 9].astype(np.int32) << 16
    number = np.where(is_v2, wide, head[:, 5]).astype(np.int32)
    system, component = (np.where(is_v2, head[:, at + 2], head[:, at]) for at in (3, 4))
    found = Packets(places - STAMP_BYTES, end, number, system, component)
    whole = (end <= len(data)) & (flags | _SIGNED == _SIGNED)
    return found.where(whole)


def _checked(data: FileArray, places: Offsets) -> Packets:
    extras = np.full(max(definitions()) + 2, -1, dtype=np.int16)
    extras[list(definitions())] = [message.extra for message in definitions().values()]
    found = frames(data, places)
    found = found.where(extras[np.minimum(found.id, len(extras) - 1)] >= 0)
    summed, stated = _sums(data, found)
    return found.where(_step(summed, extras[found.id].astype(np.uint8)) == stated)


def wanted_extras(data: FileArray, packets: Packets) -> NDArray[np.int64]:
    """What a message's definition would have to add for each packet's checksum to be right; -1 where nothing does."""
    summed, stated = _sums(data, packets)
    entry = np.full(1 << 16, -1, dtype=np.int64)
    entry[_crc_table()] = np.arange(256)
    found = entry[stated ^ (summed >> 8)]
    return np.where(found < 0, -1, found ^ (summed & 0xFF))


def payloads(data: FileArray, start: Offsets) -> tuple[Offsets, NDArray[np.int64]]:
    """First byte and size of the payloads of packets whose stamps begin at `start`."""
    marker = start + STAMP_BYTES
    head = data.at(marker, (np.uint8, 2))
    return marker + np.where(head[:, 0] == V2, 10, 6), head[:, 1].astype(np.int64)


def _sums(data: FileArray, packets: Packets) -> tuple[NDArray[np.uint16], NDArray[np.uint16]]:
    """CRC-16/MCRF4XX of packets without the byte that their message adds, and the checksums that they state."""
    marker = packets.start + STAMP_BYTES
    pieces = [_sums_of(piece, places) for ((_, places),), piece in data.windows([marker], _LONGEST)]
    none = np.empty(0, dtype=np.uint16)
    return np.concatenate([none, *(summed for summed, _ in pieces)]), np.concatenate([none, *(s for _, s in pieces)])


def _sums_of(data: Bytes, marker: NDArray[np.integer[Any]]) -> tuple[NDArray[np.uint16], NDArray[np.uint16]]:
    """The sums of packets whose markers stand at places of these bytes."""
    tail = marker + np.where(data[marker] == V2, 10, 6) + data[marker + 1]
    covered = tail - marker - 1
    order = np.argsort(-covered, kind="stable")
    place, falling = marker[order] + 1, -covered[order]
    sums = np.full(len(order), 0xFFFF, dtype=np.uint16)
    for step in range(-int(falling[0]) if len(falling) else 0):
        running = int(np.searchsorted(falling, -step))  # those longer than `step` come first
        sums[:running] = _step(sums[:running], data[place[:running] + step])
    answer = np.empty_like(sums)
    answer[order] = sums
    return answer, data[tail] | data[tail + 1].astype(np.uint16) << 8


def _step(sums: NDArray[np.uint16], byte: Bytes) -> NDArray[np.uint16]:
    return np.asarray(_crc_table()[(sums ^ byte) & 0xFF] ^ (sums >> 8))


@cache
def _crc_table() -> NDArray[np.uint16]:
    table = np.arange(256, dtype=np.uint16)
    for _ in range(8):
        table = np.where(table & 1, (table >> 1) ^ 0x8408, table >> 1).astype(np.uint16)
    return table


def stamps(data: FileArray, start: Offsets) -> Floats:
    """The times before packets, in seconds."""
    return np.asarray(data.at(start, ">u8") / 1e6, dtype=np.float64)


def decode(data: FileArray, start: Offsets, field: PacketField) -> NDArray[Any]:
    """One field of packets of one message: float64, or object for text (str) and arrays (tuple).

    A sender leaves out the zeros at the end of a payload, so what lies past it is zero.
    """
    first, size = payloads(data, start)
    within = field.offset + np.arange(field.dtype.itemsize)
    raw = data.at(first + field.offset, (np.uint8, field.dtype.itemsize))
    raw[within >= size[:, None]] = 0
    if field.dtype.kind == "S":
        return _objects([text_of(row.tobytes()) for row in raw])
    if field.dtype.shape:
        return _objects([tuple(row) for row in raw.view(field.dtype.base).tolist()])
    with np.errstate(invalid="ignore"):
        return np.asarray(raw.view(field.dtype)[:, 0].astype(np.float64))


def _objects(values: Sequence[Any]) -> NDArray[Any]:
    column = np.empty(len(values), dtype=object)
    column[:] = values
    return column
