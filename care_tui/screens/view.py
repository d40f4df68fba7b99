"""A page beside the walk, above it until Esc."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

from textual.binding import Binding, BindingType

from care_tui.pages.page import Page
from care_tui.render.rows import Glyphs
from care_tui.screens.panes import PanesScreen


class ViewScreen(PanesScreen):
    """Shows one page."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("left,h,backspace", "do('step_back')", "Back a step", key_display="h", id="graph.back"),
        Binding("x", "do('mark')", "Compare", id="history.mark"),
        Binding("n", "do('next_marked')", "Next marked", id="messages.next"),
    ]

    def __init__(self, glyphs: Glyphs, make: Callable[[PanesScreen], Page]) -> None:
        super().__init__(glyphs)
        self._page = make(self)

    @property
    def page(self) -> Page:
        return self._page

    def on_mount(self) -> None:
        self.turn_to_page()
