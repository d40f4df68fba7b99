"""The container of an MCAP file: chunks, channels, and where each message lies.

One walk over the record headers finds everything, so a file without summary, or cut short, is read by the same code
as a sound one; only chunks without message index are looked into. Format: mcap.dev/spec.
"""

from __future__ import annotations

import struct
import zlib
from array import array
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from io import BytesIO
from typing import Any, NamedTuple

import numpy as np
from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode

from care_core import limits
from care_core.logs.compression import CannotUnpackError, Unpacker
from care_core.logs.mapped import FileBytes
from care_core.logs.message_index import ChunkIndex, MessageIndex
from care_core.logs.ros_log import BrokenRecordError, Connection, Flaw, Source

MAGIC = b"\x89MCAP0\r\n"

ENTRY = np.dtype([("time", "<i8"), ("offset", "<u8")])
"""A message index's entry: log time in ns (beyond the year 2262 it wraps and is no believable time either way), offset
of the message's record in the plain chunk."""

_RECORD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<BQHIqQ")
_CHUNK = struct.Struct("<QQQII")
_FOOTER = struct.Struct("<QQI")
_CHUNK_INDEX = struct.Struct("<QQQ")
_SIZE = struct.Struct("<Q")
_INDEX = struct.Struct("<HI")
_LONGEST_NAME = 64
_PIECE = 1 << 20


@dataclass(frozen=True, slots=True, eq=False)
class McapChunk:
    """A chunk: where its packed records lie in the file."""

    pos: int
    start: int
    end: int
    is_whole: bool
    compression: str = ""
    size: int = 0
    """Bytes of the plain records."""
    checksum: int = 0
    """CRC-32 of the plain records, 0 where the recorder made none."""
    index: ChunkIndex = field(default_factory=dict)
    """What a walk meets of the messages in it, until the file's is made of it."""

    def open(self, log: FileBytes, unpack: Unpacker, needed: int = 0) -> tuple[Source, int, int]:
        """The plain records as (buffer, begin, end); what is there of a cut chunk. Raises BrokenRecordError.

        Args:
            needed: of a large file's chunk no more is unpacked than so many bytes, where that is quicker; 0: all.
        """
        if not self.compression:
            return log, self.start, self.end
        try:
            if unpack.takes_parts and 0 < 2 * needed < self.size:
                plain = unpack.head(self.compression, log, self.start, self.end, needed)
                return plain, 0, len(plain)
            plain = unpack(self.compression, log[self.start : self.end], self.size)
        except CannotUnpackError as err:
            raise BrokenRecordError(str(err)) from err
        return plain, 0, len(plain)

    def flaw(self, buffer: Source, begin: int, end: int) -> str:
        """Why the plain records cannot all be trusted, empty where they can."""
        if not self.is_whole:
            return "a chunk is cut short"
        if self.compression and end - begin < self.size:
            return "the rest of a chunk cannot be unpacked"
        if self.checksum and _checksum(buffer, begin, end) != self.checksum:
            return "a chunk does not match its checksum: values in it may be wrong"
        return ""


@dataclass(slots=True)
class McapContents:
    """What a walk over a file finds."""

    profile: str = ""
    schemas: dict[int, records.Schema] = field(default_factory=dict)
    channels: dict[int, records.Channel] = field(default_factory=dict)
    chunks: list[McapChunk] = field(default_factory=list)
    index: MessageIndex = field(init=False)
    metadata: list[records.Metadata] = field(default_factory=list)
    statistics: records.Statistics | None = None
    flaws: dict[str, Flaw] = field(default_factory=dict)
    is_closed: bool = False

    def connections(self) -> dict[int, Connection]:
        return {number: self._connection(channel) for number, channel in self.channels.items()}

    def _connection(self, channel: records.Channel) -> Connection:
        schema = self.schemas.get(channel.schema_id)
        if schema is None:
            return Connection(channel.topic, "", "", channel.message_encoding)
        definition = schema.data.decode("utf-8", "replace")
        return Connection(channel.topic, schema.name, definition, channel.message_encoding, schema.encoding)


def _checksum(buffer: Source, begin: int, end: int) -> int:
    summed = 0
    for low in range(begin, end, _PIECE):
        summed = zlib.crc32(buffer[low : min(low + _PIECE, end)], summed)
    return summed


class _Record(NamedTuple):
    pos: int
    op: int
    start: int
    end: int


