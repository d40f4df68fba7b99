"""The container of a ROS 1 bag (format 2.0): chunks, connections, and where each message lies.

One walk over the record headers finds everything, so a bag that was cut short, or whose index was never written,
is read by the same code as a sound one; only chunks without index records are looked into.
Format: wiki.ros.org/Bags/Format/2.0.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from care_core import limits
from care_core.logs.compression import CannotUnpackError, Unpacker
from care_core.logs.file_windows import FileBytes
from care_core.logs.message_index import ChunkIndex, MessageIndex
from care_core.logs.ros_log import BrokenRecordError, Connection, Flaw, Source
from care_core.records import Record, Struct, field

MAGIC = b"#ROSBAG V2.0\n"

ENTRY = np.dtype([("seconds", "<u4"), ("nanoseconds", "<u4"), ("offset", "<u4")])
"""An index record's entry: record time of a message and its offset in the uncompressed chunk."""

_MESSAGE, _BAG, _INDEX, _CHUNK, _CHUNK_INFO, _CONNECTION = range(2, 8)
_SIZE = struct.Struct("<I")
_TIME = struct.Struct("<II")
_LONGEST_HEADER = 1 << 16
_USUAL_RECORD_HEADER = 64
"""Bytes; that of a message has 46, of an index record 55."""
_MOST_AHEAD = 16
"""Records that are looked at for the message that an index entry means."""
_IS_MESSAGE = b"\x04\x00\x00\x00op=\x02"


class BagChunk(Record, eq=False):
    """A chunk: where its data lies in the file, and per connection id the entries of its messages."""

    pos: int
    start: int
    end: int
    compression: str
    size: int = 0
    """Bytes of the plain data, 0 where the bag does not say."""
    index: ChunkIndex = field(default_factory=dict)
    """What a walk meets of the messages in it, until the bag's is made of it."""

    def open(self, bag: FileBytes, unpack: Unpacker, needed: int = 0) -> tuple[Source, int, int]:
        """The chunk's plain data as (buffer, begin, end); what is there of a cut one. Raises BrokenRecordError.

        Args:
            needed: of a large bag's chunk no more is unpacked than so many bytes, where that is quicker; 0: all.
        """
        if self.compression == "none":
            return bag, self.start, self.end
        try:
            if unpack.takes_part(needed, self.size):
                plain = unpack.head(self.compression, bag, self.start, self.end, needed)
                return plain, 0, len(plain)
            plain = unpack(self.compression, bag[self.start : self.end], self.size)
        except CannotUnpackError as err:
            raise BrokenRecordError(str(err)) from err
        return plain, 0, len(plain)

    def packed(self, unpack: Unpacker, needed: int = 0) -> tuple[int, int]:
        """About where the bytes of the file lie that `open` unpacks, an empty stretch where it unpacks none."""
        if self.compression == "none":
            return self.start, self.start
        return unpack.stretch(self.start, self.end, self.size, needed)


class BagContents(Struct, eq=False):
    """What a walk over a bag finds."""

    connections: dict[int, Connection] = field(default_factory=dict)
    chunks: list[BagChunk] = field(default_factory=list)
    index: MessageIndex = field(default_factory=lambda: MessageIndex([], ENTRY))
    flaws: dict[str, Flaw] = field(default_factory=dict)
    is_encrypted: bool = False


class _Record(NamedTuple):
    """A record: its header fields and where its data lies; `end` may be beyond the file's."""

    pos: int
    op: int
    fields: dict[bytes, bytes]
    start: int
    end: int

    @property
    def is_open_chunk(self) -> bool:
        """A recorder writes the size of a chunk when it closes it: one without any goes on to the end of its bag."""
        return self.op == _CHUNK and self.end == self.start and self.fields.get(b"compression") == b"none"

    def number(self, name: bytes) -> int:
        value = self.fields.get(name, b"")
        if len(value) not in (4, 8):
            raise BrokenRecordError(f"no {name.decode()} in a record")
        return int.from_bytes(value, "little")


