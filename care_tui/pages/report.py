"""Step 6: the fix report as it will be written, and the commands that apply it."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

from textual.binding import Binding, BindingType
from textual.content import Content

from care_core.errors import CareError
from care_core.report.formats import FILE_FORMATS, FORMATS, format_of
from care_core.text import clean, number_of
from care_tui.copying import copy
from care_tui.pages.diagnosis import DiagnosisPage
from care_tui.pages.page import View, enter_to, sentence
from care_tui.render.rows import error_rows, plain_rows
from care_tui.screens.export import ExportDialog

REPORT = "report"


class ReportPage(DiagnosisPage):
    NAME = "report"
    HELP = "The report as it will be written. f changes the format, Enter writes it to a file, c copies the commands."
    BINDINGS: ClassVar[list[BindingType]] = [
        enter_to("Write it", "export"),
        Binding("f", "next_format", "Format", id="report.format"),
        Binding("e", "export", "Export", show=False, id="report.export"),
        Binding("c", "copy_commands", "Copy commands", id="report.copy"),
    ]
    _written = ""
    _written_text: object = None
    """What was on this page when it was written."""

    @property
    def _is_page(self) -> bool:
        """Whether it is for a browser: its text is shown instead."""
        return self.session.format is FORMATS["html"]

    def enter(self) -> None:
        self.forget(REPORT)
        if self.session.state == "data":
            case = self.session.decided_case()
            format = self.session.format
            self.fetched(REPORT, lambda: self.workspace.engine.preview(case, format))

    def view_of_diagnosis(self) -> View:
        tail = "enter writes it, f changes the format"
        if self._written:
            is_it = self._answers.get(REPORT) in (None, self._written_text)
            tail = f"written to {clean(self._written)}" if is_it else f"not what {clean(self._written)} holds"
        as_text = ", its text here" if self._is_page else ""
        title = Content(f"Report as {self.session.format.label}{as_text}: {tail}")
        text = self._answers.get(REPORT)
        if isinstance(text, CareError):
            return View(title, lambda _: error_rows(text))
        if not isinstance(text, str):
            return View(title, lambda _: sentence("Preparing the preview..."))
        if not text:
            return View(title, lambda _: sentence("Nothing changes, so there is no patch."))
        return View(title, lambda _: plain_rows(text))

    def action_next_format(self) -> None:
        """Show the report in the next format."""
        session = self.session
        session.format = FILE_FORMATS[(FILE_FORMATS.index(session.format) + 1) % len(FILE_FORMATS)]
        self._written = ""
        self.enter()
        self.show()

    def action_export(self) -> None:
        """Ask where the report goes, and write it."""
        name = f"{clean(Path(self.session.diagnosis.run.log.path).stem)}.care{self.session.format.suffixes[0]}"
        dialog = ExportDialog(self.session.decided_case(), Path(name), self.workspace.engine)
        self.app.push_screen(dialog, self._exported)

    def _exported(self, path: str | None) -> None:
        if path is not None:
            written = Path(path)
            self.workspace.written.append(written)
            self._written = str(written.relative_to(Path.cwd()) if written.is_relative_to(Path.cwd()) else written)
            self._show_written(written)

    def _show_written(self, path: Path) -> None:
        """Show what was written, whatever format the name of the file chose."""
        session = self.session
        format = format_of(path)
        if format is not session.format:
            session.format = format
            self._written_text = None
            self.enter()
        else:
            self._written_text = self._answers.get(REPORT)
        self.show()

    def take(self, question: str, answer: object) -> None:
        if question == REPORT and self._written and self._written_text is None:
            self._written_text = answer
        super().take(question, answer)

    def action_copy_commands(self) -> None:
        """Copy the commands that apply the fix."""
        commands = self.workspace.engine.commands(self.session.decided())
        if commands:
            self.say(copy(self.app, "\n".join(commands) + "\n", number_of(len(commands), "command"), ".commands.sh"))
        else:
            self.say("Nothing changes, so there are no commands.")
