"""What a page is: it says what to show in the list and the text of its screen, and what keys do. It is no widget."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable
from typing import TYPE_CHECKING, ClassVar, Generic, Literal, TypeVar, cast

from textual.content import Content

from care_core.errors import CareError
from care_core.records import Record
from care_tui.render.rows import Glyphs, Row, Rows, error_rows
from care_tui.widgets.choices import NOTHING, Listing

if TYPE_CHECKING:
    from care_tui.screens.panes import PanesScreen
    from care_tui.screens.walk import WalkScreen

T = TypeVar("T")


def sentence(words: str) -> Rows:
    """A text of one sentence."""
    return Rows([Row(Content(words))])


class View(Record):
    """What a screen shows: a title, a list (may be empty), and the text beside the item under the cursor."""

    title: Content
    detail: Callable[[int | None], Rows]
    listing: Listing = NOTHING
    index: int | None = None


class Page:
    """One page of the app. `ACTIONS` names the methods that keys of this page call."""

    name: ClassVar[str]
    HELP: ClassVar[str]
    ENTER: ClassVar[str] = ""
    """Where Enter leads, in a word for the line of keys; empty where it does nothing."""
    ACTIONS: ClassVar[frozenset[str]] = frozenset()
    LIST: ClassVar[Literal["half", "most", "least"]] = "half"
    """How much of the room the list gets."""

    FITS: ClassVar[bool] = False
    """Whether the text is made for the size of its pane."""

    def __init__(self, screen: PanesScreen) -> None:
        self.screen = screen

    @property
    def walk(self) -> WalkScreen:
        """The screen as what leads from page to page."""
        return cast("WalkScreen", self.screen)

    @property
    def is_shown(self) -> bool:
        """Whether this page is the one in view."""
        return self.screen.page is self

    @property
    def glyphs(self) -> Glyphs:
        return self.screen.glyphs

    @abstractmethod
    def view(self) -> View:
        """What to show now."""

    def enter(self) -> None:
        """The page comes into view."""

    def help_first(self) -> list[Row]:
        """What the help begins with: of what stands under the cursor."""
        return []

    def leads_to(self) -> str:
        """Where Enter leads now."""
        return self.ENTER

    def works(self, action: str) -> bool:
        """Whether a key of this page can do something now."""
        return action in self.ACTIONS

    def moved(self, index: int) -> None:
        """The cursor came to an item."""

    def open(self, index: int | None) -> None:
        """Enter was pressed, on an item where there is one."""

    def moment_s(self) -> float | None:
        """When what is under the cursor happened, seconds from the start of the log; None where it has no time."""
        return None

    def look_at(self, moment_s: float) -> None:
        """Show what was at this moment, seconds from the start of the log, where the page has an order of time."""


class Fetch(Generic[T]):
    """Something that a worker fetches once for a page, with the view for each state it can be in."""

    def __init__(self, page: Page, key: str) -> None:
        self._page = page
        self._key = key
        self._asked = False
        self.answer: T | CareError | None = None

    def start(self, work: Callable[[], T]) -> None:
        """Fetch it, unless that was done before."""
        if not self._asked:
            self._asked = True
            self._page.screen.fetch(self._key, lambda _job: work(), self._receive)

    def _receive(self, answer: T | CareError) -> None:
        self.answer = answer
        if self._page.is_shown:
            self._page.screen.draw()

    def forget(self) -> None:
        """Fetch it again the next time it is asked for."""
        self._asked, self.answer = False, None

    def view(self, title: str, show: Callable[[T], View]) -> View:
        """The view of the answer, of the error, or of the wait for either."""
        if self.answer is None:
            return View(Content(title), lambda _: sentence("Loading..."))
        if isinstance(self.answer, CareError):
            error = self.answer
            return View(Content(title), lambda _: error_rows(error))
        return show(self.answer)
