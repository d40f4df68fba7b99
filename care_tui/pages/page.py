"""A page: a list and the text about the item under its cursor, or one of both; its keys are its own bindings."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar, TypeVar

from textual import on
from textual.app import ComposeResult
from textual.binding import ActiveBinding, Binding, BindingType
from textual.containers import Container
from textual.content import Content
from textual.events import Resize
from textual.worker import get_current_worker

from care_core.application.proof import Subject
from care_core.errors import CareError
from care_core.records import Record
from care_core.text import clean
from care_tui.engine import CancelledError, as_care_error
from care_tui.messages import Answered, Go
from care_tui.render.rows import Glyphs, Row, Rows, cut, error_rows
from care_tui.session import Session
from care_tui.widgets.choices import NOTHING, Choices, Listing
from care_tui.widgets.reader import Reader
from care_tui.workspace import Workspace

T = TypeVar("T")


def sentence(words: str) -> Rows:
    """A text of one sentence."""
    return Rows([Row(Content(words))])


class View(Record):
    """What a page shows now: a title, a list (may be empty), and the text about the item under the cursor."""

    title: Content
    detail: Callable[[int | None], Rows]
    listing: Listing = NOTHING
    index: int | None = None
    about: str = ""
    """Title of the text, where it has one of its own."""


class Page(Container):
    """Shows its `view`, and keeps its cursor and its filter while another page is looked at."""

    HELP: ClassVar[str]
    FITS: ClassVar[bool] = False
    """Whether the text is made for the size of its pane."""
    OPENS_ITEM: ClassVar[bool] = False
    """Whether Enter opens the item under the cursor, and does nothing without one."""
    BINDINGS: ClassVar[list[BindingType]] = []

    def __init__(self, workspace: Workspace, *, id: str | None = None) -> None:
        super().__init__(id=id)
        self.workspace = workspace
        self._own_session = workspace.session
        self._view = View(Content(), lambda _: Rows([]))
        self._answers: dict[str, object] = {}
        self._asked: set[str] = set()

    def compose(self) -> ComposeResult:
        yield Choices(self.glyphs, id="list")
        yield Reader(self.glyphs, id="text")

    @property
    def session(self) -> Session:
        """That of the log that the page was made for: another log has other pages."""
        return self._own_session

    @property
    def glyphs(self) -> Glyphs:
        return self.workspace.glyphs

    @property
    def choices(self) -> Choices:
        return self.query_one("#list", Choices)

    @property
    def reader(self) -> Reader:
        return self.query_one("#text", Reader)

    @property
    def index(self) -> int | None:
        """The item under the cursor, None where the page has no list."""
        return self.choices.index if self.choices.display else None

    @property
    def title(self) -> str:
        """What the page is about now."""
        return self._view.title.plain

    # What a page says of itself

    def view(self) -> View:
        """What to show now."""
        raise NotImplementedError

    def enter(self) -> None:
        """The page comes into view."""

    def moved(self, index: int) -> None:
        """The cursor came to an item."""

    def moment_s(self) -> float | None:
        """When what is under the cursor happened, seconds of the log; None where it has no time."""
        return None

    def subject(self) -> Subject | None:
        """What is under the cursor, where a signal of the log may prove it."""
        return None

    def look_at(self, moment_s: float | None, subject: Subject | None) -> None:
        """Show what was at this moment, or what proves this, where the page can."""

    def label(self, binding: Binding) -> str:
        """What a key of the page does now, in a word or two."""
        return binding.description

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Enter is no key of a page whose list is empty."""
        if action == "open" and self.OPENS_ITEM:
            return self.index is not None
        return super().check_action(action, parameters)

    def help_first(self) -> list[Row]:
        """What the help begins with: of what stands under the cursor."""
        return []

    # Showing it

    def show(self, index: int | None = None) -> None:
        """Show what the page holds now, with the cursor on `index`, else where the page wants it, else where it was."""
        view, choices = self.view(), self.choices
        self._view = view
        with self.app.batch_update():
            choices.display = view.listing.count > 0
            choices.show(view.listing, next((i for i in (index, view.index, choices.index) if i is not None), None))
            self._show_titles()
            self._show_text(view)
            focused = self.screen.focused
            if focused is None or not focused.display or (focused is self.reader and choices.display):
                self.take_focus()
        if self.OPENS_ITEM:
            self.refresh_bindings()

    def show_text(self, *, from_top: bool = True) -> None:
        """Show the text about the item under the cursor."""
        self._view = self.view()
        self._show_titles()
        self._show_text(self._view, from_top=from_top)

    def _show_text(self, view: View, *, from_top: bool = True) -> None:
        if self.reader.has_room or not self.FITS:  # else it is drawn when its size is known
            self.reader.show(view.detail(self.index), from_top=from_top)

    def _show_titles(self) -> None:
        """Titles are in the frames of the panes; that of the page on the first of them."""
        choices, reader = self.choices, self.reader
        first, about = self._view.title, Content(clean(self._view.about))
        for pane, title in ((choices, first), (reader, about if choices.display else first)):
            room = (pane.outer_size.width or self.app.size.width) - 6
            shown = cut(title, room, self.glyphs).markup
            if pane.border_title != shown:
                pane.border_title = shown

    def take_focus(self) -> None:
        """Focus the list where there is one, else the text."""
        self.screen.set_focus(self.choices if self.choices.display else self.reader, scroll_visible=False)

    def filter(self, words: str) -> None:
        """Show only what holds these words."""
        if self.choices.display:
            if self.choices.filter(words):
                self._follow_cursor()
        else:
            self.reader.filter(words)

    def say(self, words: str) -> None:
        """Tell something in passing."""
        self.app.notify(clean(words), timeout=4, markup=False)

    @on(Choices.Moved, "#list")
    def _follow(self, event: Choices.Moved) -> None:
        event.stop()
        self._follow_cursor()

    def _follow_cursor(self) -> None:
        index = self.index
        if index is not None:
            self.moved(index)
        self.show_text()

    @on(Choices.Chosen, "#list")
    async def _chosen(self, event: Choices.Chosen) -> None:
        """A click goes on where the cursor was there already."""
        event.stop()
        await self.run_action("open")

    @on(Reader.Fitted)
    def _fit(self, event: Reader.Fitted) -> None:
        event.stop()
        if self.FITS:
            self.show_text(from_top=False)
        else:
            self._show_titles()

    def on_resize(self, _event: Resize) -> None:
        self._show_titles()

    # Work outside the event loop

    def ask(self, question: str, work: Callable[[], object]) -> None:
        """Have a thread answer a question; an answer that is still to come to the same question is dropped."""
        self.workers.cancel_group(self, question)
        self.run_worker(lambda: self._answer(question, work), group=question, thread=True, exit_on_error=False)

    def _answer(self, question: str, work: Callable[[], object]) -> None:
        worker = get_current_worker()
        try:
            answer: object = work()
        except CancelledError:
            return
        except Exception as err:
            answer = as_care_error(err)
        if not worker.is_cancelled:
            self.post_message(Answered(question, answer))

    @on(Answered)
    def _take(self, event: Answered) -> None:
        event.stop()
        self.take(event.question, event.answer)

    def take(self, question: str, answer: object) -> None:
        """An answer has come: keep it, and show the page with it."""
        self._answers[question] = answer
        if self.display:
            self.show()

    def fetched(self, question: str, work: Callable[[], T]) -> T | CareError | None:
        """The answer to a question that is asked once; None until it is there."""
        if question not in self._asked:
            self._asked.add(question)
            self.ask(question, work)
        return self._answers.get(question)  # type: ignore[return-value]

    def has_answer(self, question: str) -> bool:
        """Whether the answer is there, though it may be none."""
        return question in self._answers

    def forget(self, question: str) -> None:
        """Ask it again the next time."""
        self._asked.discard(question)
        self._answers.pop(question, None)

    def go(self, page: str, moment_s: float | None = None, subject: Subject | None = None) -> None:
        """Have another page turned to."""
        self.post_message(Go(page, moment_s, subject))


def label_of(active: ActiveBinding) -> str:
    """What a key does now, in a word or two."""
    return active.node.label(active.binding) if isinstance(active.node, Page) else active.binding.description


def view_of(title: str, answer: T | CareError | None, show: Callable[[T], View]) -> View:
    """The view of an answer, of the error, or of the wait for either."""
    if answer is None:
        return View(Content(title), lambda _: sentence("Loading..."))
    if isinstance(answer, CareError):
        return View(Content(title), lambda _: error_rows(answer))
    return show(answer)


OPEN = "page.open"
"""The id of Enter, whatever it leads to."""


def enter_to(words: str, action: str = "open") -> Binding:
    """Enter, with where it leads in a word."""
    return Binding("enter", action, words, key_display="enter", id=OPEN)
