"""Step 3: what moved the objective the wrong way in this run, and along which path."""

from __future__ import annotations

from typing import ClassVar, NamedTuple

from textual.content import Content

from care_core.diagnose.records import Cause, Fault, Hypothesis
from care_core.ecosystems.findings import Finding, every_finding
from care_core.text import clean
from care_core.variables import Variable
from care_tui.pages.page import View
from care_tui.pages.step import DiagnosisPage
from care_tui.render.causes import cause_detail, cause_item, no_cause_rows
from care_tui.render.health import hypothesis_item, hypothesis_rows
from care_tui.render.rows import Rows
from care_tui.screens.prompt import Prompt
from care_tui.widgets.choices import Listing


class Explanation(NamedTuple):
    """One line of the ranking: a cause, or what explains the failure and is none; with its probability where known."""

    cause: Cause | None
    hypothesis: Hypothesis | None


class CausesPage(DiagnosisPage):
    name = "Causes"
    NOTHING = "no cause is named"
    HELP = (
        "Options that moved the objective the wrong way in this run, best first, with the causal path of the one under "
        "the cursor. Enter goes to the fix. d sets a cause aside with a reason that goes into the report, and undoes "
        "that. o turns to the next fault."
    )
    ENTER = "Fix"
    ACTIONS: ClassVar[frozenset[str]] = frozenset({"dismiss", "next_fault"})

    def view_of_diagnosis(self) -> View:
        ranked = self.ranked()
        listing = Listing(len(ranked), lambda i, _width: self._item(ranked[i]), lambda i: _words(ranked[i]), height=2)
        return View(self._title(), self._detail, listing)

    def ranked(self) -> list[Explanation]:
        """Parts, parameters, what was met and chance in one ranking, then the causes that it does not name."""
        causes = {cause.option.name: cause for cause in self.session.causes}
        if self.session.fault is None and self._has_causes:
            return []  # of an objective that was kept
        found = [
            Explanation(causes.pop(one.name, None) if one.what == "parameter" else None, one)
            for one in self.session.diagnosis.hypotheses
        ]
        return found + [Explanation(cause, None) for cause in causes.values()]

    def _item(self, one: Explanation) -> tuple[Content, Content]:
        if one.cause is None:
            assert one.hypothesis is not None
            return hypothesis_item(one.hypothesis, self._finding(one.hypothesis), self.session.diagnosis.outside)
        aside = self.session.dismissed.get(one.cause.option.name)
        share = None if one.hypothesis is None else one.hypothesis.probability
        return cause_item(one.cause, share, aside, self.glyphs, self.session.diagnosis.odds_as_driven)

    def _finding(self, hypothesis: Hypothesis) -> Finding | None:
        """The finding that an explanation is named after."""
        name, findings = hypothesis.name, every_finding(self.session.diagnosis.health.findings)
        return next((one for one in findings if name and (one.title == name or name in one.parameters)), None)

    @property
    def _has_causes(self) -> bool:
        return any(fault.causes for fault in self.session.diagnosis.faults)

    def works(self, action: str) -> bool:
        return super().works(action) and (action != "dismiss" or bool(self.session.causes))

    def option_here(self) -> Variable | None:
        name = self.option_at(self.screen.choices.highlighted)
        return next((option for option in self.session.options() if option.name == name), None) if name else None

    def option_at(self, index: int | None) -> str | None:
        """The option of the cause at this place, None where there is none."""
        cause = None if index is None else self.ranked()[index].cause
        return None if cause is None else cause.option.name

    @property
    def _is_empty(self) -> bool:
        return super()._is_empty and not self.session.diagnosis.hypotheses

    def _title(self) -> Content:
        result, faults, fault = self.session.result, self.session.diagnosis.faults, self.session.fault
        if self.session.diagnosis.hypotheses and not self._has_causes:
            unfit = self.session.diagnosis.profile.fit.verdict == "no"
            why = "no profile fits" if unfit else "no mission was flown" if self.session.diagnosis.run.checks else ""
            return Content("What explains it" + (f"; {why}, so no parameter is judged" if why else ""))
        if result is None:
            return Content("No objective")
        title = Content.assemble("Causes of ", (clean(result.variable.name), "bold"), self._alike(fault))
        if fault is not None and fault.causes and all(cause.is_lead for cause in fault.causes):
            title += Content(f": none found, {len(fault.causes)} not ruled out")
        if fault is None or len(faults) < 2:
            return title
        return title + Content.styled(f"  ({faults.index(fault) + 1} of {len(faults)} faults, o: next)", "dim")

    def _alike(self, fault: Fault | None) -> str:
        """The other faults with the same causes, as the report puts them together."""
        if fault is None:
            return ""
        from care_core.report.shared_causes import together

        groups = together(
            self.session.diagnosis.faults, lambda one: [[node.name for node in c.path] for c in one.causes]
        )
        others = [one for group in groups if fault in group for one in group if one is not fault]
        return "".join(f" and {clean(one.objective.variable.name)}" for one in others)

    def _detail(self, index: int | None) -> Rows:
        session, result = self.session, self.session.result
        if index is None or session.case is None:
            return no_cause_rows(session.diagnosis, result)
        cause, hypothesis = self.ranked()[index]
        if cause is None or result is None:
            assert hypothesis is not None
            diagnosis = session.diagnosis
            told = [*diagnosis.notes, *(one.text for one in diagnosis.outside)]
            return Rows(hypothesis_rows(hypothesis, self._finding(hypothesis), told))
        model = session.case.model
        effect = model.effects.get((cause.option.name, result.variable.name)) if model else None
        return cause_detail(cause, session.causes, result, effect, session.diagnosis, session.dismissed, self.glyphs)

    def open(self, index: int | None) -> None:
        one = None if index is None else self.ranked()[index].hypothesis
        self.session.option = one.name if one is not None and one.what == "parameter" else self.option_at(index)
        self.walk.action_go(4)

    def next_fault(self) -> None:
        """Turn to the causes of the next faulty objective."""
        if self.session.state == "data" and self.session.next_fault():
            self.screen.draw(index=0)

    def dismiss(self) -> None:
        """Set the cause under the cursor aside, or take it back."""
        option = self.option_at(self.screen.choices.highlighted)
        if option is None:
            return
        if option in self.session.dismissed:
            self._redraw(self.session.take_back(option), f"{option} is back in the fix.")
            return
        prompt = Prompt(f"Set {option} aside", hint="Why? It goes into the report. Enter keeps it, Esc cancels.")
        self.screen.app.push_screen(prompt, lambda reason: self._dismissed(option, reason))

    def _dismissed(self, option: str, reason: str | None) -> None:
        if reason:
            self._redraw(self.session.set_aside(option, reason), f"{option} was also taken out of the fix.")

    def _redraw(self, has_changed_fix: bool, words: str) -> None:
        if has_changed_fix:
            self.walk.basket_changed()
            self.screen.say(words)
        else:
            self.screen.draw()


def _words(one: Explanation) -> str:
    """What `/` searches in."""
    named = "" if one.hypothesis is None else f"{one.hypothesis.what} {one.hypothesis.name}"
    return named if one.cause is None else f"{one.cause.option.name} {named}"
