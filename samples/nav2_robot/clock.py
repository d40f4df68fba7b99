"""The simulated clock, which waits for Nav2: on a slow machine a mission takes longer, and is the same mission."""

from __future__ import annotations

import time
from collections.abc import Callable

LIMIT_S = 10.0
"""Of real time, for one command."""
PLAN_LIMIT_S = 1.0
"""For one plan: a planner whose costmap was cleared waits for its next update, that is for simulated time."""
_AGAIN_S = 0.3
_NAP_S = 0.002


class Answers:
    """What Nav2 owes: a command every period while it drives, a plan while it plans."""

    def __init__(self, period_s: float) -> None:
        self.period_s = period_s
        self.late = 0
        """Commands that did not come within the limit."""
        self.waited_s = 0.0
        self._drives = self._plans = self._trusted = False
        self._last_s = 0.0

    def driving(self, drives: bool) -> None:
        """Whether the controller follows a path."""
        self._trusted = self._trusted and drives
        self._drives = drives

    def planning(self, plans: bool) -> None:
        """Whether a plan is being made."""
        self._plans = plans

    def commanded(self, now_s: float) -> None:
        """A command of the controller came, at this simulated time."""
        self._last_s, self._trusted = now_s, self._drives

    def wait(self, now_s: float, listen: Callable[[], None], remind: Callable[[], None]) -> None:
        """Until what is owed at this simulated time has come, or the limit is over.

        `listen` takes what came and tells it here; `remind` repeats the time.
        """
        begun = again = time.monotonic()
        listen()
        while self._plans or (self._trusted and now_s - self._last_s > self.period_s - 1e-6):
            time.sleep(_NAP_S)
            now = time.monotonic()
            if self._plans and now - begun > PLAN_LIMIT_S:
                self._plans = False
            elif now - begun > LIMIT_S:
                # Whoever was late is waited for again when the next answer came.
                self.late += 1
                self._trusted = False
            elif now - again > _AGAIN_S:
                again = now
                remind()
            listen()
        self.waited_s += time.monotonic() - begun
