"""The line that `/` opens: what is typed filters the pane above at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from textual import on
from textual.binding import Binding, BindingType
from textual.message import Message
from textual.widgets import Input

PLACEHOLDER = "type to filter; Enter keeps it, Esc clears it"


class FilterBar(Input):
    """Enter keeps the filter and goes back to the pane; Esc clears it."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape", "clear", "Clear filter", id="filter.clear"),
        Binding("down,up,tab", "keep", "To the list", show=False, id="filter.keep"),
    ]

    @dataclass
    class Typed(Message):
        """These words are to be searched for."""

        words: str

    class Closed(Message):
        """The operator is done typing."""

    def __init__(self) -> None:
        super().__init__(
            placeholder=PLACEHOLDER,
            select_on_focus=False,
            compact=True,
            id="filter",
        )
        self.cursor_blink = False
        self.display = False

    @property
    def words(self) -> str:
        """What is filtered by, empty when nothing is."""
        return self.value if self.display else ""

    def open(self) -> None:
        self.display = True
        self.focus()

    def close(self) -> None:
        with self.prevent(Input.Changed):
            self.value = ""
        self.display = False

    @on(Input.Changed)
    def _typed(self, event: Input.Changed) -> None:
        event.stop()
        self.post_message(self.Typed(self.value))

    @on(Input.Submitted)
    def _submitted(self, event: Input.Submitted) -> None:
        event.stop()
        self.action_keep()

    def action_keep(self) -> None:
        self.display = bool(self.value)
        self.post_message(self.Closed())

    def action_clear(self) -> None:
        self.close()
        self.post_message(self.Typed(""))
        self.post_message(self.Closed())
