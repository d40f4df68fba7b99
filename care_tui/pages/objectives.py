"""Step 2: every objective against its threshold."""

from __future__ import annotations

import math
from functools import partial
from typing import ClassVar

from textual.binding import Binding, BindingType
from textual.content import Content

from care_core.application.proof import Subject
from care_core.records import replace
from care_core.text import clean
from care_core.variables import Variable
from care_tui.messages import Judge
from care_tui.pages.figured import LEAST_FIGURE
from care_tui.pages.page import View, enter_to, sentence
from care_tui.pages.proven import ProvenPage
from care_tui.render.objectives import counted, objective_detail, objective_item, run_rows
from care_tui.render.rows import Row, Rows, folded
from care_tui.screens.prompt import Prompt
from care_tui.widgets.choices import Listing

NAME_WIDTH = 18
JUDGED = "How it was judged"


def _wrong(objective: Variable, typed: str) -> str:
    """Why this is no threshold; empty when it is one, or gives the profile's back."""
    if not typed:
        return ""
    try:
        limit = float(typed)
    except ValueError:
        return f"'{typed}' is not a number."
    return objective.wrong_limit(limit) if math.isfinite(limit) else f"'{typed}' is no threshold."


class ObjectivesPage(ProvenPage):
    NAME = "objectives"
    NOTHING = "nothing is judged"
    HELP = (
        "What the mission is judged by. Enter shows what caused the fault under the cursor, else the first fault that "
        "has causes. = judges by a limit of your own, marked as mine: the log is judged again, nothing is written to "
        "the profile. p shows the signals that an objective is measured on."
    )
    BINDINGS: ClassVar[list[BindingType]] = [
        enter_to("Causes"),
        Binding("p", "prove", "Signal", id="objectives.proof"),
        Binding("equals_sign,i", "type_threshold", "My limit", key_display="=", id="objectives.threshold"),
        Binding("z", "fold", "Details", id="objectives.details"),
    ]
    _is_open = False

    def view_of_diagnosis(self) -> View:
        diagnosis, glyphs = self.session.diagnosis, self.glyphs
        results, mine = diagnosis.objectives, self._mine
        if not results:
            return View(Content("Objectives"), lambda _: sentence("The profile declares no objective."))
        width = min(max(len(clean(result.variable.name)) for result in results), NAME_WIDTH)
        listing = Listing(
            len(results),
            lambda i, room: (objective_item(results[i], width, glyphs, room, is_mine=results[i].name in mine),),
            lambda i: results[i].variable.name,
        )
        title = Content(f"Objectives: {counted(results)}")
        about = "What it is measured on" if self._has_figure(self.session.objective) else JUDGED
        return View(title, self._detail, listing, self.session.objective, about)

    @property
    def _mine(self) -> dict[str, float]:
        """The operator's own limits."""
        return dict(self.workspace.request.thresholds) if self.workspace.request else {}

    def _detail(self, index: int | None) -> Rows:
        diagnosis = self.session.diagnosis
        if index is None:
            return run_rows(diagnosis)
        if self._has_figure(index):
            return Rows(self._figure(index, 0))
        rows = self._judged(index, self.reader.room.width)
        around = self.height(rows) + 2
        is_low = self._is_open or self.reader.room.height - around < LEAST_FIGURE
        return Rows([*rows, *(() if is_low else [Row(Content()), *self._figure(index, around)])])

    def _judged(self, index: int, width: int) -> list[Row]:
        """How an objective was judged, and where the run came from, folded."""
        diagnosis, case = self.session.diagnosis, self.session.case
        result = diagnosis.objectives[index]
        reference = case.reading.judged.reference.config if case and case.reading else {}
        summary = case.model.summary_at(result.variable.name, reference) if case and case.model else None
        rows = objective_detail(result, summary, self.glyphs, width)
        return [*rows, *folded("This run", run_rows(diagnosis).rows, self.glyphs, is_open=self._is_open)]

    def _figure(self, index: int, around: int) -> list[Row]:
        """What the objective is measured on."""
        result = self.session.diagnosis.objectives[index]
        return self.figure(result.name, result, around)

    def _has_figure(self, index: int | None) -> bool:
        """Whether the figure has a pane of its own."""
        if index is None or not self.is_wide:
            return False
        result = self.session.diagnosis.objectives[index]
        return self.has_figure(result.name, result)

    def beside(self) -> tuple[str, list[Row]]:
        index = self.index
        if index is None or not self._has_figure(index):
            return JUDGED, []
        return JUDGED, self._judged(
            index, self.choices.room.width - 1
        )  # as wide as the list, but for the text's margin

    def moved(self, index: int) -> None:
        self.session.objective = index

    def subject(self) -> Subject | None:
        return None if self.index is None or not self.has_content else self.session.diagnosis.objectives[self.index]

    def action_prove(self) -> None:
        """Show the signals that the objective under the cursor is measured on."""
        self.go("plots", None, self.subject())

    def action_fold(self) -> None:
        """Open or close the details of the run."""
        self._is_open = not self._is_open
        self.show_text(from_top=False)
        if self._is_open:
            self.reader.reveal("This run")

    def action_type_threshold(self) -> None:
        """Judge the objective under the cursor by a limit of one's own."""
        if self.index is None:
            return
        result = self.session.diagnosis.objectives[self.index]
        variable, bound = result.variable, result.threshold
        if variable.is_yes_or_no:
            self.say(variable.wrong_limit(math.nan))
            return
        unit = f" in {variable.unit}" if variable.unit else ""
        hint = f"A number{unit}; empty takes the profile's threshold again. Enter judges by it, Esc cancels."
        start = "" if bound is None else f"{bound.value:g}"
        sign = "" if bound is None else f" {bound.op}"
        prompt = Prompt(f"Judge {variable.name} by{sign}", start, hint, partial(_wrong, variable))
        self.app.push_screen(prompt, lambda typed: self._typed(variable.name, typed))

    def _typed(self, objective: str, typed: str | None) -> None:
        request = self.workspace.request
        if typed is None or request is None:
            return
        others = {name: value for name, value in request.thresholds.items() if name != objective}
        bounds = {**others, objective: float(typed)} if typed else others
        self.post_message(Judge(replace(request, thresholds=bounds), "objectives", objective))

    def action_open(self) -> None:
        """Go to the causes: those of the fault under the cursor, else of the first fault."""
        if self.has_content and self.session.fault is None and self.session.first_fault():
            result = self.session.result
            self.say(f"These are the causes of {result.name if result else 'the fault'}.")
        self.go_on()
