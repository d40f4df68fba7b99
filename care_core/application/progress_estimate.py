"""How far the reading of a large log has come, told between the steps of the work: bytes, and the time that is left."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from care_core import limits

_TELL_S = 0.1
"""Between two words: an operator who stops the work waits no longer than twice that."""
_SURE_S = 1.0
"""After so long the time that is left can be told."""


class Watched:
    """A progress that is told the steps, and from below them the place in the file that is read."""

    def __init__(self, progress: Callable[[str, float], None]) -> None:
        self._progress = progress
        self._step, self._share = "", 0.0
        self._began = self._told = time.monotonic()
        self._last = 0

    def __call__(self, step: str, share: float) -> None:
        self._step, self._share = step, share
        self._began, self._last = time.monotonic(), 0
        self._progress(step, share)

    def at(self, place: int, size: int) -> None:
        """The reader is at this byte of a file of so many."""
        now = time.monotonic()
        if now - self._told < _TELL_S:
            return
        self._told = now
        if place < self._last:  # the file is read once more, for something else
            self._began = now
        self._last = place
        self._progress(f"{self._step}{_bytes(place, size, now - self._began)}", self._share)


def _bytes(place: int, size: int, spent_s: float) -> str:
    if size <= limits.WHOLE_BYTES:
        return ""
    left_s = spent_s * (size - place) / max(place, 1)
    left = f", {left_s:.0f} s left" if spent_s > _SURE_S else ""
    return f": {place / 1e9:.1f} of {size / 1e9:.1f} GB{left}"


@contextmanager
def watching(progress: Callable[[str, float], None]) -> Iterator[Watched]:
    """A progress for work in this thread that reads files."""
    from care_core.logs.file_windows import WATCH

    watched = Watched(progress)
    token = WATCH.set(watched.at)
    try:
        yield watched
    finally:
        WATCH.reset(token)
