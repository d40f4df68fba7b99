"""A list to choose from, with the same keys everywhere. Only what is visible is ever built."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

from textual.binding import Binding, BindingType
from textual.content import Content
from textual.events import Click, Resize
from textual.geometry import Size
from textual.message import Message

from care_core.records import Record
from care_tui.widgets.line_view import MARGIN, SCROLL_KEYS, LineView


class Listing(Record):
    """What a list holds: `count` items of `height` lines each, built when they come into view.

    `item` gives the lines of one item for a width in cells; `words` what `/` searches in.
    """

    count: int
    item: Callable[[int, int], tuple[Content, ...]]
    words: Callable[[int], str]
    height: int = 1


NOTHING = Listing(0, lambda _index, _width: (), lambda _index: "")


class Choices(LineView):
    """A list that moves with the arrows and with j, k, g and G. An item is never wrapped: its end is cut off."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("down,j", "move(1)", "Next", show=False, id="list.down"),
        Binding("up,k", "move(-1)", "Previous", show=False, id="list.up"),
        Binding("home,g", "move(-1000000)", "First", show=False, id="list.first"),
        Binding("end,G", "move(1000000)", "Last", show=False, id="list.last"),
        *SCROLL_KEYS,
    ]

    @dataclass
    class Chosen(Message):
        """An item was clicked while it was highlighted."""

        index: int

    def __init__(self, more: str, *, moved: Callable[[], None] = lambda: None, id: str | None = None) -> None:
        """`moved` is called when the cursor came to another item. No message: it would cost a frame of its own."""
        super().__init__(id=id)
        self._more = more
        self._moved = moved
        self._listing = NOTHING
        self._kept: range | list[int] = range(0)
        self._filter = ""
        self._cursor = 0

    @property
    def highlighted(self) -> int | None:
        """The item under the cursor, counted from 0 before filtering."""
        return self._kept[self._cursor] if self._kept else None

    @property
    def option_count(self) -> int:
        """How many items are shown."""
        return len(self._kept)

    @property
    def plain(self) -> str:
        """The items as shown, one line each."""
        return "\n".join(
            line.plain for index in self._kept for line in self._listing.item(index, max(self.text_width, 60))
        )

    def show(self, listing: Listing, index: int | None = None) -> None:
        """Replace the items and put the cursor on `index`; no message is sent."""
        lines = self.line_count
        self._listing = listing
        self._keep()
        self.put(index)
        if self.line_count != lines:
            self.refresh(layout=True)

    def put(self, index: int | None) -> None:
        """Put the cursor on an item; on the first when it is not shown."""
        kept = list(self._kept)
        self._cursor = kept.index(index) if index in kept else 0
        self._bring_into_view()
        self.sync()

    def filter(self, words: str) -> None:
        """Show only the items that hold these words; all of them when empty. `moved` is not called."""
        if words.casefold() == self._filter:
            return
        here = self.highlighted
        self._filter = words.casefold()
        self._keep()
        self.put(here)

    def _keep(self) -> None:
        count, words = self._listing.count, self._listing.words
        self._kept = (
            [index for index in range(count) if self._filter in words(index).casefold()]
            if self._filter
            else range(count)
        )

    @property
    def line_count(self) -> int:
        return len(self._kept) * self._listing.height

    def get_content_height(self, container: Size, viewport: Size, width: int) -> int:
        return self.line_count

    def line(self, y: int) -> Content:
        place, part = divmod(y, self._listing.height)
        width = self.text_width
        content = self._listing.item(self._kept[place], width)[part]
        if content.cell_length > width:
            content = content.truncate(width - 1) + self._more
        line = content.pad_left(MARGIN)
        if place != self._cursor:
            return line
        # Reversed, for status colours stay legible and a terminal without colours shows it too; dim is a grey patch.
        line = Content(line.plain, [span for span in line.spans if span.style != "dim"])
        return line.pad_right(width + MARGIN - line.cell_length).stylize("bold reverse" if self.has_focus else "bold")

    def _bring_into_view(self) -> None:
        height, top = self._listing.height, self.scroll_offset.y
        first = self._cursor * height
        width, visible = self.scrollable_content_region.size
        if visible:
            self._fit(Size(width, max(self.line_count, visible)))  # before it is known, nothing can be scrolled to
        # Half a page at a time: every line moves, which a slow link should not pay for at every key.
        if visible and not top <= first <= top + visible - height:
            self.scroll_to(y=max(first - visible // (2 * height) * height, 0), animate=False)

    def on_resize(self, event: Resize) -> None:
        self._bring_into_view()
        super().on_resize(event)

    def watch_has_focus(self, has_focus: bool) -> None:
        super().watch_has_focus(has_focus)
        self.sync()

    def action_move(self, by: int) -> None:
        """Move the cursor; it stops at the ends."""
        before = self._cursor
        self._cursor = min(max(before + by, 0), max(len(self._kept) - 1, 0))
        if self._cursor != before:
            self._bring_into_view()
            self.sync()
            self._moved()

    def action_page_down(self) -> None:
        self.action_move(self._page())

    def action_page_up(self) -> None:
        self.action_move(-self._page())

    def _page(self) -> int:
        return max(self.scrollable_content_region.height // self._listing.height - 1, 1)

    def on_click(self, event: Click) -> None:
        place = (event.y + self.scroll_offset.y) // self._listing.height
        if place == self._cursor and self._kept:
            self.post_message(self.Chosen(self._kept[place]))
        elif place < len(self._kept):
            self.action_move(place - self._cursor)
