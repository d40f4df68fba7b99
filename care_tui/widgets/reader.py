"""A text to read: wrapped to the width, scrolled, and filtered line by line."""

from __future__ import annotations

from typing import ClassVar

from textual.binding import Binding, BindingType
from textual.content import Content
from textual.events import Resize
from textual.geometry import Region, Size
from textual.message import Message
from textual.scroll_view import ScrollView
from textual.strip import Strip
from textual.visual import Visual

from care_tui.render.rows import Row, Rows
from care_tui.widgets.choices import SCROLL_KEYS

_STEP = 5
"""Lines by which a text that does not fit grows."""


class Reader(ScrollView, can_focus=True, inherit_bindings=False):
    """A scrollable text. Another one repaints only the lines that differ: a slow link pays for no more."""

    ALLOW_SELECT = False
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("down,j", "scroll_down", "Scroll down", show=False, id="text.down"),
        Binding("up,k", "scroll_up", "Scroll up", show=False, id="text.up"),
        Binding("home,g", "scroll_home", "To the top", show=False, id="text.top"),
        Binding("end,G", "scroll_end", "To the bottom", show=False, id="text.bottom"),
        *SCROLL_KEYS,
    ]

    class Fitted(Message):
        """There is more or less room than before."""

        def __init__(self, reader: Reader) -> None:
            super().__init__()
            self.reader = reader

        @property
        def control(self) -> Reader:
            return self.reader

    def __init__(self, rows: Rows | None = None, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self._rows = rows or Rows([])
        self._filter = ""
        self._lines: list[Content] = []
        self._width = 0

    @property
    def plain(self) -> str:
        """The text as shown, without styles and wrapping."""
        return "\n".join(row.content.plain for row in self._kept().rows)

    @property
    def room(self) -> Size:
        """Cells that a text may fill without being wrapped or scrolled."""
        return Size(max(self.scrollable_content_region.width, 10), max(self.size.height, 1))

    def show(self, rows: Rows, *, from_top: bool = True) -> None:
        """Replace the text."""
        self._rows = rows
        if from_top and self.scroll_offset.y:
            self.scroll_to(y=0, animate=False, immediate=True)
        if not self.size:  # it is hidden: wrapped when it is drawn
            self._width = 0
            return
        before = self._lines
        self._wrap()
        top = self.scroll_offset.y
        for row in range(self.size.height):
            old, new = _line(before, top + row), _line(self._lines, top + row)
            if not old.is_same(new):
                self.refresh(Region(0, row, max(old.cell_length, new.cell_length), 1))
        self.call_after_refresh(self._fit)  # with the size that it will have then

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
        self._width = self.room.width
        self._lines = self._kept().wrap(self._width)

    def _fit(self) -> None:
        """Have as much to scroll as there is. A new size has the pane painted, so it changes seldom."""
        if not self.size:  # it is hidden
            return
        count, room = len(self._lines), self.room
        size = Size(room.width, -(-count // _STEP) * _STEP) if count > room.height else Size(0, 0)
        if size != self.virtual_size:
            self.virtual_size = size

    def on_resize(self, event: Resize) -> None:
        if not self.size:
            return
        if self._width != self.room.width:
            self._wrap()
            self.refresh()
        self._fit()
        self.post_message(self.Fitted(self))

    def render_line(self, y: int) -> Strip:
        if self._width != self.room.width:  # drawn before it is told of its new size: right at once, not twice
            self._wrap()
        width, style = self.size.width, self.visual_style
        line = _line(self._lines, self.scroll_offset.y + y)
        if not line.plain:
            return Strip.blank(width, style.rich_style)
        return Visual.to_strips(self, Rows([Row(line)]), width, 1, style, pad=True)[0].simplify()


def _line(lines: list[Content], place: int) -> Content:
    return lines[place] if place < len(lines) else Content()
