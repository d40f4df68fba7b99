"""Step 2: every objective against its threshold."""

from __future__ import annotations

from care_core.text import clean
from care_tui.pages.page import View, sentence
from care_tui.pages.step import DiagnosisPage
from care_tui.render.objectives import headline, objective_detail, objective_item, run_rows
from care_tui.render.rows import Row, Rows, text
from care_tui.widgets.choices import Listing

NAME_WIDTH = 18


class ObjectivesPage(DiagnosisPage):
    name = "Objectives"
    HELP = "What the mission is judged by. Enter on an objective shows what caused its fault."
    ENTER = "Causes"

    def view_of_diagnosis(self) -> View:
        diagnosis, glyphs = self.session.diagnosis, self.glyphs
        results = diagnosis.objectives
        if not results:
            return View(headline(diagnosis, glyphs), lambda _: sentence("The profile declares no objective."))
        width = min(max(len(clean(result.variable.name)) for result in results), NAME_WIDTH)
        listing = Listing(
            len(results),
            lambda i, _width: (objective_item(results[i], width, glyphs),),
            lambda i: results[i].variable.name,
        )
        return View(headline(diagnosis, glyphs), self._detail, listing, self.session.objective)

    def _detail(self, index: int | None) -> Rows:
        diagnosis, model = self.session.diagnosis, self.session.case and self.session.case.model
        if index is None:
            return run_rows(diagnosis)
        result = diagnosis.objectives[index]
        summary = model.summaries.get(result.variable.name) if model else None
        rows = objective_detail(result, summary, self.glyphs)
        return Rows([Row(text(result.variable.name, "bold")), *rows, Row(text("")), *run_rows(diagnosis).rows])

    def moved(self, index: int) -> None:
        self.session.objective = index

    def open(self, index: int | None) -> None:
        if index is not None:
            self.session.objective = index
        self.walk.action_go(3)
