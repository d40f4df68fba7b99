"""The bytes of a log file, safe from whoever cuts the file meanwhile: what is gone is an error, never a signal."""

from __future__ import annotations

import ctypes
import os
import sys
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from io import SEEK_END, BytesIO, FileIO
from pathlib import Path
from threading import Lock
from typing import Any, TypeVar
from weakref import finalize

import numpy as np
from numpy.typing import DTypeLike, NDArray

from care_core import limits
from care_core.errors import LogError
from care_core.files import open_regular

Bytes = NDArray[np.uint8]
Offsets = NDArray[np.integer[Any]]
Item = TypeVar("Item")
Stored = tuple[int, "np.dtype[Any]"]
"""How many bytes behind a place something is stored, and its type."""

_BLOCK = 1 << 12
"""Bytes read at least: the headers of neighbouring records lie close together."""
WINDOW, _MOST_WINDOWS = 1 << 18, 8
"""Bytes read at most for records that lie apart: they stay in the processor's cache while they are picked out. So many
times more where several lists are looked for: of each, some hundreds of records at once."""

_MAPPED = 32 << 20
"""glibc returns what is freed to the system where no larger block was freed before (mallopt(3): M_MMAP_THRESHOLD), and
always above so many bytes."""
_KEPT = _MAPPED - (1 << 20)
"""Taking the pages of each chunk anew costs ten times as much as unpacking lz4. Untouched, it needs none."""
_AHEAD, _MOST_AHEAD = 2, 1 << 23
"""So many stretches, and so many bytes of each, are fetched from the disk while one is worked on."""

WATCH: ContextVar[Callable[[int, int], None] | None] = ContextVar("WATCH", default=None)
"""Who is told, while files are read in this thread, the byte that was come to and the size of the file."""


class FileBytes:
    """A file that is sliced like `bytes` and read where it is sliced. Raises LogError for bytes that are gone."""

    def __init__(self, path: Path, stream: FileIO) -> None:
        self._path, self._stream = path, stream
        self._size = stream.seek(0, SEEK_END)
        self._at, self._end, self._block = 0, 0, b""
        keep_freed()

    def __len__(self) -> int:
        return self._size

    def __getitem__(self, place: slice) -> bytes:
        low, high = place.start, place.stop
        if low is not None and high is not None and self._at <= low <= high <= self._end:  # most of the time
            return self._block[low - self._at : high - self._at]
        low, high, _ = place.indices(self._size)
        size = high - low
        if size <= 0:
            return b""
        if size > _BLOCK:
            return self._read(low, size)
        self._block = self._read(low, min(_BLOCK, self._size - low))
        self._at, self._end = low, low + len(self._block)
        return self._block[:size]

    def byte(self, place: int) -> int:
        """The byte at a place. Raises IndexError beyond the end."""
        return self[place : place + 1][0]

    def announced(self, items: Iterable[Item], stretch: Callable[[Item], tuple[int, int]]) -> Iterator[Item]:
        """The items, each after the system was told to fetch the stretches (low, high) of the next ones: the disk works
        while this thread does, and brings nothing that was not asked for."""
        ahead: deque[Item] = deque()
        for item in items:
            self._fetch(*stretch(item))
            ahead.append(item)
            if len(ahead) > _AHEAD:
                yield ahead.popleft()
        yield from ahead

    def _fetch(self, low: int, high: int) -> None:
        if low >= high or not hasattr(os, "posix_fadvise"):
            return
        # Otherwise it guesses from the places that are read what comes next, and fetches twice as much.
        os.posix_fadvise(self._stream.fileno(), 0, 0, os.POSIX_FADV_RANDOM)
        os.posix_fadvise(self._stream.fileno(), low, min(high - low, _MOST_AHEAD), os.POSIX_FADV_WILLNEED)

    def _read(self, low: int, size: int) -> bytes:
        self._stream.seek(low)
        found = self._stream.read(size)
        if len(found) < size:
            raise cut_while_read(self._path)
        if (watch := WATCH.get()) is not None:
            watch(low + size, self._size)
        return found


