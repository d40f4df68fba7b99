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
from textual.scrollbar import ScrollBar
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
                first, last = changed_cells(old, new)
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
            self._move_bar(old_value, new_value)
        if round(old_value) != round(new_value):
            self.sync()

    def _move_bar(self, before: float, now: float) -> None:
        """Repaint the scroll bar from where its thumb was to where it is, a row more at both ends: not all of it."""
        bar, (window, rows) = self.vertical_scrollbar, (self.scrollable_content_region.height, self.size.height)
        bar.set_reactive(ScrollBar.position, now)
        share = rows / max(self.virtual_size.height, 1)
        first = max(int(min(before, now) * share) - 1, 0)
        behind = min(int((max(before, now) + window) * share) + 2, rows)
        bar.refresh(Region(0, first, 1, behind - first))

    def on_resize(self, event: Resize) -> None:
        self._drawn = []
        self.sync()
        self.refresh()

    def render_line(self, y: int) -> Strip:
        width, style = self.size.width, self.visual_style
        if y >= len(self._drawn):
            return Strip.blank(width, style.rich_style)
        return Visual.to_strips(self, Rows([Row(self._drawn[y])]), width, 1, style, pad=True)[0].simplify()


def changed_cells(old: Content, new: Content) -> tuple[int, int]:
    """The first cell that differs, in its letter or its style, and the one behind the last; the whole line where wide
    characters do."""
    width = max(old.cell_length, new.cell_length)
    a, b = _cells(old, width), _cells(new, width)
    if not (len(a) == len(b) == width):
        return 0, width
    first = sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], zip(a, b, strict=True)))
    same_end = sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], zip(reversed(a), reversed(b), strict=True)))
    return first, max(width - same_end, first)


def _cells(line: Content, width: int) -> list[tuple[object, ...]]:
    """Each letter with the styles that are laid upon it."""
    cells: list[tuple[object, ...]] = [(letter,) for letter in line.plain.ljust(width)]
    for span in line.spans:
        for place in range(span.start, min(span.end, len(cells))):
            cells[place] += (span.style,)
    return cells
