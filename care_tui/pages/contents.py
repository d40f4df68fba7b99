"""What a log holds, whether or not a profile fits it: what `care inspect` prints."""

from __future__ import annotations

from pathlib import Path

from textual.content import Content

from care_core.text import clean
from care_tui.pages.page import Fetch, Page, View
from care_tui.render.rows import Rows, plain_rows
from care_tui.screens.panes import PanesScreen


class ContentsPage(Page):
    name = "Contents"
    HELP = (
        "What the log holds: span, damage, parameters, what each profile finds in it, channels. / filters, Esc leaves."
    )

    def __init__(self, screen: PanesScreen, log: Path) -> None:
        super().__init__(screen)
        self._log = log
        self._found: Fetch[Rows] = Fetch(self, "contents")

    def enter(self) -> None:
        self._found.start(self._inspect)

    def _inspect(self) -> Rows:
        import care_core
        from care_core.report.inspection import holdings_text

        return plain_rows(holdings_text(care_core.inspect(self._log), self.screen.text.text_width))

    def view(self) -> View:
        title = f"Contents of {clean(self._log.name)}"
        return self._found.view(title, lambda rows: View(Content(title), lambda _: rows))
