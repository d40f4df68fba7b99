"""The walk from the log to the report: owns the place in it and the session."""

from __future__ import annotations

import os
import tempfile
from functools import partial
from pathlib import Path
from typing import ClassVar

from textual import on
from textual.app import ComposeResult
from textual.binding import Binding, BindingType

from care_core.application.case import Case, Request
from care_core.diagnose.records import Fix
from care_core.ecosystems.findings import Health
from care_core.errors import CareError
from care_core.records import Record, replace
from care_tui.clipboard import fits, osc52
from care_tui.jobs import CAUSES, Engine, Job
from care_tui.messages import Progressed, StepChosen
from care_tui.pages.account import AccountPage
from care_tui.pages.causes import CausesPage
from care_tui.pages.diff import DiffPage
from care_tui.pages.fix import FixPage
from care_tui.pages.log import LogPage
from care_tui.pages.objectives import ObjectivesPage
from care_tui.pages.page import Page
from care_tui.pages.report import ReportPage
from care_tui.pages.step import StepPage
from care_tui.places import remember
from care_tui.render.health import standing
from care_tui.render.rows import Glyphs
from care_tui.screens.panes import PanesScreen
from care_tui.session import Session
from care_tui.settings import Settings
from care_tui.widgets.pinned import Pinned
from care_tui.widgets.step_bar import STEPS, StepBar

PAGES: tuple[type[StepPage], ...] = (LogPage, ObjectivesPage, CausesPage, FixPage, DiffPage, ReportPage)
LOG, OBJECTIVES = 1, 2
VIEWS = {
    "graph": "The causal model around the fault",
    "messages": "What the robot's software said",
    "signals": "Plots of the signals behind the metrics",
    "history": "Past runs with trends, two side by side",
    "profiles": "The installed profiles and their model cards",
    "contents": "What the log holds: channels, parameters, damage",
    "missions": "The missions of the log with their verdicts",
}

NEED_A_DIAGNOSIS = {"graph", "messages", "signals", "missions"}
NEED_A_LOG = {*NEED_A_DIAGNOSIS, "contents"}
FOLLOW = {"graph", "history"}
"""Made anew each time: one follows what the operator looks at, the other what was remembered since."""


class Place(Record):
    """Where the operator stands: a step, or a view beside it, and the item under the cursor."""

    step: int
    view: Page | None = None
    index: int | None = None


