"""Past runs from the local history: how each objective went, and two of them side by side."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import ClassVar

from textual.content import Content

from care_core.application.case import Request
from care_core.application.viewing import Past, past_runs
from care_core.diagnose.verdict import fit_words
from care_core.errors import CareError
from care_core.text import clean
from care_tui.pages.page import Fetch, Page, View, sentence
from care_tui.render.rows import ASCII, Row, Rows, error_rows, labelled, padded, plain_rows, text
from care_tui.screens.panes import PanesScreen
from care_tui.widgets.choices import Listing

NAME_WIDTH, VALUE_WIDTH = 18, 16
TREND = 24
"""Newest runs that a trend shows."""


class HistoryPage(Page):
    name = "History"
    HELP = (
        "Runs that were triaged before, the newest first, with the trend of every objective up to the one under the "
        "cursor. Enter opens its log. x marks a run; then every other is compared with it, and Enter puts both logs "
        "side by side in full. / filters, Esc leaves."
    )
    ENTER = "Its log"
    ACTIONS: ClassVar[frozenset[str]] = frozenset({"mark"})

    def __init__(self, screen: PanesScreen) -> None:
        super().__init__(screen)
        self._found: Fetch[list[Past]] = Fetch(self, "history")
        self._marked: Past | None = None
        self._compared: tuple[Past, Past | None] | None = None
        self._whole: str | CareError | None = None
        """What both logs of `_compared` are side by side; None as long as they are read."""

    def enter(self) -> None:
        self._found.start(past_runs)

    def view(self) -> View:
        return self._found.view("History", self._show)

    def works(self, action: str) -> bool:
        return super().works(action) and bool(self._found.answer)

    def _show(self, runs: list[Past]) -> View:
        if not runs:
            nothing = "No run was triaged before: 'care triage' and this app remember those they judge."
            return View(Content("History"), lambda _: sentence(nothing))
        listing = Listing(
            len(runs),
            lambda i, _width: (self._item(runs[i]),),
            lambda i: f"{runs[i].log} {runs[i].profile} {runs[i].verdict} {runs[i].cause}",
        )
        count = f"{len(runs)} run{'' if len(runs) == 1 else 's'}"
        title = Content.assemble(f"History  {count}", ("  x marks one to compare with", "dim"))
        if self._marked is not None:
            title = Content.assemble("History  against ", (_named(self._marked), "bold"), ("  x again unmarks", "dim"))
        return View(title, lambda i: Rows([]) if i is None else self._beside(i, runs), listing)

    def _beside(self, index: int, runs: list[Past]) -> Rows:
        """What stands beside a run: both logs in full where that was asked for."""
        if self._compared != (runs[index], self._marked):
            return Rows(self._detail(index, runs))
        if isinstance(self._whole, CareError):
            return error_rows(self._whole)
        return sentence("Putting both side by side...") if self._whole is None else plain_rows(self._whole)

    def _item(self, past: Past) -> Content:
        mark = "*" if past == self._marked else " "
        line = Content(f"{mark} {past.at[:16].replace('T', ' ')}  ")
        fit = "" if past.fit == "fits" else f"  ({fit_words(past.profile, past.fit).removeprefix('Profile ')})"
        return line + padded(_named(past), 26, "bold") + text(f" {past.verdict}") + text(fit, "dim")

    def _detail(self, index: int, runs: list[Past]) -> list[Row]:
        past, other = runs[index], self._marked
        if other is not None and other != past:
            return comparison(past, other)
        rows = [
            labelled("Log", past.log),
            labelled("Fit", fit_words(past.profile, past.fit)),
            labelled("Verdict", past.verdict),
        ]
        if past.cause:
            rows.append(labelled("First cause", past.cause))
        until = [run for run in reversed(runs[index:]) if run.profile == past.profile]
        rows += [Row(Content()), _columns("Objective", "this run", f"{len(until)} runs up to it", "bold")]
        for name, value in past.values.items():
            rows.append(_columns(name, _shown(value), self._trend([run.values.get(name) for run in until])))
        return rows

    def _trend(self, values: Sequence[float | None]) -> str:
        from care_core.history.track_record import sparkline

        known = [value for value in values if value is not None][-TREND:]
        if len(known) < 2:
            return ""
        return f"{sparkline(known, ascii=self.glyphs is ASCII)}  {min(known):.4g} to {max(known):.4g}"

    def leads_to(self) -> str:
        runs, index = self._found.answer, self.screen.choices.highlighted
        if self._marked is None or not isinstance(runs, list) or index is None or runs[index] == self._marked:
            return self.ENTER
        return "Both in full"

    def moved(self, index: int) -> None:
        self.screen.refresh_bindings()  # on the marked run Enter leads elsewhere

    def open(self, index: int | None) -> None:
        runs = self._found.answer
        if not isinstance(runs, list) or index is None:
            return
        if self._marked is None or runs[index] == self._marked:
            self.walk.open_log(Path(runs[index].log))
        else:
            self._compare(self._marked, runs[index])

    def _compare(self, a: Past, b: Past) -> None:
        """Put the logs of two runs side by side, as far as they are still where they were."""
        self._compared, self._whole = (b, a), None
        one, other = (Request(Path(run.log), mission=run.mission or None) for run in (a, b))
        compare = self.walk.engine.compare
        self.screen.fetch("comparison", lambda job: compare(one, other, lambda *_: job.check()), self._receive)
        self.screen.draw()

    def _receive(self, whole: str | CareError) -> None:
        self._whole = whole
        if self.is_shown:
            self.screen.draw()

    def mark(self) -> None:
        """Mark the run under the cursor to compare others with, or take the mark away."""
        runs, index = self._found.answer, self.screen.choices.highlighted
        if isinstance(runs, list) and index is not None:
            self._marked = None if runs[index] == self._marked else runs[index]
            self.screen.draw()
            if self._marked is not None and len(runs) > 1:
                self.screen.say("Marked: go to another run to compare it with this one.")


def comparison(past: Past, other: Past) -> list[Row]:
    """Two runs side by side: objectives, then the options that differ."""
    rows = [_columns("Objective", "this run", _named(other), "bold")]
    rows += [_columns(name, _shown(value), _shown(other.values.get(name))) for name, value in past.values.items()]
    names = [name for name in past.config if past.config[name] != other.config.get(name)]
    rows += [Row(Content()), _columns("Option", "this run", _named(other), "bold")]
    if not names:
        rows.append(Row(Content("all parameters are alike")))
    return rows + [_columns(name, f"{past.config[name]:.6g}", _known(other.config.get(name))) for name in names]


def _columns(name: str, here: str, there: str, style: str = "") -> Row:
    line = padded(name, NAME_WIDTH, style or "bold") + Content(" ") + padded(here, VALUE_WIDTH, style)
    return Row(line + text(f" {there}", style), NAME_WIDTH + VALUE_WIDTH + 2)


def _named(past: Past) -> str:
    mission = f" #{past.mission}" if past.mission > 1 else ""
    return f"{clean(Path(past.log).name)}{mission}"


def _shown(value: float | None) -> str:
    return "not evaluated" if value is None else f"{value:.4g}"


def _known(value: float | None) -> str:
    return "not known" if value is None else f"{value:.6g}"
