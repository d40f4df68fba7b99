"""The most useful keys of the moment, in one line: one widget, since a bar of many costs most of a key press."""

from __future__ import annotations

from textual.content import Content
from textual.screen import Screen
from textual.widgets import Static

from care_core.text import clean


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
        hints: dict[str, tuple[bool, Content]] = {}
        for active in screen.active_bindings.values():
            binding = active.binding
            if active.enabled and binding.show:
                key = self.app.get_key_display(binding)
                everywhere = active.node is self.app
                hints.setdefault(
                    binding.action, (everywhere, Content.assemble((key, "bold"), f" {binding.description}"))
                )
        palette = screen.active_bindings.get(self.app.COMMAND_PALETTE_BINDING)
        if palette is not None:
            key = self.app.get_key_display(palette.binding)
            hints[palette.binding.action] = True, Content.assemble((key, "bold"), " Commands")
        self._here = [hint for everywhere, hint in hints.values() if not everywhere]
        self._everywhere = [hint for everywhere, hint in hints.values() if everywhere]
        self._draw()

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
