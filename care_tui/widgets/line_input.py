"""A line to type in. What is in it may be the name of a file, and nothing in that may steer the terminal."""

from __future__ import annotations

from rich.segment import Segment
from textual.strip import Strip
from textual.widgets import Input


class LineInput(Input):
    """textual's Input draws control characters as they are; here each is drawn as a question mark, and kept."""

    def render_line(self, y: int) -> Strip:
        return Strip(Segment(_printable(text), style) for text, style, _ in super().render_line(y))


def _printable(text: str) -> str:
    return "".join(character if character.isprintable() else "?" for character in text)
