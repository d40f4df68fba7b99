"""A line to type in. What is in it may be the name of a file, and nothing in that may steer the terminal."""

from __future__ import annotations

from rich.text import Text
from textual.widgets import Input


class LineInput(Input):
    """textual's Input draws control characters as they are; here each is drawn as a question mark, and kept."""

    @property
    def _value(self) -> Text:
        drawn = "".join(character if character.isprintable() else "?" for character in self.value)
        return Text(drawn, no_wrap=True, overflow="ignore", end="")
