"""Step 3: what explains the fault, with what of this run shows it."""

from __future__ import annotations

from typing import ClassVar, NamedTuple

from textual.binding import Binding, BindingType
from textual.content import Content

from care_core.application.proof import Subject
from care_core.diagnose.records import Cause, Fault, Hypothesis
from care_core.ecosystems.findings import Finding, every_finding
from care_core.text import clean
from care_core.variables import Variable
from care_tui.messages import Decided
from care_tui.pages.figured import LEAST_FIGURE
from care_tui.pages.page import View, enter_to
from care_tui.pages.proven import ProvenPage
from care_tui.render.causes import (
    cause_item,
    doubt_rows,
    evidence_rows,
    hypothesis_item,
    no_cause_rows,
    path_rows,
    statistics_rows,
    worth_rows,
)
from care_tui.render.health import hypothesis_rows
from care_tui.render.rows import Row, Rows, folded, heading, labelled
from care_tui.screens.prompt import Prompt
from care_tui.widgets.choices import Listing
from care_tui.widgets.reader import Reader


class Explanation(NamedTuple):
    """One line of the ranking: a cause, or what explains the failure and is none; with its probability where known."""

    cause: Cause | None
    hypothesis: Hypothesis | None

    @property
    def name(self) -> str:
        return self.cause.option.name if self.cause else self.hypothesis.name if self.hypothesis else ""


