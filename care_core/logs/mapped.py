"""The bytes of a log file, safe from whoever cuts the file meanwhile: what is gone is an error, never a signal."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property
from io import SEEK_END, FileIO
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from care_core import limits
from care_core.errors import LogError

Bytes = NDArray[np.uint8]

_BLOCK = 1 << 12
"""Bytes read at least: the headers of neighbouring records lie close together."""


class FileBytes:
    """A file that is sliced like `bytes` and read where it is sliced. Raises LogError for bytes that are gone."""

    def __init__(self, path: Path, stream: FileIO) -> None:
        self._path, self._stream = path, stream
        self._size = stream.seek(0, SEEK_END)
        self._at, self._block = 0, b""

    def __len__(self) -> int:
        return self._size

    def __getitem__(self, place: slice) -> bytes:
        low, high, _ = place.indices(self._size)
        size = high - low
        if size <= 0:
            return b""
        first = low - self._at
        if first >= 0 and first + size <= len(self._block):
            return self._block[first : first + size]
        if size >= _BLOCK:
            return self._read(low, size)
        self._at, self._block = low, self._read(low, min(_BLOCK, self._size - low))
        return self._block[:size]

    def byte(self, place: int) -> int:
        """The byte at a place. Raises IndexError beyond the end."""
        return self[place : place + 1][0]

    def _read(self, low: int, size: int) -> bytes:
        self._stream.seek(low)
        found = self._stream.read(size)
        if len(found) < size:
            raise cut_while_read(self._path)
        return found


def cut_while_read(path: Path) -> LogError:
    """The error of a log that became shorter since it was opened."""
    return LogError("The file was cut while it was read.", hint="Try again.", where=str(path))


@contextmanager
def opened(path: Path, magic: bytes, what: str) -> Iterator[FileBytes]:
    """The file's bytes. Raises LogError when it cannot be read or does not begin with `magic`."""
    try:
        with path.open("rb", buffering=0) as stream:
            log = FileBytes(path, stream)
            if log[: len(magic)] != magic:
                raise LogError(f"Not {what}.", hint="Was it copied whole?", where=str(path))
            yield log
    except OSError as err:
        raise LogError(f"Cannot read the log: {err.strerror or err}.", where=str(path)) from err


class MappedFile:
    """A file as an array of bytes, for as long as its reader lives.

    Held in memory; a large one is mapped instead, and then a cut between two reads is seen, but one in the middle of a
    read ends the process.
    """

    def __init__(self, path: Path) -> None:
        self._path = path

    def bytes(self) -> Bytes:
        """The bytes, shape (n,). Raises LogError where the file cannot be read, or has become shorter since."""
        try:
            data = self._data
            if data.base is not None and self._path.stat().st_size < len(data):
                raise cut_while_read(self._path)
        except (OSError, ValueError) as err:
            raise LogError(f"Cannot read the file: {err}.", where=str(self._path)) from err
        return data

    @cached_property
    def _data(self) -> Bytes:
        if self._path.stat().st_size <= limits.HELD_BYTES:
            return np.fromfile(self._path, dtype=np.uint8)
        return np.asarray(np.memmap(self._path, dtype=np.uint8, mode="r"))