def read_contents(bag: FileBytes) -> BagContents:
    """Walk over a bag's records; behind a broken one, go on where the index says that the next chunk is."""
    contents = BagContents()
    pos, size = len(MAGIC), len(bag)
    index_pos = connection_count = chunk_count = chunk_infos = 0
    while pos < size:
        try:
            record = _read_record(bag, pos, size)
            if record.op == _BAG:
                index_pos, connection_count = record.number(b"index_pos"), record.number(b"conn_count")
                chunk_count = record.number(b"chunk_count")
                contents.is_encrypted = bool(record.fields.get(b"encryptor"))
            if not index_pos and record.is_open_chunk:
                record = record._replace(end=size)
            _take(bag, record, contents)
            chunk_infos += record.op == _CHUNK_INFO
            pos = record.end
        except BrokenRecordError as err:
            resumed = next((known for known in _indexed(bag, index_pos) if known > pos), None)
            if resumed is None:
                is_cut_chunk = bool(contents.chunks) and contents.chunks[-1].end == size
                read_to = size if is_cut_chunk else pos  # what is there of a cut chunk is read
                contents.flaws[f"record {pos}"] = Flaw(str(err), read_to, cuts=True)
                break
            contents.flaws[f"record {pos}"] = Flaw(str(err), pos)
            pos = resumed
    if index_pos == 0:
        unclosed = Flaw("the recording was not closed, so the bag has no index", len(MAGIC))
        contents.flaws = {"unclosed": unclosed, **contents.flaws}
    elif (len(contents.connections) < connection_count or chunk_infos < chunk_count) and not contents.flaws:
        contents.flaws["end"] = Flaw("the end of its index is missing", size, cuts=True)
    _complete(bag, contents)
    contents.index = MessageIndex([(chunk.pos, chunk.index) for chunk in contents.chunks], ENTRY)
    for chunk in contents.chunks:
        chunk.index.clear()  # held once
    return contents


def _indexed(bag: FileBytes, index_pos: int) -> list[int]:
    """Where the index at the end of a bag says that chunks are, and where it is itself, in order."""
    if not len(MAGIC) < index_pos < len(bag):
        return []
    known = [index_pos]
    for record in _complete_records(bag, index_pos, len(bag)):
        if record.op == _CHUNK_INFO and len(record.fields.get(b"chunk_pos", b"")) == 8:
            known.append(record.number(b"chunk_pos"))
    return sorted(known)


def locate(buffer: Source, begin: int, end: int, offset: int) -> tuple[int, int]:
    """Where the data of the message at an index entry's offset lies. Raises BrokenRecordError.

    Some writers let the offset point at a connection record that comes before the message.
    """
    pos = begin + offset
    for _ in range(_MOST_AHEAD):
        if pos + 8 > end:
            break
        record = buffer[pos : min(pos + _USUAL_RECORD_HEADER, end)]
        (header_size,) = _SIZE.unpack_from(record)
        start = pos + 8 + int(header_size)
        if start > end or header_size > _LONGEST_HEADER:
            break
        if start - pos > len(record):
            record = buffer[pos:start]
        (data_size,) = _SIZE.unpack_from(record, start - 4 - pos)
        if start + data_size > end:
            break
        if record.find(_IS_MESSAGE, 4, start - 4 - pos) >= 0:
            return start, start + int(data_size)
        pos = start + int(data_size)
    raise BrokenRecordError("a message lies beyond the end of its chunk")


def _take(bag: FileBytes, record: _Record, contents: BagContents) -> None:
    """Add what a top-level record says to the contents."""
    if record.op == _CHUNK:
        compression = record.fields.get(b"compression", b"").decode("ascii", "replace")
        size = int.from_bytes(record.fields.get(b"size", b"")[:4], "little")
        contents.chunks.append(BagChunk(record.pos, record.start, min(record.end, len(bag)), compression, size))
    if record.end > len(bag):
        raise BrokenRecordError("its last record is cut short")
    if record.op == _INDEX and contents.chunks:
        size = record.number(b"count") * ENTRY.itemsize
        if size != record.end - record.start:
            raise BrokenRecordError("an index record of the wrong size")
        contents.chunks[-1].index[record.number(b"conn")] = bag[record.start : record.end]
    elif record.op == _CONNECTION:
        _take_connection(bag, record, contents)


