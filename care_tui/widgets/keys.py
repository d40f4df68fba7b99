"""The keys of the moment, in the last line."""

from __future__ import annotations

from textual.screen import Screen
from textual.widgets import Footer


class Keys(Footer):
    """Textual's footer, made anew only when other keys come to work: that costs most of a step."""

    def __init__(self) -> None:
        super().__init__(show_command_palette=False, compact=True)
        self._told: list[tuple[str, str, bool]] = []

    def bindings_changed(self, screen: Screen[object]) -> None:
        active = screen.active_bindings.values()
        told = [(one.binding.key, one.binding.description, one.enabled) for one in active if one.binding.show]
        if told != self._told:
            self._told = told
            super().bindings_changed(screen)
