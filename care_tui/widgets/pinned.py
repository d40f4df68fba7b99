"""What holds on every step, pinned under the tabs: how well the profile fits, and what limits the answer."""

from __future__ import annotations

from collections.abc import Sequence

from textual.content import Content
from textual.widgets import Static

from care_tui.render.rows import joined


class Pinned(Static):
    """Lines that are cut off at the width, never wrapped: the whole of them is on the first step."""

    def __init__(self, more: str) -> None:
        super().__init__(markup=False)
        self._more = more
        self._lines: Sequence[Content] = ()

    def show(self, lines: Sequence[Content]) -> None:
        """Pin these lines; without any a blank one stays."""
        before, self._lines = max(len(self._lines), 1), lines
        self._draw(layout=before != max(len(lines), 1))

    def on_resize(self) -> None:
        self._draw(layout=False)

    def _draw(self, *, layout: bool) -> None:
        width = self.content_size.width or self.app.size.width
        cut = [line.truncate(width - 1) + self._more if line.cell_length > width else line for line in self._lines]
        content = joined(cut, "\n")
        if layout or content != self.content:
            self.update(content, layout=layout)
