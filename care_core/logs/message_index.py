"""Where the messages of a chunked file lie: the indexes of all its chunks as one, worked on with numpy."""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Places = Mapping[int, NDArray[np.intp]]
"""Messages by connection number, each by its place among the record times of its connection, ascending."""

ChunkIndex = dict[int, bytes]
"""A chunk's index as it is stored: by connection number the entries of its messages."""


class Chosen(NamedTuple):
    """A chunk that holds wanted messages, and which of all messages these are."""

    chunk: int
    rows: NDArray[np.intp]
    needed: int
    """Bytes of the plain chunk up to the first message behind the last wanted one; 0: all that there are."""


class MessageIndex:
    """The messages of a file, chunk by chunk in the order of the file.

    Attributes:
        numbers, offsets, times_ns: connection of each message, where it lies in its plain chunk, and its record time;
            shape (n,).
        bounds: where the messages of each chunk begin, and the last end, shape (chunks + 1,).
    """

    def __init__(self, chunks: Sequence[tuple[int, ChunkIndex]], entry: np.dtype[Any]) -> None:
        """Join the indexes of chunks that begin at these bytes of the file."""
        self._begins = np.array([begin for begin, _ in chunks], np.uint64)
        stored = [part for _, index in chunks for part in index.items()]
        numbers = np.array([number for number, _ in stored], np.uint64)
        numbers = numbers.astype(np.min_scalar_type(numbers.max(initial=0)))  # few bits are sorted quickly
        self.numbers = np.repeat(numbers, [len(entries) // entry.itemsize for _, entries in stored])
        sizes = [0, *(sum(map(len, index.values())) // entry.itemsize for _, index in chunks)]
        self.bounds = np.cumsum(sizes, dtype=np.intp)
        entries = np.frombuffer(b"".join([entries for _, entries in stored]), entry)
        self.offsets: NDArray[np.unsignedinteger[Any]] = entries["offset"].copy()
        self.times_ns = _times_ns(entries)
        order = np.argsort(self.numbers, kind="stable")
        found, firsts = np.unique(self.numbers[order], return_index=True)
        self._rows: Places = dict(zip(found.tolist(), np.split(order, firsts[1:]), strict=False))

    def times_of(self, known: Container[int]) -> dict[int, NDArray[np.int64]]:
        """The record times of each known connection, in the order of the file."""
        return {number: self.times_ns[rows] for number, rows in self._rows.items() if number in known}

    def chosen(self, wanted: Places) -> Iterator[Chosen]:
        """Each chunk that holds wanted messages."""
        rows = np.sort(np.concatenate([np.empty(0, np.intp), *(self._rows[n][places] for n, places in wanted.items())]))
        edges = np.searchsorted(rows, self.bounds)
        chunks = np.flatnonzero(np.diff(edges))
        if len(chunks):
            parts = np.split(rows, edges[chunks[1:]])
            yield from map(Chosen, chunks.tolist(), parts, self._needed(chunks, rows, edges[chunks]).tolist())

    def entries(self, rows: NDArray[np.intp]) -> Iterator[tuple[int, int, int]]:
        """Connection, record time in ns and offset of messages."""
        return zip(self.numbers[rows].tolist(), self.times_ns[rows].tolist(), self.offsets[rows].tolist(), strict=True)

    def _needed(
        self, chunks: NDArray[np.intp], rows: NDArray[np.intp], firsts: NDArray[np.intp]
    ) -> NDArray[np.unsignedinteger[Any]]:
        """Per chunk what `Chosen` says; its rows begin at each of `firsts`."""
        none = np.iinfo(self.offsets.dtype).max
        last = np.full(len(self._begins), none, self.offsets.dtype)
        last[chunks] = np.maximum.reduceat(self.offsets[rows], firsts)
        behind = np.where(self.offsets > np.repeat(last, np.diff(self.bounds)), self.offsets, none)
        least = np.minimum.reduceat(behind, self.bounds[chunks])
        return np.where(least == none, 0, least)

    def first_ns(self, chunk: int) -> int | None:
        """The earliest record time of a chunk, None where it holds no message."""
        times = self.times_ns[self.bounds[chunk] : self.bounds[chunk + 1]]
        return int(times.min()) if len(times) else None

    def last_ns_before(self, byte: int) -> int | None:
        """The latest record time of the chunks that begin before a byte of the file, None where they hold none."""
        times = self.times_ns[np.repeat(self._begins < byte, np.diff(self.bounds))]
        return int(times.max()) if len(times) else None


def _times_ns(entries: NDArray[Any]) -> NDArray[np.int64]:
    if "time" in (entries.dtype.names or ()):
        return entries["time"].astype(np.int64)
    times: NDArray[np.int64] = entries["seconds"].astype(np.int64) * 1_000_000_000 + entries["nanoseconds"]
    return times
