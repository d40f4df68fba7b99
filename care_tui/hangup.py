"""What happens when the terminal goes: a lost connection, a closed window, a tmux server that was killed.

The kernel sends SIGHUP and SIGCONT, and whatever is read or written from then on fails at once. Textual takes the
second for a resume, and its threads then ask a terminal that is not there as fast as they can, for ever.
"""

from __future__ import annotations

import os
import signal
import stat
from collections.abc import Callable
from types import FrameType

STANDARD = (0, 1, 2)
"""Input, output and errors; keys are read from the first."""
MOST_S = 10
"""Whatever holds the program up, it does not outlive its terminal by more."""


def on_hangup(leave: Callable[[], object], gone: Callable[[], object]) -> None:
    """Call `leave` on SIGHUP, and `gone` where the terminal went. To be called by the main thread, once the app has its
    own signals."""

    # A handler of the interpreter and not of the event loop: it comes before that of SIGCONT.
    def hung_up(_number: int, _frame: FrameType | None) -> None:
        if os.isatty(STANDARD[0]):  # somebody asks politely
            leave()
            return
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
        signal.signal(signal.SIGCONT, lambda _number, _frame: None)
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.alarm(MOST_S)
        nowhere = os.open(os.devnull, os.O_RDWR)
        for stream in STANDARD:
            if _is_device(stream):
                os.dup2(nowhere, stream)
        gone()

    signal.signal(signal.SIGHUP, hung_up)


def _is_device(stream: int) -> bool:
    """Whether a stream may be the terminal: one that is gone does not say so any more."""
    try:
        return stat.S_ISCHR(os.fstat(stream).st_mode)
    except OSError:
        return False
