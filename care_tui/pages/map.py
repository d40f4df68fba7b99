"""Where the robot went, and the way that it was asked to go."""

from __future__ import annotations

from textual.content import Content

from care_core.application.track import Way, way_of
from care_tui.pages.page import Page, View, view_of
from care_tui.pages.proofs import WAY, grave_marks
from care_tui.render.map import map_rows
from care_tui.render.rows import Rows


class MapPage(Page):
    HELP = "Where the robot went, and the way that it was asked to go, north up and to scale. Esc leaves."
    FITS = True

    def view(self) -> View:
        case = self.session.case
        found = None if case is None else self.fetched(WAY, lambda: way_of(case))
        return view_of("Map", found, self._show)

    def _show(self, way: Way) -> View:
        marks = grave_marks(self.session.diagnosis)
        width, height = self.reader.room
        return View(
            Content("Track and the way asked for" if way.legs else "Track; the log names no way that was asked for"),
            lambda _: Rows(map_rows(way, marks, width, height, self.glyphs)),
        )
