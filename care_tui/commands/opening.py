"""`care LOG`: the terminal app."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Annotated

import typer

from care_core.errors import UsageError
from care_tui.commands.arguments import ConfigPaths, ProfileName
from care_tui.console import say
from care_tui.jobs import Request

app = typer.Typer()

OPEN = "open"
"""The hidden command behind `care LOG`."""

PLACES = (
    Path(),
    Path("logs"),
    Path("APM/LOGS"),
    Path.home() / "logs",
    Path.home() / ".ros",
    Path.home() / ".ros" / "bags",
    Path.home() / "APM" / "LOGS",
    Path.home() / "Documents" / "Mission Planner" / "logs",
    Path.home() / "Documents" / "QGroundControl" / "Telemetry",
    Path.home() / "Documents" / "QGroundControl" / "Logs",
)
"""Where `care` without a log looks for the newest one: here, and where recorders and ground stations put theirs."""

DEEP = 3
"""Folders below a place that are looked into: Mission Planner sorts by vehicle and system."""
QUIET_S, LOOK_S = 5.0, 0.5
"""A log that was written to more recently may still be growing: it is looked at for so long."""


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
    """The log that was written last in these folders; one still being written is passed over with a sentence.

    Raises:
        UsageError: they hold no log, or none that is finished.
    """
    found = {path for place in places if place.is_dir() for path in _logs(place, DEEP)}
    logs = sorted(found, key=_written_s, reverse=True)
    for path in logs:
        if not _is_growing(path):
            return path
        say(f"{path} is still being written, so an older log is taken")
    if logs:
        raise UsageError("The only log in the usual places is still being written.", hint="Stop the recording first.")
    raise UsageError("There is no log in the usual places.", hint="Name one, 'care LOG', or try 'care demo'.")


def _logs(folder: Path, deep: int) -> Iterator[Path]:
    from care_core.extract.table import is_log, is_recording

    try:
        inside = list(folder.iterdir())
    except OSError:  # not ours to look into
        return
    for path in inside:
        if is_log(path) or (path.is_dir() and is_recording(path)):
            yield path
        elif path.is_dir() and deep > 1 and not path.is_symlink() and _may_hold_logs(folder, path):
            yield from _logs(path, deep - 1)


def _may_hold_logs(folder: Path, path: Path) -> bool:
    """The working folder may be anything, so only what a recorder may have made in it is looked into."""
    return folder != Path() or path.name.startswith("rosbag2_")


def _files(path: Path) -> list[Path]:
    return [file for file in path.iterdir() if file.is_file()] if path.is_dir() else [path]


def _written_s(path: Path) -> float:
    return max((file.stat().st_mtime for file in _files(path)), default=0.0)


def _is_growing(path: Path) -> bool:
    """Whether a recorder says so by the name, or a file that was written to just now grows while we look."""
    if path.suffix == ".active":
        return True
    if time.time() - _written_s(path) > QUIET_S:
        return False
    before = [file.stat().st_size for file in _files(path)]
    time.sleep(LOOK_S)
    return before != [file.stat().st_size for file in _files(path)]
