"""The missions of the log that is open, each with its verdict: one of them is looked at. Where the screen is wide, with
where the robot went in it and what happened."""

from __future__ import annotations

from typing import ClassVar

from textual.binding import BindingType
from textual.content import Content

from care_core.application.case import Case
from care_core.application.track import Way, way_of
from care_core.diagnose.records import Diagnosis, MissionVerdict
from care_core.errors import CareError
from care_core.records import replace
from care_core.text import clean, number_of, seconds
from care_tui.messages import Judge
from care_tui.pages.figured import FiguredPage
from care_tui.pages.page import View, enter_to, sentence
from care_tui.pages.proofs import LEAST_MAP, WAY, grave_marks
from care_tui.render.health import happened_rows, health_rows
from care_tui.render.map import map_rows
from care_tui.render.objectives import STATUS_WIDTH, objective_item
from care_tui.render.rows import Row, Rows, status, text, warning
from care_tui.widgets.choices import Listing

NAME_WIDTH = 18


class MissionsPage(FiguredPage):
    HELP = (
        "The missions of this log with their verdicts. Enter diagnoses the one under the cursor, Esc leaves. From 120 "
        "columns the way of the robot and what happened in the mission stand beside it."
    )
    OPENS_ITEM = True
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
        about = "Where it went" if self._has_map(self.index) else ""
        return View(Content(count), self._detail, listing, here, about)

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
        if not self._has_map(index):
            return Rows([*self._judged(index), *(self._happened(index) if self.is_wide else ())])
        way = self._way(index)
        if not isinstance(way, Way):
            return sentence("Reading where it went...")
        marks = [mark for mark in grave_marks(self._case_of(index).diagnosis) if self._is_in(index, mark.time_s)]
        return Rows(map_rows(way, marks, *self.reader.room, self.glyphs))

    def beside(self) -> tuple[str, list[Row]]:
        index = self.index
        if index is None or not self._has_map(index):
            return "", []
        verdict = self._diagnosis.missions[index]
        noun = self._diagnosis.run.noun.capitalize()
        return f"{noun} {verdict.mission.index}", [*self._judged(index), *self._happened(index)]

    def _judged(self, index: int) -> list[Row]:
        """Each objective of a mission against its limit."""
        verdict = self._diagnosis.missions[index]
        names = (len(clean(result.variable.name)) for result in verdict.results)
        width = min(max(names, default=0), NAME_WIDTH)
        rows = [
            Row(objective_item(result, width, self.glyphs, self._width), STATUS_WIDTH) for result in verdict.results
        ]
        cut_off = warning("Mission", "the log stops before the mission does")
        return rows if verdict.mission.ended else [cut_off, *rows]

    def _happened(self, index: int) -> list[Row]:
        """What happened in a mission, a line each."""
        health, is_one = self._case_of(index).diagnosis.health, len(self._diagnosis.missions) == 1
        is_own = is_one or bool(health.runs)  # else it is of the whole log
        lines = (line for line in health_rows(health) if is_own or self._is_in(index, line.time_s))
        return happened_rows(lines, self._width, self.glyphs)

    def _is_in(self, index: int, time_s: float) -> bool:
        mission = self._diagnosis.missions[index].mission
        return mission.start_s <= time_s <= mission.end_s

    @property
    def _width(self) -> int:
        """Cells of the pane that tells of a mission: below the list, or beside it."""
        return (self.choices if self.is_wide else self.reader).room.width - 1

    def _has_map(self, index: int | None) -> bool:
        """Whether the way of a mission has a pane of its own, or may have: a thread still reads it."""
        case = self.session.case
        if index is None or case is None or case.log is None or not self.is_wide:
            return False
        return self.reader.room.height >= LEAST_MAP and not isinstance(self._way(index), CareError)

    def _way(self, index: int) -> Way | CareError | None:
        of_it = self._case_of(index)
        return self.fetched(f"{WAY} {index}", lambda: way_of(of_it))

    def _case_of(self, index: int) -> Case:
        """The case with another of its missions in place of the one that is diagnosed."""
        case, diagnosis = self.session.case, self._diagnosis
        assert case is not None
        mission = diagnosis.missions[index].mission
        if mission.index == self._here:
            return case
        run = replace(diagnosis.run, mission=mission, evidence=())
        return replace(case, diagnosis=replace(diagnosis, run=run, health=diagnosis.health.of_run(mission.start_s)))

    def action_open(self) -> None:
        """Diagnose the mission under the cursor."""
        if self.index is not None and self.workspace.request is not None:
            mission = self._diagnosis.missions[self.index].mission.index
            self.post_message(Judge(replace(self.workspace.request, mission=mission)))
