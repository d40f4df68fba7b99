"""A text to read: wrapped to the width, scrolled, and filtered line by line."""

from __future__ import annotations

from typing import ClassVar

from textual.binding import Binding, BindingType
from textual.content import Content
from textual.events import Resize
from textual.geometry import Size
from textual.message import Message
from textual.strip import Strip

from care_tui.render.rows import Glyphs, Rows
from care_tui.widgets.pane import Pane


class Reader(Pane):
    """A text, as rows that are wrapped."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("down,j", "scroll(1)", "Scroll down", show=False, id="text.down"),
        Binding("up,k", "scroll(-1)", "Scroll up", show=False, id="text.up"),
        Binding("home,g", "scroll_to_end(-1)", "To the top", show=False, id="text.top"),
        Binding("end,G", "scroll_to_end(1)", "To the bottom", show=False, id="text.bottom"),
        Binding("pagedown,ctrl+f", "scroll_page(1)", "Page down", show=False, id="text.page-down"),
        Binding("pageup,ctrl+u", "scroll_page(-1)", "Page up", show=False, id="text.page-up"),
    ]

    class Fitted(Message):
        """There is more or less room than before."""

        def __init__(self, reader: Reader) -> None:
            super().__init__()
            self.reader = reader

        @property
        def control(self) -> Reader:
            return self.reader

    def __init__(self, glyphs: Glyphs, rows: Rows | None = None, *, id: str | None = None) -> None:
        super().__init__(glyphs, id=id)
        self._rows = rows or Rows([])
        self._filter = ""
        self._lines: list[Content] = []
        self._width = 0
        self._shown_in: Size | None = None
        """The room that the text was made for; None before there was any."""

    @property
    def plain(self) -> str:
        """The text as shown, without styles and wrapping."""
        return "\n".join(row.content.plain for row in self._kept().rows)

    @property
    def line_count(self) -> int:
        return len(self._lines)

    def line(self, place: int) -> Content:
        return self._lines[place]

    def show(self, rows: Rows, *, from_top: bool = True) -> None:
        """Replace the text."""
        self._rows = rows
        self._shown_in = self.room if self.has_room else None
        self._wrap()
        if from_top:
            self.top = 0
        self.scroll_to_line(self.top)
        self.paint()

    def filter(self, words: str) -> None:
        """Show only the rows that hold these words; all of them when empty."""
        if words.casefold() != self._filter:
            self._filter = words.casefold()
            self.show(self._rows)

    def reveal(self, words: str) -> None:
        """Scroll to the line with these words, where what follows it is not all in view."""
        place = next((place for place, line in enumerate(self._lines) if words in line.plain), None)
        if place is not None and self.line_count > self.top + self.room.height:
            self.scroll_to_line(place)

    def _kept(self) -> Rows:
        if not self._filter:
            return self._rows
        return Rows(row for row in self._rows.rows if self._filter in row.content.plain.casefold())

    def _wrap(self) -> None:
        self._width = self.room.width if self.has_room else 0
        self._lines = self._kept().wrap(self._width) if self._width else []  # else when it is drawn

    def on_resize(self, event: Resize) -> None:
        if self._width != self.room.width:
            self._wrap()
            self.refresh()
        super().on_resize(event)
        if self._shown_in != self.room:  # a page that is turned to is told of its size, though it is as it was
            self.post_message(self.Fitted(self))

    def render_line(self, y: int) -> Strip:
        if self._width != self.room.width:  # drawn before it is told of its new size: right at once, not twice
            self._wrap()
        return super().render_line(y)

    def action_scroll(self, by: int) -> None:
        self.scroll_to_line(self.top + by)

    def action_scroll_page(self, by: int) -> None:
        self.scroll_to_line(self.top + by * self.room.height)

    def action_scroll_to_end(self, by: int) -> None:
        self.scroll_to_line(by * self.line_count)
