"""The most useful keys of the moment, in one line: one widget, since a bar of many costs most of a key press."""

from __future__ import annotations

from textual.binding import Binding
from textual.content import Content
from textual.screen import Screen
from textual.widgets import Static


class KeyHints(Static):
    """Follows the focus and repaints only when other keys come to work."""

    def on_mount(self) -> None:
        self.screen.bindings_updated_signal.subscribe(self, self._follow)
        self._follow(self.screen)

    def _follow(self, screen: Screen[object]) -> None:
        hints: dict[str, tuple[str, str]] = {}
        for active in screen.active_bindings.values():
            if active.binding.show and active.enabled:
                hints.setdefault(active.binding.action, (self._key(active.binding), active.binding.description))
        palette = screen.active_bindings.get(self.app.COMMAND_PALETTE_BINDING)
        if palette is not None:
            hints[palette.binding.action] = (self._key(palette.binding), "Commands")
        line = Content("  ").join(Content.assemble((key, "bold"), f" {does}") for key, does in hints.values())
        if line != self.content:
            self.update(line)

    def _key(self, binding: Binding) -> str:
        return self.app.get_key_display(binding)
