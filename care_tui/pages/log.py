"""Step 1: which log. Found ones newest first, any other by its path; progress while one is read."""

from __future__ import annotations

import time
from pathlib import Path
from typing import ClassVar

from textual.content import Content

from care_core.errors import CareError
from care_core.text import clean
from care_tui.pages.page import Fetch, View
from care_tui.pages.step import StepPage, failure_rows
from care_tui.places import LogFile, found_logs
from care_tui.render.objectives import run_rows
from care_tui.render.rows import Row, Rows, error_rows, labelled, progress_bar, text
from care_tui.screens.open_log import OpenLogDialog
from care_tui.screens.panes import PanesScreen
from care_tui.widgets.choices import Listing

NAME_WIDTH = 30
SHORTEST_FOLDER = 10
"""Cells below which the end of a path tells nothing."""


class LogPage(StepPage):
    name = "Log"
    HELP = (
        "Logs of the usual places, newest first. Enter opens one, o asks for any other (or drop a file on the "
        "terminal). While a log is read, Esc stops it. Nothing is ever written to a log."
    )
    ENTER = "Open"
    ACTIONS: ClassVar[frozenset[str]] = frozenset({"pick", "again", "rescan"})

    def __init__(self, screen: PanesScreen) -> None:
        super().__init__(screen)
        self._found: Fetch[list[LogFile]] = Fetch(self, "logs")

    def enter(self) -> None:
        places, opened, found = self.walk.settings.places, self.session.path, self._found.answer
        if isinstance(found, list) and opened is not None and opened not in [log.path for log in found]:
            self._found.forget()
        # After the first frame, as the reading of the log.
        self.screen.call_after_refresh(self._found.start, lambda: found_logs(places, opened))

    def view(self) -> View:
        found = self._found.answer
        logs = found if isinstance(found, list) else []
        now = time.time()
        places = [log.path for log in logs]
        listing = Listing(
            len(logs),
            lambda i, width: (self._item(logs[i], now, width),),
            lambda i: f"{logs[i].path.name} {logs[i].path}",
        )
        opened = self.session.path
        index = places.index(opened) if opened in places else None
        return View(self._title(len(logs)), lambda i: self._detail(None if i is None else logs[i]), listing, index)

    def _title(self, count: int) -> Content:
        state, path = self.session.state, self.session.path
        name = "" if path is None else clean(path.name)
        return {
            "empty": Content("Open a log: Enter, or o for one that is not listed"),
            "loading": Content.assemble("Reading ", (name, "bold"), "  (Esc stops)"),
            "data": Content.assemble("Open is ", (name, "bold"), "  (Enter on another opens it)" if count > 1 else ""),
            "error": Content.assemble("No diagnosis of ", (name, "bold"), "  (r: again, o: other log)"),
        }[state]

    def _item(self, log: LogFile, now: float, width: int) -> Content:
        mark = self.glyphs.here if log.path == self.session.path else " "
        opened = "opened" if log.is_recent else ""
        about = f" {age(now - log.modified_s):>10}  {size(log.size):>8}  {opened:<6}  "
        named = text(log.path.name, "bold")
        if named.cell_length > NAME_WIDTH:
            named = named.truncate(NAME_WIDTH - 1) + self.glyphs.more
        line = Content.assemble(f"{mark} ", named.pad_right(NAME_WIDTH - named.cell_length), about)
        # Of a long path the end tells more than the beginning.
        folder, room = clean(short(log.path.parent)), width - line.cell_length
        if len(folder) > room:
            folder = self.glyphs.more + folder[len(folder) - room + 1 :] if room > SHORTEST_FOLDER else ""
        return line + Content.styled(folder, "dim")

    def _detail(self, log: LogFile | None) -> Rows:
        session = self.session
        if session.state == "loading" and session.progress is not None:
            step, fraction = session.progress
            return Rows([labelled("Doing", step), labelled("Done", progress_bar(fraction, self.glyphs))])
        if session.error is not None and (log is None or log.path == session.path):
            return failure_rows(session)
        if session.case is not None and (log is None or log.path == session.path):
            return run_rows(session.diagnosis)
        if log is not None:
            when = time.strftime("%Y-%m-%d %H:%M", time.localtime(log.modified_s))
            return Rows([labelled("Log", str(log.path)), labelled("Written", when), labelled("Size", size(log.size))])
        if isinstance(self._found.answer, CareError):
            return error_rows(self._found.answer)
        if self._found.answer is None:
            return Rows([Row(Content("Looking for logs..."))])
        looked = ", ".join(str(place) for place in self.walk.settings.places)
        return Rows([labelled("No log", f"none was found in {looked}"), labelled("What to do", "press o and name one")])

    def open(self, index: int | None) -> None:
        found = self._found.answer
        if isinstance(found, list) and index is not None:
            path = found[index].path
            is_open = path == self.session.path
            if is_open and self.session.state == "data":
                self.walk.action_go(1)
            elif is_open and self.session.state == "loading":
                self.screen.say("It is being read; Esc stops that.")
            else:
                self.walk.open_log(path)

    def pick(self) -> None:
        """Ask for the path of a log."""
        start = self.session.path.parent if self.session.path else Path()
        self.screen.app.push_screen(OpenLogDialog(start, self.glyphs), self._picked)

    def _picked(self, path: Path | None) -> None:
        if path is not None:
            self.walk.open_log(path)

    def again(self) -> None:
        """Read the log again, after an error or a change."""
        self.walk.again()

    def rescan(self) -> None:
        """Look for logs again."""
        self._found.forget()
        self.enter()


def age(seconds: float) -> str:
    """How long ago, in the largest unit that fits."""
    for unit, length in (("d", 86400), ("h", 3600), ("min", 60)):
        if seconds >= length:
            return f"{seconds // length:.0f} {unit} ago"
    return "just now"


def short(folder: Path) -> str:
    """A folder as the operator says it: from here, or from home."""
    for start, name in ((Path.cwd(), ""), (Path.home(), "~/")):
        if folder.is_relative_to(start):
            return f"{name}{folder.relative_to(start)}"
    return str(folder)


def size(count: int) -> str:
    """Bytes as people say them."""
    return f"{count / 1e6:.1f} MB" if count >= 1e5 else f"{count / 1e3:.1f} kB"
