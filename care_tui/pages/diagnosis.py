"""What the pages of a diagnosis share: what to show while there is none, and how Enter leads on."""

from __future__ import annotations

from typing import ClassVar

from textual.binding import Binding
from textual.content import Content

from care_core.errors import LogError
from care_core.text import clean
from care_core.variables import Variable
from care_tui.page_names import NAMES, PAGES
from care_tui.pages.page import Page, View, sentence
from care_tui.render.fix import known_rows
from care_tui.render.rows import Row, Rows, error_rows, labelled
from care_tui.session import Session


class DiagnosisPage(Page):
    """A step that needs a diagnosis: says so while there is none, or why it has nothing."""

    NAME: ClassVar[str]
    NOTHING: ClassVar[str] = ""
    """What there is not where nothing is judged."""

    def view(self) -> View:
        session, title = self.session, Content(PAGES[self.NAME].title)
        if session.state == "data":
            if self.NAME not in session.empty_steps():
                return self.view_of_diagnosis()
            return View(title, lambda _: sentence(f"{_why(session)}, so {self.NOTHING}. 1 tells what happened."))
        if session.error is not None:
            return View(title, lambda _: failure_rows(session))
        says = "No log is open. L leads to the logs." if session.state == "empty" else "The log is being read."
        return View(title, lambda _: sentence(says))

    def view_of_diagnosis(self) -> View:
        """What to show once there is one."""
        raise NotImplementedError

    @property
    def has_content(self) -> bool:
        """Whether keys of this page have something to work on."""
        return self.session.state == "data" and self.NAME not in self.session.empty_steps()

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Keys of this page do nothing where it has nothing to show; Enter leads on."""
        own = f"action_{action}" in vars(type(self))
        return self.has_content if own and action != "open" else super().check_action(action, parameters)

    def option_here(self) -> Variable | None:
        """The option under the cursor."""
        return None

    def help_first(self) -> list[Row]:
        option = self.option_here() if self.session.state == "data" else None
        return [] if option is None else known_rows(option, self.session.diagnosis.run)

    @property
    def _next(self) -> str:
        """The next step that has something to show."""
        empty = self.session.empty_steps()
        return next(name for name in (*NAMES[NAMES.index(self.NAME) + 1 :], "report") if name not in empty)

    def label(self, binding: Binding) -> str:
        return PAGES[self._next].title if binding.action == "open" else super().label(binding)

    def go_on(self) -> None:
        """To the next step that has something to show."""
        self.go(self._next)

    def action_open(self) -> None:
        """Go on."""
        self.go_on()


def _why(session: Session) -> str:
    """Why nothing is judged: a profile that is missing comes before a mission that was not flown."""
    fit = session.diagnosis.profile.fit
    if fit.verdict == "no":
        return f"No profile fits this log ({clean(fit.reasons[0])})" if fit.reasons else "No profile fits this log"
    return "No mission was flown"


def failure_rows(session: Session) -> Rows:
    """Why there is no diagnosis, and what can still be looked at."""
    if session.error is None:
        return Rows([])
    rows = error_rows(session.error).rows
    holds = session.is_readable and not isinstance(session.error, LogError)  # of what cannot be read v knows no more
    return Rows([*rows, labelled("", "v shows what the log holds")] if holds else rows)
