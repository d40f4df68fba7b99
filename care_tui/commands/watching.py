"""`care watch`: a line for each log that is finished, and the app on any of them."""

from __future__ import annotations

import os
import select
import shutil
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from care_core.errors import ExitCode, UsageError
from care_core.records import Struct, field
from care_core.text import number_of
from care_tui.commands.arguments import ProfileName, RobotName, Site, Thresholds, bounds
from care_tui.commands.past import NoHistory
from care_tui.console import emit, painted, say
from care_tui.start import own_command

if TYPE_CHECKING:
    from care_core.application.notifying import Notifier
    from care_core.application.watching import Watcher
    from care_core.report.watching import WatchEntry

app = typer.Typer()

_NARROWEST = 60
_LOOK_S = 0.2
"""How often is looked whether the app was closed."""


@app.command()
def watch(
    folders: Annotated[
        list[Path], typer.Argument(metavar="DIR...", help="Folders that logs come to.", show_default=False)
    ],
    profile: ProfileName = None,
    threshold: Thresholds = None,
    site: Site = None,
    robot: RobotName = None,
    json: Annotated[bool, typer.Option("--json", help="Print a line of JSON for each log.")] = False,
    once: Annotated[bool, typer.Option("--once", help="Triage what is there and end.")] = False,
    notify_command: Annotated[
        str | None,
        typer.Option(
            "--notify-command",
            metavar="CMD",
            help="Run this for each log, without a shell: {log}, {name}, {verdict}, {robot}, {says}, ...",
        ),
    ] = None,
    quiet: Annotated[
        float, typer.Option("--quiet", min=0.0, help="A log is finished when nothing was written for so many seconds.")
    ] = 10.0,
    abandoned: Annotated[
        float, typer.Option("--abandoned", min=0.0, help="One that nobody closed is judged after so many seconds.")
    ] = 600.0,
    limit: Annotated[float, typer.Option("--limit", min=0.1, help="Seconds that one log may take.")] = 600.0,
    ascii: Annotated[bool, typer.Option("--ascii", help="Print nothing but ASCII.")] = False,
    no_history: NoHistory = False,
) -> None:
    """Wait for finished logs and triage each once. Prints a line a log; ends with 130 on Ctrl+C.

    A log that is in the history already, judged by the same options, is counted and not judged again (--no-history
    judges all). With --once it ends with 1 where a fault was found, 4 where a log could not be read, 3 where one could
    not be judged or is not finished, else 0: also where all were known before, whatever their verdicts.
    """
    from care_core.application.notifying import parse_notifier
    from care_core.application.watching import Task, Watcher, overall_code
    from care_core.history.store import History, history_path
    from care_tui.settings import takes_only_ascii

    missing = [folder for folder in folders if folder.exists() and not folder.is_dir()]
    missing += [folder for folder in folders if once and not folder.exists()]
    if missing:
        raise UsageError("There is no such folder.", hint="Name the folder that logs come to.", where=str(missing[0]))
    closed = [folder for folder in folders if folder.exists() and not os.access(folder, os.R_OK | os.X_OK)]
    if closed:
        hint = "Check its owner and mode."
        raise UsageError("No permission to read the folder.", hint=hint, where=str(closed[0]))
    notifier = None if notify_command is None else parse_notifier(notify_command)
    path = None if no_history else history_path()
    if profile is not None:
        from care_core.profile.store import load_profile

        load_profile(profile)  # a wrong name is said now, not at the first log
    task = Task(
        tuple(folder.absolute() for folder in folders),
        profile,
        bounds(threshold or ()),
        site,
        robot,
        quiet,
        max(quiet, abandoned),
        limit,
    )
    words = [word for name, value in (("--profile", profile), ("--site", site)) if value for word in (name, str(value))]
    words += [word for text in threshold or () for word in ("--threshold", text)]
    only_ascii = ascii or takes_only_ascii(sys.stdout.encoding, os.environ.get("TERM", ""))
    screen = _Screen(json, only_ascii, words)
    watcher = Watcher(task, None if path is None else History(path), screen.tell)
    try:
        if once:
            _look_until_done(watcher, screen, notifier)
        else:
            screen.begin(folders)
            _look_for_ever(watcher, screen, notifier)
    except KeyboardInterrupt:
        screen.end()
        raise typer.Exit(ExitCode.INTERRUPTED) from None
    finally:
        screen.close_app()
    screen.say_waiting(watcher)
    raise typer.Exit(overall_code(screen.entries, len(watcher.waiting)))


def _look_for_ever(watcher: Watcher, screen: _Screen, notifier: Notifier | None) -> None:
    while True:
        screen.wait(_look(watcher, screen, notifier))


def _look_until_done(watcher: Watcher, screen: _Screen, notifier: Notifier | None) -> None:
    """Look until every log is dealt with, but those that are still being written or that nobody closed."""
    started = time.monotonic()
    while True:
        before = len(screen.entries)
        pause_s = _look(watcher, screen, notifier)
        rested = time.monotonic() - started > watcher.task.quiet_s + pause_s
        if not watcher.waiting or (rested and len(screen.entries) == before and not watcher.is_shared):
            return
        time.sleep(pause_s)


