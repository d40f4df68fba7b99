"""The answer of the run, pinned under the tabs of every page."""

from __future__ import annotations

from textual.widgets import Static

from care_tui.render.answer import answer_lines
from care_tui.render.rows import Glyphs, cut, joined
from care_tui.session import Session

USUAL_HEIGHT, TALL_HEIGHT = 24, 30
"""Rows of a terminal as most are opened, and of one that has room for every line."""


class AnswerBar(Static):
    """Lines that are cut off at the width, never wrapped."""

    def __init__(self, glyphs: Glyphs) -> None:
        super().__init__(markup=False)
        self._glyphs = glyphs
        self._session = Session()

    def tell(self, session: Session) -> None:
        """Show where this session stands."""
        self._session = session
        self._draw()

    def on_resize(self) -> None:
        self._draw()

    def _draw(self) -> None:
        width = self.content_size.width or self.app.size.width - 2
        height = self.app.size.height
        lines = answer_lines(
            self._session, self._glyphs, width, is_low=height < USUAL_HEIGHT, is_tall=height >= TALL_HEIGHT
        )
        content = joined([cut(line, width, self._glyphs) for line in lines], "\n")
        if content != self.content:
            self.update(content, layout=content.plain.count("\n") != str(self.content).count("\n"))
