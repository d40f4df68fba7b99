"""A screen of two panes, a list and a text, that shows one page at a time.

The widgets are made once. Going to another page changes what they hold, so only lines that differ are drawn.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

from textual import on
from textual.app import ComposeResult
from textual.binding import Binding, BindingType
from textual.containers import Container
from textual.widgets import Static

from care_core.errors import CareError
from care_tui.jobs import Job
from care_tui.messages import Fetched
from care_tui.pages.page import Page, View
from care_tui.render.rows import Glyphs, Row
from care_tui.screens.base import CareScreen
from care_tui.widgets.choices import Choices
from care_tui.widgets.filter_bar import FilterBar
from care_tui.widgets.key_hints import KeyHints
from care_tui.widgets.lines import Lines

if TYPE_CHECKING:
    from care_tui.app import CareApp

T = TypeVar("T")


class PanesScreen(CareScreen):
    """Shows the list and the text of its page, filters both, and runs the page's work outside the event loop."""

    AUTO_FOCUS = ""
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("enter", "open", "Open", key_display="enter", id="page.open"),
        Binding("escape", "back", "Back", key_display="esc", id="page.back"),
        Binding("slash", "filter", "Filter", key_display="/", id="page.filter"),
    ]
    app: CareApp

    def __init__(self, glyphs: Glyphs) -> None:
        super().__init__()
        self.glyphs = glyphs
        self._jobs: dict[str, Job] = {}

    @property
    @abstractmethod
    def page(self) -> Page:
        """The page in view."""

    def compose_body(self) -> ComposeResult:
        yield Static(classes="title", markup=False)
        with Container(id="panes"):
            yield Choices(self.glyphs.more, moved=self._show_detail, id="list")
            yield Lines(resized=self._fit_text, id="text")
        yield FilterBar()
        yield KeyHints()

    def help_text(self) -> str:
        return self.page.HELP

    def help_first(self) -> Sequence[Row]:
        return self.page.help_first()

    @property
    def choices(self) -> Choices:
        return self.query_one("#list", Choices)

    @property
    def text(self) -> Lines:
        return self.query_one("#text", Lines)

    # Showing the page

    def draw(self, *, index: int | None = None) -> None:
        """Show what the page holds now, with the cursor on `index`, else where the page wants it, else where it was."""
        view, choices = self.page.view(), self.choices
        self._put(view, next((i for i in (index, view.index) if i is not None), choices.highlighted))

    def _put(self, view: View, index: int | None) -> None:
        choices = self.choices
        with self.app.batch_update():
            self.query_one(".title", Static).update(view.title, layout=False)
            appears = view.listing.count > 0 and not choices.display
            choices.display = view.listing.count > 0
            choices.show(view.listing, index)
            self.text.show(view.detail(choices.highlighted))
            if self.focused is None or not self.focused.display or (appears and self.focused is self.text):
                self.take_focus()
            self.refresh_bindings()

    def turn_to_page(self, index: int | None = None) -> None:
        """Another page comes into view: its own filter, its own cursor, or the one it had when it was left."""
        self.say("")
        self.query_one(FilterBar).close()
        self.choices.filter("")
        self.text.filter("")
        self.page.enter()
        for share in ("most", "least"):
            self.set_class(share == self.page.LIST, f"-list-{share}")
        view = self.page.view()
        self._put(view, view.index if index is None else index)
        self.take_focus()

    def take_focus(self) -> None:
        """Focus the list where there is one, else the text."""
        (self.choices if self.choices.display else self.text).focus(scroll_visible=False)

    def _show_detail(self) -> None:
        """The cursor came to another item."""
        self.say("")
        index = self.choices.highlighted
        if index is not None:
            self.page.moved(index)
        self.text.show(self.page.view().detail(index))

    def _fit_text(self) -> None:
        """The text has more or less room than before."""
        if self.page.FITS:
            self.draw()

    @on(Choices.Chosen)
    def _open_item(self, event: Choices.Chosen) -> None:
        event.stop()
        self.page.open(event.index)

    def say(self, words: str) -> None:
        """Tell something in passing, until the operator goes on."""
        self.query_one(KeyHints).say(words)

    # Keys

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        if action == "open":
            return bool(self.page.leads_to())
        return self.page.works(str(parameters[0])) if action == "do" else True

    def described(self, binding: Binding) -> str:
        """What a key does here, in a word or two."""
        return self.page.leads_to() if binding.action == "open" else binding.description

    def action_do(self, name: str) -> None:
        """Call an action of the page; keys of another page do nothing here."""
        self.say("")
        getattr(self.page, name)()

    def action_open(self) -> None:
        self.page.open(self.choices.highlighted if self.choices.display else None)

    def action_filter(self) -> None:
        self.query_one(FilterBar).open()

    @on(FilterBar.Typed)
    def _apply_filter(self, event: FilterBar.Typed) -> None:
        event.stop()
        self._filter(event.words)

    def _filter(self, words: str) -> None:
        if self.choices.display:
            self.choices.filter(words)
            self._show_detail()
        else:
            self.text.filter(words)

    @on(FilterBar.Closed)
    def _leave_filter(self, event: FilterBar.Closed) -> None:
        event.stop()
        self.take_focus()

    def action_back(self) -> None:
        bar = self.query_one(FilterBar)
        if bar.words:
            bar.close()
            self._filter("")
        else:
            self.leave()

    @abstractmethod
    def leave(self) -> None:
        """Go back to where the operator came from."""

    # Work outside the event loop

    def fetch(self, key: str, work: Callable[[Job], T], receive: Callable[[T | CareError], None]) -> None:
        """Run `work` in a thread; its answer, or its error, goes to `receive`. New work of a key replaces the old."""
        self.cancel(key)
        job = self._jobs[key] = Job()
        job.start(work, lambda answer: self._deliver(job, receive, answer))

    def _deliver(self, job: Job, receive: Callable[[Any], None], answer: object) -> None:
        self.post_message(Fetched(job, receive, answer))

    @on(Fetched)
    def _take_answer(self, event: Fetched) -> None:
        event.stop()
        event.job.done = True
        if not event.job.cancelled:
            event.receive(event.answer)

    @property
    def is_busy(self) -> bool:
        """Whether an answer is still to come."""
        return any(not job.done for job in self._jobs.values())

    def cancel(self, key: str) -> None:
        """Stop work that is under way; what it still answers is ignored."""
        job = self._jobs.pop(key, None)
        if job is not None:
            job.cancelled = True

    def cancel_all(self) -> None:
        """Stop everything that is under way."""
        for key in tuple(self._jobs):
            self.cancel(key)

    def on_unmount(self) -> None:
        self.cancel_all()
