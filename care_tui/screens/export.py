"""Where the report goes, and whether an existing file may be replaced."""

from __future__ import annotations

import os
from pathlib import Path
from typing import ClassVar

from textual import on, work
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Vertical
from textual.content import Content
from textual.screen import ModalScreen
from textual.widgets import Input, Static

from care_core.application.case import Case
from care_core.errors import CareError, UsageError
from care_core.report.formats import Format, format_of, suffixes_text
from care_core.text import clean
from care_tui.engine import Engine, as_care_error
from care_tui.places import at_home
from care_tui.screens.confirm import Confirm
from care_tui.widgets.line_input import LineInput


class ExportDialog(ModalScreen[str | None]):
    """Asks for a file name and writes the report; answers with the path, None when nothing was written."""

    BINDINGS: ClassVar[list[BindingType]] = [Binding("escape", "dismiss(None)", "Cancel", id="export.cancel")]

    def __init__(self, case: Case, default: Path, engine: Engine) -> None:
        super().__init__()
        self._case = case
        self._default = default
        self._engine = engine

    def compose(self) -> ComposeResult:
        box = LineInput(str(self._default), select_on_focus=False, compact=True, classes="box")
        box.cursor_blink = False
        with Vertical(classes="dialog small"):
            yield Static("Write the report to", classes="title", markup=False)
            yield box
            yield Static(f"The name chooses the format: {suffixes_text()}. Enter writes, Esc cancels.", classes="hint")
            yield Static(classes="error", markup=False)

    @on(Input.Submitted)
    def _submit(self, event: Input.Submitted) -> None:
        event.stop()
        self._export(at_home(event.value.strip()))

    @work(exclusive=True, group="export")
    async def _export(self, path: Path) -> None:
        try:
            format = format_of(path)
        except UsageError as err:
            self._say(err)
            return
        if os.path.isdir(path):
            self._say(UsageError("This is a folder.", hint="Name a file in it."))
        elif not os.path.exists(path) or await self.app.push_screen_wait(_replacing(path)):
            error = await self._write(path, format).wait()
            if error is None:
                self.dismiss(str(path.absolute()))
            else:
                self._say(error)

    @work(thread=True, exclusive=True, group="write", exit_on_error=False)
    def _write(self, path: Path, format: Format) -> CareError | None:
        try:
            self._engine.save(path, self._engine.report(self._case, format.name))
        except Exception as err:
            return as_care_error(err)
        return None

    def _say(self, error: CareError) -> None:
        self.query_one(".error", Static).update(Content.styled(f"! {clean(str(error))}", "bold $text-error"))


def _replacing(path: Path) -> Confirm:
    return Confirm(f"{path} exists. Replace it?", "y replaces it, n or Esc keeps it")
