"""The five steps of the walk: each shows one part of a diagnosis and posts what the operator chose."""

from __future__ import annotations

from textual import on
from textual.app import ComposeResult
from textual.containers import Vertical
from textual.content import Content
from textual.widgets import OptionList, Static

from care_core.diagnose.records import Cause, Diagnosis, Fault, ObjectiveResult
from care_core.errors import CareError
from care_core.text import clean
from care_tui import render
from care_tui.jobs import ReportFormat, fixes
from care_tui.messages import CauseChosen, FixChosen, ObjectiveChosen, StepChosen
from care_tui.render import Glyphs
from care_tui.widgets.choices import Choices
from care_tui.widgets.lines import Lines


class Step(Vertical):
    """One step of the walk."""

    HELP = ""

    def __init__(self, diagnosis: Diagnosis, glyphs: Glyphs, *, id: str) -> None:
        super().__init__(id=id)
        self.diagnosis = diagnosis
        self.glyphs = glyphs

    def take_focus(self) -> None:
        """Focus the first thing of this step that can be worked with."""
        for widget in self.query("Choices, Lines"):
            if widget.display:
                widget.focus()
                return


class ObjectivesStep(Step):
    """Every objective against its threshold, and where the run came from."""

    HELP = "What the mission is judged by. Enter on an objective shows what caused its fault."

    def compose(self) -> ComposeResult:
        results = self.diagnosis.objectives
        width = max((len(clean(result.variable.name)) for result in results), default=0)
        yield Static(render.headline(self.diagnosis, self.glyphs), classes="title")
        yield Choices((render.objective_rows(result, width, self.glyphs) for result in results), id="objective-list")
        yield Lines(render.run_rows(self.diagnosis), id="run-summary")

    def on_mount(self) -> None:
        """Start at the first fault, where the operator's question is."""
        statuses = [result.status for result in self.diagnosis.objectives]
        choices = self.query_one(Choices)
        choices.highlighted = statuses.index("fault") if "fault" in statuses else 0
        choices.display = bool(statuses)

    @on(OptionList.OptionSelected)
    def _choose(self, event: OptionList.OptionSelected) -> None:
        event.stop()
        self.post_message(ObjectiveChosen(event.option_index))


class CausesStep(Step):
    """The ranked causes of one objective, and the causal path of the highlighted one."""

    HELP = "Options that moved the objective the wrong way in this run, best first. Enter shows the fix."

    def compose(self) -> ComposeResult:
        yield Static(classes="title", markup=False)
        with Vertical(id="causes-panes"):
            yield Choices(id="cause-list")
            yield Lines(id="causal-path")

    def explain(self, objective: ObjectiveResult | None) -> None:
        """Show the causes of an objective, or why there are none."""
        self.objective = objective
        fault = self._fault_of(objective)
        self.causes = fault.causes if fault else ()
        self.query_one(".title", Static).update(self._title(fault))
        self.query_one(Choices).fill(render.cause_rows(cause, self.glyphs) for cause in self.causes)
        if not self.causes:
            self.query_one(Lines).show(render.no_cause_rows(self.diagnosis, objective))

    def _fault_of(self, objective: ObjectiveResult | None) -> Fault | None:
        if objective is None:
            return None
        name = objective.variable.name
        return next((fault for fault in self.diagnosis.faults if fault.objective.variable.name == name), None)

    def _title(self, fault: Fault | None) -> Content:
        if self.objective is None:
            return Content("No objective")
        title = Content.assemble("Causes of ", (clean(self.objective.variable.name), "bold"))
        faults = self.diagnosis.faults
        if fault is None or len(faults) < 2:
            return title
        return title + Content.styled(f"  ({faults.index(fault) + 1} of {len(faults)} faults, o: next)", "dim")

    @on(OptionList.OptionHighlighted)
    def _show_path(self, event: OptionList.OptionHighlighted) -> None:
        event.stop()
        if self.objective is not None and event.option_index < len(self.causes):
            cause, evidence = self.causes[event.option_index], self.diagnosis.run.evidence
            self.query_one(Lines).show(render.cause_detail(cause, self.objective, evidence, self.glyphs))

    @on(OptionList.OptionSelected)
    def _choose(self, event: OptionList.OptionSelected) -> None:
        event.stop()
        self.post_message(CauseChosen(self.causes[event.option_index]))


class FixStep(Step):
    """The suggested fix and its alternatives; the highlighted one is what diff and report use."""

    HELP = "Changes with their predicted outcome. The highlighted fix goes into diff and report."

    def compose(self) -> ComposeResult:
        choices = fixes(self.diagnosis)
        yield Static(Content("What to change" if choices else "No fix"), classes="title")
        items = (render.fix_rows(fix, place, self.glyphs) for place, fix in enumerate(choices))
        yield Choices(items, id="fix-list")
        yield Lines(None if choices else render.no_fix_rows(self.diagnosis), id="fix-detail")

    def on_mount(self) -> None:
        choices = self.query_one(Choices)
        choices.display = choices.option_count > 0
        choices.highlighted = 0 if choices.option_count else None

    def choose_for(self, cause: Cause) -> None:
        """Highlight the first fix that changes the option of this cause, if there is one."""
        for place, fix in enumerate(fixes(self.diagnosis)):
            if any(change.option.name == cause.option.name for change in fix.changes):
                self.query_one(Choices).highlighted = place
                return

    @on(OptionList.OptionHighlighted)
    def _show(self, event: OptionList.OptionHighlighted) -> None:
        event.stop()
        fix = fixes(self.diagnosis)[event.option_index]
        self.query_one(Lines).show(render.fix_detail(fix, self.diagnosis.objectives, self.glyphs))
        self.post_message(FixChosen(event.option_index))

    @on(OptionList.OptionSelected)
    def _open_diff(self, event: OptionList.OptionSelected) -> None:
        event.stop()
        self.post_message(StepChosen(4))


class DiffStep(Step):
    """The configuration as driven against the suggested one."""

    HELP = "Lines with - were driven, lines with + are suggested. Nothing is written to the robot."

    def compose(self) -> ComposeResult:
        yield Static(Content("Configuration as driven (-) against suggested (+)"), classes="title")
        yield Lines(None if self.diagnosis.fix else render.no_fix_rows(self.diagnosis), id="diff")

    def show(self, diff: str | CareError) -> None:
        rows = render.error_rows(diff) if isinstance(diff, CareError) else render.diff_rows(diff)
        self.query_one(Lines).show(rows)


class ReportStep(Step):
    """The fix report as it will be written."""

    HELP = "The report as it will be written. f changes the format, e writes it to a file."

    def compose(self) -> ComposeResult:
        yield Static(classes="title", markup=False)
        yield Lines(id="report")

    def show(self, report: str | CareError) -> None:
        rows = render.error_rows(report) if isinstance(report, CareError) else render.plain_rows(report)
        self.query_one(Lines).show(rows)

    def entitle(self, format: ReportFormat, written: str = "") -> None:
        """Say which format is shown, and where the report was written."""
        label = {"yaml": "YAML", "markdown": "Markdown", "json": "JSON"}[format]
        tail = f"written to {clean(written)}" if written else "e writes it to a file, f changes the format"
        self.query_one(".title", Static).update(Content.assemble(f"Report as {label}", (f"  {tail}", "dim")))
