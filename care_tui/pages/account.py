"""Step 1 once a log is open: what happened in it, the first cause first, whether or not a profile fits."""

from __future__ import annotations

from typing import ClassVar

from textual.content import Content

from care_core.application.case import Case
from care_core.application.viewing import what_would_fit
from care_core.ecosystems.findings import Health
from care_tui.pages.page import Fetch, View
from care_tui.pages.step import StepPage
from care_tui.render.health import (
    FindingRow,
    fit_rows,
    health_row_details,
    health_row_item,
    health_rows,
    verdict_line,
)
from care_tui.render.objectives import run_rows
from care_tui.render.rows import Row, Rows
from care_tui.screens.panes import PanesScreen
from care_tui.widgets.choices import Listing


class AccountPage(StepPage):
    name = "Log"
    HELP = (
        "What happened: findings, the first cause first with what it led to, then the account in order of time. "
        "m shows the messages, p the plots at the moment under the cursor. t chooses another mission of the log, "
        "o another log. Enter goes to the objectives."
    )
    ENTER = "Objectives"
    ACTIONS: ClassVar[frozenset[str]] = frozenset({"pick", "again"})
    LIST = "most"

    _rows: tuple[Health, list[FindingRow]] | None = None

    def __init__(self, screen: PanesScreen) -> None:
        super().__init__(screen)
        self._advice: Fetch[list[str]] = Fetch(self, "fit")
        self._asked_for: Case | None = None

    def enter(self) -> None:
        case = self.session.case
        if case is None or case.diagnosis.profile.fit.verdict != "no":
            return
        if self._asked_for is not case:
            self._asked_for = case
            self._advice.forget()
        self._advice.start(lambda: what_would_fit(case))

    @property
    def _lines(self) -> list[FindingRow]:
        """The lines of the pane, made once for a log."""
        health = self.session.diagnosis.health
        if self._rows is None or self._rows[0] is not health:
            self._rows = health, health_rows(health)
        return self._rows[1]

    def view(self) -> View:
        diagnosis, glyphs, lines = self.session.diagnosis, self.glyphs, self._lines
        listing = Listing(len(lines), lambda i, _width: (health_row_item(lines[i], glyphs),), lambda i: lines[i].words)
        return View(verdict_line(diagnosis, glyphs), self._detail, listing)

    def _detail(self, index: int | None) -> Rows:
        diagnosis = self.session.diagnosis
        found = self._advice.answer
        fit = fit_rows(diagnosis, found if isinstance(found, list) else [])
        rows = [] if index is None else health_row_details(self._lines[index])
        parts = [part for part in (rows, fit, run_rows(diagnosis).rows) if part]
        return Rows(row for place, part in enumerate(parts) for row in ([Row(Content())] if place else []) + [*part])

    def moment_s(self) -> float | None:
        index = self.screen.choices.highlighted
        return None if index is None else self._lines[index].time_s

    def leads_to(self) -> str:
        return "Plots" if self._is_the_answer else self.ENTER

    @property
    def _is_the_answer(self) -> bool:
        """Whether the account is all there is: nothing is judged."""
        return not self.session.diagnosis.objectives

    def open(self, index: int | None) -> None:
        if self._is_the_answer:
            self.walk.action_view("signals")
        else:
            self.walk.action_go(2)

    def pick(self) -> None:
        """Choose another log."""
        self.walk.action_view("logs")

    def again(self) -> None:
        """Read the log again."""
        self.walk.again()
