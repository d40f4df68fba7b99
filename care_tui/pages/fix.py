"""Step 4: the changes as a basket of boxes, with the odds and the objectives they are predicted to bring, and how the
odds answer to the value of the parameter under the cursor."""

from __future__ import annotations

from asyncio import sleep
from collections.abc import Callable
from functools import partial
from typing import ClassVar

from textual.binding import Binding, BindingType
from textual.content import Content

from care_core.application.deciding import changes_of, fixes
from care_core.diagnose.records import Fix, Odds
from care_core.report.responses import Response
from care_core.text import clean, number_of
from care_core.variables import Variable
from care_tui.basket import nudged, parsed, possible
from care_tui.messages import Decided
from care_tui.pages.diagnosis import DiagnosisPage
from care_tui.pages.figured import FiguredPage
from care_tui.pages.page import View, enter_to
from care_tui.render.fix import OptionColumns, no_fix_rows, option_change, option_item, option_rows, outcome_rows
from care_tui.render.response import response_rows
from care_tui.render.rows import Row, Rows, error_rows, warning
from care_tui.screens.prompt import Prompt
from care_tui.widgets.choices import Listing
from care_tui.workspace import Workspace

UNCHANGED, RESPONSE, REST = "unchanged", "response", "rest"
REST_S = 0.15
"""How long the cursor rests before values are asked for: a held key passes over options that nobody looks at."""
CURVE = "fix.curve"
"""The id of the key that shows the curve."""
Key = tuple[str, frozenset[tuple[str, float]]]
"""An option, and the changes beside which its values are asked for."""


