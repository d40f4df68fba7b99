"""Step 5: what would change in the configuration, line by line."""

from __future__ import annotations

from typing import ClassVar

from textual.content import Content

from care_core.application.configuring import DiffSide
from care_core.errors import CareError
from care_tui.pages.page import View, sentence
from care_tui.pages.step import DiagnosisPage
from care_tui.render.fix import no_fix_rows
from care_tui.render.rows import Rows, command_rows, diff_rows, error_rows

SIDES: dict[DiffSide, str] = {
    "driven": "As driven (-) against suggested (+)",
    "file": "Your file (-) against suggested (+)",
    "changed": "As driven (-) against your file (+)",
}


class DiffPage(DiagnosisPage):
    name = "Diff"
    NOTHING = "nothing is to be changed"
    NEEDS_MISSION = True
    HELP = (
        "Lines with - are what is, lines with + what is suggested. f compares with the file given by --config instead. "
        "c copies the diff. Enter goes to the report. Nothing is written to the robot."
    )
    ENTER = "Report"
    ACTIONS: ClassVar[frozenset[str]] = frozenset({"other_side", "copy_diff"})
    side: DiffSide = "driven"

    def enter(self) -> None:
        if self.session.state == "data":
            self._text: str | CareError | None = None
            self._commands: list[str] = []
            fix, case, side = self.session.fix, self.session.case, self.side
            if case is not None and fix is not None and (fix.changes or side == "changed"):
                engine, decided = self.walk.engine, self.session.decided()
                commands = engine.commands if side == "driven" else lambda _diagnosis: []
                self.screen.fetch(
                    "diff", lambda _job: (engine.diff(case, fix, side), commands(decided)), self._received
                )

    def _received(self, answer: tuple[str, list[str]] | CareError) -> None:
        self._text, self._commands = (answer, []) if isinstance(answer, CareError) else answer
        if self.is_shown:
            self.screen.draw()

    def view_of_diagnosis(self) -> View:
        session, text = self.session, self._text
        title = Content("Nothing changes" if text is None and not session.basket.ticked else SIDES[self.side])
        if isinstance(text, CareError):
            return View(title, lambda _: error_rows(text))
        if text is not None:
            shown = text or "No difference.\n"
            return View(title, lambda _: Rows([*diff_rows(shown).rows, *command_rows(self._commands)]))
        if session.basket.ticked and session.fix_error is not None:
            error = session.fix_error
            return View(title, lambda _: error_rows(error))
        if session.basket.ticked:
            return View(title, lambda _: sentence("Computing..."))
        if session.diagnosis.fix is None:
            return View(title, lambda _: no_fix_rows(session.diagnosis))
        return View(title, lambda _: sentence("No change is ticked in the fix (4)."))

    def other_side(self) -> None:
        """Compare with the file on disk, or with what was driven."""
        if self.session.state != "data":
            return
        if not self.session.case or not self.session.case.configs:
            self.screen.say("Start care with --config FILE to compare with the file on disk.")
            return
        sides = list(SIDES)
        self.side = sides[(sides.index(self.side) + 1) % len(sides)]
        self.enter()
        self.screen.draw()

    def copy_diff(self) -> None:
        """Copy the diff to the operator's clipboard."""
        if self.session.state == "data" and isinstance(self._text, str) and self._text:
            self.walk.copy(self._text, "the diff", ".patch")
        else:
            self.screen.say("There is no diff to copy.")

    def open(self, index: int | None) -> None:
        self.walk.action_go(6)
