"""A page with a figure of what is under the cursor, and what else is said of it in a pane beside the figure where the
screen is wide."""

from __future__ import annotations

from textual import on
from textual.app import ComposeResult
from textual.containers import Container
from textual.geometry import Size
from textual.reactive import Reactive

from care_tui.pages.page import Page
from care_tui.render.rows import Row, Rows
from care_tui.widgets.choices import Choices
from care_tui.widgets.reader import Reader

FIGURE, LEAST_FIGURE = 14, 6
"""Lines of a figure below a text at most, and at least."""


class Column(Container):
    """Panes one below the other."""

    virtual_size: Reactive[Size] = Reactive(Size(0, 0), repaint=False)
    """Without a layout where it is news, for nothing depends on it: the screen would be laid out and painted twice."""


class FiguredPage(Page):
    """List and `side` on the left, the figure on the right; one below the other where the screen is narrow."""

    FITS = True

    def compose(self) -> ComposeResult:
        with Column(id="left"):
            yield Choices(self.glyphs, id="list")
            yield Reader(self.glyphs, id="side")
        yield Reader(self.glyphs, id="text")

    def beside(self) -> tuple[str, list[Row]]:
        """Title and text of the pane beside the figure where there is room; no text where the figure's pane says it
        all."""
        return "", []

    @property
    def is_wide(self) -> bool:
        """Whether list, text and figure stand side by side."""
        return self.screen.has_class("-wide") or self.screen.has_class("-widest")

    def room_of_figure(self, around: int = 0) -> Size:
        """Cells and lines of a figure beside so many lines of text."""
        room = self.reader.room
        height = max(room.height - around, LEAST_FIGURE)
        return Size(room.width, height if self.is_wide else min(height, FIGURE))

    def height(self, rows: list[Row]) -> int:
        """Lines that rows take."""
        return len(Rows(rows).wrap(self.reader.room.width))

    def show_text(self, *, from_top: bool = True) -> None:
        super().show_text(from_top=from_top)
        self._show_side()

    def show(self, index: int | None = None) -> None:
        super().show(index)
        self._show_side()

    def _show_side(self) -> None:
        side = self.query_one("#side", Reader)
        title, rows = self.beside() if self.is_wide else ("", [])
        side.display = bool(rows)
        self.query_one("#left").display = self.choices.display or side.display  # else the text has the whole width
        if rows:
            if side.border_title != title:  # even the same title has the whole pane drawn
                side.border_title = title
            side.show(Rows(rows))

    @on(Reader.Fitted, "#side")
    def _side_fits(self, event: Reader.Fitted) -> None:
        event.stop()