class WalkScreen(PanesScreen):
    """Six steps, and views beside them. Enter leads on, Esc leads back, one key leads to any of them from anywhere."""

    BINDINGS: ClassVar[list[BindingType]] = [
        *(
            Binding(str(number), f"go({number})", "Jump to a step", show=False, id=f"step.{name.lower()}")
            for number, name in enumerate(STEPS, start=1)
        ),
        Binding("f2,w", "view('graph')", "Causal graph", show=False, id="view.graph"),
        Binding("f3,m", "view('messages')", "Messages of the log", show=False, id="view.messages"),
        Binding("f4,p", "view('signals')", "Plots of signals", show=False, id="view.signals"),
        Binding("f5,y", "view('history')", "History", show=False, id="view.history"),
        Binding("f6,b", "view('profiles')", "Profiles", show=False, id="view.profiles"),
        Binding("f7,v", "view('contents')", "Contents of the log", show=False, id="view.contents"),
        Binding("left,h,backspace", "do('step_back')", "Back a step", key_display="h", id="graph.back"),
        Binding("plus,right_square_bracket", "do('closer')", "Zoom in", key_display="+", id="signals.closer"),
        Binding("minus,left_square_bracket", "do('farther')", "Zoom out", key_display="-", id="signals.farther"),
        Binding("x", "do('mark')", "Compare", id="history.mark"),
        Binding("n", "do('next_marked')", "Next marked", id="messages.next"),
        Binding("f8,t", "view('missions')", "Missions of the log", show=False, id="view.missions"),
        Binding("right,l", "move(1)", "Next step", show=False, id="step.next"),
        Binding("left,h", "move(-1)", "Previous step", show=False, id="step.previous"),
        Binding("o", "do('pick')", "Other log", id="log.pick"),
        Binding("r", "do('again')", "Read again", show=False, id="log.again"),
        Binding("R", "do('rescan')", "Look for logs again", show=False, id="log.rescan"),
        Binding("equals_sign,i", "do('type_threshold')", "Threshold", key_display="=", id="objectives.threshold"),
        Binding("d", "do('dismiss')", "Set aside", id="causes.dismiss"),
        Binding("o", "do('next_fault')", "Next fault", show=False, id="causes.next-fault"),
        Binding("space", "do('toggle')", "Tick", key_display="space", id="fix.toggle", priority=True),
        Binding("plus,right_square_bracket", "do('nudge_up')", "More", key_display="+", id="fix.more"),
        Binding("minus,left_square_bracket", "do('nudge_down')", "Less", key_display="-", id="fix.less"),
        Binding("equals_sign,i", "do('type_value')", "Value", key_display="=", id="fix.value"),
        Binding("a", "do('alternative')", "Alternative", id="fix.alternative"),
        Binding("s", "do('suggestion')", "Suggestion", show=False, id="fix.suggestion"),
        Binding("u", "do('undo')", "Undo", show=False, id="fix.undo"),
        Binding("f", "do('other_side')", "Compare with file", id="diff.side"),
        Binding("c", "do('copy_diff')", "Copy", id="diff.copy"),
        Binding("f", "do('next_format')", "Format", id="report.format"),
        Binding("e", "do('export')", "Export", show=False, id="report.export"),
        Binding("c", "do('copy_commands')", "Copy commands", id="report.copy"),
    ]

    def __init__(
        self,
        engine: Engine,
        settings: Settings,
        glyphs: Glyphs,
        *,
        request: Request | None = None,
    ) -> None:
        super().__init__(glyphs)
        self.engine = engine
        self.settings = settings
        self.session = Session()
        self.step = LOG
        self._pages = tuple(page(self) for page in PAGES)
        self._account = AccountPage(self)
        self._causes = next(page for page in self._pages if isinstance(page, CausesPage))
        self._view: Page | None = None
        self._views: dict[str, Page] = {"logs": self._pages[0]}
        """Views of this log that were opened before: what they read of it is kept."""
        self._left_at: dict[str, int | None] = {}
        """The item that was under the cursor when a view was left."""
        self._visited: list[Place] = []
        self._request = request

    def compose_body(self) -> ComposeResult:
        yield StepBar(self.glyphs)
        yield Pinned(self.glyphs.more)
        yield from super().compose_body()

    def on_mount(self) -> None:
        if self._request is not None:
            self._read(self._request)
        else:
            self._show(Place(LOG))

    @property
    def page(self) -> Page:
        if self._view is None and self.step == LOG and self.session.state == "data":
            return self._account
        return self._view or self._pages[self.step - 1]

    # Moving through the steps and views

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        if action == "move":
            return self._view is None and LOG <= self.step + int(str(parameters[0])) <= len(STEPS)
        if action == "do" and parameters == ("toggle",):  # a priority key must leave the space bar to what is typed
            return super().check_action(action, parameters) and self.focused is self.choices
        return super().check_action(action, parameters)

    @property
    def _index(self) -> int | None:
        """The item under the cursor, None where the page has no list."""
        return self.choices.highlighted if self.choices.display else None

    def _show(self, place: Place) -> None:
        self._left_at |= {name: self._index for name, view in self._views.items() if view is self._view}
        self.step, self._view = place.step, place.view
        with self.app.batch_update():
            self._mark()
            self._pin()
            self.turn_to_page(place.index)

    def _mark(self) -> None:
        path = self.session.path
        self.query_one(StepBar).mark(
            self.step, "" if path is None else path.name, None if self._view is None else self._view.name
        )

    def _pin(self) -> None:
        case = self.session.case
        self.query_one(Pinned).show([] if case is None else standing(case.diagnosis, self.glyphs))

    def _go(self, place: Place) -> None:
        """Show another place; Esc leads back to this one, as it is now."""
        self._visited.append(Place(self.step, self._view, self._index))
        self._show(place)

    def action_go(self, step: int) -> None:
        if step != self.step or self._view is not None:
            self._go(Place(step))

    def action_move(self, by: int) -> None:
        self.action_go(self.step + by)

    def leave(self) -> None:
        if self._visited and (self._view is not None or self.session.state != "loading"):
            self._show(self._visited.pop())
        elif self.session.state == "loading":
            self._stop_reading()

    def action_view(self, name: str, moment_s: float | None = None) -> None:
        """Turn to a page beside the walk, at this moment of the log, else at that of what is under the cursor."""
        session = self.session
        if name in NEED_A_LOG and not session.is_readable:
            self.say("Open a log first: 1 leads to them.")
        elif name in NEED_A_DIAGNOSIS and session.case is None:
            self.say("This log has no diagnosis; v shows what it holds.")
        elif self._view is None or self._view is not self._views.get(name):
            moment_s = self.page.moment_s() if moment_s is None else moment_s
            view = self._view_of(name)
            if moment_s is not None:
                view.look_at(moment_s)
            self._go(
                Place(self.step, view, self._left_at.get(name) if moment_s is None and name not in FOLLOW else None)
            )

    def _view_of(self, name: str) -> Page:
        from care_tui.pages.views import view_of

        if name not in self._views or name in FOLLOW:
            self._views[name] = view_of(name, self, self.session, self._subject())
        return self._views[name]

    def _subject(self) -> str | None:
        """The variable that the operator is looking at: the cause under the cursor, else the objective."""
        session, index = self.session, self.choices.highlighted
        if session.case is None:
            return None
        option = self._causes.option_at(index) if self.page is self._causes else None
        if option is not None:
            return option
        return None if session.result is None else session.result.variable.name

    @on(StepChosen)
    def _step_chosen(self, event: StepChosen) -> None:
        event.stop()
        self.action_go(event.step)

    # Reading a log

    def again(self) -> None:
        """Read the log again, after an error or a change."""
        if self._request is not None:
            self._read(self._request)

    def diagnose_mission(self, index: int) -> None:
        """Diagnose another mission of the log, from 1."""
        assert self._request is not None
        self._read(replace(self._request, mission=index))

    def judge_by(self, objective: str, bound: float | None) -> None:
        """Judge the log again with another threshold of an objective; None: that of the profile."""
        assert self._request is not None
        others = {name: value for name, value in self._request.thresholds.items() if name != objective}
        bounds = others if bound is None else {**others, objective: bound}
        self._read(replace(self._request, thresholds=bounds), step=self.step, objective=objective)

    def open_log(self, path: Path) -> None:
        """Diagnose a log, asked for as the one before; what was chosen for that one is gone."""
        # A mission and a good log belong to the log that they were named for.
        asked = self._request
        is_other = asked is not None and asked.log.absolute() != path.absolute()
        self._read(
            Request(path, top=CAUSES)
            if asked is None
            else replace(asked, log=path, mission=None if is_other else asked.mission)
        )

    def _read(self, request: Request, *, step: int = LOG, objective: str | None = None) -> None:
        """Read and judge a log; the operator waits at `step`, and comes back to `objective`."""
        self._request = request
        self.session = Session(path=request.log.absolute(), progress=("starting", 0.0), looked_at=objective)
        self._visited.clear()
        self._left_at.clear()
        self._views = {"logs": self._pages[0]}
        self._show(Place(step))
        # After the first frame, which the imports of the work would hold up.
        self.call_after_refresh(self.fetch, "diagnose", partial(self._diagnose, request), self._opened)

    def _diagnose(self, request: Request, job: Job) -> tuple[Case, CareError | None]:
        """In the thread of the job: the answer, and why it could not be put into the history."""

        def report(step: str, fraction: float) -> None:
            job.check()
            self.post_message(Progressed(step, fraction))

        case = self.engine.diagnose(request, report)
        remember(request.log)
        return case, self.engine.remember(case.diagnosis, request)

    @on(Progressed)
    def _show_progress(self, event: Progressed) -> None:
        event.stop()
        if self.session.state == "loading":
            self.session.progress = (event.step, event.fraction)
            self.draw()

    def _opened(self, answer: tuple[Case, CareError | None] | CareError) -> None:
        case, problem = (answer, None) if isinstance(answer, CareError) else answer
        self._diagnosed(case)
        if problem is not None:
            self.say(problem.message)

    def _diagnosed(self, answer: Case | CareError) -> None:
        self.app.note(answer)
        if isinstance(answer, CareError):
            self.session.error = answer
            self.draw()
            return
        self.session.take(answer)
        self._pin()
        if self._view is not None:
            self.draw()
        elif answer.diagnosis.profile.fit.verdict == "no" or _has_failed_part(answer.diagnosis.health):
            self._show(Place(self.step))  # what happened is the answer, or a part of it that comes first
        elif self.step == LOG:
            self.action_go(OBJECTIVES)
        else:
            self._show(Place(self.step))

    def _stop_reading(self) -> None:
        self.cancel("diagnose")
        self._diagnosed(CareError("The diagnosis was stopped.", hint="r starts it again, o opens another log."))

    # What the ticked changes would bring

    def basket_changed(self) -> None:
        """Predict again with the boxes as they are now."""
        session = self.session
        session.fix = session.fix_error = None
        changes, case = dict(session.basket.ticked), session.case
        assert case is not None
        self.draw()
        self.fetch("predict", lambda _job: self.engine.predict(case, changes), self._predicted)

    def _predicted(self, answer: Fix | CareError) -> None:
        session = self.session
        if isinstance(answer, CareError):
            session.fix_error = answer
        else:
            session.fix = answer
        self.page.enter()
        self.draw()

    def predict_unchanged(self) -> None:
        """What the next run would bring with the configuration as driven; asked for once."""
        case = self.session.case
        if self.session.unchanged is None and case is not None:
            self.fetch("unchanged", lambda _job: self.engine.predict(case, {}), self._unchanged_predicted)

    def _unchanged_predicted(self, answer: Fix | CareError) -> None:
        if not isinstance(answer, CareError):  # without it the probability stands alone, which is no failure
            self.session.unchanged = answer
            self.draw()

    # Copying

    def copy(self, text: str, what: str, suffix: str) -> None:
        """Send a text to the operator's clipboard, and to a file, for no terminal says whether it took it."""
        handle, name = tempfile.mkstemp(prefix="care-", suffix=suffix)
        with os.fdopen(handle, "w", encoding="utf-8") as stream:
            stream.write(text)
        if fits(text):
            self.app.write_control(osc52(text))
            self.say(f"Sent {what} to the clipboard; also in {name}")
        else:
            self.say(f"Too long for the clipboard: {what} are in {name}")


def _has_failed_part(health: Health) -> bool:
    """Whether something failed that would stop a mission, before it was down."""
    return any(one.severity == "critical" and not one.after_impact for one in health.findings)
