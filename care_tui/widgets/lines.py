"""A text to read: wrapped to the width, scrolled, and filtered line by line."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

from textual.binding import Binding, BindingType
from textual.content import Content
from textual.events import Resize

from care_tui.render.rows import Rows
from care_tui.widgets.line_view import MARGIN, SCROLL_KEYS, LineView


class Lines(LineView):
    """A scrollable text. `show` replaces it; lines that stay the same are not sent to the terminal again."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("down,j", "scroll_down", "Scroll down", show=False, id="text.down"),
        Binding("up,k", "scroll_up", "Scroll up", show=False, id="text.up"),
        Binding("home,g", "scroll_home", "To the top", show=False, id="text.top"),
        Binding("end,G", "scroll_end", "To the bottom", show=False, id="text.bottom"),
        *SCROLL_KEYS,
    ]

    def __init__(
        self, rows: Rows | None = None, *, resized: Callable[[], None] = lambda: None, id: str | None = None
    ) -> None:
        """`resized` is called when there is more or less room."""
        super().__init__(id=id)
        self._resized = resized
        self._rows = rows or Rows([])
        self._filter = ""
        self._wrapped: list[Content] = []

    @property
    def plain(self) -> str:
        """The text as shown, without styles and wrapping."""
        return "\n".join(row.content.plain for row in self._kept().rows)

    def show(self, rows: Rows) -> None:
        """Replace the text and go back to its top."""
        self._rows = rows
        self._wrap()
        self.scroll_to(y=0, animate=False)
        self.sync()

    def filter(self, words: str) -> None:
        """Show only the rows that hold these words; all of them when empty."""
        if words.casefold() != self._filter:
            self._filter = words.casefold()
            self.show(self._rows)

    def _kept(self) -> Rows:
        if not self._filter:
            return self._rows
        return Rows(row for row in self._rows.rows if self._filter in row.content.plain.casefold())

    def _wrap(self) -> None:
        self._wrapped = [line.pad_left(MARGIN) for line in self._kept().wrap(self.text_width)]

    def on_resize(self, event: Resize) -> None:
        self._wrap()
        super().on_resize(event)
        self._resized()

    @property
    def line_count(self) -> int:
        return len(self._wrapped)

    def line(self, y: int) -> Content:
        return self._wrapped[y]
