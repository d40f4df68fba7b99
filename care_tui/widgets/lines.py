"""Rows of text that scroll, and repaint only where they changed: a slow link pays for nothing else."""

from __future__ import annotations

from itertools import zip_longest
from typing import ClassVar

from textual.binding import Binding, BindingType
from textual.content import Content
from textual.events import Resize
from textual.geometry import Region, Size
from textual.scroll_view import ScrollView
from textual.strip import Strip
from textual.visual import Visual

from care_tui.render import Row, Rows

MARGIN = 1
"""Blank cells left and right of the text; part of the lines, since a style's padding costs bytes on each of them."""


class Lines(ScrollView, can_focus=True, inherit_bindings=False):
    """A scrollable text. `show` replaces it; lines that stay the same are not sent to the terminal again."""

    ALLOW_SELECT = False
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("down,j", "scroll_down", "Scroll down", show=False, id="text.down"),
        Binding("up,k", "scroll_up", "Scroll up", show=False, id="text.up"),
        Binding("pagedown,space", "page_down", "Page down", show=False, id="text.page-down"),
        Binding("pageup", "page_up", "Page up", show=False, id="text.page-up"),
        Binding("home,g", "scroll_home", "To the top", show=False, id="text.top"),
        Binding("end,G", "scroll_end", "To the bottom", show=False, id="text.bottom"),
    ]

    def __init__(self, rows: Rows | None = None, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self._rows = rows or Rows([])
        self._lines: list[Content] = []

    @property
    def plain(self) -> str:
        """The text as shown, without styles and wrapping."""
        return "\n".join(row.content.plain for row in self._rows.rows)

    def show(self, rows: Rows) -> None:
        """Replace the text and go back to its top."""
        self._rows = rows
        self.scroll_to(y=0, animate=False)
        self._wrap()

    def on_resize(self, event: Resize) -> None:
        self._wrap()

    def _wrap(self) -> None:
        width, height = self.scrollable_content_region.size
        if width <= 2 * MARGIN:
            return
        before = self._lines
        self._lines = [line.pad_left(MARGIN) for line in self._rows.wrap(width - 2 * MARGIN)]
        # Assigned as usual, a new size makes Textual lay out and repaint the screen; only the scroll bar depends on it.
        size = Size(width, max(len(self._lines), height))
        self.set_reactive(Lines.virtual_size, size)
        self._scroll_update(size)
        self._refresh_scrollbars()
        for y, (old, new) in enumerate(zip_longest(before, self._lines, fillvalue=Content())):
            if not old.is_same(new):
                self.refresh(Region(0, y - self.scroll_offset.y, max(old.cell_length, new.cell_length), 1))

    def render_line(self, y: int) -> Strip:
        place, width, style = y + self.scroll_offset.y, self.size.width, self.visual_style
        if place >= len(self._lines):
            return Strip.blank(width, style.rich_style)
        return Visual.to_strips(self, Rows([Row(self._lines[place])]), width, 1, style, pad=True)[0].simplify()
