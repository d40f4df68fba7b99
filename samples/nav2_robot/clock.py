"""The simulated clock, which waits for Nav2: on a slow machine a mission takes longer, and is the same mission."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable

LIMIT_S = 2.0
"""Of real time, for one answer."""
_AGAIN_S = 0.05


class Answers:
    """What Nav2 owes: a command every period while it drives, a plan while it plans. Told by other threads."""

    def __init__(self, period_s: float) -> None:
        self.period_s = period_s
        self.late = 0
        """Answers that did not come within the limit."""
        self.waited_s = 0.0
        self._changed = threading.Condition()
        self._drives = self._plans = self._trusted = False
        self._count, self._last_s = 0, 0.0

    def driving(self, drives: bool) -> None:
        """Whether the controller follows a path."""
        with self._changed:
            self._trusted = self._trusted and drives
            self._drives = drives
            self._changed.notify_all()

    def planning(self, plans: bool) -> None:
        """Whether a plan is being made."""
        with self._changed:
            self._plans = plans
            self._changed.notify_all()

    def commanded(self, now_s: float) -> None:
        """A command of the controller came, at this simulated time."""
        with self._changed:
            self._count += 1
            self._last_s, self._trusted = now_s, self._drives
            self._changed.notify_all()

    def wait(self, now_s: float, remind: Callable[[], None]) -> None:
        """Until what is owed at this simulated time has come, or the limit is over; `remind` repeats the time."""
        begun = time.monotonic()
        with self._changed:
            count, plans = self._count, self._plans

            def is_settled() -> bool:
                owed = self._trusted and self._count == count and now_s - self._last_s > self.period_s - 1e-6
                return not owed and not self._plans

            while not self._changed.wait_for(is_settled, _AGAIN_S):
                if time.monotonic() - begun > LIMIT_S:
                    # Whoever was late is waited for again when the next answer came.
                    self.late += 1
                    self._trusted = False
                    self._plans = self._plans and not plans
                    break
                remind()
        self.waited_s += time.monotonic() - begun
