"""Any file by its path: typing narrows the list down, Enter goes into a folder or takes the file."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import ClassVar

from textual import on
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Vertical
from textual.content import Content
from textual.screen import ModalScreen
from textual.widgets import Input, Static

from care_tui.places import as_path, entries
from care_tui.render.rows import Glyphs, text
from care_tui.widgets.choices import Choices, Listing
from care_tui.widgets.line_input import LineInput


class FileDialog(ModalScreen[str | None]):
    """A path to type, with what is in its folder below. Answers None when the operator goes back.

    Args:
        accepts: whether a path is such a file, or a recording that is a folder.
        has_namespace: `NAMESPACE=` may stand before the path, as in the answer.
    """

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape", "dismiss(None)", "Cancel", id="open.cancel"),
        Binding("down", "move(1)", "Next", id="open.down", priority=True),
        Binding("up", "move(-1)", "Previous", id="open.up", priority=True),
        Binding("tab", "complete", "Complete", id="open.complete", priority=True),
    ]

    def __init__(
        self, title: str, start: Path, accepts: Callable[[Path], bool], glyphs: Glyphs, *, has_namespace: bool = False
    ) -> None:
        super().__init__()
        self._title = title
        self._start = start.absolute()
        self._accepts = accepts
        self._glyphs = glyphs
        self._has_namespace = has_namespace
        self._entries: list[Path] = []

    def compose(self) -> ComposeResult:
        box = LineInput(f"{self._start}/", select_on_focus=False, compact=True, classes="box")
        box.cursor_blink = False
        keys = "Up and Down choose, Tab completes, Enter takes it, Esc goes back"
        namespace = ". For ROS also NAMESPACE=FILE" if self._has_namespace else ""
        with Vertical(classes="dialog"):
            yield Static(self._title, classes="title", markup=False)
            yield box
            yield Static(f"{keys}{namespace}", classes="hint", markup=False)
            yield Choices(self._glyphs, id="entries")
            yield Static(classes="error", markup=False)

    def on_mount(self) -> None:
        self._list(self.query_one(Input).value)

    @on(Input.Changed)
    def _typed(self, event: Input.Changed) -> None:
        event.stop()
        self._list(event.value)

    def _list(self, typed: str) -> None:
        self._entries = entries(self._parts(typed)[1], self._accepts)
        shown = self._entries
        self.query_one(Choices).show(
            Listing(len(shown), lambda i, _width: (self._item(shown[i]),), lambda i: shown[i].name), 0
        )

    def _parts(self, typed: str) -> tuple[str, str]:
        """The namespace with its sign, and the path."""
        namespace, sign, path = typed.rpartition("=") if self._has_namespace else ("", "", typed)
        return f"{namespace}{sign}", path

    @staticmethod
    def _item(path: Path) -> Content:
        return text(f"{path.name}/", "bold") if path.is_dir() else text(path.name)

    def action_move(self, by: int) -> None:
        self.query_one(Choices).action_cursor(by)

    def action_complete(self) -> None:
        """Put the entry under the cursor into the line."""
        index = self.query_one(Choices).index
        if index is not None:
            self._put(self._entries[index])

    def _put(self, path: Path) -> None:
        box = self.query_one(Input)
        box.value = f"{self._parts(box.value)[0]}{path}{'/' if path.is_dir() else ''}"
        box.cursor_position = len(box.value)

    @on(Input.Submitted)
    def _submit(self, event: Input.Submitted) -> None:
        event.stop()
        namespace, rest = self._parts(event.value)
        typed, index = as_path(rest), self.query_one(Choices).index
        path = typed if os.path.isfile(typed) or index is None else self._entries[index]
        if os.path.isfile(path) or self._accepts(path):
            self.dismiss(f"{namespace}{path}")
        elif os.path.isdir(path):
            self._put(path)
        else:
            self.query_one(".error", Static).update(Content.styled("! There is no such file.", "bold $text-error"))