class FixPage(FiguredPage, DiagnosisPage):
    NAME = "fix"
    NOTHING = "no change is suggested"
    HELP = (
        "Space ticks a change, + and - nudge its value, = types one. The odds follow at once, here and in the answer "
        "above, where they are of all objectives together and count that the cause may be another; those at a line are "
        "of the next run if only this parameter is changed. a loads the next alternative, s the suggestion, u takes "
        "the last change back. Every parameter of the profile is here: / finds it. Enter shows the diff. Nothing is "
        "written to the robot."
    )
    BINDINGS: ClassVar[list[BindingType]] = [
        enter_to("Diff"),
        Binding("space", "tick", "Tick", key_display="space", id="fix.toggle"),
        Binding(
            "plus,right_square_bracket",
            "nudge(1)",
            "More",
            key_display="+",
            id="fix.more",
            tooltip="Take the next value up",
        ),
        Binding(
            "minus,left_square_bracket",
            "nudge(-1)",
            "Less",
            key_display="-",
            id="fix.less",
            tooltip="Take the next value down",
        ),
        Binding("equals_sign,i", "type_value", "Value", key_display="=", id="fix.value"),
        Binding("z", "turn", "Curve", id=CURVE),
        Binding("a", "alternative", "Alternative", id="fix.alternative"),
        Binding("s", "suggestion", "Suggestion", show=False, id="fix.suggestion"),
        Binding("u", "undo", "Undo", show=False, id="fix.undo"),
    ]

    def __init__(self, workspace: Workspace, *, id: str | None = None) -> None:
        super().__init__(workspace, id=id)
        self._is_turned = False
        """Whether the curve has the place of the prediction, where there is room for one of them."""
        self._columns: Callable[[int], OptionColumns] | None = None
        """The columns that the lines of the list share, measured over all of them for the values below."""
        self._columns_of: tuple[dict[str, float], set[str]] = {}, set()
        self._responses: dict[Key, list[Odds]] = {}
        self._has_model = True
        """Whether there are odds to ask for, as far as they were asked for."""
        self._weighed: Key | None = None
        """What the thread is at that asks for the odds over an option's values."""

    def enter(self) -> None:
        case, session = self.session.case, self.session
        if self.has_content and case is not None and session.unchanged is None:
            self.fetched(UNCHANGED, lambda: self.workspace.engine.predict(case, {}))

    def take(self, question: str, answer: object) -> None:
        if question == UNCHANGED and isinstance(answer, Fix):  # without it the odds stand alone, which is no failure
            self.session.unchanged = answer
            self.post_message(Decided(has_changed_fix=False))
        if question == RESPONSE:
            self._take_response(answer)
        else:
            super().take(question, answer)

    def view_of_diagnosis(self) -> View:
        session, basket, glyphs = self.session, self.session.basket, self.glyphs
        options, alone = session.options(), session.alone()

        def change(option: Variable) -> Content:
            current, value = session.current(option), basket.values.get(option.name)
            ticked = option.name in basket.ticked
            return option_change(option, current, session.is_assumed(option), value, ticked, glyphs)

        values = dict(basket.values), set(basket.ticked)
        if self._columns is None or self._columns_of != values:
            longest = max((len(clean(option.name)) for option in options), default=0)
            changes = (change(option).cell_length for option in options if option.name in basket.values)
            self._columns = partial(OptionColumns.sharing, name=longest, change=max(changes, default=0))
            self._columns_of = values
        columns = self._columns

        def item(index: int, room: int) -> tuple[Content]:
            option = options[index]
            value = basket.values.get(option.name)
            ticked = None if value is None else option.name in basket.ticked
            odds = None if value is None else alone.get((option.name, value))
            return (option_item(option, change(option), ticked, odds, columns(room), glyphs),)

        index, session.option = self._place(options), None
        listing = Listing(len(options), item, lambda i: f"{options[i].name} {options[i].doc}")
        here = self.option_here() if index is None else options[index]
        has_figure = self._has_figure(here or next(iter(options), None))  # a list that is new begins at the first
        about = "Odds of all objectives, by its value" if has_figure else self._about_prediction
        return View(self._title(), lambda i: self._detail(None if i is None else options[i]), listing, index, about)

    @property
    def _about_prediction(self) -> str:
        return f"Predicted {'with what is ticked' if self.session.basket.ticked else 'as driven'} (80% intervals)"

    def _place(self, options: list[Variable]) -> int | None:
        names = [option.name for option in options]
        return names.index(self.session.option) if self.session.option in names else None

    def _title(self) -> Content:
        if self.session.fix_error is not None:
            return Content("No prediction")
        count = len(self.session.basket.ticked)
        ticked = f"{number_of(count, 'change')} ticked" if count else "nothing ticked"
        return Content(f"What to change: {ticked}")

    def _detail(self, option: Variable | None) -> Rows:
        if option is not None and self._has_figure(option):
            return Rows(self._figure(option))
        return Rows(self._predicted(option))

    def beside(self) -> tuple[str, list[Row]]:
        option = self.option_here()
        return self._about_prediction, self._predicted(option) if self._has_figure(option) else []

    def _predicted(self, option: Variable | None) -> list[Row]:
        """What is predicted of the ticked changes, and what has to be known of an option."""
        session = self.session
        if session.fix_error is not None:
            return list(error_rows(session.fix_error).rows)
        rows: list[Row] = []
        ticked = session.basket.ticked
        if session.diagnosis.fix is None:
            rows += [*no_fix_rows(session.diagnosis).rows, Row(Content())]
        shown = session.fix if ticked else session.unchanged
        if shown is not None:
            rows += [warning("Unless", f"it happens again: {title}") for title in session.diagnosis.lost_by]
            rows += [
                warning("Unless", f"{name} acts again, of which training knows nothing") for name in self._unknown()
            ]
            rows += outcome_rows(shown, session.diagnosis.objectives, self.glyphs)
            if shown.why_not_measured:
                rows.append(warning("Odds", f"not measured: {shown.why_not_measured}"))
        if option is not None:
            rows += [Row(Content()), *option_rows(option, self._caveats(option), self.glyphs)]
        return rows

    def _unknown(self) -> tuple[str, ...]:
        """The parameter that leads what explains the run, where no profile models it and it stays as it is."""
        first = next(iter(self.session.diagnosis.hypotheses), None)
        known = {option.name for option in self.session.case.options} if self.session.case is not None else set()
        left = {"", *known, *self.session.basket.ticked}
        return (first.name,) if first is not None and first.what == "parameter" and first.name not in left else ()

    # The odds over the values of the option under the cursor

    def _key(self, option: Variable) -> Key:
        beside = {name: value for name, value in self.session.basket.ticked.items() if name != option.name}
        return option.name, frozenset(beside.items())

    def _has_figure(self, option: Variable | None) -> bool:
        """Whether the odds over an option's values have a pane of their own."""
        if option is None or self.session.fix_error is not None or not self._has_model:
            return False
        if not (self.is_wide or self._is_turned):
            return False
        return bool(option.across(2)) and self._responses.get(self._key(option)) != []

    def _figure(self, option: Variable) -> list[Row]:
        odds = self._responses.get(self._key(option))
        if odds is None:
            self._weigh(option)
            return [Row(Content("Asking what each value would bring..."))]
        room = self.room_of_figure()
        return response_rows(Response(option, tuple(odds), self._marks(option)), room.width, room.height, self.glyphs)

    def _marks(self, option: Variable) -> tuple[tuple[float, str], ...]:
        session = self.session
        marks = {session.reference(option): "reference", session.current(option): "as driven"}
        marks[session.basket.ticked.get(option.name)] = "ticked"
        return tuple((value, what) for value, what in marks.items() if value is not None)

    def _take_response(self, answer: object) -> None:
        """Keep the odds under the option that they are of, which the cursor may have left."""
        if isinstance(answer, tuple):
            key, odds = answer
            self._responses[key] = odds
            if key == self._weighed:
                self._weighed = None
        else:
            self._has_model = False
        self.show_text(from_top=False)

    def _weigh(self, option: Variable) -> None:
        """Have a thread ask for the odds of each value once the cursor has rested; those of another option are left."""
        case, key, odds_over = self.session.case, self._key(option), self.workspace.engine.odds_over
        if case is None or key == self._weighed:
            return
        self._weighed = key

        def work() -> tuple[Key, list[Odds]]:
            return key, list(odds_over(case, option, dict(key[1])))

        self.workers.cancel_group(self, RESPONSE)
        self.run_worker(self._ask_rested(work), group=REST, exclusive=True)

    async def _ask_rested(self, work: Callable[[], object]) -> None:
        await sleep(REST_S)
        self.ask(RESPONSE, work)

    def _caveats(self, option: Variable) -> list[str]:
        session, value = self.session, self.session.basket.values.get(option.name)
        notes = [note for change in (session.fix.changes if session.fix else ()) if change.option.name == option.name
                 for note in change.notes]  # fmt: skip
        if value is not None and self._is_past_reference(option, value):
            reference = option.show(session.reference(option) or 0.0)
            notes.append(f"past its reference, {reference}: a suggestion stops there, as far as it is known to work")
        if option.safety and value is not None and value != option.default:
            notes.append("a safety parameter: think twice before it leaves its default")
        if option.name in session.dismissed:
            notes.append(f"set aside: {session.dismissed[option.name]}")
        return notes

    def _is_past_reference(self, option: Variable, value: float) -> bool:
        """Whether the value lies on the other side of the reference than that of the run."""
        current, reference = self.session.current(option), self.session.reference(option)
        if current is None or reference is None or option.labels or option.type == "bool":
            return False
        return (value - reference) * (reference - current) > 0

    # What the keys do

    def option_here(self) -> Variable | None:
        return None if self.index is None or not self.has_content else self.session.options()[self.index]

    def _here(self) -> tuple[Variable, float] | None:
        """The option under the cursor and the value it has in this run."""
        option = self.option_here()
        current = None if option is None else self.session.current(option)
        if option is not None and current is None:
            self.say(f"Nothing says what value {option.name} has in this run.")
        return None if option is None or current is None else (option, current)

    def action_tick(self) -> None:
        """Tick or untick the change under the cursor."""
        if (here := self._here()) is None:
            return
        if self.session.basket.toggle(here[0].name):
            self.post_message(Decided())
        else:
            self.action_type_value()

    def action_nudge(self, by: int) -> None:
        """Take the next value up or down."""
        if (here := self._here()) is not None:
            option, current = here
            value = self.session.basket.ticked.get(option.name, current)
            self._set(option, nudged(option, value, by), current)

    def action_type_value(self) -> None:
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
        self.app.push_screen(prompt, lambda typed: self._typed(option, current, typed))

    def _typed(self, option: Variable, current: float, typed: str | None) -> None:
        if typed is not None:
            self._set(option, parsed(option, typed), current)

    def _set(self, option: Variable, value: float, current: float) -> None:
        self.session.basket.set(option.name, value, current=current)
        self.post_message(Decided())

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        if action == "turn" and self.is_wide:  # both are in view
            return False
        return super().check_action(action, parameters)

    def label(self, binding: Binding) -> str:
        return "Prediction" if binding.id == CURVE and self._is_turned else super().label(binding)

    def action_turn(self) -> None:
        """Show the curve in the prediction's place, or the other way round."""
        self._is_turned = not self._is_turned
        self.refresh_bindings()
        self.show_text()

    def action_alternative(self) -> None:
        """Load the next fix that was found."""
        found = [changes_of(fix) for fix in fixes(self.session.diagnosis)]
        if not found:
            self.say("No change is known that helps.")
            return
        ticked = self.session.basket.ticked
        place = (found.index(ticked) + 1) % len(found) if ticked in found else 0
        self.session.basket.load(found[place])
        self.post_message(Decided())
        if len(found) == 1:
            self.say("This is the suggestion again: there is no alternative to it.")
            return
        what = "the suggestion" if place == 0 else f"alternative {place} of {len(found) - 1}"
        self.say(f"This is {what}.")

    def action_suggestion(self) -> None:
        """Load the suggested fix."""
        suggested = self.session.diagnosis.fix
        if suggested is None:
            return
        aside = sorted(changes_of(suggested).keys() & self.session.dismissed.keys())
        if aside:
            self.say(f"The suggestion changes {', '.join(aside)}, which was set aside.")
            return
        self.session.basket.load(changes_of(suggested))
        self.post_message(Decided())

    def action_undo(self) -> None:
        """Take back the last change of the basket."""
        if self.session.basket.undo():
            self.post_message(Decided())
        else:
            self.say("There is nothing to take back.")
