"""Step 1: what happened in the log, the first cause first, whether or not a profile fits."""

from __future__ import annotations

from typing import ClassVar

from textual.binding import Binding, BindingType
from textual.content import Content

from care_core.application.proof import Subject
from care_core.application.viewing import what_would_fit
from care_core.ecosystems.findings import Finding, Health
from care_core.text import clean
from care_tui.messages import Judge
from care_tui.pages.diagnosis import DiagnosisPage
from care_tui.pages.page import View, enter_to
from care_tui.pages.proofs import place_rows, proof_rows
from care_tui.render.health import FindingRow, fit_rows, health_row_details, health_row_item, health_rows
from care_tui.render.objectives import run_rows
from care_tui.render.rows import Row, Rows, folded
from care_tui.widgets.choices import Listing


class LogPage(DiagnosisPage):
    NAME = "log"
    FITS = True
    HELP = (
        "What happened: findings, the first cause first with what it led to, then the events in order of time. p shows "
        "the signal that proves what is under the cursor, m the messages of its moment. z opens the details of the "
        "run, o leads to the other logs. Enter goes on."
    )
    BINDINGS: ClassVar[list[BindingType]] = [
        enter_to("Next"),
        Binding("p", "prove", "Proof", show=True, id="log.proof"),
        Binding("z", "fold", "Details", id="log.details"),
        Binding("o", "pick", "Other log", id="log.pick"),
        Binding("r", "again", "Read again", show=False, id="log.again"),
    ]
    _is_open = False
    _rows: tuple[Health, list[FindingRow]] | None = None

    @property
    def _lines(self) -> list[FindingRow]:
        """The lines of the list, made once for a log."""
        health = self.session.diagnosis.health
        if self._rows is None or self._rows[0] is not health:
            self._rows = health, health_rows(health)
        return self._rows[1]

    def view_of_diagnosis(self) -> View:
        diagnosis, glyphs, lines = self.session.diagnosis, self.glyphs, self._lines
        listing = Listing(len(lines), lambda i, _width: (health_row_item(lines[i], glyphs),), lambda i: lines[i].words)
        robot = diagnosis.health.robot
        title = Content("What happened" + (f": {clean(robot)}" if robot else ""))
        return View(title, self._detail, listing, about="What shows it")

    def _detail(self, index: int | None) -> Rows:
        diagnosis, case = self.session.diagnosis, self.session.case
        advice: object = None
        if case is not None and diagnosis.profile.fit.verdict == "no":
            advice = self.fetched("fit", lambda: what_would_fit(case))
        rows = [] if index is None else health_row_details(self._lines[index])
        rows += fit_rows(diagnosis, advice if isinstance(advice, list) else [])
        is_open = self._is_open or not rows
        rows += folded("This run", run_rows(diagnosis).rows, self.glyphs, is_open=is_open)
        return Rows([*rows, *(() if is_open else self._figure(index, rows))])

    def _figure(self, index: int | None, rows: list[Row]) -> list[Row]:
        """Below these rows: the signal that shows a finding, or where the robot was at a moment."""
        width, height = self.reader.room
        left, subject, moment_s = height - len(Rows(rows).wrap(width)) - 1, self.subject(), self.moment_s()
        if subject is not None:
            shown = proof_rows(self, f"{index}", subject, width, left)
        else:
            shown = [] if moment_s is None else place_rows(self, moment_s, width, left)
        return [Row(Content()), *shown] if shown else []

    def moment_s(self) -> float | None:
        return None if self.index is None or self.session.state != "data" else self._lines[self.index].time_s

    def subject(self) -> Subject | None:
        what = None if self.index is None or self.session.state != "data" else self._lines[self.index].what
        return what if isinstance(what, Finding) else None

    def action_prove(self) -> None:
        """Show the signal that proves what is under the cursor."""
        self.go("plots", self.moment_s(), self.subject())

    def action_fold(self) -> None:
        """Open or close the details of the run."""
        self._is_open = not self._is_open
        self.show_text(from_top=False)
        if self._is_open:
            self.reader.reveal("This run")

    def action_pick(self) -> None:
        """Choose another log."""
        self.go("logs")

    def action_again(self) -> None:
        """Read the log again, after an error or a change."""
        if self.workspace.request is not None and self.session.state != "loading":
            self.post_message(Judge(self.workspace.request))

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        return True if action in ("pick", "again") else super().check_action(action, parameters)
