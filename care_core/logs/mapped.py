"""A log file mapped into memory for the time of one pass over it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from mmap import ACCESS_READ, mmap
from pathlib import Path

from care_core.errors import LogError


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