def read_contents(log: FileBytes) -> McapContents:
    """Walk over a file's records; behind a broken one, go on where the summary says that the next chunk is."""
    contents = McapContents()
    loose = _Loose()
    pos, size = len(MAGIC), len(log)
    while pos < size and not contents.is_closed:
        try:
            record = _read_record(log, pos, size)
            if record.op == Opcode.MESSAGE:
                loose.add(log, record)
            else:
                _take(log, record, contents)
            pos = record.end
        except BrokenRecordError as err:
            resumed = next((known for known in _summarised(log) if known > pos), None)
            contents.flaws[f"record {pos}"] = Flaw(str(err), pos, cuts=resumed is None)
            if resumed is None:
                break
            pos = resumed
    if not contents.is_closed and not contents.flaws:
        contents.flaws["end"] = Flaw("the recording was not closed", size, cuts=True)
    chunk_count = contents.statistics.chunk_count if contents.statistics else 0
    if len(contents.chunks) < chunk_count and not contents.flaws:
        contents.flaws["chunks"] = Flaw(f"{chunk_count - len(contents.chunks)} of {chunk_count} chunks are not found")
    contents.chunks.extend(loose.chunks(size))
    _complete(log, contents)
    contents.index = MessageIndex([(chunk.pos, chunk.index) for chunk in contents.chunks], ENTRY)
    for chunk in contents.chunks:
        chunk.index.clear()  # held once
    return contents


def locate(buffer: Source, begin: int, end: int, offset: int, number: int, time_ns: int) -> tuple[int, int]:
    """Where the data of the message that an index entry describes lies. Raises BrokenRecordError."""
    pos = begin + offset
    if pos + _MESSAGE.size > end:
        raise BrokenRecordError("a message lies beyond the end of its chunk")
    op, size, channel, _, stamp_ns, _ = _MESSAGE.unpack(buffer[pos : pos + _MESSAGE.size])
    after = pos + _RECORD.size + size
    is_it = op == Opcode.MESSAGE and channel == number and stamp_ns == time_ns
    if not is_it or not pos + _MESSAGE.size <= after <= end:
        raise BrokenRecordError("a message is not where the index says")
    return pos + _MESSAGE.size, after


class _Loose:
    """Messages outside chunks, as entries per channel: their offsets count from the beginning of the file."""

    def __init__(self) -> None:
        self.times: dict[int, array[int]] = {}
        self.offsets: dict[int, array[int]] = {}

    def add(self, log: FileBytes, record: _Record) -> None:
        if record.end - record.pos < _MESSAGE.size:
            raise BrokenRecordError("a message is too short")
        _, _, number, _, time_ns, _ = _MESSAGE.unpack(log[record.pos : record.pos + _MESSAGE.size])
        self.times.setdefault(number, array("q")).append(time_ns)
        self.offsets.setdefault(number, array("Q")).append(record.pos)

    def chunks(self, size: int) -> Iterator[McapChunk]:
        if self.times:
            index = {number: _entries(times, self.offsets[number]) for number, times in self.times.items()}
            yield McapChunk(0, 0, size, is_whole=True, index=index)


def _take(log: FileBytes, record: _Record, contents: McapContents) -> None:
    """Add what a top-level record says to the contents."""
    if record.op == Opcode.CHUNK:
        contents.chunks.append(_chunk(log, record))
        if record.end > len(log):
            raise BrokenRecordError("its last record is cut short")
    elif record.op == Opcode.MESSAGE_INDEX and contents.chunks:
        _take_index(log, record, contents.chunks[-1])
    elif record.op == Opcode.FOOTER:
        if log[record.end : record.end + len(MAGIC)] != MAGIC:
            raise BrokenRecordError("the end mark is missing")
        contents.is_closed = True
    else:
        _take_described(log, record, contents)


def _take_index(log: FileBytes, record: _Record, chunk: McapChunk) -> None:
    if record.end - record.start < _INDEX.size:
        raise BrokenRecordError("a message index of the wrong size")
    number, size = _INDEX.unpack(log[record.start : record.start + _INDEX.size])
    if size % ENTRY.itemsize or size != record.end - record.start - _INDEX.size:
        raise BrokenRecordError("a message index of the wrong size")
    if size:
        chunk.index[number] = log[record.start + _INDEX.size : record.end]


def _take_described(log: Source, record: _Record, contents: McapContents) -> None:
    """Take records that the mcap library reads: schemas, channels, metadata, statistics."""
    kinds: Mapping[int, Any] = {
        Opcode.HEADER: records.Header, Opcode.SCHEMA: records.Schema, Opcode.CHANNEL: records.Channel,
        Opcode.METADATA: records.Metadata, Opcode.STATISTICS: records.Statistics,
    }  # fmt: skip
    kind = kinds.get(record.op)
    if kind is None:
        return
    try:
        read = kind.read(ReadDataStream(BytesIO(log[record.start : record.end])))
    except (McapError, struct.error, UnicodeDecodeError) as err:
        raise BrokenRecordError(f"a {kind.__name__.lower()} record is broken") from err
    if isinstance(read, records.Header):
        contents.profile = read.profile
    elif isinstance(read, records.Schema):
        contents.schemas.setdefault(read.id, read)
    elif isinstance(read, records.Channel):
        contents.channels.setdefault(read.id, read)
    elif isinstance(read, records.Metadata):
        contents.metadata.append(read)
    else:
        contents.statistics = read


