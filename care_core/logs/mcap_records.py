"""The container of an MCAP file: chunks, channels, and where each message lies.

One walk over the record headers finds everything, so a file without summary, or cut short, is read by the same code
as a sound one; only chunks without message index are looked into. Format: mcap.dev/spec.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping, Sequence
from io import BytesIO
from typing import Any, NamedTuple

import numpy as np
from mcap import records
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from numpy.typing import NDArray

from care_core import limits
from care_core.logs.compression import CannotUnpackError, Unpacker
from care_core.logs.file_windows import FileBytes
from care_core.logs.message_index import ChunkIndex, MessageIndex
from care_core.logs.ros_log import BrokenRecordError, Connection, Flaw, Source
from care_core.records import Record, Struct, field

MAGIC = b"\x89MCAP0\r\n"

ENTRY = np.dtype([("time", "<i8"), ("offset", "<u8")])
"""A message index's entry: log time in ns (beyond the year 2262 it wraps and is no believable time either way), offset
of the message's record in the plain chunk."""

_RECORD = struct.Struct("<BQ")
_MESSAGE = struct.Struct("<BQHIqQ")
_STORED = np.dtype({"names": ["channel", "time"], "formats": ["<u2", "<i8"], "offsets": [9, 15], "itemsize": 31})
"""What of a message's record goes into an index."""
_CHUNK = struct.Struct("<QqQII")
_FOOTER = struct.Struct("<QQI")
_CHUNK_INDEX = struct.Struct("<QQQ")
_SIZE = struct.Struct("<Q")
_INDEX = struct.Struct("<HI")
_LONGEST_NAME = 64
_PIECE = 1 << 20
_STRETCH = 1 << 16
"""Bytes of messages that are taken at a time."""


class McapChunk(Record, eq=False):
    """A chunk: where its packed records lie in the file."""

    pos: int
    start: int
    end: int
    is_whole: bool
    compression: str = ""
    size: int = 0
    """Bytes of the plain records."""
    until_ns: int | None = None
    """Its last record time, as its header says it."""
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
            if unpack.takes_part(needed, self.size):
                plain = unpack.head(self.compression, log, self.start, self.end, needed)
                return plain, 0, len(plain)
            plain = unpack(self.compression, log[self.start : self.end], self.size)
        except CannotUnpackError as err:
            raise BrokenRecordError(str(err)) from err
        return plain, 0, len(plain)

    def packed(self, unpack: Unpacker, needed: int = 0) -> tuple[int, int]:
        """About where the bytes of the file lie that `open` unpacks, an empty stretch where it unpacks none."""
        if not self.compression:
            return self.start, self.start
        return unpack.stretch(self.start, self.end, self.size, needed)

    def flaw(self, buffer: Source, begin: int, end: int) -> str:
        """Why the plain records cannot all be trusted, empty where they can, or where the walk told it: a cut chunk."""
        if not self.is_whole:
            return ""
        if self.compression and end - begin < self.size:
            return "the rest of a chunk cannot be unpacked"
        if self.checksum and _checksum(buffer, begin, end) != self.checksum:
            return "a chunk does not match its checksum: values in it may be wrong"
        return ""


class McapContents(Struct, eq=False):
    """What a walk over a file finds."""

    profile: str = ""
    schemas: dict[int, records.Schema] = field(default_factory=dict)
    channels: dict[int, records.Channel] = field(default_factory=dict)
    chunks: list[McapChunk] = field(default_factory=list)
    index: MessageIndex = field(default_factory=lambda: MessageIndex([], ENTRY))
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
    loose = _Messages()
    pos, size = len(MAGIC), len(log)
    while pos < size and not contents.is_closed:
        try:
            record = _read_record(log, pos, size)
            if record.op == Opcode.MESSAGE and record.end - pos < _MESSAGE.size:
                raise BrokenRecordError("a message is too short")
            if record.op == Opcode.MESSAGE:
                pos = loose.take(log, pos, size)
            else:
                _take(log, record, contents)
                pos = record.end
        except BrokenRecordError as err:
            if contents.chunks:  # where its index is cut short, topics are missing from it: `_complete` makes it anew
                contents.chunks[-1].index.clear()
            resumed = next((known for known in _summarised(log) if known > pos), None)
            if resumed is None:
                contents.flaws[f"record {pos}"] = _cut(str(err), pos, contents.chunks)
                break
            contents.flaws[f"record {pos}"] = Flaw(str(err), pos)
            pos = resumed
    if not contents.is_closed and not contents.flaws:
        contents.flaws["end"] = Flaw("the recording was not closed", size, cuts=True)
    chunk_count = contents.statistics.chunk_count if contents.statistics else 0
    if len(contents.chunks) < chunk_count and not contents.flaws:
        contents.flaws["chunks"] = Flaw(f"{chunk_count - len(contents.chunks)} of {chunk_count} chunks are not found")
    if loose.count:
        contents.chunks.append(McapChunk(0, 0, size, is_whole=True, index=loose.index()))
    _complete(log, contents)
    contents.index = MessageIndex([(chunk.pos, chunk.index) for chunk in contents.chunks], ENTRY)
    for chunk in contents.chunks:
        chunk.index.clear()  # held once
    return contents


