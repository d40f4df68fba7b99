"""`care LOG`: the terminal app."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import typer

from care_core.application.case import Request
from care_core.errors import UsageError
from care_tui.commands.arguments import (
    ConfigPaths,
    Keep,
    Mission,
    ProfileName,
    Reference,
    Since,
    Site,
    Thresholds,
    bounds,
)
from care_tui.console import say
from care_tui.places import files_of, is_openable, logs_in, named, written_s

app = typer.Typer()

QUIET_S, LOOK_S = 5.0, 0.5
"""A log that was written to more recently may still be growing: it is looked at for so long."""


@app.command("open", hidden=True)
def open_app(
    log: Annotated[Path | None, typer.Argument(metavar="[LOG]", show_default=False)] = None,
    profile: ProfileName = None,
    config: ConfigPaths = None,
    keep: Keep = None,
    threshold: Thresholds = None,
    site: Site = None,
    mission: Mission = None,
    since: Since = None,
    reference: Reference = None,
    ascii: Annotated[bool, typer.Option("--ascii", help="Draw with nothing but ASCII.")] = False,
    no_mouse: Annotated[bool, typer.Option("--no-mouse", help="Leave the mouse to the terminal.")] = False,
    color: Annotated[str | None, typer.Option("--color", help="auto, truecolor, 256, 16 or none.")] = None,
    theme: Annotated[str | None, typer.Option("--theme", help="Such as high-contrast.")] = None,
    settings: Annotated[Path | None, typer.Option("--settings", help="The app's own settings file.")] = None,
) -> None:
    """Open a log in the terminal app: the newest one when none is named."""
    from care_core.logs.opening import sniff
    from care_tui.settings import load_settings, prepare_terminal, takes_only_ascii, with_flags

    bound = bounds(threshold or ())
    ascii = ascii or takes_only_ascii(sys.stderr.encoding, os.environ.get("TERM", ""))
    chosen = with_flags(load_settings(settings), ascii=ascii, mouse=not no_mouse, color=color, theme=theme)
    path = log or newest_log(chosen.places)
    if path is not None and not (path.is_dir() and not is_openable(path)):
        sniff(path)
    # Textual draws on stderr. In a browser ('care serve') there is no terminal, but a driver of its own.
    is_terminal = all(stream.isatty() for stream in (sys.stdin, sys.stdout, sys.stderr))
    if not is_terminal and "TEXTUAL_DRIVER" not in os.environ:
        raise UsageError("The terminal app needs a terminal.", hint="Use 'care triage LOG' here.")
    prepare_terminal(chosen)
    from care_tui.app import run
    from care_tui.engine import CAUSES

    request = None
    if path is not None:
        request = Request(
            path,
            profile,
            tuple(config or ()),
            keep=tuple(keep or ()),
            thresholds=bound,
            site=site,
            top=CAUSES,
            mission=mission,
            since=since,
            reference=reference,
        )
    raise typer.Exit(run(request, chosen))


def newest_log(places: Iterable[Path]) -> Path | None:
    """The log that was written last in these folders, None when they hold none.

    One still being written is passed over with a sentence.

    Raises:
        UsageError: none of them is finished.
    """
    found = {path for place in places if place.is_dir() for path in logs_in(place)}
    logs = sorted(found, key=written_s, reverse=True)
    for path in logs:
        if not _is_growing(path):
            return path
        say(f"{path} is still being written, so an older log is taken")
    if logs:
        raise UsageError("The only log in the usual places is still being written.", hint="Stop the recording first.")
    return None


def newest_named() -> Path:
    """The newest log of the usual places, which is said. Raises UsageError where there is none."""
    from care_tui.settings import load_settings

    places = load_settings(None).places
    found = newest_log(places)
    if found is None:
        raise UsageError("There is no log in the usual places.", hint=f"Name one; looked in {named(places)}.")
    say(f"the newest log is {found}")
    return found


def _is_growing(path: Path) -> bool:
    """Whether a recorder says so by the name, or a file that was written to just now grows while we look."""
    if path.suffix == ".active":
        return True
    if time.time() - written_s(path) > QUIET_S:
        return False
    before = [file.stat().st_size for file in files_of(path)]
    time.sleep(LOOK_S)
    return before != [file.stat().st_size for file in files_of(path)]
