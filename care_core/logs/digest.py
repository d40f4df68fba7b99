"""The digest of a log, worked out while the log is read."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

from care_core.logs import log_digest

Sha256 = Callable[[], str]
"""Waits for the digest of a log and gives it."""


@contextmanager
def hashing(path: str | Path) -> Iterator[Sha256]:
    """The log's digest from a thread: hashing leaves the interpreter lock."""
    with ThreadPoolExecutor(max_workers=1) as pool:
        yield pool.submit(log_digest, path).result
