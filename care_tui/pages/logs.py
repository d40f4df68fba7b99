"""The logs there are, the newest first, with their verdicts as they become known. Enter opens one."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from textual import on, work
from textual.binding import Binding, BindingType
from textual.content import Content
from textual.message import Message
from textual.worker import Worker, get_current_worker

from care_core.application.case import Request
from care_core.application.history_writing import options_of, terms_of
from care_core.application.viewing import known_verdicts
from care_core.diagnose.verdict import RunStatus, verdict_of
from care_core.errors import CareError
from care_core.records import Record
from care_core.text import clean, number_of
from care_tui.engine import CancelledError, as_care_error
from care_tui.messages import Judge, OpenLog
from care_tui.pages.page import Page, View, enter_to
from care_tui.places import LogFile, found_logs, is_openable, named, short
from care_tui.render.rows import Row, Rows, by_options, error_rows, labelled, status, text, without_middle
from care_tui.screens.file_dialog import FileDialog
from care_tui.session import Session
from care_tui.widgets.choices import Listing
from care_tui.workspace import Workspace

NAME_WIDTH, VERDICT_WIDTH = 30, 16
ROOMY = 100
"""Cells from which there is room for age and size beside the reason; the text below tells them, too."""
SHORTEST_FOLDER = 10
"""Cells below which the end of a path tells nothing."""
LOGS = "logs"


class Known(Record):
    """What is known of a log without opening it: its verdict, and what failed."""

    status: RunStatus
    words: str
    judged_with: str = ""
    """The options that gave it other limits or another reference than its own."""


class LogsPage(Page):
    HELP = (
        "The logs that there are, newest first, with their verdicts as far as they are known. Enter opens one, o asks "
        "for any other (or drop a file on the terminal). While a log is read, Esc stops it. Nothing is ever written to "
        "a log."
    )
    OPENS_ITEM = True
    BINDINGS: ClassVar[list[BindingType]] = [
        enter_to("Open"),
        Binding("o", "pick", "Any log", id="logs.pick"),
        Binding("r", "again", "Read again", show=False, id="logs.again"),
        Binding("R", "rescan", "Look again", id="logs.rescan"),
    ]

    @dataclass
    class Verdict(Message):
        """The verdict on a log has come."""

        path: Path
        known: Known

    def __init__(self, workspace: Workspace, *, id: str | None = None) -> None:
        super().__init__(workspace, id=id)
        self._known: dict[Path, Known] = {}
        self._name_width = NAME_WIDTH

    @property
    def session(self) -> Session:
        """That of the log that is open now: this page stays."""
        return self.workspace.session

    def enter(self) -> None:
        places, opened = self.workspace.places, self.session.path
        is_usual = self.workspace.folder is None  # of a folder that was named nothing else is wanted
        found = self._answers.get(LOGS)
        if isinstance(found, list) and opened is not None and opened not in [log.path for log in found]:
            self.forget(LOGS)
        # After the first frame, as the reading of the log.
        self.call_after_refresh(self.fetched, LOGS, lambda: found_logs(places, opened, with_recent=is_usual))

    def take(self, question: str, answer: object) -> None:
        if question == LOGS and isinstance(answer, list):
            self._judge([log for log in answer if log.path not in self._known])
        super().take(question, answer)

    @work(thread=True, exclusive=True, group="verdicts", exit_on_error=False)
    def _judge(self, logs: list[LogFile]) -> None:
        """Tell the verdicts that are remembered; of a folder that was named the others are found out, too."""
        worker = get_current_worker()
        remembered = known_verdicts({log.path: log.modified_s for log in logs})
        if self.workspace.folder is not None:  # by other options it may be another verdict
            remembered = {
                path: past
                for path, past in remembered.items()
                if past.terms == terms_of(self.workspace.request_for(path))
            }
        for path, past in remembered.items():
            self.post_message(self.Verdict(path, Known(past.status, past.failed, past.judged_with)))
        for log in logs if self.workspace.folder is not None else ():
            if log.path in remembered:
                continue
            known = self._verdict(self.workspace.request_for(log.path), worker)
            if known is None:
                return
            self.post_message(self.Verdict(log.path, known))

    def _verdict(self, request: Request, worker: Worker[object]) -> Known | None:
        """The verdict on a log, None where the work was taken back."""
        engine = self.workspace.engine

        def go_on(_step: str, _share: float) -> None:
            if worker.is_cancelled:
                raise CancelledError

        try:
            case = engine.diagnose(request, go_on)
            engine.remember(case.diagnosis, request)
        except CancelledError:
            return None
        except Exception as err:
            return Known("unreadable", as_care_error(err).message)
        verdict = verdict_of(case.diagnosis)
        return Known(verdict.status, verdict.failed, options_of(request))

    @on(Verdict)
    def _tell(self, event: Verdict) -> None:
        event.stop()
        self._known[event.path] = event.known
        if self.display:
            self.show()

    def learned(self, path: Path, known: Known) -> None:
        """A log was opened, so its verdict is known."""
        self._known[path.absolute()] = known

    def view(self) -> View:
        logs, now = self._logs, time.time()
        places = [log.path for log in logs]
        self._name_width = max((self._named(path).cell_length for path in places), default=NAME_WIDTH)
        listing = Listing(
            len(logs),
            lambda i, width: (self._item(logs[i], now, width),),
            lambda i: f"{logs[i].path.name} {logs[i].path}",
        )
        opened = self.session.path
        index = places.index(opened) if opened in places and self.choices.index is None else None
        unknown = sum(path not in self._known for path in places) if self.workspace.folder else 0
        count = number_of(len(logs), "log")
        more = f", {unknown} still to be judged" if unknown else ""
        where = f" in {clean(short(self.workspace.folder) or '.')}" if self.workspace.folder else ""
        return View(
            Content(f"{count}{where}{more}"), lambda i: self._detail(None if i is None else logs[i]), listing, index
        )

    @property
    def _logs(self) -> list[LogFile]:
        found = self._answers.get(LOGS)
        return found if isinstance(found, list) else []

    def _named(self, path: Path) -> Content:
        """The name of a log, with the folders between it and the folder that was named, of which the end tells most."""
        named = text(without_middle(path.name, NAME_WIDTH, self.glyphs), "bold")
        inside = self.workspace.folder
        between = path.parent.relative_to(inside) if inside and path.is_relative_to(inside) else Path()
        room = NAME_WIDTH - named.cell_length - 1
        if between == Path() or room < 2:
            return named
        folders = clean(str(between))
        if len(folders) > room:
            folders = self.glyphs.more + folders[len(folders) - room + 1 :]
        return Content.assemble((f"{folders}/", "dim"), named)

    def _item(self, log: LogFile, now: float, width: int) -> Content:
        mark = self.glyphs.here if log.path == self.session.path else " "
        known = self._known.get(log.path)
        verdict = Content("") if known is None else status(known.status, self.glyphs)
        words = "" if known is None else by_options(known.judged_with) + known.words
        is_told = bool(words) and width < ROOMY
        about = " " if is_told else f" {age(now - log.modified_s):>10}  {size(log.size):>8}  "
        named = self._named(log.path)
        line = Content.assemble(
            f"{mark} ",
            verdict.pad_right(VERDICT_WIDTH - verdict.cell_length),
            named.pad_right(self._name_width - named.cell_length),
            about,
        )
        if words:
            return line + text(words, "dim")
        # Of a long path the end tells more than the beginning.
        folder, room = clean(short(log.path.parent)), width - line.cell_length
        if len(folder) > room:
            folder = self.glyphs.more + folder[len(folder) - room + 1 :] if room > SHORTEST_FOLDER else ""
        return line + Content.styled(folder, "dim")

    def _detail(self, log: LogFile | None) -> Rows:
        if log is not None:
            return Rows(self._about(log))
        found = self._answers.get(LOGS)
        if isinstance(found, CareError):
            return error_rows(found)
        if found is None:
            return Rows([Row(Content("Looking for logs..."))])
        nothing = f"none was found in {named(self.workspace.places)}"
        return Rows([labelled("No log", nothing), labelled("What to do", "press o and name one")])

    def _about(self, log: LogFile) -> Iterator[Row]:
        known = self._known.get(log.path)
        if known is not None:
            yield labelled("Verdict", Content.assemble(status(known.status, self.glyphs), "  ", text(known.words)))
            if known.judged_with:
                yield labelled("Judged", f"with {known.judged_with}, not by its own limits")
        yield labelled("Log", str(log.path))
        yield labelled("Written", time.strftime("%Y-%m-%d %H:%M", time.localtime(log.modified_s)))
        yield labelled("Size", size(log.size) + (", opened before" if log.is_recent else ""))

    def action_open(self) -> None:
        """Open the log under the cursor."""
        if self.index is None:
            return
        path = self._logs[self.index].path
        is_open = path == self.session.path
        if is_open and self.session.state == "data":
            self.go("log")
        elif is_open and self.session.state == "loading":
            self.say("It is being read; Esc stops that.")
        else:
            self.post_message(OpenLog(path))

    def action_pick(self) -> None:
        """Ask for the path of a log."""
        start = self.session.path.parent if self.session.path else self.workspace.folder or Path()
        self.app.push_screen(FileDialog("Open a log", start, is_openable, self.glyphs), self._picked)

    def _picked(self, path: str | None) -> None:
        if path is not None:
            self.post_message(OpenLog(Path(path)))

    def action_again(self) -> None:
        """Read the log again, after an error or a change."""
        if self.workspace.request is not None and self.session.path is not None:
            self.post_message(Judge(self.workspace.request))

    def action_rescan(self) -> None:
        """Look for logs again."""
        self.forget(LOGS)
        self.enter()


def age(seconds: float) -> str:
    """How long ago, in the largest unit that fits."""
    for unit, length in (("d", 86400), ("h", 3600), ("min", 60)):
        if seconds >= length:
            return f"{seconds // length:.0f} {unit} ago"
    return "just now"


def size(count: int) -> str:
    """Bytes as people say them."""
    return f"{count / 1e6:.1f} MB" if count >= 1e5 else f"{count / 1e3:.1f} kB"
