"""Pages as a row of tabs, one line high."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass

from textual.content import Content
from textual.message import Message
from textual.style import Style
from textual.widgets import Static

from care_tui.page_names import PageInfo
from care_tui.render.rows import joined


class TabRow(Static):
    """One text, where Textual's tabs are a widget each and draw the mark in a frame of its own. A click turns to a
    page, and `mark` says where the operator is."""

    def __init__(self, pages: Iterable[PageInfo], *, pad: str = "", id: str | None = None) -> None:
        """Args: pad: what stands on both sides of a name."""
        super().__init__(markup=False, id=id)
        self._pages = tuple(pages)
        self._pad = pad
        self.here = ""
        """The page that is marked; empty where it is none of this row."""
        self._empty = frozenset[str]()
        self._shown = Content()

    @dataclass
    class Chosen(Message):
        """A tab was clicked."""

        page: str

    def action_choose(self, page: str) -> None:
        self.post_message(self.Chosen(page))

    def mark(self, name: str, empty: Collection[str]) -> None:
        """Mark a page where it is of this row, and grey out those that have nothing."""
        self.here = name if any(page.name == name for page in self._pages) else ""
        self._empty = frozenset(empty)
        self._draw()

    def on_resize(self) -> None:
        self._draw()

    def _draw(self) -> None:
        gap = "" if self._pad else " "
        content = joined([self._tab(page, page.title) for page in self._pages], gap)
        if content.cell_length > (self.content_size.width or self.app.size.width):
            content = joined([self._tab(page, page.short) for page in self._pages], gap)
        if not content.is_same(self._shown):
            self._shown = content
            self.update(content, layout=False)

    def _tab(self, page: PageInfo, title: str) -> Content:
        is_here, is_empty = page.name == self.here, page.name in self._empty
        style = "bold reverse $text-accent" if is_here else "dim $text-disabled" if is_empty else ""
        click = Style.from_meta({"@click": f"choose('{page.name}')"})
        return Content.styled(f"{self._pad}{page.key} {title}{self._pad}", style).stylize(click)