def _look(watcher: Watcher, screen: _Screen, notifier: Notifier | None) -> float:
    """One look; returns how long to wait until the next."""
    began = time.monotonic()
    spent_s = 0.0
    for entry in watcher.look():
        screen.show(entry)
        if notifier is not None and entry.is_new and (problem := notifier.tell(entry)):
            screen.tell(problem)
        spent_s = time.monotonic() - began
    screen.status(watcher)
    return watcher.pause_s(time.monotonic() - began - spent_s)


class _Screen(Struct, eq=False, dict=True):
    """What is printed, and what the operator types. While the app is open, lines wait."""

    is_json: bool
    ascii: bool
    words: Sequence[str]
    """What the app is given beside the log."""
    entries: list[WatchEntry] = field(default_factory=list)
    _held: list[str] = field(default_factory=list)
    _app: subprocess.Popen[bytes] | None = None
    _folder: Path | None = None
    _status: str = ""

    @cached_property
    def _listens(self) -> bool:
        return not self.is_json and all(stream.isatty() for stream in (sys.stdin, sys.stdout, sys.stderr))

    @cached_property
    def _in_place(self) -> bool:
        return sys.stderr.isatty() and os.environ.get("TERM") != "dumb"

    def begin(self, folders: Sequence[Path]) -> None:
        self._folder = folders[0]
        say(f"watching {', '.join(map(str, folders))}")
        if self._listens:
            say("Number and Enter opens that log in the app, Enter the last one, l and Enter lists all; Ctrl+C ends.")

    def show(self, entry: WatchEntry) -> None:
        from care_core.report.watching import entry_line

        self.entries.append(entry)
        if self.is_json:
            self._print(entry.to_json(indent=None))
            return
        width = None
        if sys.stdout.isatty():
            # One column is left: a terminal wraps a line that fills it.
            width = max(shutil.get_terminal_size().columns, _NARROWEST) - 1
        line = entry_line(entry, time.strftime("%H:%M"), width, ascii=self.ascii)
        self._print(painted(f"{line}\n"))

    def tell(self, text: str) -> None:
        self._clear()
        say(text)

    def _print(self, text: str) -> None:
        if self._app is not None:
            self._held.append(text)
            return
        self._clear()
        emit(text)

    def status(self, watcher: Watcher) -> None:
        """Say on a terminal what is waited for, in place."""
        if not self._in_place or self._app is not None:
            return
        text = self._waited_for(watcher)
        if text != self._status:
            self._clear()
            width = max(shutil.get_terminal_size().columns, _NARROWEST) - 1
            print(text[:width], end="", file=sys.stderr, flush=True)
            self._status = text

    def _waited_for(self, watcher: Watcher) -> str:
        from care_core.text import clean

        known = f"{_done_before(watcher)}; " if watcher.known and not self.entries else ""
        if not watcher.waiting:
            return f"{known}waiting for logs"
        first = watcher.waiting[0]
        more = f" and {len(watcher.waiting) - 1} more" if len(watcher.waiting) > 1 else ""
        return clean(f"{known}waiting for {first.path.name}{more}: {first.open_by or 'is it finished?'}")

    def _clear(self) -> None:
        if self._status:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)
            self._status = ""

    def say_waiting(self, watcher: Watcher) -> None:
        """Say at the end what is not finished."""
        self._clear()
        for sight in watcher.waiting:
            say(f"{sight.path}: not finished: {sight.open_by or 'it is still being written'}")
        if watcher.known:
            say(_done_before(watcher))

    def end(self) -> None:
        self._clear()
        faults = sum(entry.verdict == "fault" for entry in self.entries)
        say(f"{number_of(len(self.entries), 'log')}, {faults} with a fault")

    def wait(self, pause_s: float) -> None:
        """Wait, open what the operator asks for, and show what was held when the app is closed."""
        if self._app is not None:
            self._await_app(pause_s)
        elif self._listens and _is_in_front():
            if select.select([sys.stdin], [], [], pause_s)[0]:
                self._asked(sys.stdin.readline())
        else:
            time.sleep(pause_s)

    def _asked(self, line: str) -> None:
        if not line:  # Ctrl+D: nothing more will be asked
            self._listens = False
            return
        self._status = ""  # Enter has moved on to a line of its own
        wanted = line.strip()
        if wanted == "l" and self._folder is not None:  # those of earlier days, too
            self._app = subprocess.Popen(own_command(str(self._folder), *self.words))
            return
        chosen = [entry for entry in self.entries if not wanted or str(entry.number) == wanted.removeprefix("#")]
        if not chosen:
            say(f"there is no log {wanted} yet" if self.entries else "there is no log yet")
            return
        self._app = subprocess.Popen(own_command(chosen[-1].log, *self.words))

    def _await_app(self, pause_s: float) -> None:
        until = time.monotonic() + pause_s
        while self._app is not None and time.monotonic() < until:
            with suppress(subprocess.TimeoutExpired):
                self._app.wait(_LOOK_S)
                self._app = None
        if self._app is None:
            emit("".join(self._held))
            self._held.clear()

    def close_app(self) -> None:
        """End the app with the watcher."""
        if self._app is not None:
            self._app.terminate()
            self._app.wait()
            self._app = None


def _is_in_front() -> bool:
    """Whether the terminal's input is for this process: one in the background would be stopped for reading it."""
    try:
        return os.tcgetpgrp(sys.stdin.fileno()) == os.getpgrp()
    except OSError:
        return False


def _done_before(watcher: Watcher) -> str:
    return f"{number_of(watcher.known, 'log')} {'was' if watcher.known == 1 else 'were'} done before"
