"""Step 4: the changes as a basket of boxes, with the probability and the objectives they are predicted to bring."""

from __future__ import annotations

from typing import ClassVar

from textual.content import Content

from care_core.application.case import changes_of, fixes
from care_core.text import clean
from care_core.variables import Variable
from care_tui.basket import nudged, parsed, possible
from care_tui.pages.page import View
from care_tui.pages.step import DiagnosisPage
from care_tui.render.fix import no_fix_rows, option_item, option_rows, outcome_rows
from care_tui.render.rows import Row, Rows, error_rows, heading, percent, warning
from care_tui.screens.prompt import Prompt
from care_tui.widgets.choices import Listing

NAME_WIDTH = 26


class FixPage(DiagnosisPage):
    name = "Fix"
    NOTHING = "no change is suggested"
    NEEDS_MISSION = True
    HELP = (
        "Space ticks a change, + and - nudge its value, = types one. The probability follows at once. a loads the next "
        "alternative, s the suggestion, u takes the last change back. Every parameter of the profile is here: / finds "
        "it. Enter shows the diff. Nothing is written to the robot."
    )
    ENTER = "Diff"
    ACTIONS: ClassVar[frozenset[str]] = frozenset(
        {"toggle", "nudge_up", "nudge_down", "type_value", "alternative", "suggestion", "undo"}
    )

    def enter(self) -> None:
        if self.session.state == "data" and not self._is_empty:
            self.walk.predict_unchanged()

    def view_of_diagnosis(self) -> View:
        session, basket, glyphs = self.session, self.session.basket, self.glyphs
        options, alone = session.options(), session.alone()
        width = min(max((len(clean(option.name)) for option in options), default=0), NAME_WIDTH)

        def item(index: int, _width: int) -> tuple[Content]:
            option = options[index]
            value = basket.values.get(option.name)
            probability = None if value is None else alone.get((option.name, value))
            shown = "" if probability is None else f"alone {percent(probability)}"
            ticked = option.name in basket.ticked
            current, is_assumed = session.current(option), session.is_assumed(option)
            return (option_item(option, current, is_assumed, value, ticked, shown, width, glyphs),)

        index, session.option = self._place(options), None
        listing = Listing(len(options), item, lambda i: f"{options[i].name} {options[i].doc}")
        return View(self._title(), lambda i: self._detail(None if i is None else options[i]), listing, index)

    def _place(self, options: list[Variable]) -> int | None:
        names = [option.name for option in options]
        return names.index(self.session.option) if self.session.option in names else None

    def _title(self) -> Content:
        session = self.session
        if session.fix_error is not None:
            return Content("No prediction")
        count = len(session.basket.ticked)
        shown = session.fix if count else session.unchanged
        probability = "..." if shown is None else "not measured" if shown.odds is None else percent(shown.odds)
        again = Content.styled(" unless it happens again", "$text-warning") if session.diagnosis.lost_by else Content()
        if not count:
            return Content.assemble(
                "Probability of no fault ", (probability, "bold"), " as driven", again, ("  nothing ticked", "dim")
            )
        changes = f"{count} change{'' if count == 1 else 's'}"
        now = "" if session.unchanged is None else f"  (as driven {percent(session.unchanged.p_fixed)})"
        outside = " a guess, outside the training runs" if shown is not None and shown.is_guess else ""
        return Content.assemble(
            "Probability of no fault ", (probability, "bold"), outside, again, now, (f"  {changes}", "dim")
        )

    def _detail(self, option: Variable | None) -> Rows:
        session = self.session
        if session.fix_error is not None:
            return error_rows(session.fix_error)
        rows: list[Row] = []
        ticked = session.basket.ticked
        if session.diagnosis.fix is None:
            rows += no_fix_rows(session.diagnosis).rows
        shown = session.fix if ticked else session.unchanged
        if shown is not None:
            if rows:
                rows.append(Row(Content()))
            rows.append(heading(f"Predicted {'with what is ticked' if ticked else 'as driven'}, 80 % interval"))
            rows += outcome_rows(shown, session.diagnosis.objectives, self.glyphs)
            rows += [warning("Unless", f"it happens again: {title}") for title in session.diagnosis.lost_by]
        if option is not None:
            rows += [Row(Content()), *option_rows(option, self._caveats(option), self.glyphs)]
        return Rows(rows)

    def _caveats(self, option: Variable) -> list[str]:
        session, value = self.session, self.session.basket.values.get(option.name)
        notes = [note for change in (session.fix.changes if session.fix else ()) if change.option.name == option.name
                 for note in change.notes]  # fmt: skip
        if option.safety and value is not None and value != option.default:
            notes.append("a safety parameter: think twice before it leaves its default")
        if option.name in session.dismissed:
            notes.append(f"set aside: {session.dismissed[option.name]}")
        return notes

    # What the keys do

    def option_here(self) -> Variable | None:
        index = self.screen.choices.highlighted
        return None if index is None else self.session.options()[index]

    def _here(self) -> tuple[Variable, float] | None:
        """The option under the cursor and the value it has in this run."""
        index = self.screen.choices.highlighted
        if self.session.state != "data" or index is None:
            return None
        option = self.session.options()[index]
        current = self.session.current(option)
        if current is None:
            self.screen.say(f"Nothing says what value {option.name} has in this run.")
            return None
        return option, current

    def toggle(self) -> None:
        """Tick or untick the change under the cursor."""
        if (here := self._here()) is None:
            return
        if self.session.basket.toggle(here[0].name):
            self.walk.basket_changed()
        else:
            self.type_value()

    def nudge_up(self) -> None:
        self._nudge(1)

    def nudge_down(self) -> None:
        self._nudge(-1)

    def _nudge(self, by: int) -> None:
        if (here := self._here()) is not None:
            option, current = here
            value = self.session.basket.ticked.get(option.name, current)
            self._set(option, nudged(option, value, by), current)

    def type_value(self) -> None:
        """Ask for a value of the option under the cursor."""
        if (here := self._here()) is None:
            return
        option, current = here

        def check(typed: str) -> str:
            try:
                parsed(option, typed)
            except ValueError as err:
                return str(err)
            return ""

        value = self.session.basket.values.get(option.name, current)
        prompt = Prompt(f"What if {clean(option.name)} were", f"{value:g}", possible(option), check)
        self.screen.app.push_screen(prompt, lambda typed: self._typed(option, current, typed))

    def _typed(self, option: Variable, current: float, typed: str | None) -> None:
        if typed is not None:
            self._set(option, parsed(option, typed), current)

    def _set(self, option: Variable, value: float, current: float) -> None:
        self.session.basket.set(option.name, value, current=current)
        self.walk.basket_changed()

    def alternative(self) -> None:
        """Load the next fix that the engine found."""
        found = [changes_of(fix) for fix in fixes(self.session.diagnosis)] if self.session.state == "data" else []
        if not found:
            self.screen.say("The engine found no fix.")
            return
        ticked = self.session.basket.ticked
        place = (found.index(ticked) + 1) % len(found) if ticked in found else 0
        self.session.basket.load(found[place])
        self.walk.basket_changed()
        if len(found) == 1:
            self.screen.say("This is the suggestion; the engine found no alternative.")
            return
        what = "the suggestion" if place == 0 else f"alternative {place} of {len(found) - 1}"
        self.screen.say(f"This is {what}.")

    def suggestion(self) -> None:
        """Load the suggested fix."""
        if self.session.state == "data" and self.session.diagnosis.fix is not None:
            self.session.basket.load(changes_of(self.session.diagnosis.fix))
            self.walk.basket_changed()

    def undo(self) -> None:
        """Take back the last change of the basket."""
        if self.session.basket.undo():
            self.walk.basket_changed()
        else:
            self.screen.say("There is nothing to take back.")

    def open(self, index: int | None) -> None:
        self.walk.action_go(5)
