"""A list to choose from, with the same keys everywhere. An item is built when it comes into view."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

from textual.binding import Binding, BindingType
from textual.content import Content
from textual.css.styles import RulesMap
from textual.events import Resize
from textual.reactive import reactive
from textual.strip import Strip
from textual.style import Style
from textual.visual import RenderOptions, Visual
from textual.widgets import OptionList
from textual.widgets.option_list import Option

from care_core.records import Record

SCROLL_KEYS: list[BindingType] = [
    Binding("pagedown,ctrl+f", "page_down", "Page down", show=False, id="text.page-down"),
    Binding("pageup,ctrl+u", "page_up", "Page up", show=False, id="text.page-up"),
]


class Listing(Record):
    """What a list holds: `count` items of `height` lines each, built when they come into view.

    `item` gives the lines of one item for a width in cells; `words` what `/` searches in.
    """

    count: int
    item: Callable[[int, int], tuple[Content, ...]]
    words: Callable[[int], str]
    height: int = 1


NOTHING = Listing(0, lambda _index, _width: (), lambda _index: "")


class _Lines(Visual):
    """So many lines, for Textual to count: `Choices` draws them itself."""

    def __init__(self, height: int) -> None:
        self._height = height

    def render_strips(self, width: int, height: int | None, style: Style, options: RenderOptions) -> list[Strip]:
        return [Strip.blank(width, style.rich_style)] * self._height

    def get_optimal_width(self, rules: RulesMap, container_width: int) -> int:
        return container_width

    def get_minimal_width(self, rules: RulesMap) -> int:
        return 1

    def get_height(self, rules: RulesMap, width: int) -> int:
        return self._height


class Choices(OptionList, inherit_bindings=False):
    """Textual's option list for long lists: it stops at its ends, never wraps an item, and paints only the lines that
    changed. Enter is left to the page."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("down,j", "cursor_down", "Next", show=False, id="list.down"),
        Binding("up,k", "cursor_up", "Previous", show=False, id="list.up"),
        Binding("home,g", "first", "First", show=False, id="list.first"),
        Binding("end,G", "last", "Last", show=False, id="list.last"),
        *SCROLL_KEYS,
    ]
    highlighted: reactive[int | None] = reactive(None, repaint=False)

    def __init__(self, more: str, *, id: str | None = None) -> None:
        """`more` stands for what is cut off."""
        super().__init__(id=id, markup=False)
        self._more = more
        self.listing = NOTHING
        self._shown: list[int] = []
        self._height = 0
        self._filter = ""
        self._painted: dict[int, Content] = {}
        self.clicked_on: int | None = None
        """Where the cursor was when the mouse was clicked last."""

    @property
    def index(self) -> int | None:
        """The item under the cursor, counted from 0 before filtering."""
        return None if self.highlighted is None or not self._shown else self._shown[self.highlighted]

    @property
    def plain(self) -> str:
        """The items as shown, one line each."""
        width = max(self.scrollable_content_region.width - 2, 60)
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
        count, words, height = self.listing.count, self.listing.words, self.listing.height
        shown = [i for i in range(count) if not self._filter or self._filter in words(i).casefold()]
        with self.prevent(OptionList.OptionHighlighted):
            if (len(shown), height) != (self.option_count, self._height):
                self._height = height
                self.set_options(Option(_Lines(height)) for _ in shown)
            self._shown = shown
            self.highlighted = None if not shown else shown.index(index) if index in shown else 0
        self.scroll_to_highlight()
        self._paint()

    def _paint(self) -> None:
        """Have the lines in view painted that are not what was painted last."""
        before, self._painted = self._painted, {}
        for row in range(self.size.height):
            y = self.scroll_offset.y + row
            line = self._line(y)
            if y not in before or not before[y].is_same(line):
                self.refresh_lines(y)

    def _line(self, y: int) -> Content:
        """Line y of the list, cut off at the width; empty below its end."""
        place, part = divmod(y, self.listing.height)
        width = self.scrollable_content_region.width - 2
        if place >= len(self._shown) or width < 1:
            return Content()
        line = self.listing.item(self._shown[place], width)[part]
        if line.cell_length > width:
            line = line.truncate(width - 1) + self._more
        if place == self.highlighted and self.has_focus:  # grey on the bar of the cursor is a patch
            line = Content(line.plain, [span for span in line.spans if span.style != "dim"])
        return line.pad(1, 1).pad_right(width - line.cell_length)

    def render_line(self, y: int) -> Strip:
        y += self.scroll_offset.y
        line, style = self._line(y), self.visual_style
        self._painted[y] = line
        place = y // self.listing.height
        if place == self.highlighted:
            # Reversed: status colours stay legible, and a terminal without colours shows it too.
            style += Style(bold=True, reverse=self.has_focus)
        if not line.plain:
            return Strip.blank(self.size.width, self.visual_style.rich_style)
        strip = Visual.to_strips(self, line, line.cell_length, 1, style)[0]
        return strip.simplify().apply_meta({"option": place})

    def on_click(self) -> None:
        self.clicked_on = self.highlighted

    def on_resize(self, event: Resize) -> None:
        event.prevent_default()  # Textual would paint all of it
        self.scroll_to_highlight()
        self._paint()

    def watch_highlighted(self, before: int | None, highlighted: int | None) -> None:  # type: ignore[override]
        super().watch_highlighted(highlighted)
        for place in (before, highlighted):
            if place is not None:
                self.refresh_lines(place * self.listing.height, self.listing.height)

    def scroll_to_highlight(self, top: bool = False) -> None:
        """Half a page at a time: every line moves then, which a slow link should not pay for at every key."""
        height, visible = self.listing.height, self.scrollable_content_region.height
        first = (self.highlighted or 0) * height
        if visible and not self.scroll_offset.y <= first <= self.scroll_offset.y + visible - height:
            self.scroll_to(y=max(first - visible // 2, 0), animate=False, immediate=True)

    def action_cursor_down(self) -> None:
        if self.highlighted is not None and self.highlighted < len(self._shown) - 1:
            super().action_cursor_down()

    def action_cursor_up(self) -> None:
        if self.highlighted:
            super().action_cursor_up()