class CausesPage(ProvenPage):
    NAME = "causes"
    NOTHING = "no cause is named"
    HELP = (
        "What explains the fault, the likeliest first, with what this run shows of it, and the path that led to the "
        "fault. p opens the proof as a plot, z the statistics behind it. d sets a cause aside with a reason that "
        "goes into the report, the others are weighed anew, and d takes it back. o turns to the next fault. Enter goes "
        "to the fix."
    )
    BINDINGS: ClassVar[list[BindingType]] = [
        enter_to("Fix"),
        Binding("p", "prove", "Proof", id="causes.proof"),
        Binding("d", "dismiss", "Set aside", id="causes.dismiss"),
        Binding("z", "fold", "Statistics", id="causes.statistics"),
        Binding("o", "next_fault", "Next fault", id="causes.next-fault"),
    ]
    _is_open = False
    _wanted: str | None = None
    """The cause that the cursor follows to its new place."""

    def enter(self) -> None:
        if self.has_content and self.session.fault is None:
            self.session.first_fault()  # of an objective that was kept, or not evaluated, there are no causes

    def view_of_diagnosis(self) -> View:
        ranked = self.ranked()
        listing = Listing(len(ranked), lambda i, width: self._item(ranked[i], width), lambda i: f"{ranked[i].name}")
        names, wanted, self._wanted = [one.name for one in ranked], self._wanted, None
        index = names.index(wanted) if wanted in names else None
        return View(self._title(), self._detail, listing, index, about="What shows it, and how it led to the fault")

    def ranked(self) -> list[Explanation]:
        """Parts, parameters, what was met and chance in one ranking, then the causes that it does not name, and those
        that were set aside."""
        session = self.session
        causes = {cause.option.name: cause for cause in session.causes}
        if session.fault is None and self._has_causes:
            return []  # of an objective that was kept
        found = [
            Explanation(causes.pop(one.name, None) if one.what == "parameter" else None, one)
            for one in session.hypotheses()
        ]
        left = [Explanation(cause, None) for cause in causes.values()]
        return found + sorted(left, key=lambda one: one.name in session.dismissed)

    def _item(self, one: Explanation, width: int) -> tuple[Content]:
        if one.cause is None:
            assert one.hypothesis is not None
            return (
                hypothesis_item(
                    one.hypothesis, self._finding(one.hypothesis), self.session.diagnosis.outside, self.glyphs
                ),
            )
        aside = self.session.dismissed.get(one.cause.option.name)
        share = None if one.hypothesis is None else one.hypothesis.probability
        return (cause_item(one.cause, share, aside, self.glyphs, width),)

    def _finding(self, hypothesis: Hypothesis) -> Finding | None:
        """The finding that an explanation is named after."""
        name, findings = hypothesis.name, every_finding(self.session.diagnosis.health.findings)
        return next((one for one in findings if name and (one.title == name or name in one.parameters)), None)

    @property
    def _has_causes(self) -> bool:
        return any(fault.causes for fault in self.session.diagnosis.faults)

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        if action == "dismiss" and self.has_content and not self.session.causes:
            return False
        if action == "next_fault" and self.has_content:
            return len(self.session.diagnosis.faults) > 1
        return super().check_action(action, parameters)

    def label(self, binding: Binding) -> str:
        is_back = binding.id == "causes.dismiss" and self.option_name() in self.session.dismissed
        return "Take back" if is_back else super().label(binding)

    def show(self, index: int | None = None) -> None:
        super().show(index)
        self.refresh_bindings()

    def moved(self, index: int) -> None:
        if self.session.dismissed:  # else no key has another label
            self.refresh_bindings()

    @property
    def _here(self) -> Explanation | None:
        """The explanation under the cursor."""
        if self.index is None or not self.has_content:
            return None
        ranked = self.ranked()
        return ranked[self.index] if self.index < len(ranked) else None

    def option_here(self) -> Variable | None:
        name = self.option_name()
        return next((option for option in self.session.options() if option.name == name), None) if name else None

    def option_name(self) -> str | None:
        """The option of the cause under the cursor, None where there is none."""
        here = self._here
        return here.cause.option.name if here and here.cause else None

    def subject(self) -> Subject | None:
        here = self._here
        if here is None:
            return None
        return here.cause or (self._finding(here.hypothesis) if here.hypothesis else None)

    def _title(self) -> Content:
        result, faults, fault = self.session.result, self.session.diagnosis.faults, self.session.fault
        if self.session.diagnosis.hypotheses and not self._has_causes:
            unfit = self.session.diagnosis.profile.fit.verdict == "no"
            why = "no profile fits" if unfit else "no mission was flown" if self.session.diagnosis.run.checks else ""
            return Content("What explains it" + (f"; {why}: by what the log shows alone" if why else ""))
        if result is None:
            return Content("No objective")
        title = Content(f"Causes of {clean(result.variable.name)}{self._alike(fault)}")
        if fault is not None and fault.causes and all(cause.is_lead for cause in fault.causes):
            title += Content(f": none found, {len(fault.causes)} not ruled out")
        if fault is None or len(faults) < 2:
            return title
        return title + Content(f" ({faults.index(fault) + 1} of {len(faults)} faults, o: next)")

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

    # The text: what shows it first, then the path and what a change brings, then statistics

    def _detail(self, index: int | None) -> Rows:
        session, result = self.session, self.session.result
        ranked = self.ranked() if session.case is not None else []
        if index is None or index >= len(ranked):
            return no_cause_rows(session.diagnosis, result)
        cause, hypothesis = ranked[index]
        if cause is None or result is None:
            assert hypothesis is not None
            return self._of_hypothesis(hypothesis)
        diagnosis = session.diagnosis
        doubt = doubt_rows(diagnosis)
        shown = evidence_rows(cause, diagnosis, session.dismissed)
        rows = [*(doubt if cause.is_lead else ()), *shown]
        if self.is_wide:
            return Rows([*rows, *self.figure(cause.option.name, cause, self.height(rows))])
        path = [*self._path(cause), Row(Content())]
        # A low pane has a lower plot, so that the path is in view with it; a very low one has it below.
        around = self.height([*rows, *path])
        figure = self.figure(cause.option.name, cause, around)
        is_first = self.reader.room.height - around >= LEAST_FIGURE
        return Rows([*rows, *(figure if is_first else path), *(path if is_first else figure), *self._worth(cause)])

    def _path(self, cause: Cause) -> list[Row]:
        assert self.session.result is not None
        return [heading("Path"), *path_rows(cause, self.session.result, self.glyphs)]

    def _of_cause(self, cause: Cause) -> list[Row]:
        """The path of a cause, what its change brings, and the statistics, folded."""
        return [*self._path(cause), Row(Content()), *self._worth(cause)]

    def _worth(self, cause: Cause) -> list[Row]:
        """What the change of a cause brings, and the statistics, folded."""
        session, result = self.session, self.session.result
        assert result is not None
        model = session.case.model if session.case else None
        effect = model.effects.get((cause.option.name, result.variable.name)) if model else None
        rows = worth_rows(cause, result, session.odds_unchanged(), self.glyphs)
        doubt = [] if cause.is_lead else doubt_rows(session.diagnosis)
        statistics = statistics_rows(cause, session.causes, effect, self.glyphs)
        return [*rows, *doubt, *folded("Statistics", statistics, self.glyphs, is_open=self._is_open)]

    def _of_hypothesis(self, hypothesis: Hypothesis) -> Rows:
        diagnosis, finding = self.session.diagnosis, self._finding(hypothesis)
        told = [*diagnosis.notes, *(one.text for one in diagnosis.outside)]
        rows = hypothesis_rows(hypothesis, finding, told)
        if finding is None:
            return Rows([*rows, *self._set_as(hypothesis.name if hypothesis.what == "parameter" else "")])
        first = [labelled("Seen by", finding.evidence)] if finding.evidence else []
        figure = self.figure(finding.title, finding, self.height(first))
        return Rows([*first, *figure, *(() if self.is_wide else rows)])

    def _set_as(self, name: str) -> list[Row]:
        """How a parameter is set that nothing in this run speaks for, and why it is told all the same."""
        option = next((one for one in self.session.options() if one.name == name), None)
        current = None if option is None else self.session.current(option)
        reference = None if option is None else self.session.reference(option)
        if option is None or current is None or reference is None:
            return []
        return [
            labelled("This run", f"{option.show(current)}, the reference is {option.show(reference)}"),
            labelled("Why", "it is off its reference, and nothing in this run speaks for it or against it"),
        ]

    def beside(self) -> tuple[str, list[Row]]:
        return "Path and fix", self._path_and_fix()

    def _path_and_fix(self) -> list[Row]:
        """The path of a cause and what its change brings, or all about a finding."""
        here = self._here
        if here is None:
            return []
        if here.cause is not None and self.session.result is not None:
            return self._of_cause(here.cause)
        finding = here.hypothesis and self._finding(here.hypothesis)
        return hypothesis_rows(here.hypothesis, finding) if here.hypothesis and finding else []

    # What the keys do

    def action_open(self) -> None:
        """Go to the fix, with the cursor on this parameter."""
        here = self._here
        is_parameter = here is not None and (here.cause or (here.hypothesis and here.hypothesis.what == "parameter"))
        self.session.option = here.name if here is not None and is_parameter else None
        self.go_on()

    def action_prove(self) -> None:
        """Show the signal that proves the cause under the cursor."""
        self.go("plots", None, self.subject())

    def action_fold(self) -> None:
        """Open or close the statistics."""
        if self.option_name() is None:
            self.say("Training knows nothing of this: there are no statistics.")
            return
        self._is_open = not self._is_open
        self.show_text(from_top=False)
        if self._is_open:
            for reader in self.query(Reader):
                reader.reveal("Statistics")

    def action_next_fault(self) -> None:
        """Turn to the causes of the next faulty objective."""
        if self.session.next_fault():
            self.show(0)
            self.refresh_bindings()

    def action_dismiss(self) -> None:
        """Set the cause under the cursor aside, or take it back."""
        option = self.option_name()
        if option is None:
            self.say("Only a parameter of the profile can be set aside.")
            return
        if option in self.session.dismissed:
            self._wanted = option
            self._decided(self.session.take_back(option), f"{option} is back in the fix.")
            return
        hint = "Why not? The reason goes into the report. Enter sets it aside, Esc cancels."
        prompt = Prompt(f"Set {option} aside", hint=hint)
        self.app.push_screen(prompt, lambda reason: self._dismissed(option, reason))

    def _dismissed(self, option: str, reason: str | None) -> None:
        if reason:
            self._wanted = option
            changed = self.session.set_aside(option, reason)
            self._decided(changed, f"{option} was also taken out of the fix.")

    def _decided(self, has_changed_fix: bool, words: str) -> None:
        if has_changed_fix:
            self.say(words)
        self.post_message(Decided(has_changed_fix))
