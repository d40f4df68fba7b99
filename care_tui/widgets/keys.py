"""The keys of the moment, in the last line."""

from __future__ import annotations

from collections.abc import Callable

from textual.binding import ActiveBinding
from textual.content import Content
from textual.screen import Screen
from textual.style import Style
from textual.widgets import Static

from care_tui.render.rows import Glyphs, cut, joined

_BACK, _ALWAYS = "page.back", ("app.help", "app.quit")
"""Bindings by their names: the first to go, and those that stay, where the line is short."""


class Keys(Static):
    """One text, where Textual's footer has a widget for each key: those are laid out anew at each step, which costs
    more than all the rest of it. A click on a key presses it."""

    def __init__(self, glyphs: Glyphs, label_of: Callable[[ActiveBinding], str]) -> None:
        """Args: label_of: what a key does now, in a word or two."""
        super().__init__(markup=False)
        self._glyphs = glyphs
        self._label_of = label_of
        self._keys = Content()
        self._is_asked = False
        """Whether the keys are to be told already: several signals come of one key."""

    def on_mount(self) -> None:
        self.screen.bindings_updated_signal.subscribe(self, self._ask)

    def _ask(self, _screen: Screen[object]) -> None:
        if not self._is_asked:
            self._is_asked = True
            # Not after the refresh: the screen in front sees to that, and forgets it where it closes first.
            self.call_later(self._tell_asked)

    def _tell_asked(self) -> None:
        self._is_asked = False
        self.tell(self.screen)

    def on_resize(self) -> None:
        self.tell(self.screen)

    def tell(self, screen: Screen[object]) -> None:
        """Show the keys that work now."""
        shown = {one.binding.action: one for one in reversed(screen.active_bindings.values()) if one.binding.show}
        content = self._fitting(list(reversed(shown.values())))
        if not self._keys.is_same(content):
            self._keys = content
            self.update(content, layout=False)

    def _fitting(self, bindings: list[ActiveBinding]) -> Content:
        """The keys that the line has room for: help stays, which lists them all, and the way back is known best."""
        width = self.size.width or self.app.size.width
        always = [self._key(one) for one in bindings if one.binding.id in _ALWAYS]
        others = (one for one in bindings if one.binding.id not in _ALWAYS)
        own = sorted(others, key=lambda one: one.binding.id == _BACK)
        keys = [self._key(one) for one in own]
        while keys and joined([*keys, *always], "  ").cell_length > width:
            keys.pop()
        return cut(joined([*keys, *always], "  "), width, self._glyphs)

    def _key(self, active: ActiveBinding) -> Content:
        key = self.app.get_key_display(active.binding)
        return Content.assemble((key, "bold $footer-key-foreground"), f" {self._label_of(active)}").stylize(
            Style.from_meta({"@click": f"app.simulate_key('{active.binding.key}')"})
        )