def _cut(why: str, pos: int, chunks: Sequence[McapChunk]) -> Flaw:
    """The file's end in its record at a position. What is there of a cut chunk is read."""
    if not chunks or chunks[-1].is_whole:
        return Flaw(why, pos, cuts=True)
    return Flaw(why, chunks[-1].end, cuts=True, until_ns=chunks[-1].until_ns)


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


class _Messages:
    """Messages that a walk meets, whose offsets count from a place."""

    def __init__(self, begin: int = 0) -> None:
        self._begin = begin
        self._channels: list[NDArray[np.uint16]] = []
        self._entries: list[NDArray[Any]] = []
        self.count = 0

    def take(self, source: Source, pos: int, end: int) -> int:
        """Take complete messages that follow each other from a record on, some at a time; where the next one begins."""
        low, piece = (0, source) if isinstance(source, bytes) else (pos, source[pos : min(pos + _STRETCH, end)])
        at, stop = pos - low, end - low
        last = min(at + _STRETCH, len(piece), stop) - _MESSAGE.size
        head, least, message, header_of = _RECORD.size, _MESSAGE.size, int(Opcode.MESSAGE), _RECORD.unpack_from
        places: list[int] = []
        while at <= last:
            op, size = header_of(piece, at)
            after = at + head + size
            if op != message or head + size < least or after > stop:
                break
            places.append(at)
            at = after
        if places:
            everywhere = np.ndarray((len(piece) - _MESSAGE.size + 1,), _STORED, piece, 0, (1,))
            stored, entries = everywhere[places], np.empty(len(places), ENTRY)
            entries["time"], entries["offset"] = stored["time"], np.array(places) + (low - self._begin)
            self._channels.append(stored["channel"])
            self._entries.append(entries)
            self.count += len(places)
        return low + at

    def index(self) -> ChunkIndex:
        """The entries of each channel, in the order in which these come first."""
        if not self.count:
            return {}
        channels, entries = np.concatenate(self._channels), np.concatenate(self._entries)
        numbers, firsts, counts = np.unique(channels, return_index=True, return_counts=True)
        parts = np.split(entries[np.argsort(channels, kind="stable")], np.cumsum(counts)[:-1])
        return {int(numbers[one]): parts[one].tobytes() for one in np.argsort(firsts).tolist()}


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
    _, until_ns, size, checksum, name_size = _CHUNK.unpack(log[record.start : name_at])
    start = name_at + name_size + _SIZE.size
    if name_size > _LONGEST_NAME or start > end:
        raise BrokenRecordError("a chunk's header is broken")
    (packed,) = _SIZE.unpack(log[start - _SIZE.size : start])
    if start + packed != record.end:
        raise BrokenRecordError("a chunk of the wrong size")
    compression = log[name_at : name_at + name_size].decode("ascii", "replace")
    return McapChunk(record.pos, start, end, end == record.end, compression, size, until_ns, checksum)


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
    found = _Messages(begin)
    pos = begin
    while pos < end:
        try:
            record = _read_record(buffer, pos, end)
        except BrokenRecordError:
            break
        if record.end > end:
            break
        if record.op == Opcode.MESSAGE and record.end - pos >= _MESSAGE.size:
            pos = found.take(buffer, pos, end)
            if found.count > most:
                raise BrokenRecordError("it holds more messages than a file of its size can")
            continue
        if record.op in (Opcode.SCHEMA, Opcode.CHANNEL):
            _take_described(buffer, record, contents)
        pos = record.end
    return found.index()


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
