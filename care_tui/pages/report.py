"""Step 6: the fix report as it will be written, and the commands that apply it."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

from textual.content import Content

from care_core.errors import CareError
from care_core.report.formats import FILE_FORMATS, FORMATS
from care_core.text import clean
from care_tui.pages.page import View, sentence
from care_tui.pages.step import DiagnosisPage
from care_tui.render.rows import error_rows, plain_rows
from care_tui.screens.export import ExportDialog


class ReportPage(DiagnosisPage):
    name = "Report"
    HELP = "The report as it will be written. f changes the format, Enter writes it to a file, c copies the commands."
    ENTER = "Export"
    ACTIONS: ClassVar[frozenset[str]] = frozenset({"next_format", "export", "copy_commands"})
    _text: str | CareError | None = None
    _written = ""

    @property
    def _is_page(self) -> bool:
        """Whether it is for a browser: its text is shown instead."""
        return self.session.format is FORMATS["html"]

    def enter(self) -> None:
        if self.session.state == "data":
            self._text = None
            case = self.session.decided_case()
            shown = FORMATS["markdown"] if self._is_page else self.session.format
            self.screen.fetch("report", lambda _job: self.walk.engine.report(case, shown.name), self._received)

    def _received(self, text: str | CareError) -> None:
        self._text = text
        if self.is_shown:
            self.screen.draw()

    def view_of_diagnosis(self) -> View:
        tail = f"written to {clean(self._written)}" if self._written else "Enter writes it, f changes the format"
        as_text = ", its text here" if self._is_page else ""
        title = Content.assemble(f"Report as {self.session.format.label}{as_text}", (f"  {tail}", "dim"))
        text = self._text
        if isinstance(text, CareError):
            return View(title, lambda _: error_rows(text))
        if text is None:
            return View(title, lambda _: sentence("Writing..."))
        if not text:
            return View(title, lambda _: sentence("Nothing changes, so there is no patch."))
        return View(title, lambda _: plain_rows(text))

    def next_format(self) -> None:
        """Show the report in the next format."""
        session = self.session
        session.format = FILE_FORMATS[(FILE_FORMATS.index(session.format) + 1) % len(FILE_FORMATS)]
        self._written = ""
        self.enter()
        self.screen.draw()

    def export(self) -> None:
        """Ask where the report goes, and write it."""
        if self.session.state != "data":
            return
        name = f"{clean(Path(self.session.diagnosis.run.log.path).stem)}.care{self.session.format.suffixes[0]}"
        self.screen.app.push_screen(
            ExportDialog(self.session.decided_case(), Path(name), self.walk.engine), self._exported
        )

    def _exported(self, path: str | None) -> None:
        if path is not None:
            written = Path(path)
            self._written = str(written.relative_to(Path.cwd()) if written.is_relative_to(Path.cwd()) else written)
            self.screen.draw()

    def copy_commands(self) -> None:
        """Copy the commands that apply the fix."""
        commands = self.walk.engine.commands(self.session.decided()) if self.session.state == "data" else []
        if commands:
            self.walk.copy("\n".join(commands) + "\n", f"{len(commands)} commands", ".commands.sh")
        else:
            self.screen.say("Nothing changes, so there are no commands.")

    def open(self, index: int | None) -> None:
        self.export()
