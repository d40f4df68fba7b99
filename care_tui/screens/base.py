"""What all full screens share."""

from __future__ import annotations

from typing import ClassVar

from textual.app import ComposeResult
from textual.screen import Screen
from textual.widgets import Static

MIN_WIDTH, MIN_HEIGHT = 60, 20
WIDE = 110
"""From this width on, lists and what they explain stand side by side."""


class CareScreen(Screen[None]):
    """A screen that says so where the terminal is too small for it, and asks for nothing else there."""

    HORIZONTAL_BREAKPOINTS: ClassVar[list[tuple[int, str]] | None] = [
        (0, "-too-narrow"),
        (MIN_WIDTH, "-narrow"),
        (WIDE, "-wide"),
    ]
    VERTICAL_BREAKPOINTS: ClassVar[list[tuple[int, str]] | None] = [(0, "-too-low"), (MIN_HEIGHT, "-tall")]
    HELP_TEXT = ""

    def compose(self) -> ComposeResult:
        yield Static(f"Terminal too small: {MIN_WIDTH} x {MIN_HEIGHT} is needed. q quits.", id="too-small", markup=False)
        yield from self.compose_body()

    def compose_body(self) -> ComposeResult:
        """The screen's own widgets."""
        raise NotImplementedError

    def help_text(self) -> str:
        """One or two sentences for the help screen on what can be done here."""
        return self.HELP_TEXT