def _take_connection(buffer: Source, record: _Record, contents: BagContents) -> None:
    described = _fields(buffer[record.start : record.end])
    contents.connections[record.number(b"conn")] = Connection(
        topic=_normal(record.fields.get(b"topic", b"").decode("utf-8", "replace")),
        type=described.get(b"type", b"").decode("utf-8", "replace"),
        definition=described.get(b"message_definition", b"").decode("utf-8", "replace"),
        publisher=described.get(b"callerid", b"").decode("utf-8", "replace"),
    )


def _complete(bag: FileBytes, contents: BagContents) -> None:
    """Look into chunks for what index and connection records at the top level do not say."""
    unpack = Unpacker(len(bag))
    left = limits.messages(len(bag))
    for chunk in contents.chunks:
        if chunk.index and all(number in contents.connections for number in chunk.index):
            continue
        try:
            found = _scan(chunk, bag, contents, unpack, left)
        except BrokenRecordError as err:
            contents.flaws[f"chunk {chunk.pos}"] = Flaw(str(err), chunk.pos)
            continue
        if not chunk.index:
            chunk.index.update({number: np.array(entries, ENTRY).tobytes() for number, entries in found.items()})
        left -= sum(map(len, found.values()))


def _scan(
    chunk: BagChunk, bag: FileBytes, contents: BagContents, unpack: Unpacker, most: int
) -> dict[int, list[tuple[int, int, int]]]:
    """Index entries of a chunk's complete messages per connection; takes its connection records on the way."""
    buffer, begin, end = chunk.open(bag, unpack)
    found: dict[int, list[tuple[int, int, int]]] = {}
    for record in _complete_records(buffer, begin, end):
        if record.op == _CONNECTION:
            _take_connection(buffer, record, contents)
        elif record.op == _MESSAGE and len(record.fields.get(b"time", b"")) == _TIME.size:
            if not most:
                raise BrokenRecordError("it holds more messages than a file of its size can")
            most -= 1
            seconds, nanoseconds = _TIME.unpack(record.fields[b"time"])
            found.setdefault(record.number(b"conn"), []).append((seconds, nanoseconds, record.pos - begin))
    return found


def _complete_records(buffer: Source, pos: int, end: int) -> Iterator[_Record]:
    while pos < end:
        try:
            record = _read_record(buffer, pos, end)
        except BrokenRecordError:
            return
        if record.end > end:
            return
        yield record
        pos = record.end


def _read_record(buffer: Source, pos: int, end: int) -> _Record:
    record = buffer[pos : min(pos + _USUAL_RECORD_HEADER, end)]
    try:
        (header_size,) = _SIZE.unpack_from(record)
        start = pos + 8 + int(header_size)
        if start > end:
            raise BrokenRecordError("a record header is cut short")
        if start - pos > len(record):
            record = buffer[pos:start]
        fields = _fields(record[4 : start - 4 - pos])
        (data_size,) = _SIZE.unpack_from(record, start - 4 - pos)
    except struct.error as err:
        raise BrokenRecordError("a record header is cut short") from err
    if b"op" not in fields:
        raise BrokenRecordError("these bytes are no record")
    op = fields[b"op"]
    return _Record(pos, op[0] if len(op) == 1 else -1, fields, start, start + int(data_size))


def _fields(header: bytes) -> dict[bytes, bytes]:
    fields: dict[bytes, bytes] = {}
    pos, end = 0, len(header)
    while pos < end:
        size = int.from_bytes(header[pos : pos + 4], "little")
        pos += 4
        if pos + size > end:
            raise BrokenRecordError("these bytes are no record")
        name, _, value = header[pos : pos + size].partition(b"=")
        fields[name] = value
        pos += size
    return fields


def _normal(topic: str) -> str:
    """The topic without doubled or trailing slashes."""
    lead = "/" if topic.startswith("/") else ""
    return lead + "/".join(part for part in topic.split("/") if part)
