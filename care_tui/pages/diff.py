"""Step 5: what would change in the configuration, line by line, and the change put into the operator's file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import ClassVar

from textual.binding import Binding, BindingType
from textual.content import Content

from care_core.application.configuring import DiffSide
from care_core.application.deciding import changes_of
from care_core.diagnose.records import Cause, Fix, helps
from care_core.errors import CareError
from care_core.records import replace
from care_core.text import clean, number_of, percent
from care_tui.copying import copy
from care_tui.pages.figured import LEAST_FIGURE
from care_tui.pages.page import View, enter_to, sentence
from care_tui.pages.proven import ProvenPage
from care_tui.places import is_no_log
from care_tui.render.fix import about_rows, no_fix_rows
from care_tui.render.rows import Row, Rows, command_rows, diff_rows, error_rows, heading, labelled, warning
from care_tui.screens.confirm import Confirm
from care_tui.screens.file_dialog import FileDialog

SIDES: dict[DiffSide, str] = {
    "driven": "As driven (-) against the change (+)",
    "file": "Your file (-) against the change (+)",
    "changed": "As driven (-) against your file (+)",
}
TURNS: dict[DiffSide, str] = {"driven": "As driven", "file": "My file", "changed": "My file as driven"}
"""What a key says that turns to each."""
HELD = "The file holds these values already: there is nothing to put into it."
DIFF, APPLY, DOUBTS = "diff", "apply", "doubts"


class DiffPage(ProvenPage):
    NAME = "diff"
    NOTHING = "nothing is to be changed"
    HELP = (
        "Lines with - are what is, lines with + what it would become. f compares with your own file, which it asks "
        "for, F with another; A puts the change into that file: comments stay, the old one is kept beside. c copies "
        "the diff. Enter goes to the report. From 120 columns what is known of each parameter stands beside it, what "
        "the change is predicted to bring, and what shows its cause. Nothing is written to the robot."
    )
    BINDINGS: ClassVar[list[BindingType]] = [
        enter_to("Report"),
        Binding("f", "other_side", "My file", id="diff.side"),
        Binding("F", "other_file", "Other file", show=False, id="diff.file"),
        Binding("A", "apply", "Apply to it", id="diff.apply"),
        Binding("c", "copy_diff", "Copy", id="diff.copy"),
    ]
    side: DiffSide = "driven"
    _told: tuple[str, ...] = ()
    """What was written last, and where what it was before is."""
    _told_of: object = None
    """Files and changes that this was of."""

    def enter(self) -> None:
        self.forget(DIFF)
        case, fix, side = self.session.case, self.session.fix, self.side
        if self._told_of != self._asked_for:
            self._told = ()
        if case is None or fix is None or not (fix.changes or side == "changed") or not self.has_content:
            return
        engine, decided = self.workspace.engine, self.session.decided()
        # A file that the change was put into is not what the robot ran, as it should be.
        is_done = any(str(name).endswith(str(file)) for file in self.workspace.written for name in case.configs)
        commands = engine.commands if side == "driven" else lambda _diagnosis: []
        self.fetched(
            DIFF,
            lambda: (
                engine.diff(case, fix, side),
                commands(decided),
                engine.doubts(case, fix) if side == "file" and not is_done else (),
            ),
        )

    def view_of_diagnosis(self) -> View:
        session, answer = self.session, self._answers.get(DIFF)
        title = Content(SIDES[self.side])
        if isinstance(answer, CareError):
            return View(title, lambda _: error_rows(answer))
        if isinstance(answer, tuple):
            diff, commands, doubts = answer
            notes = [labelled("Written", told) for told in self._told if self.side == "file"]
            notes += [warning("File", clean(doubt)) for doubt in doubts]
            rows = [*notes, *diff_rows(diff or "No difference.\n").rows, *command_rows(commands)]
            return View(title, lambda _: Rows([*rows, *self._shown_by(rows)]))
        if session.basket.ticked and session.fix_error is not None:
            error = session.fix_error
            return View(title, lambda _: error_rows(error))
        if session.basket.ticked:
            return View(title, lambda _: sentence("Computing..."))
        title = Content("Nothing changes")
        if session.diagnosis.fix is None:
            return View(title, lambda _: no_fix_rows(session.diagnosis))
        return View(title, lambda _: sentence("No change is ticked in the fix (4)."))

    def _shown_by(self, above: list[Row]) -> list[Row]:
        """What shows in this run what the change is to mend, where these rows leave room for it."""
        fix = self.session.fix
        around = self.height(above) + 2
        if fix is None or not self.is_wide or self.reader.room.height - around < LEAST_FIGURE:
            return []
        cause = next(self._causes(fix), None)
        figure = [] if cause is None else self.figure(cause.option.name, cause, around)
        return [Row(Content()), heading("What shows it in this run"), *figure] if figure else []

    def _causes(self, fix: Fix) -> Iterator[Cause]:
        """The causes that a change is to mend, those of the first fault first."""
        changed = changes_of(fix)
        causes = (cause for fault in self.session.diagnosis.faults for cause in fault.causes)
        return (cause for cause in causes if cause.option.name in changed)

    def beside(self) -> tuple[str, list[Row]]:
        fix = self.session.fix
        if fix is None or not fix.changes or not self.has_content:
            return "", []
        cautions = [warning("Caution", caution) for caution in self._cautions(fix)]
        return "About the change", [*cautions, *about_rows(fix, self.session.diagnosis, self.glyphs)]

    @property
    def _text(self) -> str:
        answer = self._answers.get(DIFF)
        return answer[0] if isinstance(answer, tuple) else ""

    def action_other_side(self) -> None:
        """Compare with the operator's file, which is asked for, or with what was driven."""
        case = self.session.case
        if case is None or not case.configs:
            self._ask_for_file()
            return
        self._turn(self._next_side)

    @property
    def _next_side(self) -> DiffSide:
        case, sides = self.session.case, list(SIDES)
        if case is None or not case.configs:
            return "file"
        return sides[(sides.index(self.side) + 1) % len(sides)]

    def label(self, binding: Binding) -> str:
        return TURNS[self._next_side] if binding.id == "diff.side" else super().label(binding)

    def action_other_file(self) -> None:
        """Name another file than the one before."""
        self._ask_for_file()

    def _turn(self, side: DiffSide) -> None:
        self.side = side
        self.enter()
        self.show()
        self.refresh_bindings()

    def _ask_for_file(self, *, to_apply: bool = False) -> None:
        title = "Apply to which file?" if to_apply else "Compare with which file?"
        dialog = FileDialog(title, Path(), is_no_log, self.glyphs, has_namespace=True)
        self.app.push_screen(dialog, lambda typed: self._named(typed, to_apply))

    def _named(self, typed: str | None, to_apply: bool) -> None:
        if typed is None or self.session.case is None:
            return
        self.session.case = replace(self.session.case, configs=(typed,))
        if self.workspace.request is not None:
            self.workspace.request = replace(self.workspace.request, configs=(typed,))
        self._turn("file")
        if to_apply:
            self.action_apply()

    def action_apply(self) -> None:
        """Put the change into the operator's file, once that is confirmed; the old one is kept beside."""
        case, fix = self.session.case, self.session.fix
        if case is None or fix is None or not fix.changes:
            self.say("No change is ticked in the fix (4).")
        elif not case.configs:
            self._ask_for_file(to_apply=True)
        else:
            engine = self.workspace.engine
            self.ask(DOUBTS, lambda: (engine.diff(case, fix, "file"), engine.doubts(case, fix)))

    def _confirm(self, doubts: Sequence[str]) -> None:
        """Ask before anything is written: with the odds, and what speaks against it."""
        case, fix = self.session.case, self.session.fix
        if case is None or fix is None:
            return
        files = ", ".join(str(name) for name in case.configs)
        meets = "probability that the next run then meets all objectives"
        odds = "" if fix.odds is None else f" {percent(fix.odds)} {meets}."
        question = f"Put {number_of(len(fix.changes), 'change')} into {files}?{odds}"
        keys = "y writes it and keeps the old one as .bak, n or Esc leaves it"
        self.app.push_screen(Confirm(question, keys, [*doubts, *self._cautions(fix)]), self._confirmed)

    def _cautions(self, fix: Fix) -> Iterator[str]:
        """How unsure the cause is, and what else speaks against the change."""
        session = self.session
        sure = {cause.confidence for cause in self._causes(fix)}
        if sure - {"high"}:
            yield f"confidence is {', '.join(sorted(sure))}: try it where nothing can be hurt first"
        driven = session.odds_unchanged()
        if driven is not None and fix.by_hand and not helps(fix.odds, driven):
            yield f"chosen by hand, and not predicted to help: as driven it is {percent(driven)}"
        yield from (f"{change.option.name}: {note}" for change in fix.changes for note in change.notes)

    def _confirmed(self, answer: bool | None) -> None:
        case, fix = self.session.case, self.session.fix
        if answer and case is not None and fix is not None:
            self.ask(APPLY, lambda: self.workspace.engine.apply(case, fix))

    def take(self, question: str, answer: object) -> None:
        if question == DOUBTS:
            self._ask_to_apply(answer)
        elif question != APPLY:
            super().take(question, answer)
        elif isinstance(answer, CareError):
            self.say(str(answer))
        elif isinstance(answer, list):
            self.workspace.written += [file for file, _ in answer]
            self._told_of = self._asked_for
            self._told = tuple(f"wrote {file}, the old one is {backup.name}" for file, backup in answer)
            if not answer:
                self.say(HELD)
            self._turn("file")

    @property
    def _asked_for(self) -> object:
        """The files that would be written, and what would be put into them."""
        case, fix = self.session.case, self.session.fix
        return case and case.configs, fix and changes_of(fix)

    def _ask_to_apply(self, answer: object) -> None:
        """The difference to the file is known, and the doubts about it."""
        if isinstance(answer, CareError):
            self.say(str(answer))
        elif isinstance(answer, tuple):
            difference, doubts = answer
            if difference:
                self._confirm(doubts)
            else:
                self.say(HELD)

    def action_copy_diff(self) -> None:
        """Copy the diff to the operator's clipboard."""
        if self._text:
            self.say(copy(self.app, self._text, "the diff", ".patch"))
        else:
            self.say("There is no diff to copy.")
