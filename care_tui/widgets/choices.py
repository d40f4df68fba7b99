"""A list to choose from, with the same keys everywhere."""

from __future__ import annotations

from collections.abc import Iterable
from typing import ClassVar

from textual.binding import Binding, BindingType
from textual.reactive import reactive
from textual.strip import Strip
from textual.style import Style
from textual.widgets import OptionList

from care_tui.render import Rows


class Choices(OptionList, inherit_bindings=False):
    """An option list that moves with the arrows and with j, k, g and G."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("down,j", "cursor_down", "Next", show=False, id="list.down"),
        Binding("up,k", "cursor_up", "Previous", show=False, id="list.up"),
        Binding("home,g", "first", "First", show=False, id="list.first"),
        Binding("end,G", "last", "Last", show=False, id="list.last"),
        Binding("pagedown,space", "page_down", "Page down", show=False, id="list.page-down"),
        Binding("pageup", "page_up", "Page up", show=False, id="list.page-up"),
        Binding("enter", "select", "Open", key_display="enter", id="list.open"),
    ]

    def __init__(self, items: Iterable[Rows] = (), *, id: str | None = None) -> None:
        super().__init__(*items, id=id, compact=True)

    highlighted: reactive[int | None] = reactive(None, repaint=False)

    def _watch_highlighted(self, before: int | None, after: int | None) -> None:
        """Repaint the two items that changed instead of the whole list."""
        self._update_lines()
        for item in (before, after):
            if item is not None and item in self._index_to_line:
                self.refresh_lines(self._index_to_line[item], self._heights[item])

    def get_visual_style(self, *component_classes: str, partial: bool = False) -> Style:
        """Reverse the highlighted item, which a style sheet cannot: status colours stay legible, mono shows it too."""
        style = super().get_visual_style(*component_classes, partial=partial)
        here = self.has_focus and "option-list--option-highlighted" in component_classes
        return style + Style(reverse=True) if here else style

    def render_line(self, y: int) -> Strip:
        return super().render_line(y).simplify()

    def action_cursor_down(self) -> None:
        """Stop at the end instead of starting again at the top."""
        if self.highlighted != self.option_count - 1:
            super().action_cursor_down()

    def action_cursor_up(self) -> None:
        if self.highlighted != 0:
            super().action_cursor_up()

    def fill(self, items: Iterable[Rows]) -> None:
        """Replace the items and highlight the first."""
        self.set_options(items)
        self.highlighted = 0 if self.option_count else None
        self.display = self.option_count > 0
