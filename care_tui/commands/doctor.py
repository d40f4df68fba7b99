"""`care doctor`: what works here. What is of the terminal is looked at in this place, the rest in the core."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from typing import TYPE_CHECKING

import typer

from care_core.errors import ExitCode
from care_tui import __version__
from care_tui.commands.arguments import AsJson
from care_tui.console import Progress, emit

if TYPE_CHECKING:
    from care_core.application.checkup import Checked, Status

app = typer.Typer()

_SLOW_ESCAPE_MS = 100
"""tmux holds the key Esc back for so long: 500 ms where nobody set `escape-time` (tmux.1)."""
_LOOK_S = 2.0


@app.command()
def doctor(json: AsJson = False) -> None:
    """Say what works here and what to do. Ends with 1 where something is to be repaired."""
    from care_core.application.checkup import look_over
    from care_core.report.checkup import CheckEntry, doctor_document, doctor_text
    from care_core.text import clean

    with Progress() as progress:
        progress("looking", 0.0)
        found = [*_terminal(), *look_over()]
    document = doctor_document(
        __version__,
        [CheckEntry(name=one.name, status=one.status, says=clean(one.says), do=clean(one.do)) for one in found],
    )
    emit(document.to_json() if json else doctor_text(document))
    raise typer.Exit(ExitCode.FAULT if document.status == "fail" else ExitCode.OK)


def _terminal() -> Iterator[Checked]:
    from care_core.application.checkup import Checked
    from care_tui.screens.case import MIN_HEIGHT, MIN_WIDTH
    from care_tui.settings import takes_only_ascii

    term = os.environ.get("TERM", "")
    if not all(stream.isatty() for stream in (sys.stdin, sys.stderr)):
        advice = "The app needs one; 'care triage LOG' does not. Over SSH: ssh -t HOST care."
        yield Checked("terminal", "warn", "this is no terminal", advice)
        return
    if term == "dumb":
        yield Checked("terminal", "fail", "it can place no text (TERM=dumb)", "Set TERM to what the terminal is.")
    else:
        width, height = shutil.get_terminal_size()
        is_small = width < MIN_WIDTH or height < MIN_HEIGHT
        advice = f"Make it {MIN_WIDTH}x{MIN_HEIGHT} or larger." if is_small else ""
        yield Checked("terminal", "warn" if is_small else "ok", f"{term or 'unnamed'}, {width}x{height}", advice)
    yield Checked("colours", *_colours(term))
    encoding = sys.stderr.encoding
    if takes_only_ascii(encoding, term):
        advice = "Set a UTF-8 locale, such as LANG=C.UTF-8; until then all is drawn in ASCII."
        yield Checked("encoding", "warn", f"{encoding} cannot hold what the app draws with", advice)
    else:
        yield Checked("encoding", "ok", encoding)
    if "TMUX" in os.environ:
        yield _tmux()


def _colours(term: str) -> tuple[Status, str, str]:
    if os.environ.get("NO_COLOR"):
        return "ok", "none, as NO_COLOR says", ""
    if os.environ.get("COLORTERM", "").casefold() in ("truecolor", "24bit"):
        return "ok", "16 million", ""
    if "256" in term or "direct" in term:
        return "ok", "256", ""
    return "warn", "16", "No meaning is in colour alone; with more, set TERM, such as xterm-256color."


def _tmux() -> Checked:
    from care_core.application.checkup import Checked
    from care_core.starting import program_path

    try:
        words = [program_path("tmux"), "show-options", "-sv", "escape-time"]
        asked = subprocess.run(words, capture_output=True, text=True, timeout=_LOOK_S, check=False)
        wait_ms = int(asked.stdout)
    except (OSError, ValueError, subprocess.TimeoutExpired):
        return Checked("tmux", "ok", "inside tmux, which does not say how long it holds Esc back")
    if wait_ms > _SLOW_ESCAPE_MS:
        return Checked("tmux", "warn", f"the key Esc takes {wait_ms} ms", "tmux set -s escape-time 20")
    return Checked("tmux", "ok", f"the key Esc takes {wait_ms} ms")
