"""No frame is drawn before the terminal has shown the one before: over a slow link frames would queue up, and a held
key would go on long after it was released.

After a frame the terminal is asked where its cursor is, which it answers when it has come to the question. What changes
meanwhile is drawn at once when the answer is there. A terminal that never answered is not waited for, unless what was
written to it has not even left this machine.
"""

from __future__ import annotations

import time
from collections.abc import Callable

ASK = "\x1b[6n"
"""Report the position of the cursor (DSR, ECMA-48 section 8.3.35)."""
_LOST_S = 2.0
"""An answer that takes longer does not come any more."""


class Link:
    """What is under way to the terminal. `write` sends to it; `waiting` tells how many writes wait on this side."""

    def __init__(self, write: Callable[[str], None], waiting: Callable[[], int]) -> None:
        self._write, self._waiting = write, waiting
        self._answers = False
        self._asked_s: float | None = None

    @property
    def is_busy(self) -> bool:
        """Whether the last frame is still under way."""
        return self._waiting() > 0 or (self._answers and self.is_asked)

    @property
    def is_asked(self) -> bool:
        """Whether an answer may still come."""
        return self._asked_s is not None and time.monotonic() - self._asked_s < _LOST_S

    def drawn(self) -> None:
        """A frame was written."""
        if self._asked_s is None or (self._answers and not self.is_asked):
            self._asked_s = time.monotonic()
            self._write(ASK)

    def answered(self) -> None:
        """The terminal has come to the end of the last frame."""
        self._answers, self._asked_s = True, None
