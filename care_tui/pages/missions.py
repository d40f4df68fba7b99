"""The missions of the log that is open, each with its verdict: one of them is looked at."""

from __future__ import annotations

from textual.content import Content

from care_core.application.case import Case
from care_core.diagnose.records import MissionVerdict
from care_core.text import seconds
from care_tui.pages.page import Page, View, sentence
from care_tui.render.objectives import objective_item
from care_tui.render.rows import Row, Rows, status, text, warning
from care_tui.screens.panes import PanesScreen
from care_tui.widgets.choices import Listing

NAME_WIDTH = 18


class MissionsPage(Page):
    name = "Missions"
    HELP = "The missions of this log with their verdicts. Enter diagnoses the one under the cursor, Esc leaves."
    ENTER = "Diagnose"

    def __init__(self, screen: PanesScreen, case: Case) -> None:
        super().__init__(screen)
        self._diagnosis = case.diagnosis
        self._placed = False

    def view(self) -> View:
        missions = self._diagnosis.missions
        if not missions:
            none = "No profile fits this log, so no mission is judged."
            return View(Content("Missions of the log"), lambda _: sentence(none))
        count = f"{len(missions)} {self._diagnosis.run.noun}{'' if len(missions) == 1 else 's'}"
        listing = Listing(
            len(missions),
            lambda i, _width: (self._item(missions[i]),),
            lambda i: f"{missions[i].mission.index} {missions[i].reason}",
        )
        here, self._placed = None if self._placed else self._here - 1, True
        return View(Content(f"The log holds {count}"), self._detail, listing, here)

    def leads_to(self) -> str:
        return self.ENTER if self._diagnosis.missions else ""

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
        rows = [Row(objective_item(result, NAME_WIDTH, self.glyphs), 2) for result in verdict.results]
        cut = warning("Mission", "the log stops before the mission does")
        return Rows(rows if verdict.mission.ended else [cut, *rows])

    def open(self, index: int | None) -> None:
        if index is not None:
            self.walk.diagnose_mission(self._diagnosis.missions[index].mission.index)
