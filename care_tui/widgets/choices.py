"""A list to choose from, with the same keys everywhere."""

from __future__ import annotations

from collections.abc import Iterable
from typing import ClassVar

from textual.binding import Binding, BindingType
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
        Binding("enter", "select", "Open", id="list.open"),
    ]

    def __init__(self, items: Iterable[Rows] = (), *, id: str | None = None) -> None:
        super().__init__(*items, id=id, compact=True)

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
