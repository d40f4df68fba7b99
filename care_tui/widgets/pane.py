"""Lines that scroll in a pane, with marks for what is cut off."""

from __future__ import annotations

from textual.content import Content
from textual.events import MouseScrollDown, MouseScrollUp, Resize
from textual.geometry import Region, Size
from textual.scroll_view import ScrollView
from textual.strip import Strip
from textual.visual import Visual

from care_tui.render.rows import Glyphs, Row, Rows

MARGIN = 2
"""Cells at the right that are kept for the marks of what is cut off."""
_WHEEL = 3
"""Lines that a turn of the wheel moves."""


class Pane(ScrollView, can_focus=True, inherit_bindings=False):
    """It scrolls itself and is as large as its place for Textual, which would lay the screen out anew for every text of
    another length. Only lines that changed are painted: a slow link pays for no more."""

    ALLOW_SELECT = False

    def __init__(self, glyphs: Glyphs, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self.glyphs = glyphs
        self.top = 0
        """The first line in view."""
        self._painted: dict[int, Content] = {}

    @property
    def line_count(self) -> int:
        raise NotImplementedError

    def line(self, place: int) -> Content:
        """A line of the whole, at most as wide as there is room."""
        raise NotImplementedError

    @property
    def has_room(self) -> bool:
        """Whether it is known how large the pane is: it was laid out once."""
        return bool(self.outer_size)

    @property
    def room(self) -> Size:
        """Cells that lines may fill without being cut or scrolled; where the pane is hidden, as it was last."""
        gutter = self.styles.gutter
        width, height = self.outer_size.width - gutter.width - MARGIN, self.outer_size.height - gutter.height
        return Size(max(width, 10), max(height, 1))

    def scroll_to_line(self, top: int) -> None:
        """Have this line at the top, as far as there are lines below it."""
        top = min(max(top, 0), max(self.line_count - self.room.height, 0))
        if top != self.top:
            self.top = top
            self.paint()

    def paint(self) -> None:
        """Have the lines painted that are not what was painted last."""
        for y, before in self._painted.items():
            if not before.is_same(self._marked(y)):
                self.refresh(Region(0, y, self.size.width, 1))

    def _marked(self, y: int) -> Content:
        """Line y of the pane, with the mark of what is cut off above or below."""
        line = self.line(self.top + y) if self.top + y < self.line_count else Content()
        height = self.room.height
        below, mark = self.line_count - self.top - height, ""
        if y == height - 1 and below > 0:
            mark = f"{below} more {self.glyphs.down}"
            if len(line.plain.rstrip()) + len(mark) > self.room.width:
                mark = self.glyphs.down
        elif not y and self.top:
            mark = self.glyphs.up
        if not mark:
            return line
        width = self.room.width + MARGIN - len(mark)
        return Content.assemble(line[:width].pad_right(width - line[:width].cell_length), (mark, "dim"))

    def on_resize(self, _event: Resize) -> None:
        self.scroll_to_line(self.top)

    def render_line(self, y: int) -> Strip:
        style = self.visual_style
        line = self._painted[y] = self._marked(y)
        if not line.plain:
            return Strip.blank(self.size.width, style.rich_style)
        return Visual.to_strips(self, Rows([Row(line)]), self.size.width, 1, style, pad=True)[0].simplify()

    def on_mouse_scroll_down(self, event: MouseScrollDown) -> None:
        event.prevent_default().stop()
        self.scroll_to_line(self.top + _WHEEL)

    def on_mouse_scroll_up(self, event: MouseScrollUp) -> None:
        event.prevent_default().stop()
        self.scroll_to_line(self.top - _WHEEL)
