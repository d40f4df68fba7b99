"""The digest of a log, worked out while the log is read."""

from __future__ import annotations

import errno
import hashlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Event, Thread
from typing import BinaryIO

from care_core import limits
from care_core.errors import LogError
from care_core.files import open_regular
from care_core.folders import files_in
from care_core.logs.opening import cannot_open

Sha256 = Callable[[], str]
"""Waits for the digest of a log and gives it."""

SAMPLED = "sampled:"
"""Begins the digest of a log that was too large to be read whole for it."""
_SAMPLES, _SAMPLE_BYTES = 256, 1 << 15
_PIECE_BYTES = 1 << 22


def log_digest(path: str | Path, stopped: Event | None = None) -> str:
    """SHA-256 of the file, or of a folder's files one after the other by name, in hex, read in pieces.

    Of a log beyond `limits.WHOLE_BYTES`, of each file's size and of pieces at even distances, the first and last among
    them, and marked as such: it tells recordings apart, and does not prove that no byte of one was changed.

    Args:
        stopped: where set, nobody waits for the answer any more, and what is there is given.
    """
    path = Path(path)
    digest = hashlib.sha256()
    try:
        files = files_in(path) if path.is_dir() else [path]
        if not files:
            raise FileNotFoundError(errno.ENOENT, "there is no file in it", str(path))
        is_whole = sum(file.stat().st_size for file in files) <= limits.WHOLE_BYTES
        for file in files:
            with open_regular(file, buffering=0) as stream:
                for piece in _whole(stream) if is_whole else _samples(stream, file.stat().st_size):
                    digest.update(piece)
                    if stopped is not None and stopped.is_set():
                        break
    except OSError as err:
        raise cannot_open(path, err) from err
    return digest.hexdigest() if is_whole else f"{SAMPLED}{digest.hexdigest()}"


def _whole(stream: BinaryIO) -> Iterator[memoryview]:
    # One large buffer: after each piece the thread waits for its turn among those that compute.
    piece = memoryview(bytearray(_PIECE_BYTES))
    while size := stream.readinto(piece):  # type: ignore[attr-defined]
        yield piece[:size]


def _samples(stream: BinaryIO, size: int) -> Iterator[bytes]:
    yield size.to_bytes(8, "little")
    last = max(0, size - _SAMPLE_BYTES)
    for place in sorted({last * i // (_SAMPLES - 1) for i in range(_SAMPLES)}):
        stream.seek(place)
        yield stream.read(_SAMPLE_BYTES)


@contextmanager
def hashing(path: str | Path) -> Iterator[Sha256]:
    """The log's digest from a thread: hashing leaves the interpreter lock."""
    stopped = Event()
    found: list[str | LogError] = []

    def work() -> None:
        try:
            found.append(log_digest(path, stopped))
        except LogError as err:
            found.append(err)

    def digest() -> str:
        worker.join()
        (answer,) = found
        if isinstance(answer, LogError):
            raise answer
        return answer

    worker = Thread(target=work)
    worker.start()
    try:
        yield digest
    finally:
        stopped.set()
        worker.join()
