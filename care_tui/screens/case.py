"""The screen of a case: the answer under two rows of tabs, and one page at a time below."""

from __future__ import annotations

from asyncio import Lock
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, cast

from textual import on
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Horizontal
from textual.reactive import Reactive
from textual.screen import Screen
from textual.widget import Widget
from textual.widgets import ContentSwitcher, Static
from textual.worker import get_current_worker

from care_core.application.case import Case, Request
from care_core.application.history_writing import options_of
from care_core.application.proof import Subject
from care_core.diagnose.records import Fix
from care_core.diagnose.verdict import verdict_of
from care_core.ecosystems.findings import Health
from care_core.errors import CareError
from care_core.records import Record, replace
from care_core.text import clean, listed
from care_tui.engine import CancelledError, as_care_error
from care_tui.messages import Answered, Decided, Go, Judge, OpenLog, Progressed
from care_tui.page_names import LOGS, NAMES, PAGES, STEPS, VIEWS
from care_tui.pages.logs import Known, LogsPage
from care_tui.pages.making import make_page
from care_tui.pages.page import Page, label_of
from care_tui.places import remember
from care_tui.render.rows import without_middle
from care_tui.session import Session
from care_tui.widgets.answer_bar import AnswerBar
from care_tui.widgets.filter_bar import FilterBar
from care_tui.widgets.keys import Keys
from care_tui.widgets.tab_row import TabRow
from care_tui.workspace import Workspace, left_out

if TYPE_CHECKING:
    from care_tui.app import CareApp

MIN_WIDTH, MIN_HEIGHT = 60, 20
WIDE, WIDEST = 120, 160
"""From these widths on list and text stand side by side, and then cause, proof and fix."""
ROOMY = 30
"""From this height on panes have a frame, below it only a line above."""
STEPS_WIDTH, SHORTEST_NAME = 59, 12
"""Cells that the tabs of the steps take, and below which the name of a log tells nothing."""
_SETTLED_S = 0.001
"""What a step changes is drawn after so long: by then every widget has said what it wants painted."""
DIAGNOSIS, PREDICTION = "diagnosis", "prediction"


class Place(Record):
    """Where the operator stood: a page, and the item under the cursor."""

    page: str
    index: int | None


