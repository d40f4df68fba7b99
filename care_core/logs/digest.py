"""The digest of a log, worked out while the log is read."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

from care_core.logs.opening import cannot_open

Sha256 = Callable[[], str]
"""Waits for the digest of a log and gives it."""


def log_digest(path: str | Path) -> str:
    """SHA-256 of the file, or of a folder's files one after the other by name, in hex, read in pieces."""
    path = Path(path)
    digest = hashlib.sha256()
    # One large buffer: after each piece the thread waits for its turn among those that compute.
    piece = memoryview(bytearray(1 << 22))
    try:
        files = sorted(file for file in path.iterdir() if file.is_file()) if path.is_dir() else [path]
        for file in files:
            with file.open("rb", buffering=0) as stream:
                while size := stream.readinto(piece):
                    digest.update(piece[:size])
    except OSError as err:
        raise cannot_open(path, err) from err
    return digest.hexdigest()


@contextmanager
def hashing(path: str | Path) -> Iterator[Sha256]:
    """The log's digest from a thread: hashing leaves the interpreter lock."""
    with ThreadPoolExecutor(max_workers=1) as pool:
        yield pool.submit(log_digest, path).result
