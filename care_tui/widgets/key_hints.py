"""The most useful keys of the moment, in one line: one widget, since a bar of many costs most of a key press."""

from __future__ import annotations

from textual.binding import Binding
from textual.content import Content
from textual.screen import Screen
from textual.widgets import Static

from care_core.text import clean
from care_tui.screens.base import CareScreen


class KeyHints(Static):
    """Follows the focus and repaints only when other keys come to work. What does not fit is left out whole."""

    def __init__(self) -> None:
        super().__init__(markup=False)
        self._here: list[Content] = []
        self._everywhere: list[Content] = []
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
        here: dict[str, Binding] = {}
        everywhere: dict[str, Binding] = {}
        for active in screen.active_bindings.values():
            if active.enabled and active.binding.show:
                (everywhere if active.node is self.app else here).setdefault(active.binding.action, active.binding)
        self._here = [self._hint(binding) for binding in sorted(here.values(), key=_order)]
        palette = screen.active_bindings.get(self.app.COMMAND_PALETTE_BINDING)
        if palette is not None:
            self._here.append(Content.assemble((self.app.get_key_display(palette.binding), "bold"), " Commands"))
        self._everywhere = [self._hint(binding) for binding in everywhere.values()]
        self._draw()

    def _hint(self, binding: Binding) -> Content:
        screen = self.screen
        does = screen.described(binding) if isinstance(screen, CareScreen) else binding.description
        return Content.assemble((self.app.get_key_display(binding), "bold"), f" {does}")

    def _draw(self) -> None:
        line = Content.styled(self._notice, "bold") if self._notice else self._keys()
        if line != self.content:
            self.update(line, layout=False)

    def _keys(self) -> Content:
        gap, shown = Content("  "), list(self._here)
        line = gap.join([*shown, *self._everywhere])
        while shown and line.cell_length > self.content_size.width:
            shown.pop()
            line = gap.join([*shown, *self._everywhere])
        return line


def _order(binding: Binding) -> int:
    """The way on comes first, then what only this page can do: the end of the line is what a narrow one leaves out."""
    if binding.action == "open":
        return 0
    return 1 if binding.action.startswith("do(") else 2
