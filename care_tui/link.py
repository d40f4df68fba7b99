"""No frame is drawn before the terminal has shown the one before: over a slow link frames would queue up, and a held
key would go on long after it was released.

After a frame the terminal is asked where its cursor is, which it answers when it has come to the question. Until then
the app batches its updates, and what changed meanwhile is drawn at once when the answer is there. A terminal that never
answered is not waited for, unless it does not even take what is written to it.
"""

from __future__ import annotations

import select
import sys
import time
from collections.abc import Callable
from typing import Any

from textual.driver import Driver

from care_tui.frames import lean

ASK = "\x1b[6n"
"""Report the position of the cursor (DSR, ECMA-48 section 8.3.35)."""
_LOST_S = 2.0
"""An answer that takes longer does not come any more."""


def _takes_nothing() -> bool:
    """Whether the terminal has no room for what is written to it."""
    stream = sys.__stderr__  # what Textual draws on
    return stream is not None and stream.isatty() and not select.select([], [stream.fileno()], [], 0)[1]


class Link:
    """What is under way to the terminal. `write` sends to it; nothing is sent while there is none."""

    def __init__(self, is_full: Callable[[], bool] = _takes_nothing) -> None:
        self.write: Callable[[str], None] | None = None
        self.width = 0
        """Cells across the terminal; 0 where that is not known yet."""
        self._is_full = is_full
        self._answers = False
        self._asked_s: float | None = None

    @property
    def is_busy(self) -> bool:
        """Whether the last frame is still under way."""
        return self.write is not None and (self._is_full() or (self._answers and self.is_asked))

    @property
    def is_asked(self) -> bool:
        """Whether an answer may still come."""
        return self._asked_s is not None and time.monotonic() - self._asked_s < _LOST_S

    def drawn(self) -> None:
        """A frame was written."""
        if self.write is not None and (self._asked_s is None or (self._answers and not self.is_asked)):
            self._asked_s = time.monotonic()
            self.write(ASK)

    def answered(self) -> None:
        """The terminal has come to the end of the last frame."""
        self._answers, self._asked_s = True, None


def linked(driver: type[Driver], link: Link) -> type[Driver]:
    """The driver of the terminal, which lends the link its `write` while it is running."""

    class Linked(driver):  # type: ignore[misc,valid-type]
        def __init__(self, *args: Any, **kwargs: Any) -> None:
            super().__init__(*args, **kwargs)
            link.write = None if self.is_headless or self.is_web else self.write

        def write(self, data: str) -> None:
            super().write(lean(data, link.width))

    return Linked
