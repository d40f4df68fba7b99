"""The walk from the objectives to the report: owns the place in it and what was chosen on the way."""

from __future__ import annotations

from pathlib import Path
from typing import ClassVar

from textual import on, work
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.widgets import ContentSwitcher

from care_core.diagnose.records import Diagnosis
from care_core.errors import CareError
from care_tui.jobs import SUFFIXES, Engine, ReportFormat, as_care_error, fixes, with_fix
from care_tui.messages import (
    CauseChosen,
    DiffReady,
    FixChosen,
    ObjectiveChosen,
    ReportReady,
    StepChosen,
)
from care_tui.render import Glyphs
from care_tui.screens.base import CareScreen
from care_tui.screens.export import ExportDialog
from care_tui.widgets.key_hints import KeyHints
from care_tui.widgets.step_bar import STEPS, StepBar
from care_tui.widgets.steps import CausesStep, DiffStep, FixStep, ObjectivesStep, ReportStep, Step

OBJECTIVES, CAUSES, FIX, DIFF, REPORT = range(1, len(STEPS) + 1)
FORMATS: tuple[ReportFormat, ...] = ("yaml", "markdown", "json")


class DiagnosisScreen(CareScreen):
    """Five steps; Enter leads on, Esc leads back, digits jump."""

    AUTO_FOCUS = ""
    BINDINGS: ClassVar[list[BindingType]] = [
        *(
            Binding(str(number), f"go({number})", "Jump to a step", show=False, id=f"step.{name.lower()}")
            for number, name in enumerate(STEPS, start=1)
        ),
        Binding("right,l", "move(1)", "Next step", show=False, id="step.next"),
        Binding("left,h", "move(-1)", "Previous step", show=False, id="step.previous"),
        Binding("enter", "move(1)", "Next step", key_display="enter", id="step.on"),
        Binding("escape", "back", "Back", id="step.back"),
        Binding("o", "next_fault", "Next fault", show=False, id="causes.next-fault"),
        Binding("f", "next_format", "Format", id="report.format"),
        Binding("e", "export", "Export", id="report.export"),
    ]

    def __init__(self, diagnosis: Diagnosis, engine: Engine, glyphs: Glyphs) -> None:
        super().__init__()
        self.diagnosis = diagnosis
        self._engine = engine
        self._glyphs = glyphs
        self._visited: list[int] = []
        self._fix = 0
        self._format: ReportFormat = "yaml"
        self.step = OBJECTIVES
        statuses = [result.status for result in diagnosis.objectives]
        self._objective = statuses.index("fault") if "fault" in statuses else 0

    def compose_body(self) -> ComposeResult:
        diagnosis, glyphs = self.diagnosis, self._glyphs
        yield StepBar(Path(diagnosis.run.log.path).name, glyphs)
        with ContentSwitcher(initial="step-1"):
            yield ObjectivesStep(diagnosis, glyphs, id="step-1")
            yield CausesStep(diagnosis, glyphs, id="step-2")
            yield FixStep(diagnosis, glyphs, id="step-3")
            yield DiffStep(diagnosis, glyphs, id="step-4")
            yield ReportStep(diagnosis, glyphs, id="step-5")
        yield KeyHints()

    def on_mount(self) -> None:
        self._explain(self._objective)
        self.query_one(ReportStep).entitle(self._format)
        self._show(OBJECTIVES)
        if not fixes(self.diagnosis):
            self._compute_report()

    def help_text(self) -> str:
        return self._current().HELP

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Keys of one step work in that step only."""
        if action in ("next_format", "export"):
            return self.step == REPORT
        if action == "move":
            return OBJECTIVES <= self.step + int(str(parameters[0])) <= REPORT
        if action == "next_fault":
            return self.step == CAUSES and len(self.diagnosis.faults) > 1
        return True

    # Moving through the steps

    def _current(self) -> Step:
        return self.query_one(f"#step-{self.step}", Step)

    def _show(self, step: int) -> None:
        self.step = step
        with self.app.batch_update():
            self.query_one(StepBar).mark(step)
            self.query_one(ContentSwitcher).current = f"step-{step}"
            self._current().take_focus()
            self.refresh_bindings()

    def action_go(self, step: int) -> None:
        if step != self.step:
            self._visited.append(self.step)
            self._show(step)

    def action_move(self, by: int) -> None:
        self.action_go(self.step + by)

    def action_back(self) -> None:
        if self._visited:
            self._show(self._visited.pop())

    @on(StepChosen)
    def _step_chosen(self, event: StepChosen) -> None:
        self.action_go(event.step)

    # Choosing what to look at

    def _explain(self, objective: int) -> None:
        self._objective = objective
        results = self.diagnosis.objectives
        self.query_one(CausesStep).explain(results[objective] if results else None)

    def action_next_fault(self) -> None:
        names = [result.variable.name for result in self.diagnosis.objectives]
        faulty = sorted(names.index(fault.objective.variable.name) for fault in self.diagnosis.faults)
        self._explain(next((place for place in faulty if place > self._objective), faulty[0]))
        self.query_one(CausesStep).take_focus()

    @on(ObjectiveChosen)
    def _objective_chosen(self, event: ObjectiveChosen) -> None:
        self._explain(event.index)
        self.action_go(CAUSES)

    @on(CauseChosen)
    def _cause_chosen(self, event: CauseChosen) -> None:
        self.query_one(FixStep).choose_for(event.cause)
        self.action_go(FIX)

    @on(FixChosen)
    def _fix_chosen(self, event: FixChosen) -> None:
        self._fix = event.index
        self._compute_diff()
        self._compute_report()

    # Diff and report, made outside the event loop

    def _chosen(self) -> Diagnosis:
        return with_fix(self.diagnosis, self._fix) if fixes(self.diagnosis) else self.diagnosis

    @work(thread=True, exclusive=True, group="diff", exit_on_error=False)
    def _compute_diff(self) -> None:
        try:
            text: str | CareError = self._engine.diff(self.diagnosis.run, fixes(self.diagnosis)[self._fix])
        except Exception as err:
            text = as_care_error(err)
        self.post_message(DiffReady(text))

    @work(thread=True, exclusive=True, group="report", exit_on_error=False)
    def _compute_report(self) -> None:
        try:
            text: str | CareError = self._engine.report(self._chosen(), self._format)
        except Exception as err:
            text = as_care_error(err)
        self.post_message(ReportReady(text))

    @on(DiffReady)
    def _show_diff(self, event: DiffReady) -> None:
        self.query_one(DiffStep).show(event.text)

    @on(ReportReady)
    def _show_report(self, event: ReportReady) -> None:
        self.query_one(ReportStep).show(event.text)

    def action_next_format(self) -> None:
        self._format = FORMATS[(FORMATS.index(self._format) + 1) % len(FORMATS)]
        self.query_one(ReportStep).entitle(self._format)
        self._compute_report()

    def action_export(self) -> None:
        suffix = next(suffix for suffix, format in SUFFIXES.items() if format == self._format)
        name = f"{Path(self.diagnosis.run.log.path).stem}.care{suffix}"
        self.app.push_screen(ExportDialog(self._chosen(), Path(name), self._engine), self._exported)

    def _exported(self, path: str | None) -> None:
        if path is not None:
            self.query_one(ReportStep).entitle(self._format, written=path)
