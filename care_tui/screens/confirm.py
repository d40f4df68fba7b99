"""A question to be answered with yes or no before something is written."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Vertical
from textual.content import Content
from textual.screen import ModalScreen
from textual.widgets import Static

from care_core.text import clean


class Confirm(ModalScreen[bool]):
    """Asks; only y is a yes."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("y", "dismiss(True)", "Yes", id="confirm.yes"),
        Binding("n,escape", "dismiss(False)", "No", id="confirm.no"),
    ]

    def __init__(self, question: str, keys: str, doubts: Sequence[str] = ()) -> None:
        """Args: doubts: what speaks against a yes."""
        super().__init__()
        self._question, self._keys, self._doubts = question, keys, tuple(doubts)

    def compose(self) -> ComposeResult:
        with Vertical(classes="dialog small"):
            yield Static(Content.styled(clean(self._question), "bold"))
            for doubt in self._doubts:
                yield Static(Content.styled(f"! {clean(doubt)}", "$text-warning"))
            yield Static(self._keys, classes="hint", markup=False)
