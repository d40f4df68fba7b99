"""The six steps of the walk, with the operator's place in them: one line, one widget."""

from __future__ import annotations

from textual.content import Content
from textual.events import Click
from textual.widgets import Static

from care_core.text import clean
from care_tui.messages import StepChosen
from care_tui.render.rows import Glyphs

STEPS = ("Log", "Objectives", "Causes", "Fix", "Diff", "Report")


class StepBar(Static):
    """All steps in a row, and the name of the log where there is room."""

    def __init__(self, glyphs: Glyphs) -> None:
        super().__init__(markup=False)
        self._glyphs = glyphs
        self._step = 1
        self._log_name = ""
        self._view: str | None = None

    def mark(self, step: int, log_name: str, view: str | None = None) -> None:
        """Mark the step (counted from 1), or the view beside it, as the operator's place, with a sign and a style."""
        self._step, self._log_name, self._view = step, clean(log_name), view
        self._draw()

    def on_resize(self) -> None:
        self._draw()

    def _tabs(self) -> list[str]:
        here = 0 if self._view else self._step
        return [
            f"{self._glyphs.here if number == here else ' '}{number} {name} "
            for number, name in enumerate(STEPS, start=1)
        ]

    def _draw(self) -> None:
        here = 0 if self._view else self._step
        line = Content.assemble(
            *((tab, "bold reverse" if number == here else "") for number, tab in enumerate(self._tabs(), start=1))
        )
        if self._view:
            line += Content.styled(f"{self._glyphs.here}{self._view} ", "bold reverse")
        room = self.size.width - line.cell_length - 2
        name = Content(self._log_name)
        if room >= min(name.cell_length, 12):
            line += Content.styled(" " + name.right(room, ellipsis=True).plain, "dim")
        self.update(line, layout=False)

    def on_click(self, event: Click) -> None:
        end = 0
        for number, tab in enumerate(self._tabs(), start=1):
            end += len(tab)
            if event.x < end:
                self.post_message(StepChosen(number))
                return