class CaseScreen(Screen[None]):
    """Turns from page to page, and reads, judges and asks what they want read, judged and asked."""

    AUTO_FOCUS = ""
    focused: Reactive[Widget | None] = Reactive(None, repaint=False)
    """Without a repaint of the whole screen: the frames of the panes tell which is focused."""
    # Textual declares both as instance variables, so they cannot be ClassVar here.
    HORIZONTAL_BREAKPOINTS = [(0, "-too-narrow"), (MIN_WIDTH, "-narrow"), (WIDE, "-wide"), (WIDEST, "-widest")]  # noqa: RUF012
    VERTICAL_BREAKPOINTS = [(0, "-too-low"), (MIN_HEIGHT, "-low"), (ROOMY, "-tall")]  # noqa: RUF012
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("escape", "back", "Back", key_display="esc", id="page.back"),
        Binding("slash", "filter", "Filter", show=False, key_display="/", id="page.filter"),
        *(
            Binding(page.keys, f"go('{page.name}')", page.title, show=False, id=page.binding)
            for page in (*STEPS, *VIEWS, LOGS)
        ),
        Binding("right,l", "move(1)", "Next step", show=False, id="step.next"),
        Binding("left,h", "move(-1)", "Previous step", show=False, id="step.previous"),
        Binding("tab", "app.focus_next", "Next pane", show=False, id="screen.next-pane"),
        Binding("shift+tab", "app.focus_previous", "Previous pane", show=False, id="screen.previous-pane"),
    ]

    def __init__(self, workspace: Workspace) -> None:
        super().__init__()
        self.workspace = workspace
        self.here = "logs"
        self._visited: list[Place] = []
        self._serial = 0
        """Pages of another log are other pages."""
        self._making = Lock()

    def compose(self) -> ComposeResult:
        too_small = f"Terminal too small: {MIN_WIDTH} x {MIN_HEIGHT} is needed. q quits."
        yield Static(too_small, id="too-small", markup=False)
        with Horizontal(id="steps"):
            yield TabRow(STEPS, pad=" ", id="step-tabs")
            yield Static(id="log-name", markup=False)
        yield TabRow(VIEWS, id="view-tabs")
        yield AnswerBar(self.workspace.glyphs)
        yield ContentSwitcher(id="pages")
        yield FilterBar()
        yield Keys(self.workspace.glyphs, label_of)

    async def on_mount(self) -> None:
        request = self.workspace.request
        if request is None or self.workspace.folder is not None:
            await self._turn_to("logs")
        else:
            await self._read(request)

    @property
    def session(self) -> Session:
        return self.workspace.session

    def on_resize(self) -> None:
        self.call_after_refresh(self._fit)

    def _fit(self) -> None:
        """What is hidden loses the focus and is told of no size: a terminal that was too small for a moment has nothing
        that takes keys, and an answer for another height."""
        is_hidden = self.has_class("-too-narrow") or self.has_class("-too-low")
        if is_hidden or self.query_one(ContentSwitcher).current is None:
            return
        if self.focused is None:
            self.page.take_focus()
        self._name_log()
        self.query_one(AnswerBar).tell(self.session)

    # Turning to a page

    @property
    def page(self) -> Page:
        """The page in view."""
        return cast("Page", self.query_one(ContentSwitcher).visible_content)

    def pages(self) -> Iterator[Page]:
        yield from self.query(Page)

    def _page_id(self, name: str) -> str:
        return name if name == "logs" else f"{name}-{self._serial}"

    async def _turn_to(
        self, name: str, index: int | None = None, moment_s: float | None = None, subject: Subject | None = None
    ) -> None:
        switcher, id = self.query_one(ContentSwitcher), self._page_id(name)
        self.query_one(FilterBar).close()
        if switcher.current is not None:
            self.page.filter("")
        is_new = not switcher.query(f"#{id}")
        page = await self._made(name)
        self.here = name
        # As large as the one before at once: a size that is news would have the screen laid out and painted twice.
        page.set_reactive(Widget.virtual_size, switcher.size)
        if is_new or moment_s is not None or subject is not None:
            page.look_at(moment_s, subject)
        turning = ExitStack()
        turning.callback(self.check_idle)
        turning.enter_context(self.app.batch_update())
        switcher.current = id
        page.enter()
        page.show(index)
        page.take_focus()
        self._mark()
        self.query_one(Keys).tell(cast("Screen[object]", self))
        self.set_timer(_SETTLED_S, turning.close)

    async def _prepare(self) -> None:
        """Make the next page that the operator will turn to while there is nothing else to do, hidden."""
        switcher = self.query_one(ContentSwitcher)
        missing = [name for name in NAMES if not switcher.query(f"#{self._page_id(name)}")]
        if missing and self.session.case is not None:
            await self._made(missing[0])
            self.call_after_refresh(self._prepare)

    async def _made(self, name: str) -> Page:
        """The page of a name, made where there is none, hidden until it is turned to. One at a time: a key may ask for
        a page that is just being prepared, which must have its parts before it can show anything."""
        switcher, id = self.query_one(ContentSwitcher), self._page_id(name)
        async with self._making:
            if not switcher.query(f"#{id}"):
                page = make_page(name, self.workspace, id)
                page.display = False
                await switcher.mount(page)
            return cast("Page", switcher.get_child_by_id(id))

    def _mark(self) -> None:
        session = self.session
        empty = session.empty_steps()
        self.query_one("#step-tabs", TabRow).mark(self.here, empty)
        self.query_one("#view-tabs", TabRow).mark(self.here, [page.name for page in VIEWS if self._lacks(page.name)])
        self._name_log()
        self.query_one(AnswerBar).tell(session)

    def _name_log(self) -> None:
        """The name of the log at the end of the first row, as far as there is room."""
        session, name, room = self.session, "", self.app.size.width - STEPS_WIDTH
        if session.path is not None and room >= SHORTEST_NAME:
            name = without_middle(session.path.name, room, self.workspace.glyphs)
        shown = self.query_one("#log-name", Static)
        if shown.content != name:
            shown.update(name)

    def _lacks(self, name: str) -> str:
        """What a page needs that is not there; empty where there is all."""
        needs, session = PAGES[name].needs, self.session
        if needs == "nothing" or name in NAMES or session.case is not None:
            return ""
        if session.state == "loading":
            return "The log is still being read."
        if not session.is_readable:
            return "Open a log first: L leads to them."
        return "" if needs == "log" else "This log has no diagnosis; v shows what it holds."

    async def action_go(self, name: str) -> None:
        """Turn to a page, at the moment and the proof of what is under the cursor."""
        view = name not in NAMES and name != "logs"
        page = self.page
        await self._go(name, page.moment_s() if view else None, page.subject() if view else None)

    async def _go(self, name: str, moment_s: float | None = None, subject: Subject | None = None) -> None:
        lacks = self._lacks(name)
        if lacks:
            self.app.notify(lacks, markup=False)
        elif name != self.here or moment_s is not None or subject is not None:
            if name != self.here:
                self._visited.append(Place(self.here, self.page.index))
            await self._turn_to(name, None, moment_s, subject)

    async def action_move(self, by: int) -> None:
        await self._go(NAMES[NAMES.index(self.here) + by])

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        if action == "move":
            return self.here in NAMES and 0 <= NAMES.index(self.here) + int(str(parameters[0])) < len(NAMES)
        return action != "back" or self._leads_back

    @on(Go)
    async def _wanted(self, event: Go) -> None:
        event.stop()
        await self._go(event.page, event.moment_s, event.subject)

    @on(TabRow.Chosen)
    async def _tab_chosen(self, event: TabRow.Chosen) -> None:
        event.stop()
        await self.action_go(event.page)
        self._mark()

    async def action_back(self) -> None:
        bar = self.query_one(FilterBar)
        if bar.words:
            bar.close()
            self.page.filter("")
        elif self.session.state == "loading":
            self._stop_reading()
        elif self._visited:
            place = self._visited.pop()
            await self._turn_to(place.page, place.index)
        elif self._came_from_list:
            await self._turn_to("logs")

    @property
    def _came_from_list(self) -> bool:
        """Whether the list of a folder's logs lies behind what is in view."""
        return self.workspace.folder is not None and self.here != "logs"

    @property
    def _leads_back(self) -> bool:
        """Whether there is anything that Esc takes back."""
        # Asked of every key, the first ones before there is a filter.
        is_under_way = self.session.state == "loading" or any(bar.words for bar in self.query(FilterBar))
        return is_under_way or bool(self._visited) or self._came_from_list

    # The filter

    def action_filter(self) -> None:
        self.query_one(FilterBar).open()

    @on(FilterBar.Typed)
    def _filter(self, event: FilterBar.Typed) -> None:
        event.stop()
        self.page.filter(event.words)

    @on(FilterBar.Closed)
    def _leave_filter(self, event: FilterBar.Closed) -> None:
        event.stop()
        self.page.take_focus()

    # Reading a log

    @on(OpenLog)
    async def _open(self, event: OpenLog) -> None:
        event.stop()
        await self.open_log(event.path, event.mission)

    async def open_log(self, path: Path, mission: int | None = None) -> None:
        """Diagnose a log by what belongs to it; what was chosen for the one before is gone."""
        before, request = self.workspace.request, self.workspace.request_for(path)
        request = request if mission is None else replace(request, mission=mission)
        if before is not None and (left_behind := listed(left_out(before, request))):
            told = f"Judged by itself: {left_behind} stayed with {before.log.name}."
            self.app.notify(clean(told), markup=False)
        await self._read(request)

    @on(Judge)
    async def _judge(self, event: Judge) -> None:
        event.stop()
        await self._read(event.request, page=event.page, objective=event.objective)

    async def _read(self, request: Request, *, page: str = "log", objective: str | None = None) -> None:
        """Read and judge a log; the operator waits at `page`, and comes back to `objective`."""
        workspace = self.workspace
        workspace.request = request
        workspace.session = Session(path=request.log.absolute(), progress=("starting", 0.0), looked_at=objective)
        self._visited.clear()
        old = [one for one in self.pages() if one.id != "logs"]
        self._serial += 1
        await self._turn_to(page)
        for one in old:
            await one.remove()
        # After the first frame, which the imports of the work would hold up.
        self.call_after_refresh(self._start_reading, request)

    def _start_reading(self, request: Request) -> None:
        self.workers.cancel_group(self, DIAGNOSIS)
        self.run_worker(lambda: self._diagnose(request), group=DIAGNOSIS, thread=True, exit_on_error=False)

    def _diagnose(self, request: Request) -> None:
        """In a thread: the answer, and why it could not be put into the history."""
        worker, engine = get_current_worker(), self.workspace.engine

        def report(step: str, fraction: float) -> None:
            if worker.is_cancelled:
                raise CancelledError
            self.post_message(Progressed(request, step, fraction))

        problem: CareError | None = None
        try:
            answer: Case | CareError = engine.diagnose(request, report)
            remember(request.log)
            if isinstance(answer, Case):
                problem = engine.remember(answer.diagnosis, request)
        except CancelledError:
            return
        except Exception as err:
            answer = as_care_error(err)
        if not worker.is_cancelled:
            self.post_message(Answered(DIAGNOSIS, (answer, problem)))

    @on(Progressed)
    def _show_progress(self, event: Progressed) -> None:
        event.stop()
        if self.session.state == "loading" and event.request is self.workspace.request:
            self.session.progress = (event.step, event.fraction)
            self.query_one(AnswerBar).tell(self.session)

    @on(Answered)
    async def _answered(self, event: Answered) -> None:
        event.stop()
        if event.question == PREDICTION:
            self._predicted(event.answer)
            return
        answer, problem = event.answer
        self.session.not_remembered = problem
        await self._diagnosed(answer)
        if problem is not None:
            self.app.notify(clean(problem.message), markup=False)

    async def _diagnosed(self, answer: Case | CareError) -> None:
        cast("CareApp", self.app).note(answer)
        if isinstance(answer, CareError):
            self.session.error = answer
            self._mark()
            self.page.show()
            self.refresh_bindings()
            return
        self.session.take(answer)
        diagnosis = answer.diagnosis
        verdict = verdict_of(diagnosis)
        for logs in self.query(LogsPage):
            path = answer.log.path if answer.log else self.session.path or Path()
            with_options = options_of(self.workspace.request) if self.workspace.request else ""
            logs.learned(path, Known(verdict.status, verdict.failed, with_options))
        self.call_after_refresh(self._prepare)
        # What happened is the answer where no profile fits, or a part of it that comes first where one failed.
        stays = diagnosis.profile.fit.verdict == "no" or _has_failed_part(diagnosis.health)
        if self.here == "log" and not stays:
            await self._go("objectives")
        else:
            self.page.enter()
            self._mark()
            self.page.show()
            self.refresh_bindings()

    def _stop_reading(self) -> None:
        self.workers.cancel_group(self, DIAGNOSIS)
        self.session.error = CareError("The diagnosis was stopped.", hint="r starts it again, o opens another log.")
        cast("CareApp", self.app).note(self.session.error)
        self._mark()
        self.page.show()
        self.refresh_bindings()

    # What was decided

    @on(Decided)
    def _decide(self, event: Decided) -> None:
        """Tell what follows from the boxes and the causes as they are now."""
        event.stop()
        session = self.session
        if event.has_changed_fix and session.case is not None:
            session.fix = session.fix_error = None
            case, asked = session.weighed_case(), session.asked()
            self.workers.cancel_group(self, PREDICTION)
            self.run_worker(lambda: self._predict(case, asked), group=PREDICTION, thread=True)
        with self.app.batch_update():
            self.query_one(AnswerBar).tell(session)
            self.page.show()

    def _predict(self, case: Case, asked: Sequence[Mapping[str, float]]) -> None:
        worker, predict = get_current_worker(), self.workspace.engine.predict
        try:
            answer: list[Fix] | CareError = [predict(case, changes) for changes in asked]
        except Exception as err:
            answer = as_care_error(err)
        if not worker.is_cancelled:
            self.post_message(Answered(PREDICTION, answer))

    def _predicted(self, answer: list[Fix] | CareError) -> None:
        if isinstance(answer, CareError):
            self.session.fix_error = answer
        else:
            self.session.predicted(answer)
        with self.app.batch_update():
            self.query_one(AnswerBar).tell(self.session)
            self.page.enter()
            self.page.show()


def _has_failed_part(health: Health) -> bool:
    """Whether something failed that would stop a mission, before it was down."""
    return any(one.severity == "critical" and not one.after_impact for one in health.findings)
