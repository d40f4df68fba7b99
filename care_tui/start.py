"""Where the command begins: an interruption ends it without a word, whatever it is importing or building then."""

from __future__ import annotations

import signal
from types import FrameType

_INTERRUPTED = 128 + signal.SIGINT
_TERMINATED = 128 + signal.SIGTERM


def main() -> None:
    """Entry point of the console script."""
    is_listening = signal.getsignal(signal.SIGINT) is not signal.SIG_IGN  # a shell's background job is not
    if is_listening:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from care_tui.cli import main as run

    try:
        signal.signal(signal.SIGTERM, _leave)
        if is_listening:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        run()
    except KeyboardInterrupt:  # typer builds its commands before it handles any
        raise SystemExit(_INTERRUPTED) from None
    finally:
        if is_listening:
            signal.signal(signal.SIGINT, signal.SIG_DFL)


def _leave(_number: int, _frame: FrameType | None) -> None:
    """End as on an error, so that temporary files go: the system's own way leaves them."""
    raise SystemExit(_TERMINATED)