def cut_while_read(path: Path) -> LogError:
    """The error of a log that became shorter since it was opened."""
    return LogError("The file was cut while it was read.", hint="Try again.", where=str(path))


@contextmanager
def opened(path: Path, magic: bytes, what: str) -> Iterator[FileBytes]:
    """The file's bytes. Raises LogError when it cannot be read or does not begin with `magic`."""
    try:
        with open_regular(path, buffering=0) as stream:
            log = FileBytes(path, stream)
            if log[: len(magic)] != magic:
                raise LogError(f"Not {what}.", hint="Was it copied whole?", where=str(path))
            yield log
    except OSError as err:
        raise LogError(f"Cannot read the log: {err.strerror or err}.", where=str(path)) from err


class FileArray:
    """A file as an array of bytes, shape (n,), that is read where it is indexed, for as long as its reader lives.

    Never mapped: of a mapped file, what somebody cuts off meanwhile ends the process with a signal. One of at most
    `limits.HELD_BYTES` is read once and held; of a larger one so much is read as is asked for, window by window, which
    costs the copying and saves the memory. Places come in the order of the file, as records do.
    """

    def __init__(self, stream: FileIO | BytesIO, path: Path) -> None:
        self._stream, self.path = stream, path
        self._size = stream.seek(0, SEEK_END)
        self._lock = Lock()
        self._held = self._filled(np.empty(self._size, np.uint8), 0) if self._size <= limits.HELD_BYTES else None

    @classmethod
    def open(cls, path: Path) -> FileArray:
        """The bytes of a file. Raises LogError where it cannot be read."""
        try:
            stream = open_regular(path, buffering=0)
        except OSError as err:
            raise LogError(f"Cannot read the file: {err}.", where=str(path)) from err
        found = cls(stream, path)
        finalize(found, stream.close)
        return found

    def __len__(self) -> int:
        return self._size

    def between(self, low: int, high: int) -> Bytes:
        """The bytes of a stretch, as many as the file had when it was opened. Raises LogError for those gone."""
        low, high = max(low, 0), min(high, self._size)
        if self._held is not None:
            return self._held[low:high]
        return self._filled(np.empty(max(high - low, 0), dtype=np.uint8), low)

    def _filled(self, found: Bytes, low: int) -> Bytes:
        """The array with the bytes of the file from `low` in it."""
        rest = found.data
        try:
            with self._lock:  # the app's threads share a log
                self._stream.seek(low)
                while len(rest):
                    count = self._stream.readinto(rest)
                    if not count:
                        raise cut_while_read(self.path)
                    rest = rest[count:]
        except OSError as err:
            raise LogError(f"Cannot read the file: {err}.", where=str(self.path)) from err
        if (watch := WATCH.get()) is not None:
            watch(low + len(found), self._size)
        return found

    def pieces(self, more: int) -> Iterator[tuple[int, Bytes]]:
        """The whole file piece by piece: where each begins, and its bytes with so many of the next, which may be
        overwritten by the next."""
        buffer = np.empty(WINDOW + more if self._held is None else 0, dtype=np.uint8)
        for low in range(0, self._size, WINDOW):
            high = min(low + WINDOW + more, self._size)
            yield low, self._filled(buffer[: high - low], low) if self._held is None else self._held[low:high]

    def byte(self, place: int) -> int:
        return int(self.between(place, place + 1)[0])

    def at(self, places: Offsets, dtype: DTypeLike = np.uint8) -> NDArray[Any]:
        """What is stored at places, shape (n,) and that of the type; past the end of the file are zeros."""
        return self.fields([(places, [(0, np.dtype(dtype))])])[0][0]

    def fields(self, wanted: Sequence[tuple[Offsets, Sequence[Stored]]]) -> list[list[NDArray[Any]]]:
        """As `at`, for several lists of places, of each the values that lie so many bytes behind them: all from one
        walk through the file."""
        found = [[np.empty((len(places), *kind.shape), kind.base) for _, kind in kinds] for places, kinds in wanted]
        size = max((offset + kind.itemsize for _, kinds in wanted for offset, kind in kinds), default=0)
        for near, piece in self.windows([places for places, _ in wanted], size):
            for columns, (_, kinds), (rows, inner) in zip(found, wanted, near, strict=True):
                if not len(inner):
                    continue
                # The stretch with all of them is picked out once: that is what takes the time.
                first = min(offset for offset, _ in kinds)
                span = max(offset + kind.itemsize for offset, kind in kinds) - first
                picked = stored_in(piece, inner, (first, np.dtype((np.void, span)))).view(np.uint8)
                for column, (offset, kind) in zip(columns, kinds, strict=True):
                    column[rows] = _every(picked, offset - first, kind, span)
        return found

    def parts(self, lows: Offsets, highs: Offsets) -> list[bytes]:
        """The stretches from `lows` to `highs`, which follow each other in the file."""
        found: list[bytes] = []
        for first, last in _close(lows, WINDOW):
            low = int(lows[first])
            text = self.between(low, int(highs[last - 1])).data
            bounds = zip((lows[first:last] - low).tolist(), (highs[first:last] - low).tolist(), strict=True)
            found += [bytes(text[a:b]) for a, b in bounds]
        return found

    def windows(self, places: Sequence[Offsets], size: int) -> Iterator[tuple[list[tuple[slice, Offsets]], Bytes]]:
        """A walk along lists of places: of each list the rows that lie in a window and where in it, and the window's
        bytes with `size` past the last place, zeros past the end of the file; they may be overwritten by the next."""
        window = WINDOW * min(len(places), _MOST_WINDOWS)
        buffer = np.empty(window + size if self._held is None else 0, dtype=np.uint8)
        first = [0] * len(places)
        while ahead := [int(each[at]) for each, at in zip(places, first, strict=True) if at < len(each)]:
            low = min(ahead)
            last = [_until(each, low + window - 1) for each in places]
            near = [(slice(a, b), each[a:b] - low) for each, a, b in zip(places, first, last, strict=True)]
            high = low + max(int(inner[-1]) for _, inner in near if len(inner)) + size
            there = min(high, self._size)
            held = self._held
            piece = self._filled(buffer[: there - low], low) if held is None else held[low:there]
            if there < high:
                piece = np.append(piece, np.zeros(high - there, dtype=np.uint8))
            yield near, piece
            first = last


