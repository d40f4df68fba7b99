"""Lines of text that scroll. Only what changed of a line is sent to the terminal: a slow link pays for no more."""

from __future__ import annotations

from abc import abstractmethod
from itertools import takewhile
from typing import ClassVar

from textual.binding import Binding, BindingType
from textual.content import Content
from textual.events import Resize
from textual.geometry import Region, Size
from textual.scroll_view import ScrollView
from textual.strip import Strip
from textual.visual import Visual

from care_tui.render.rows import Row, Rows

MARGIN = 1
"""Blank cells left and right of the text; part of the lines, since a style's padding costs bytes on each of them."""

SCROLL_KEYS: list[BindingType] = [
    Binding("pagedown,space,ctrl+f", "page_down", "Page down", show=False, id="text.page-down"),
    Binding("pageup,ctrl+u", "page_up", "Page up", show=False, id="text.page-up"),
]


class LineView(ScrollView, can_focus=True, inherit_bindings=False):
    """Draws `line(y)` for every visible y. Call `sync` after a change: it repaints what differs from the screen."""

    ALLOW_SELECT = False
    BINDINGS: ClassVar[list[BindingType]] = []

    def __init__(self, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self._drawn: list[Content] = []
        self._changed: dict[int, tuple[int, int]] = {}

    @property
    @abstractmethod
    def line_count(self) -> int:
        """How many lines there are in all."""

    @abstractmethod
    def line(self, y: int) -> Content:
        """Line y of the whole text, counted from 0."""

    @property
    def text_width(self) -> int:
        """Cells between the margins."""
        return max(self.scrollable_content_region.width - 2 * MARGIN, 1)

    def sync(self) -> None:
        """Repaint the visible lines that changed, from their first changed cell to their last."""
        width, height = self.scrollable_content_region.size
        if width <= 2 * MARGIN or height <= 0:
            return
        self._fit(Size(width, max(self.line_count, height)))
        before, self._drawn = self._drawn, self._visible(height)
        before += [Content()] * (height - len(before))
        for row, (old, new) in enumerate(zip(before, self._drawn, strict=False)):
            if not old.is_same(new):
                self._changed[row] = first, last = changed_cells(old, new)
                self.refresh(Region(first, row, last - first, 1))

    def _fit(self, size: Size) -> None:
        """Make the scroll bar, and how far there is to scroll, follow the number of lines.

        Assigned as usual, a new size makes Textual lay out and repaint the screen; only the scroll bar depends on it.
        """
        if size != self.virtual_size:
            self.set_reactive(LineView.virtual_size, size)
            self._scroll_update(size)
            self._refresh_scrollbars()

    def _visible(self, height: int) -> list[Content]:
        top, count = self.scroll_offset.y, self.line_count
        return [self.line(top + row) if top + row < count else Content() for row in range(height)]

    def watch_scroll_y(self, old_value: float, new_value: float) -> None:
        if self.show_vertical_scrollbar:
            self.vertical_scrollbar.position = new_value
        if round(old_value) != round(new_value):
            self.sync()

    def on_resize(self, event: Resize) -> None:
        self._drawn = []
        self.sync()
        self.refresh()

    def render_line(self, y: int) -> Strip:
        width, style = self.size.width, self.visual_style
        if y >= len(self._drawn):
            return Strip.blank(width, style.rich_style)
        strip = Visual.to_strips(self, Rows([Row(self._drawn[y])]), width, 1, style, pad=True)[0].simplify()
        # Textual sends whole segments: cut where the change begins and ends, only that part is sent.
        first, last = self._changed.get(y, (0, width))
        cuts = sorted({first, min(last, width), width} - {0})
        return Strip.join(strip.divide(cuts))


def changed_cells(old: Content, new: Content) -> tuple[int, int]:
    """The first cell that differs and the one behind the last; the whole line where styles or wide characters do."""
    width = max(old.cell_length, new.cell_length)
    a, b = old.plain.ljust(width), new.plain.ljust(width)
    if old.spans != new.spans or not (len(a) == len(b) == width):
        return 0, width
    first = sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], zip(a, b, strict=True)))
    same_end = sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], zip(reversed(a), reversed(b), strict=True)))
    return first, width - same_end
