"""ROS 1 bags. Times are the bag's record times; only chunks that hold a wanted topic are touched."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from care_core.errors import LogError
from care_core.logs import formats
from care_core.logs.compression import Unpacker
from care_core.logs.file_windows import opened
from care_core.logs.message_index import Places
from care_core.logs.recording import PART, recording_at
from care_core.logs.ros1_records import MAGIC, BagChunk, BagContents, locate, read_contents
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
from care_core.logs.ros_metadata import Metadata

_MOST_PAUSE_NS = 60_000_000_000
"""`rosbag record` begins the next part at once: parts further apart are separate recordings."""


class Ros1Bag(RosLog):
    """A ROS 1 bag of format 2.0, or the parts of a split one."""

    def __init__(self, path: Path) -> None:
        """Walk over the record headers. Raises LogError when it is no readable bag at all."""
        recording = recording_at(path)
        parts = [Ros1Part(file) for file in recording.files]
        _check_one_run(path, parts)
        notes = dict(recording.notes)
        if recording.beside and not any(_joins(parts[0], file) for file in recording.beside):
            del notes[PART]  # numbered by hand: recordings of their own
        super().__init__(
            path, formats.ROS1_BAG, parts, missing=recording.missing, notes=notes,
        )  # fmt: skip


class Ros1Part:
    """One bag file, fulfilling `Part`."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.metadata = Metadata()
        with opened(path, MAGIC, "a ROS 1 bag of format 2.0") as bag:
            self._contents: BagContents = read_contents(bag)
        if self._contents.is_encrypted:
            raise LogError("The bag is encrypted.", hint="Decrypt it with 'rosbag decrypt' first.", where=str(path))
        self.connections: Mapping[int, Connection] = self._contents.connections
        self._index = self._contents.index
        self.flaws = timed(self._contents.flaws, self._index)
        self.times_ns = self._index.times_of(self._contents.connections)

    def messages(self, wanted: Places) -> Iterator[Message]:
        """The wanted messages, chunk by chunk."""
        with opened(self.path, MAGIC, "a ROS 1 bag of format 2.0") as bag:
            unpack = Unpacker(len(bag))
            chunks = self._contents.chunks
            chosen = self._index.chosen(wanted)
            for at, rows, needed in bag.announced(chosen, lambda one: chunks[one.chunk].packed(unpack, one.needed)):
                chunk = chunks[at]
                try:
                    plain = chunk.open(bag, unpack, needed)
                except BrokenRecordError as err:
                    self.flaws.setdefault(f"chunk {chunk.pos}", Flaw(str(err), chunk.pos, self._index.first_ns(at)))
                else:
                    yield from self._of_chunk(chunk, rows, *plain)

    def _of_chunk(
        self, chunk: BagChunk, rows: NDArray[np.intp], buffer: Source, begin: int, end: int
    ) -> Iterator[Message]:
        left = end - begin
        for number, time_ns, offset in self._index.entries(rows):
            try:
                pos, after = locate(buffer, begin, end, offset)
                left -= after - pos
                check_room(left)
            except BrokenRecordError as err:
                self.flaws.setdefault(f"chunk {chunk.pos}", Flaw(str(err), chunk.pos, time_ns))
            else:
                yield number, time_ns, *piece_of(buffer, pos, after)


def _joins(part: Ros1Part, file: Path) -> bool:
    """Whether another file begins where a part ends, or ends where it begins; one that cannot be read may."""
    try:
        spans = sorted((_span(part), _span(Ros1Part(file))))
    except (LogError, ValueError):
        return True
    return _follows(*spans)


def _span(part: Ros1Part) -> tuple[int, int]:
    """First and last record time, ns; ValueError where there is none."""
    times = part.times_ns.values()
    return min(int(t.min()) for t in times), max(int(t.max()) for t in times)


def _follows(sooner: tuple[int, int], later: tuple[int, int]) -> bool:
    return -_MOST_PAUSE_NS < later[0] - sooner[1] < _MOST_PAUSE_NS


def _check_one_run(path: Path, parts: Sequence[Ros1Part]) -> None:
    """Refuse a folder whose parts do not follow one another. Raises LogError."""
    spans = [_span(part) for part in parts if part.times_ns]
    if not all(_follows(sooner, later) for sooner, later in pairwise(spans)):
        raise LogError(
            "The bags in the folder are separate recordings.", hint="Name one log file in it.", where=str(path)
        )
