"""The keys that work where the operator stands."""

from __future__ import annotations

from collections.abc import Iterable
from typing import ClassVar

from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Vertical
from textual.content import Content
from textual.screen import ModalScreen
from textual.widgets import Static

from care_tui.render.rows import Glyphs, Row, Rows
from care_tui.widgets.reader import Reader

Keys = Iterable[tuple[str, str, str]]
"""Keys, what they do, and the id by which the settings give the action another key."""

DOES = 22
"""Cells of what a key does."""


class HelpScreen(ModalScreen[None]):
    """A list of keys and what they do, above the screen they belong to."""

    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape,q,question_mark,f1,enter", "dismiss", "Close", id="help.close"),
    ]

    def __init__(self, glyphs: Glyphs, about: str, keys: Keys, first: Iterable[Row] = ()) -> None:
        """Args: first: what the help begins with."""
        super().__init__()
        self._glyphs = glyphs
        self._about = about
        self._first = tuple(first)
        self._keys = tuple(keys)

    def compose(self) -> ComposeResult:
        width = max((len(key) for key, _, _ in self._keys), default=0) + 2
        rows = [*self._first, Row(Content(self._about)), Row(Content())]
        rows.append(Row(Content.styled(f"{'key':<{width}}{'what it does':<{DOES}}name in settings.yaml", "dim"), width))
        rows += [
            Row(Content.assemble((f"{key:<{width}}", "bold $text-accent"), f"{does:<{DOES}}", (id, "dim")), width)
            for key, does, id in self._keys
        ]
        with Vertical(classes="dialog"):
            yield Static("Help and keys (Esc closes)", classes="title", markup=False)
            yield Reader(self._glyphs, Rows(rows), id="help")
