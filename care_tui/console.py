"""What the command line says and where: data on stdout, talk on stderr, and every error in one sentence."""

from __future__ import annotations

import errno
import io
import os
import re
import sys
import time
import traceback
from json import dumps
from pathlib import Path

from care_core.errors import CareError, ExitCode, UsageError
from care_core.text import clean

PIPE_CLOSED = 128 + 13
"""Exit code of a process whose reader went away, as the shell gives it for SIGPIPE."""

QUIET_S, AGAIN_S = 1.0, 60.0
"""Work that takes longer says what it is doing; how often it says so where no line can be rewritten."""

_UNLISTED = re.compile(r"[^\x00-\x7f]")
_STATUS = re.compile(r"\b(FAULT|NOT EVALUATED|OK)\b")
_COLOURS = {"FAULT": "\x1b[1;31m", "NOT EVALUATED": "\x1b[33m", "OK": "\x1b[32m"}
_RESET = "\x1b[0m"


def emit(
    text: str, out: Path | None = None, *, force: bool = False, hint: str | None = None, is_plain: bool = False
) -> None:
    """Write data: to the file `out`, whole or not at all, else to stdout.

    Args:
        force: replace a file of another kind.
        hint: what to do with such a file; by default, --force.
        is_plain: it is text for people, which says in a file who wrote it.
    """
    if out is not None:
        from care_core.outputs import FORCE_HINT, signed, write_output

        write_output(out, signed(text) if is_plain else text, force=force, hint=hint or FORCE_HINT)
        say(f"wrote {out}")
        return
    try:
        sys.stdout.write(encodable(text, sys.stdout.encoding))
        sys.stdout.flush()
    except BrokenPipeError:
        # The interpreter flushes stdout once more when it ends, which must not fail again.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise SystemExit(PIPE_CLOSED) from None
    except OSError as err:
        # What is left in the buffer would fail again when the interpreter ends.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        raise UsageError(f"Cannot write the output: {err.strerror}.", hint="Write it to another place.") from None


def escape_the_rest() -> None:
    """Have stdout and stderr write a character that their encoding lacks as its name, `\\N{DEGREE SIGN}`: no error."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="namereplace")


def encodable(text: str, encoding: str | None) -> str:
    """The text in characters that an encoding has; JSON, HTML and XML have escapes of their own for the others."""
    try:
        text.encode(encoding or "utf-8")
    except UnicodeEncodeError:
        if text.startswith(("{", "[")):
            return _UNLISTED.sub(lambda match: dumps(match[0])[1:-1], text)
        errors = "xmlcharrefreplace" if text.startswith("<") else "namereplace"
        return text.encode(encoding or "utf-8", errors).decode(encoding or "utf-8")
    return text


def check_writable(out: Path) -> None:
    """Refuse, before any work is done, a file that could not be written. Raises UsageError."""
    from care_core.outputs import refuse_recording

    refuse_recording(out)
    check_place(out)


def check_place(out: Path) -> None:
    """Refuse a place where no file can be written, whatever it holds. Raises UsageError."""
    if out.is_dir():
        raise UsageError("This is a folder.", hint="Name a file in it.", where=str(out))
    if not out.parent.is_dir():
        raise UsageError("The folder does not exist.", hint="Make it first.", where=str(out.parent))
    if not os.access(out.parent, os.W_OK):
        raise UsageError("No permission to write there.", hint="Choose another place.", where=str(out.parent))


def say(text: str) -> None:
    """One line of talk on stderr."""
    print(clean(text), file=sys.stderr)


def painted(text: str) -> str:
    """The text with its status words in colour, where stdout is a terminal that wants colour."""
    if not sys.stdout.isatty() or os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb":
        return text
    return _STATUS.sub(lambda match: f"{_COLOURS[match[0]]}{match[0]}{_RESET}", text)


class Progress:
    """Says on stderr what is being done: a line rewritten in place on a terminal, else plain lines: one after a second,
    and one more each minute, for what runs through the night.

    Use as a context manager; the object is called with the step and the share that is done (0 to 1).
    """

    def __init__(self) -> None:
        self._in_place = sys.stderr.isatty() and os.environ.get("TERM") != "dumb"
        self._due_s = time.monotonic() + QUIET_S
        self._said = False

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *_: object) -> None:
        if self._in_place and self._said:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)

    def __call__(self, step: str, share: float) -> None:
        if self._in_place:
            print(f"\r\x1b[K{clean(step)} {share:.0%}"[:100], end="", file=sys.stderr, flush=True)
            self._said = True
        elif share < 1.0 and (now := time.monotonic()) > self._due_s:
            say(f"{step} ...")
            self._due_s = now + AGAIN_S


def explain(err: Exception) -> ExitCode:
    """Say what went wrong on stderr and give the exit code for it. With CARE_DEBUG=1 the traceback is shown too."""
    if os.environ.get("CARE_DEBUG") == "1":
        traceback.print_exception(type(err), err, err.__traceback__)
    if isinstance(err, CareError):
        say(f"care: {err}")
        return err.exit_code
    if isinstance(err, OSError) and err.errno == errno.ENAMETOOLONG:  # wherever a path is first looked at
        say(f"care: {err.filename}: The name is longer than names of files can be. Check the path.")
        return ExitCode.USAGE
    if isinstance(err, PermissionError) and err.filename is not None:  # it lies in a folder that is closed to us
        say(f"care: {err.filename}: No permission to look there. Check the owner and mode of its folders.")
        return ExitCode.UNREADABLE
    say(f"care: unexpected {type(err).__name__}: {err}. Set CARE_DEBUG=1 to see where it comes from.")
    return ExitCode.USAGE
