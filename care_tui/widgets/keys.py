"""The keys of the moment, in the last line."""

from __future__ import annotations

from textual.content import Content
from textual.screen import Screen
from textual.style import Style
from textual.widgets import Static

from care_tui.render.rows import Glyphs, cut, joined


class Keys(Static):
    """One text, where Textual's footer has a widget for each key: those are laid out anew at each step, which costs
    more than all the rest of it. A click on a key presses it."""

    def __init__(self, glyphs: Glyphs) -> None:
        super().__init__(markup=False)
        self._glyphs = glyphs
        self._keys = Content()

    def on_mount(self) -> None:
        self.screen.bindings_updated_signal.subscribe(self, self.tell)

    def tell(self, screen: Screen[object]) -> None:
        """Show the keys that work now."""
        shown = {
            one.binding.action: one.binding for one in reversed(screen.active_bindings.values()) if one.binding.show
        }
        keys = [
            Content.assemble(
                (self.app.get_key_display(binding), "bold $footer-key-foreground"), f" {binding.description}"
            ).stylize(Style.from_meta({"@click": f"app.simulate_key('{binding.key}')"}))
            for binding in reversed(shown.values())
        ]
        content = cut(joined(keys, "  "), self.size.width or self.app.size.width, self._glyphs)
        if not self._keys.is_same(content):
            self._keys = content
            self.update(content, layout=False)
