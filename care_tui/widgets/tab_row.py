"""Pages as a row of tabs, one line high."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass

from textual.events import Click
from textual.message import Message
from textual.widgets import Tab, Tabs

from care_tui.page_names import PageInfo


class TabRow(Tabs, can_focus=False, inherit_bindings=False):
    """Textual's tabs for some pages: a click turns to one, and `mark` says where the operator is."""

    def __init__(self, pages: Iterable[PageInfo], *, id: str | None = None) -> None:
        self._pages = {page.name: page for page in pages}
        super().__init__(*(Tab(page.label, id=page.name) for page in self._pages.values()), id=id)

    @dataclass
    class Chosen(Message):
        """A tab was clicked. Textual's own message also comes when a tab is marked, and at the start."""

        page: str

    def on_click(self, event: Click) -> None:
        if isinstance(event.widget, Tab) and event.widget.id is not None:
            self.post_message(self.Chosen(event.widget.id))

    def mark(self, name: str, empty: Collection[str]) -> None:
        """Mark a page where it is of this row, and grey out those that have nothing."""
        with self.prevent(Tabs.TabActivated, Tabs.Cleared):
            self.active = name if name in self._pages else ""
        for tab in self.query(Tab):
            tab.set_class(tab.id in empty, "-empty")
