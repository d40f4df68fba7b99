"""A list to choose from, with the same keys everywhere. An item is built when it comes into view."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

from textual.binding import Binding, BindingType
from textual.content import Content
from textual.events import Click, Resize
from textual.geometry import Size
from textual.message import Message

from care_core.records import Record
from care_tui.render.rows import Glyphs, cut, text
from care_tui.widgets.pane import MARGIN, Pane


class Listing(Record):
    """What a list holds: `count` items of `height` lines each, built when they come into view.

    `item` gives the lines of one item for a width in cells; `words` what `/` searches in.
    """

    count: int
    item: Callable[[int, int], tuple[Content, ...]]
    words: Callable[[int], str]
    height: int = 1


NOTHING = Listing(0, lambda _index, _width: (), lambda _index: "")


class Choices(Pane):
    """It stops at its ends and cuts its items off, and has no widget or option for an item: a profile has hundreds.
    Enter is left to the page."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("down,j", "cursor(1)", "Next", show=False, id="list.down"),
        Binding("up,k", "cursor(-1)", "Previous", show=False, id="list.up"),
        Binding("home,g", "cursor_to_end(-1)", "First", show=False, id="list.first"),
        Binding("end,G", "cursor_to_end(1)", "Last", show=False, id="list.last"),
        Binding("pagedown,ctrl+f", "cursor_page(1)", "Page down", show=False, id="text.page-down"),
        Binding("pageup,ctrl+u", "cursor_page(-1)", "Page up", show=False, id="text.page-up"),
    ]

    class ListEvent(Message):
        """What the operator did in a list."""

        def __init__(self, choices: Choices) -> None:
            super().__init__()
            self.choices = choices

        @property
        def control(self) -> Choices:
            return self.choices

    class Moved(ListEvent):
        """The cursor was moved."""

    class Chosen(ListEvent):
        """The item under the cursor was clicked."""

    def __init__(self, glyphs: Glyphs, *, id: str | None = None) -> None:
        super().__init__(glyphs, id=id)
        self.listing = NOTHING
        self.highlighted: int | None = None
        """Place of the cursor among the items that are shown."""
        self._shown: list[int] = []
        self._filter = ""

    @property
    def index(self) -> int | None:
        """The item under the cursor, before filtering."""
        return None if self.highlighted is None or not self._shown else self._shown[self.highlighted]

    @property
    def shown_count(self) -> int:
        """Items that the filter leaves."""
        return len(self._shown)

    @property
    def plain(self) -> str:
        """The items as shown, one line each."""
        width = max(self.room.width, 60)
        return "\n".join(line.plain for index in self._shown for line in self.listing.item(index, width))

    def show(self, listing: Listing, index: int | None = None) -> None:
        """Replace the items and put the cursor on `index`, else on the first; no message is sent."""
        self.listing = listing
        self._fill(index)

    def filter(self, words: str) -> bool:
        """Show only the items that hold these words; all of them when empty. False where that changes nothing. No
        message is sent."""
        if words.casefold() == self._filter:
            return False
        here, self._filter = self.index, words.casefold()
        self._fill(here)
        return True

    def _fill(self, index: int | None) -> None:
        count, words, before = self.listing.count, self.listing.words, self.line_count
        self._shown = [i for i in range(count) if not self._filter or self._filter in words(i).casefold()]
        self.highlighted = None if not self._shown else self._shown.index(index) if index in self._shown else 0
        if self.line_count != before:
            self.refresh(layout=True)
        self._scroll_to_cursor()
        self.paint()

    # As a pane

    @property
    def _matches_nothing(self) -> bool:
        return bool(self._filter and self.listing.count and not self._shown)

    @property
    def line_count(self) -> int:
        return 1 if self._matches_nothing else len(self._shown) * self.listing.height

    def get_content_height(self, container: Size, viewport: Size, width: int) -> int:
        return self.line_count

    def line(self, place: int) -> Content:
        if self._matches_nothing:
            return cut(text(f" nothing here holds '{self._filter}'", "dim"), self.room.width, self.glyphs)
        item, part = divmod(place, self.listing.height)
        width = self.room.width - 1
        line = self.listing.item(self._shown[item], width)[part]
        line = cut(line, width, self.glyphs)
        if item != self.highlighted:
            return line.pad_left(1)
        if self.has_focus:  # grey on the bar of the cursor is a patch
            line = Content(line.plain, [span for span in line.spans if span.style != "dim"])
        bar = line.pad_left(1).pad_right(width + MARGIN - line.cell_length)
        # Reversed: status colours stay legible, and a terminal without colours shows it too.
        return bar.stylize("bold reverse" if self.has_focus else "bold")

    def on_resize(self, event: Resize) -> None:
        super().on_resize(event)
        self._scroll_to_cursor()

    def _scroll_to_cursor(self) -> None:
        """Half a page at a time: every line moves then, which a slow link should not pay for at every key."""
        height, visible = self.listing.height, self.room.height
        first = (self.highlighted or 0) * height
        if not self.has_room:
            return
        if not self.top <= first <= self.top + visible - height:
            self.scroll_to_line(first - visible // 2)
        self.scroll_to_line(self.top)

    # What the operator does

    def move_to(self, place: int) -> None:
        """Put the cursor on one of the items that are shown, the last where there are fewer."""
        place = min(max(place, 0), len(self._shown) - 1)
        if self._shown and place != self.highlighted:
            self.highlighted = place
            self._scroll_to_cursor()
            self.paint()
            self.post_message(self.Moved(self))

    def action_cursor(self, by: int) -> None:
        self.move_to((self.highlighted or 0) + by)

    def action_cursor_page(self, by: int) -> None:
        self.move_to((self.highlighted or 0) + by * max(self.room.height // self.listing.height, 1))

    def action_cursor_to_end(self, by: int) -> None:
        self.move_to(by * len(self._shown))

    def on_click(self, event: Click) -> None:
        """A click moves the cursor, and chooses where it was there already."""
        at = event.get_content_offset(self)
        place = -1 if at is None else (self.top + at.y) // self.listing.height
        if place == self.highlighted:
            self.post_message(self.Chosen(self))
        elif 0 <= place < len(self._shown):
            self.move_to(place)
