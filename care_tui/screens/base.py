"""What all full screens share."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import ClassVar

from rich.console import Console
from rich.control import Control
from rich.style import Style
from textual._compositor import ChopsUpdate, Compositor
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.screen import Screen
from textual.strip import Strip
from textual.widgets import Static

from care_tui.link import Link
from care_tui.render.rows import Row

MIN_WIDTH, MIN_HEIGHT = 60, 20
WIDE = 160
"""From this width on, lists and what they explain stand side by side, each with the room of a whole terminal."""
_FEW = 8
"""Blanks that are as short as what would erase them."""


class _Cropped(ChopsUpdate):
    """What changed of each line and no more: Textual cuts a line where its change ends, and not where it begins."""

    def render_segments(self, console: Console) -> str:
        parts: list[str] = []
        for y, begin, end in self.spans:
            for behind, (x, strip) in zip(self.chop_ends[y], self.chops[y].items(), strict=False):
                first, last = max(x, begin), min(behind, end)
                if strip is not None and first < last:
                    parts += [Control.move_to(first, y).segment.text, _sent(strip.crop(first - x, last - x), console)]
        return "".join(parts)


def _sent(strip: Strip, console: Console) -> str:
    """A part of a line as the terminal gets it: blanks at its end are erased (ECH, ECMA-48 section 8.3.38)."""
    segments = list(strip)
    blanks = segments[-1].text if segments else ""
    if len(blanks) < _FEW or blanks.strip(" ") or not _is_bare(segments[-1].style):
        return strip.render(console)
    return f"{Strip(segments[:-1]).render(console)}\x1b[{len(blanks)}X"


def _is_bare(style: Style | None) -> bool:
    """Whether a blank shows nothing but the terminal's own background."""
    if style is None:
        return True
    drawn = style.reverse or style.underline or style.underline2 or style.overline or style.strike
    return not drawn and (style.bgcolor is None or style.bgcolor.is_default)


class _Compositor(Compositor):
    def render_partial_update(self) -> ChopsUpdate | None:
        update = super().render_partial_update()
        return None if update is None else _Cropped(update.chops, update.spans, update.chop_ends)


class CareScreen(Screen[None]):
    """A screen that says so where the terminal is too small for it, and asks for nothing else there."""

    # Textual declares both as instance variables, so they cannot be ClassVar here.
    HORIZONTAL_BREAKPOINTS = [(0, "-too-narrow"), (MIN_WIDTH, "-narrow"), (WIDE, "-wide")]  # noqa: RUF012
    VERTICAL_BREAKPOINTS = [(0, "-too-low"), (MIN_HEIGHT, "-tall")]  # noqa: RUF012
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("tab", "app.focus_next", "Next pane", show=False, id="screen.next-pane"),
        Binding("shift+tab", "app.focus_previous", "Previous pane", show=False, id="screen.previous-pane"),
    ]

    def compose(self) -> ComposeResult:
        yield Static(
            f"Terminal too small: {MIN_WIDTH} x {MIN_HEIGHT} is needed. q quits.", id="too-small", markup=False
        )
        yield from self.compose_body()

    def __init__(self) -> None:
        super().__init__()
        self._is_settling = False
        self._compositor = _Compositor()

    def _on_timer_update(self) -> None:
        # Its timer goes on until the link is free; what is to be drawn gathers meanwhile.
        link = getattr(self.app, "link", None)
        if isinstance(link, Link) and link.is_busy:
            return
        # New sizes are given one tick before anything is drawn: Textual draws at once, and again when the widgets have
        # made their lines for the new size, which sent a change of step to the terminal three times.
        was_settling, self._is_settling = self._is_settling, self._layout_required and not self._is_settling
        super()._on_timer_update()
        if was_settling:
            self._compositor_refresh()

    def _compositor_refresh(self) -> None:
        if self._is_settling:
            self._update_timer.resume()  # whoever asks is drawn with the next tick
        else:
            super()._compositor_refresh()

    @abstractmethod
    def compose_body(self) -> ComposeResult:
        """The screen's own widgets."""

    def described(self, binding: Binding) -> str:
        """What a key does here, in a word or two."""
        return binding.description

    def help_first(self) -> Sequence[Row]:
        """What the help screen begins with: what stands under the cursor."""
        return ()

    @abstractmethod
    def help_text(self) -> str:
        """One or two sentences for the help screen on what can be done here."""