def keep_freed() -> None:
    """Have what is freed from now on stay with the process: taking the pages of each large array anew is slow."""
    np.empty(_KEPT, np.uint8)  # freed at once


def give_back(size: int) -> None:
    """Give the system what was freed, ahead of so many bytes that never take its place."""
    if size > _MAPPED and sys.platform == "linux" and (trim := getattr(ctypes.CDLL(None), "malloc_trim", None)):
        trim(0)


def stored_in(piece: Bytes, places: Offsets, kind: Stored) -> NDArray[Any]:
    """What is stored so many bytes behind places of a window."""
    # A view of the type at every byte, from which indexing copies only the wanted.
    return _every(piece, *kind, step=1)[places]


def _every(piece: Bytes, offset: int, dtype: np.dtype[Any], step: int) -> NDArray[Any]:
    """A view of what is stored in a window at a byte and after each so many more, shape (n,) and that of the type."""
    inner = (dtype.base.itemsize,) if dtype.shape else ()
    count = (len(piece) - offset - dtype.itemsize) // step + 1
    found: NDArray[Any] = np.ndarray((count, *dtype.shape), dtype.base, piece.data, offset, (step, *inner))
    return found


def _until(places: Offsets, last: int) -> int:
    """How many places, in the order of the file, lie no further than a byte."""
    if not len(places) or places[-1] <= last:
        return len(places)
    # A number of the array's own type: of another, the whole array is converted each time.
    return int(np.searchsorted(places, places.dtype.type(last), "right"))


def _close(places: Offsets, window: int) -> Iterator[tuple[int, int]]:
    """First and one past the last of places, in the order of the file, that lie within so many bytes."""
    first = 0
    while first < len(places):
        last = _until(places, int(places[first]) + window)
        yield first, last
        first = last
