"""The most useful keys of the moment, in one line: one widget, since a bar of many costs most of a key press."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from textual.binding import Binding
from textual.content import Content
from textual.events import Click
from textual.screen import Screen
from textual.widgets import Static

from care_core.text import clean
from care_tui.render.rows import joined
from care_tui.screens.base import CareScreen

GAP = "  "


class Hint(NamedTuple):
    """A key, and what the line says of it."""

    key: str
    words: Content


class KeyHints(Static):
    """Follows the focus and repaints only when other keys come to work. What does not fit is left out whole."""

    def __init__(self) -> None:
        super().__init__(markup=False)
        self._here: list[Hint] = []
        self._everywhere: list[Hint] = []
        self._notice = ""

    def on_mount(self) -> None:
        self.screen.bindings_updated_signal.subscribe(self, self._follow)
        self._follow(self.screen)

    def on_resize(self) -> None:
        self._draw()

    def say(self, words: str) -> None:
        """Show something in passing instead of the keys; an empty text brings them back."""
        self._notice = clean(words)
        self._draw()

    def _follow(self, screen: Screen[object]) -> None:
        here: dict[str, tuple[str, Binding]] = {}
        everywhere: dict[str, tuple[str, Binding]] = {}
        for key, active in screen.active_bindings.items():
            if active.enabled and active.binding.show:
                found = everywhere if active.node is self.app else here
                found.setdefault(active.binding.action, (key, active.binding))
        self._here = [self._hint(*pair) for pair in sorted(here.values(), key=lambda pair: _order(pair[1]))]
        palette = screen.active_bindings.get(self.app.COMMAND_PALETTE_BINDING)
        if palette is not None:
            shown = Content.assemble((self.app.get_key_display(palette.binding), "bold"), " Commands")
            self._here.append(Hint(self.app.COMMAND_PALETTE_BINDING, shown))
        self._everywhere = [self._hint(*pair) for pair in everywhere.values()]
        self._draw()

    def _hint(self, key: str, binding: Binding) -> Hint:
        screen = self.screen
        does = screen.described(binding) if isinstance(screen, CareScreen) else binding.description
        return Hint(key, Content.assemble((self.app.get_key_display(binding), "bold"), f" {does}"))

    def _draw(self) -> None:
        hints = joined([hint.words for hint in self._fitting()], GAP)
        line = Content.styled(self._notice, "bold") if self._notice else hints
        if line != self.content:
            self.update(line, layout=False)

    def _fitting(self) -> list[Hint]:
        """The hints that there is room for."""
        here = list(self._here)
        while here and _width([*here, *self._everywhere]) > self.content_size.width:
            here.pop()
        return [*here, *self._everywhere]

    def on_click(self, event: Click) -> None:
        """A click on a hint is its key; one on a notice brings the keys back."""
        if self._notice:
            self.say("")
            return
        x, end = event.get_content_offset_capture(self).x, 0
        for hint in self._fitting():
            start, end = end, end + hint.words.cell_length
            if start <= x < end:
                self.app.simulate_key(hint.key)
            end += len(GAP)


def _width(hints: Sequence[Hint]) -> int:
    return sum(hint.words.cell_length for hint in hints) + len(GAP) * (len(hints) - 1)


def _order(binding: Binding) -> int:
    """The way on comes first, then what only this page can do: the end of the line is what a narrow one leaves out."""
    if binding.action == "open":
        return 0
    return 1 if binding.action.startswith("do(") else 2
