"""Where the command begins: an interruption ends it without a word, whatever it is importing or building then."""

from __future__ import annotations

import gc
import signal
import sys

TYPE_CHECKING = False  # until an interruption is heeded nothing is imported that can wait: `typing` alone takes 10 ms
if TYPE_CHECKING:
    from types import FrameType
    from typing import Any

_INTERRUPTED = 128 + signal.SIGINT


def main() -> None:
    """Entry point of the console script."""
    is_listening = signal.getsignal(signal.SIGINT) is not signal.SIG_IGN  # a shell's background job is not
    if is_listening:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from care_tui.cli import main as run

    try:
        signal.signal(signal.SIGTERM, _leave)
        if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:  # nohup means it
            signal.signal(signal.SIGHUP, _leave)
        sys.unraisablehook = _once_more
        if is_listening:
            signal.signal(signal.SIGINT, signal.default_int_handler)
        run()
    except KeyboardInterrupt:  # typer builds its commands before it handles any
        raise SystemExit(_INTERRUPTED) from None
    finally:
        gc.freeze()  # the memory goes with the process: looking through it for cycles first is a sixth of a triage
        if is_listening:
            signal.signal(signal.SIGINT, signal.SIG_DFL)


def own_command(*words: str) -> list[str]:
    """The command that runs this program once more."""
    from care_core.starting import python_command

    return python_command("from care_tui.start import main; main()", *words)


def called() -> list[str]:
    """How this program was called, for a command that is to work as it is printed in the same folder."""
    import os
    import shutil

    from care_core.starting import interpreter

    given = sys.argv[0] if sys.argv else ""
    if os.path.basename(given) == "__main__.py":
        return [_short(interpreter()), "-m", "care_tui"]
    on_path = shutil.which("care")
    if not given or os.path.basename(given) != "care" or (on_path and os.path.samefile(on_path, given)):
        return ["care"]
    return [_short(given)]


def _short(path: str) -> str:
    """A path as it is typed in the current folder, where it lies below that."""
    import os

    here = os.getcwd()
    is_below = os.path.commonpath((here, os.path.abspath(path))) == here
    return os.path.relpath(path) if is_below else path


def _leave(number: int, _frame: FrameType | None) -> None:
    """End as on an error, so that temporary files go: the system's own way leaves them.

    Whoever ends a whole group sends several signals. Another exception while the first unwinds would break what
    unwinds (a lock is waited for, and then released unheld), so who is ending already is told no more.
    """
    if isinstance(sys.exc_info()[1], KeyboardInterrupt):
        return
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    raise SystemExit(128 + number)


def _once_more(unraisable: Any) -> None:
    """An interruption that met a callback of the interpreter's own is lost there, so it is sent again."""
    if not isinstance(unraisable.exc_value, KeyboardInterrupt):
        sys.__unraisablehook__(unraisable)
        return
    from threading import Timer, main_thread

    Timer(0.01, signal.pthread_kill, (main_thread().ident, signal.SIGINT)).start()
