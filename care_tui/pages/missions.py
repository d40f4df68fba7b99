"""The missions of the log that is open, each with its verdict: one of them is looked at."""

from __future__ import annotations

from typing import ClassVar

from textual.binding import BindingType
from textual.content import Content

from care_core.diagnose.records import Diagnosis, MissionVerdict
from care_core.records import replace
from care_core.text import number_of, seconds
from care_tui.messages import Judge
from care_tui.pages.page import Page, View, enter_to, sentence
from care_tui.render.objectives import STATUS_WIDTH, objective_item
from care_tui.render.rows import Row, Rows, status, text, warning
from care_tui.widgets.choices import Listing

NAME_WIDTH = 18


class MissionsPage(Page):
    HELP = "The missions of this log with their verdicts. Enter diagnoses the one under the cursor, Esc leaves."
    BINDINGS: ClassVar[list[BindingType]] = [enter_to("Diagnose it")]
    _placed = False

    @property
    def _diagnosis(self) -> Diagnosis:
        return self.session.diagnosis

    def view(self) -> View:
        missions = self._diagnosis.missions
        if not missions:
            none = "No profile fits this log, so no mission is judged."
            return View(Content("Missions"), lambda _: sentence(none))
        count = number_of(len(missions), self._diagnosis.run.noun)
        listing = Listing(
            len(missions),
            lambda i, _width: (self._item(missions[i]),),
            lambda i: f"{missions[i].mission.index} {missions[i].reason}",
        )
        here, self._placed = None if self._placed else self._here - 1, True
        return View(Content(count), self._detail, listing, here)

    @property
    def _here(self) -> int:
        """The mission that is diagnosed now, from 1."""
        return self._diagnosis.run.mission.index

    def _item(self, verdict: MissionVerdict) -> Content:
        one = verdict.mission
        mark = self.glyphs.here if one.index == self._here else " "
        span = f"{seconds(one.start_s)} to {seconds(one.end_s)}"
        head = Content.assemble(f"{mark} {one.index:>3}  {span:<22}  ", status(verdict.status, self.glyphs))
        return head + text(f"  {verdict.reason}")

    def _detail(self, index: int | None) -> Rows:
        if index is None:
            return Rows([])
        verdict = self._diagnosis.missions[index]
        rows = [
            Row(objective_item(result, NAME_WIDTH, self.glyphs, self.reader.room.width), STATUS_WIDTH)
            for result in verdict.results
        ]
        cut = warning("Mission", "the log stops before the mission does")
        return Rows(rows if verdict.mission.ended else [cut, *rows])

    def action_open(self) -> None:
        """Diagnose the mission under the cursor."""
        if self.index is not None and self.workspace.request is not None:
            mission = self._diagnosis.missions[self.index].mission.index
            self.post_message(Judge(replace(self.workspace.request, mission=mission)))
