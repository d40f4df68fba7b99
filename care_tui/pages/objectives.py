"""Step 2: every objective against its threshold."""

from __future__ import annotations

import math
from typing import ClassVar

from care_core.text import clean
from care_tui.pages.page import View, sentence
from care_tui.pages.step import DiagnosisPage
from care_tui.render.objectives import headline, objective_detail, objective_item, run_rows
from care_tui.render.rows import Row, Rows, text
from care_tui.screens.prompt import Prompt
from care_tui.widgets.choices import Listing

NAME_WIDTH = 18


def _wrong(typed: str) -> str:
    """Why this is no threshold; empty when it is one, or gives the profile's back."""
    try:
        return "" if not typed or math.isfinite(float(typed)) else f"'{typed}' is no threshold."
    except ValueError:
        return f"'{typed}' is not a number."


class ObjectivesPage(DiagnosisPage):
    name = "Objectives"
    NOTHING = "nothing is judged"
    HELP = (
        "What the mission is judged by. Enter on an objective shows what caused its fault. = judges the one under the "
        "cursor by another threshold: the log is judged again, and nothing is written to the profile."
    )
    ENTER = "Causes"
    ACTIONS: ClassVar[frozenset[str]] = frozenset({"type_threshold"})

    @property
    def _is_empty(self) -> bool:
        """Without a profile a run is still judged by what its robot says of itself."""
        return super()._is_empty and not self.session.diagnosis.objectives

    @property
    def _unjudged(self) -> str:
        return "" if self.session.diagnosis.objectives else super()._unjudged

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
        reading = self.session.case and self.session.case.reading
        reference = reading.judged.reference.config if reading else {}
        summary = model.summary_at(result.variable.name, reference) if model else None
        rows = objective_detail(result, summary, self.glyphs)
        return Rows([Row(text(result.variable.name, "bold")), *rows, Row(text("")), *run_rows(diagnosis).rows])

    def moved(self, index: int) -> None:
        self.session.objective = index

    def type_threshold(self) -> None:
        """Ask for another threshold of the objective under the cursor."""
        index = self.screen.choices.highlighted
        if index is None:
            return
        result = self.session.diagnosis.objectives[index]
        variable, bound = result.variable, result.threshold
        if variable.kind == "functional":
            self.screen.say(f"{clean(variable.name)} is met or not: it has no other threshold.")
            return
        unit = f" in {variable.unit}" if variable.unit else ""
        hint = f"A number{unit}; empty takes the profile's threshold again. Enter judges by it, Esc cancels."
        start = "" if bound is None else f"{bound.value:g}"
        sign = "" if bound is None else f" {bound.op}"
        prompt = Prompt(f"Judge {variable.name} by{sign}", start, hint, _wrong)
        self.screen.app.push_screen(prompt, lambda typed: self._typed(variable.name, typed))

    def _typed(self, objective: str, typed: str | None) -> None:
        if typed is not None:
            self.walk.judge_by(objective, float(typed) if typed else None)

    def open(self, index: int | None) -> None:
        if index is not None:
            self.session.objective = index
        self.walk.action_go(3)
