"""`care LOG`: the terminal app."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import typer

from care_core.errors import UsageError
from care_tui.commands.arguments import ConfigPaths, ProfileName
from care_tui.jobs import Request

app = typer.Typer()

OPEN = "open"
"""The hidden command behind `care LOG`."""

PLACES = (Path(), Path("logs"), Path.home() / "logs", Path.home() / ".ros")
"""Where `care` without a log looks for the newest one."""


@app.command(OPEN, hidden=True)
def open_app(
    log: Annotated[Path | None, typer.Argument(metavar="[LOG]", show_default=False)] = None,
    profile: ProfileName = None,
    config: ConfigPaths = None,
    ascii: Annotated[bool, typer.Option("--ascii", help="Draw without box characters.")] = False,
) -> None:
    """Open a log in the terminal app: the newest one when none is named."""
    from care_core.logs import sniff

    path = log or newest_log(PLACES)
    sniff(path)
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        raise UsageError("The terminal app needs a terminal.", hint="Use 'care triage LOG' here.")
    from care_tui.app import run

    raise typer.Exit(run(Request(path, profile, tuple(config or ())), ascii=ascii))


def newest_log(places: Iterable[Path]) -> Path:
    """The log that was written last in these folders. Raises UsageError when they hold none."""
    from care_core.extract.table import LOG_SUFFIXES

    files = (path for place in places if place.is_dir() for path in place.iterdir())
    logs = [path for path in files if path.suffix.lower() in LOG_SUFFIXES and path.is_file()]
    if not logs:
        raise UsageError("There is no log in the usual places.", hint="Name one, 'care LOG', or try 'care demo'.")
    return max(logs, key=lambda path: path.stat().st_mtime)
