"""A list to choose from, with the same keys everywhere. An item is built when it comes into view."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

from textual.binding import Binding, BindingType
from textual.content import Content
from textual.css.styles import RulesMap
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


class _Item(Visual):
    """One item of the list's listing, whatever that is now."""

    def __init__(self, choices: Choices, index: int) -> None:
        self._choices, self._index = choices, index

    def render_strips(self, width: int, height: int | None, style: Style, options: RenderOptions) -> list[Strip]:
        lines = [
            line.pad(1, 1).pad_right(width - 2 - line.cell_length)
            for line in self._choices.lines(self._index, width - 2)
        ]
        if style.underline:  # stands for reverse in the style sheet: `get_visual_style` leaves reverse out
            style += Style(underline=False, reverse=True)
            # Grey on the bar of the cursor is a patch.
            lines = [Content(line.plain, [span for span in line.spans if span.style != "dim"]) for line in lines]
        return [strip for line in lines for strip in line.render_strips(width, 1, style, options)]

    def get_optimal_width(self, rules: RulesMap, container_width: int) -> int:
        return container_width

    def get_minimal_width(self, rules: RulesMap) -> int:
        return 1

    def get_height(self, rules: RulesMap, width: int) -> int:
        return self._choices.listing.height


class Choices(OptionList, inherit_bindings=False):
    """Textual's option list for long lists: it stops at its ends, never wraps an item, and a step of the cursor paints
    two items. Enter is left to the page."""

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
        self._filter = ""

    @property
    def index(self) -> int | None:
        """The item under the cursor, counted from 0 before filtering."""
        return None if self.highlighted is None or not self._shown else self._shown[self.highlighted]

    @property
    def plain(self) -> str:
        """The items as shown, one line each."""
        width = max(self.scrollable_content_region.width - 2, 60)
        return "\n".join(line.plain for index in self._shown for line in self.listing.item(index, width))

    def lines(self, index: int, width: int) -> list[Content]:
        """The lines of an item, none longer than the width."""
        return [
            line if line.cell_length <= width else line.truncate(width - 1) + self._more
            for line in self.listing.item(index, width)
        ]

    def show(self, listing: Listing, index: int | None = None) -> None:
        """Replace the items and put the cursor on `index`, else on the first; no message is sent."""
        before, self.listing = self.listing, listing
        self._fill(index, is_same=(before.count, before.height) == (listing.count, listing.height))

    def filter(self, words: str) -> None:
        """Show only the items that hold these words; all of them when empty. No message is sent."""
        if words.casefold() != self._filter:
            here, self._filter = self.index, words.casefold()
            self._fill(here)

    def _fill(self, index: int | None, *, is_same: bool = False) -> None:
        count, words = self.listing.count, self.listing.words
        shown = [i for i in range(count) if not self._filter or self._filter in words(i).casefold()]
        with self.prevent(OptionList.OptionHighlighted):
            if is_same and shown == self._shown and shown:
                self.replace_option_prompt_at_index(0, _Item(self, shown[0]))  # has all of them drawn anew
            else:
                self._shown = shown
                self.set_options(Option(_Item(self, i)) for i in shown)
            self.highlighted = None if not shown else shown.index(index) if index in shown else 0
        self.scroll_to_highlight()

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