def _chunk(log: FileBytes, record: _Record) -> McapChunk:
    """A chunk record; of one that is cut short, what is there."""
    end = min(record.end, len(log))
    name_at = record.start + _CHUNK.size
    if name_at > end:
        raise BrokenRecordError("its last record is cut short")
    _, _, size, checksum, name_size = _CHUNK.unpack(log[record.start : name_at])
    start = name_at + name_size + _SIZE.size
    if name_size > _LONGEST_NAME or start > end:
        raise BrokenRecordError("a chunk's header is broken")
    (packed,) = _SIZE.unpack(log[start - _SIZE.size : start])
    if start + packed != record.end:
        raise BrokenRecordError("a chunk of the wrong size")
    compression = log[name_at : name_at + name_size].decode("ascii", "replace")
    return McapChunk(record.pos, start, end, end == record.end, compression, size, checksum)


def _complete(log: FileBytes, contents: McapContents) -> None:
    """Look into chunks for what their message index and the summary do not say."""
    unpack = Unpacker(len(log))
    left = limits.messages(len(log))
    for chunk in contents.chunks:
        is_indexed = bool(chunk.index) or not chunk.size
        if is_indexed and all(number in contents.channels for number in chunk.index):
            continue
        try:
            found = _scan(chunk, log, contents, unpack, left)
        except BrokenRecordError as err:
            contents.flaws.setdefault(f"chunk {chunk.pos}", Flaw(str(err), chunk.pos))
            continue
        if not chunk.index:
            chunk.index.update(found)
        left -= sum(map(len, found.values())) // ENTRY.itemsize


def _scan(chunk: McapChunk, log: FileBytes, contents: McapContents, unpack: Unpacker, most: int) -> ChunkIndex:
    """Index entries of a chunk's complete messages per channel; takes its schemas and channels on the way."""
    buffer, begin, end = chunk.open(log, unpack)
    times: dict[int, array[int]] = {}
    offsets: dict[int, array[int]] = {}
    pos = begin
    while pos < end:
        try:
            record = _read_record(buffer, pos, end)
        except BrokenRecordError:
            break
        if record.end > end:
            break
        if record.op == Opcode.MESSAGE and record.end - pos >= _MESSAGE.size:
            if not most:
                raise BrokenRecordError("it holds more messages than a file of its size can")
            most -= 1
            _, _, number, _, time_ns, _ = _MESSAGE.unpack(buffer[pos : pos + _MESSAGE.size])
            times.setdefault(number, array("q")).append(time_ns)
            offsets.setdefault(number, array("Q")).append(pos - begin)
        elif record.op in (Opcode.SCHEMA, Opcode.CHANNEL):
            _take_described(buffer, record, contents)
        pos = record.end
    return {number: _entries(stamps, offsets[number]) for number, stamps in times.items()}


def _entries(times: array[int], offsets: array[int]) -> bytes:
    entries = np.empty(len(times), ENTRY)
    entries["time"], entries["offset"] = times, offsets
    return entries.tobytes()


def _summarised(log: FileBytes) -> list[int]:
    """Where the summary at the end of a file says that chunks are, and where it is itself, in order."""
    footer = len(log) - len(MAGIC) - _FOOTER.size
    if footer < len(MAGIC) or log[footer + _FOOTER.size :] != MAGIC:
        return []
    start, _, _ = _FOOTER.unpack(log[footer : footer + _FOOTER.size])
    known = [start, footer - _RECORD.size]
    pos = start
    while len(MAGIC) < pos < footer:
        try:
            record = _read_record(log, pos, footer)
        except BrokenRecordError:
            break
        if record.op == Opcode.CHUNK_INDEX and record.end - record.start >= _CHUNK_INDEX.size:
            known.append(_CHUNK_INDEX.unpack(log[record.start : record.start + _CHUNK_INDEX.size])[2])
        pos = record.end
    return sorted(known)


def _read_record(buffer: Source, pos: int, end: int) -> _Record:
    """The record at a position; only a chunk may reach beyond the end."""
    if pos + _RECORD.size > end:
        raise BrokenRecordError("a record header is cut short")
    op, size = _RECORD.unpack(buffer[pos : pos + _RECORD.size])
    start = pos + _RECORD.size
    if not op:
        raise BrokenRecordError("these bytes are no record")
    if start + size > end and op != Opcode.CHUNK:
        raise BrokenRecordError("its last record is cut short")
    return _Record(pos, op, start, start + size)
