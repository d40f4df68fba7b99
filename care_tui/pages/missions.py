"""The missions of the log that is open, each with its verdict: one of them is looked at."""

from __future__ import annotations

from textual.content import Content

from care_core.application.case import Case
from care_core.application.viewing import MissionVerdict, missions_of
from care_core.text import seconds
from care_tui.pages.page import Fetch, Page, View, sentence
from care_tui.render.objectives import objective_item, worst
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
        self._case = case
        self._found: Fetch[list[MissionVerdict]] = Fetch(self, "missions")
        self._placed = False

    def enter(self) -> None:
        self._found.start(lambda: missions_of(self._case))

    def view(self) -> View:
        return self._found.view("Missions of the log", self._show)

    def _show(self, missions: list[MissionVerdict]) -> View:
        count = f"{len(missions)} mission{'' if len(missions) == 1 else 's'}"
        title = Content(f"Missions of the log  {count}")
        if not missions:
            return View(title, lambda _: sentence("No profile fits this log, so no mission is judged."))
        listing = Listing(
            len(missions),
            lambda i, _width: (self._item(missions[i]),),
            lambda i: f"{missions[i].index} {' '.join(_broken(missions[i]))}",
        )
        here, self._placed = None if self._placed else self._here - 1, True
        return View(title, lambda i: Rows([]) if i is None else self._detail(missions[i]), listing, here)

    @property
    def _here(self) -> int:
        """The mission that is diagnosed now, from 1."""
        return self._case.diagnosis.run.mission.index

    def _item(self, mission: MissionVerdict) -> Content:
        mark = self.glyphs.here if mission.index == self._here else " "
        span = f"{seconds(mission.start_s)} to {seconds(mission.end_s)}"
        verdict = status(worst(mission.results), self.glyphs)
        return Content.assemble(
            f"{mark} {mission.index:>3}  {span:<22}  ", verdict, text(f"  {', '.join(_broken(mission))}")
        )

    def _detail(self, mission: MissionVerdict) -> Rows:
        rows = [Row(objective_item(result, NAME_WIDTH, self.glyphs), 2) for result in mission.results]
        return Rows(rows if mission.ended else [warning("Mission", "the log stops before the mission does"), *rows])

    def open(self, index: int | None) -> None:
        missions = self._found.answer
        if isinstance(missions, list) and index is not None:
            self.walk.diagnose_mission(missions[index].index)


def _broken(mission: MissionVerdict) -> list[str]:
    return [result.variable.name for result in mission.results if result.status == "fault"]
