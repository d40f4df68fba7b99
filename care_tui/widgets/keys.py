"""The keys of the moment, in the last line."""

from __future__ import annotations

from itertools import zip_longest
from typing import Any, cast

from textual.screen import Screen
from textual.widgets import Footer


class Keys(Footer):
    """Textual's footer. Its keys are labelled anew where other ones come to work: to make them anew costs more than all
    the rest of a step."""

    def __init__(self) -> None:
        super().__init__(show_command_palette=False, compact=True)

    def bindings_changed(self, screen: Screen[object]) -> None:
        shown = {
            one.binding.action: one.binding for one in reversed(screen.active_bindings.values()) if one.binding.show
        }
        bindings, keys = list(reversed(shown.values())), list(self.query("FooterKey"))
        if len(keys) < len(bindings):
            super().bindings_changed(screen)
            return
        for widget, binding in zip_longest(keys, bindings):
            widget.display = binding is not None
            key = cast("Any", widget)
            if binding is not None and (key.key, key.description) != (binding.key, binding.description):
                key.key, key.action, key.description = binding.key, binding.action, binding.description
                key.key_display = self.app.get_key_display(binding)
                key.refresh(layout=True)
