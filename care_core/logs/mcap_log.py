"""MCAP files with ROS 1 or ROS 2 messages. Times are log times; only chunks that hold a wanted topic are touched."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from care_core.logs import formats
from care_core.logs.compression import ZSTD_MAGIC, CannotUnpackError, PlainFile, Unpacker
from care_core.logs.file_windows import FileBytes, opened
from care_core.logs.mcap_records import MAGIC, McapChunk, McapContents, locate, read_contents
from care_core.logs.message_index import Places
from care_core.logs.recording import recording_at
from care_core.logs.ros_log import (
    BrokenRecordError,
    Connection,
    Flaw,
    Message,
    RosLog,
    Source,
    check_room,
    piece_of,
    timed,
)
from care_core.logs.ros_metadata import Metadata, parse_metadata

_WHAT = "an MCAP file"
_ROSBAG2, _SERIALIZED = "rosbag2", "serialized_metadata"


class McapLog(RosLog):
    """An MCAP file, or the files of a split recording."""

    def __init__(self, path: Path) -> None:
        """Walk over the record headers. Raises LogError when it is no readable file, or nothing can be decoded."""
        recording = recording_at(path)
        parts = [McapPart(file) for file in recording.files]
        super().__init__(
            path, formats.MCAP, parts,
            metadata=recording.metadata, missing=recording.missing, notes=recording.notes,
        )  # fmt: skip


class McapPart:
    """One MCAP file, fulfilling `Part`."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file = PlainFile(path)
        with opened(self._file.path, MAGIC, _WHAT) as log:
            contents = read_contents(log)
        self._chunks, self._index = contents.chunks, contents.index
        self._checked: set[int] = set()
        self.flaws = timed(contents.flaws, self._index)
        if self._file.is_cut:
            self.flaws["zstd"] = Flaw("the zstd file is cut short or broken")
        self.connections: Mapping[int, Connection] = contents.connections()
        self.times_ns = self._index.times_of(contents.channels)
        self.metadata = _metadata(contents)

    def messages(self, wanted: Places) -> Iterator[Message]:
        """The wanted messages, chunk by chunk."""
        with opened(self._file.path, MAGIC, _WHAT) as log:
            unpack = Unpacker(len(log))
            chunks, chosen = self._chunks, self._index.chosen(wanted)
            for at, rows, needed in log.announced(chosen, lambda one: chunks[one.chunk].packed(unpack, one.needed)):
                if plain := self._open(at, needed, log, unpack):
                    yield from self._of_chunk(chunks[at], rows, unpack, *plain)

    def _open(self, at: int, needed: int, log: FileBytes, unpack: Unpacker) -> tuple[Source, int, int] | None:
        chunk = self._chunks[at]
        key = f"chunk {chunk.pos}"
        try:
            found = chunk.open(log, unpack, needed)
        except BrokenRecordError as err:
            self.flaws.setdefault(key, Flaw(str(err), chunk.pos, self._index.first_ns(at)))
            return None
        if not unpack.takes_parts and chunk.pos not in self._checked:  # what is not read cannot be summed up
            self._checked.add(chunk.pos)
            why = chunk.flaw(*found)
            if why:
                self.flaws.setdefault(key, Flaw(why, chunk.pos, self._index.first_ns(at)))
        return found

    def _of_chunk(
        self, chunk: McapChunk, rows: NDArray[np.intp], unpack: Unpacker, buffer: Source, begin: int, end: int
    ) -> Iterator[Message]:
        left = end - begin
        cdr = {number for number, one in self.connections.items() if one.encoding == "cdr"}
        for number, time_ns, offset in self._index.entries(rows):
            try:
                pos, after = locate(buffer, begin, end, offset, number, time_ns)
                left -= after - pos
                check_room(left)
                # No CDR message begins so: the recorder packed each message by itself.
                if number in cdr and buffer[pos : pos + len(ZSTD_MAGIC)] == ZSTD_MAGIC:
                    plain = unpack("zstd", buffer[pos:after])
                    yield number, time_ns, plain, 0, len(plain)
                else:
                    yield number, time_ns, *piece_of(buffer, pos, after)
            except (BrokenRecordError, CannotUnpackError) as err:
                self.flaws.setdefault(f"chunk {chunk.pos}", Flaw(str(err), chunk.pos, time_ns))


def _metadata(contents: McapContents) -> Metadata:
    """What the recorder wrote into the file: its own record, the statistics, and whatever else was noted."""
    found = []
    for record in contents.metadata:
        if record.name == _ROSBAG2:
            found.append(parse_metadata(record.metadata.get(_SERIALIZED, "")))
        else:
            found.append(Metadata(custom={f"{record.name}.{key}": text for key, text in record.metadata.items()}))
    counted = contents.statistics
    if counted is not None:
        span_s = (counted.message_end_time - counted.message_start_time) / 1e9
        found.append(Metadata(duration_s=span_s, message_count=counted.message_count))
    return Metadata.merged(found)
