"""One line to type, checked before it is taken."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

from textual import on
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Vertical
from textual.content import Content
from textual.screen import ModalScreen
from textual.widgets import Input, Static

from care_core.text import clean
from care_tui.widgets.line_input import LineInput

Check = Callable[[str], str]


class Prompt(ModalScreen[str | None]):
    """Asks for a text; answers None when the operator goes back. `check` says in a sentence what is wrong with it."""

    BINDINGS: ClassVar[list[BindingType]] = [Binding("escape", "dismiss(None)", "Cancel", id="prompt.cancel")]

    def __init__(self, title: str, value: str = "", hint: str = "", check: Check = lambda _typed: "") -> None:
        super().__init__()
        self._title = title
        self._value = value
        self._hint = hint
        self._check = check

    def compose(self) -> ComposeResult:
        box = LineInput(self._value, select_on_focus=True, compact=True, classes="box")
        box.cursor_blink = False
        with Vertical(classes="dialog small"):
            yield Static(Content(clean(self._title)), classes="title")
            yield box
            yield Static(Content(clean(self._hint)), classes="hint")
            yield Static(classes="error", markup=False)

    @on(Input.Submitted)
    def _submit(self, event: Input.Submitted) -> None:
        event.stop()
        typed = event.value.strip()
        problem = self._check(typed)
        if problem:
            self.query_one(".error", Static).update(Content.styled(f"! {clean(problem)}", "bold $text-error"))
        else:
            self.dismiss(typed)
