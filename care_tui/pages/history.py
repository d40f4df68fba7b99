"""Past runs from the local history: how each objective went, and two of them side by side."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

from textual.content import Content

from care_tui.pages.page import Fetch, Page, View, sentence
from care_tui.reading import Past, past_runs
from care_tui.render.rows import ASCII, Row, Rows, heading, labelled, padded, text
from care_tui.screens.panes import PanesScreen
from care_tui.widgets.choices import Listing


class HistoryPage(Page):
    name = "History"
    HELP = (
        "Runs that were triaged before, the newest first, with the trend of every objective. x marks a run to compare "
        "the one under the cursor with. / filters, Esc leaves."
    )
    ACTIONS: ClassVar[frozenset[str]] = frozenset({"mark"})

    def __init__(self, screen: PanesScreen) -> None:
        super().__init__(screen)
        self._found: Fetch[list[Past]] = Fetch(screen, "history")
        self._marked: Past | None = None

    def enter(self) -> None:
        self._found.start(past_runs)

    def view(self) -> View:
        return self._found.view("History", self._show)

    def _show(self, runs: list[Past]) -> View:
        if not runs:
            nothing = "No run was triaged before: 'care triage' and this app remember those they judge."
            return View(Content("History"), lambda _: sentence(nothing))
        listing = Listing(
            len(runs),
            lambda i, _width: (self._item(runs[i]),),
            lambda i: f"{runs[i].log} {runs[i].profile} {runs[i].verdict}",
        )
        marked = "" if self._marked is None else f"  compared with {Path(self._marked.log).name}"
        return View(
            Content(f"History  {len(runs)} runs") + text(marked, "bold"),
            lambda i: Rows([]) if i is None else self._detail(runs[i], runs),
            listing,
        )

    def _item(self, past: Past) -> Content:
        mark = "*" if past == self._marked else " "
        line = Content(f"{mark} {past.at[:16].replace('T', ' ')}  ")
        return line + padded(Path(past.log).name, 26, "bold") + text(f" {past.verdict}")

    def _detail(self, past: Past, runs: list[Past]) -> Rows:
        rows = [labelled("Log", past.log), labelled("Profile", past.profile), labelled("Verdict", past.verdict)]
        if past.cause:
            rows.append(labelled("First cause", past.cause))
        other = self._marked if self._marked is not None and self._marked != past else None
        rows += [Row(Content()), heading("Objectives" if other is None else f"Against {Path(other.log).name}")]
        for name, value in past.values.items():
            rows.append(labelled(name, self._line(name, value, past, other, runs)))
        if other is not None:
            rows += [Row(Content()), heading("Options that differ"), *_differences(past, other)]
        return Rows(rows)

    def _line(self, name: str, value: float | None, past: Past, other: Past | None, runs: list[Past]) -> str:
        shown = "not evaluated" if value is None else f"{value:.4g}"
        if other is not None:
            before = other.values.get(name)
            return f"{shown}  (there {'not evaluated' if before is None else f'{before:.4g}'})"
        alike = [run.values.get(name) for run in reversed(runs) if run.profile == past.profile]
        known = [number for number in alike if number is not None]
        return f"{shown:<14} {self._spark(known)}"

    def _spark(self, values: list[float]) -> str:
        from care_core.history import sparkline

        return sparkline(values[-40:], ascii=self.glyphs is ASCII) if len(values) > 1 else ""

    def mark(self) -> None:
        """Mark the run under the cursor to compare others with, or take the mark away."""
        runs, index = self._found.answer, self.screen.choices.highlighted
        if isinstance(runs, list) and index is not None:
            self._marked = None if runs[index] == self._marked else runs[index]
            self.screen.draw()


def _differences(past: Past, other: Past) -> list[Row]:
    names = [name for name in past.config if past.config[name] != other.config.get(name)]
    if not names:
        return [Row(Content("  none"))]
    return [labelled(name, f"{past.config[name]:g}  (there {_known(other.config.get(name))})") for name in names]


def _known(value: float | None) -> str:
    return "not known" if value is None else f"{value:g}"
