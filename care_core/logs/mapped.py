"""A log file mapped into memory: for one pass over it, or for as long as its reader lives."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cached_property
from mmap import ACCESS_READ, mmap
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from care_core.errors import LogError

Bytes = NDArray[np.uint8]


@contextmanager
def mapped(path: Path, magic: bytes, what: str) -> Iterator[mmap]:
    """The file's bytes. Raises LogError when it cannot be read or does not begin with `magic`."""
    try:
        with path.open("rb") as stream:
            if stream.read(len(magic)) != magic:
                raise LogError(f"Not {what}.", hint="Was it copied whole?", where=str(path))
            with mmap(stream.fileno(), 0, access=ACCESS_READ) as view:
                yield view
    except OSError as err:
        raise LogError(f"Cannot read the log: {err.strerror or err}.", where=str(path)) from err


class MappedFile:
    """A file as an array of bytes, mapped once and not copied."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def bytes(self) -> Bytes:
        """The bytes, shape (n,). Raises LogError where the file cannot be read, or has become shorter since."""
        try:
            data, size = self._mapped, self._path.stat().st_size
        except (OSError, ValueError) as err:
            raise LogError(f"Cannot read the file: {err}.", where=str(self._path)) from err
        if size < len(data):  # touching a byte that is gone ends the process
            raise LogError("The file was cut while it was read.", hint="Try again.", where=str(self._path))
        return data

    @cached_property
    def _mapped(self) -> Bytes:
        return np.asarray(np.memmap(self._path, dtype=np.uint8, mode="r"))
