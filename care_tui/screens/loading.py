"""The screen while the engine works, and the one that says why it has no answer."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Vertical
from textual.content import Content
from textual.widgets import Static

from care_core.errors import CareError
from care_core.text import clean
from care_tui import render
from care_tui.render import Glyphs
from care_tui.screens.base import CareScreen
from care_tui.widgets.key_hints import KeyHints
from care_tui.widgets.lines import Lines


class LoadingScreen(CareScreen):
    """Which step the engine is at. Nothing here moves on its own."""

    HELP_TEXT = "The log is read and diagnosed. Esc stops the work; nothing was written."
    BINDINGS: ClassVar[list[BindingType]] = [Binding("escape", "app.cancel", "Cancel", id="loading.cancel")]

    def __init__(self, log: Path, glyphs: Glyphs) -> None:
        super().__init__()
        self._log = log
        self._glyphs = glyphs

    def compose_body(self) -> ComposeResult:
        with Vertical(classes="message"):
            yield Static(Content(f"Diagnosing {clean(self._log.name)}"), classes="title")
            yield Static("starting", id="step", markup=False)
            yield Static(render.progress_bar(0.0, self._glyphs), id="progress")
        yield KeyHints()

    def advance(self, step: str, fraction: float) -> None:
        """Show the step the engine is at."""
        self.query_one("#step", Static).update(render.text(step))
        self.query_one("#progress", Static).update(render.progress_bar(fraction, self._glyphs))


class ErrorScreen(CareScreen):
    """What is wrong, where, and what to do about it."""

    HELP_TEXT = "There is no diagnosis. r tries again, q quits."
    BINDINGS: ClassVar[list[BindingType]] = [Binding("r", "app.retry", "Try again", id="error.retry")]

    def __init__(self, error: CareError) -> None:
        super().__init__()
        self.error = error

    def compose_body(self) -> ComposeResult:
        with Vertical(classes="message"):
            yield Static("No diagnosis", classes="title", markup=False)
            yield Lines(render.error_rows(self.error), id="error")
        yield KeyHints()
