"""The five steps of the walk, with the operator's place in them."""

from __future__ import annotations

from textual.app import ComposeResult
from textual.containers import Horizontal
from textual.content import Content
from textual.widgets import Static

from care_core.text import clean
from care_tui.messages import StepChosen
from care_tui.render import Glyphs

STEPS = ("Objectives", "Causes", "Fix", "Diff", "Report")


class StepTab(Static):
    """One step; a click opens it."""

    def __init__(self, number: int, glyphs: Glyphs) -> None:
        super().__init__(classes="step-tab", markup=False)
        self._number = number
        self._glyphs = glyphs

    def mark(self, current: bool) -> None:
        """Show whether the operator is here, with a sign beside the colour."""
        sign = self._glyphs.here if current else " "
        self.update(Content(f"{sign}{self._number} {STEPS[self._number - 1]}"))
        self.set_class(current, "-current")

    def on_click(self) -> None:
        self.post_message(StepChosen(self._number))


class StepBar(Horizontal):
    """All steps in a row, and the name of the log where there is room."""

    def __init__(self, log_name: str, glyphs: Glyphs) -> None:
        super().__init__()
        self._log_name = log_name
        self._glyphs = glyphs

    def compose(self) -> ComposeResult:
        for number in range(1, len(STEPS) + 1):
            yield StepTab(number, self._glyphs)
        yield Static(Content(clean(self._log_name)), id="log-name")

    def mark(self, step: int) -> None:
        """Mark the step (counted from 1) as the operator's place."""
        for number, tab in enumerate(self.query(StepTab), start=1):
            tab.mark(number == step)
