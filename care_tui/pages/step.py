"""What the pages of the six steps share: the session, and what to show before there is a diagnosis."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar

from textual.content import Content

from care_core.variables import Variable
from care_tui.pages.page import Page, View, sentence
from care_tui.render.fix import known_rows
from care_tui.render.rows import Row, Rows, error_rows, labelled, progress_bar
from care_tui.session import Session


class StepPage(Page):
    """One step of the walk."""

    @property
    def session(self) -> Session:
        return self.walk.session


class DiagnosisPage(StepPage):
    """A step that needs a diagnosis: says so while there is none."""

    NOTHING: ClassVar[str] = ""
    """What there is not where nothing is judged; empty for a step that has something to show all the same."""
    NEEDS_MISSION: ClassVar[bool] = False
    """Whether a flight without a mission leaves nothing to show either."""

    def option_here(self) -> Variable | None:
        """The option under the cursor."""
        return None

    def help_first(self) -> list[Row]:
        option = self.option_here() if self.session.state == "data" else None
        return [] if option is None else known_rows(option, self.session.diagnosis.run)

    def works(self, action: str) -> bool:
        return super().works(action) and self.session.state == "data" and not self._is_empty

    @property
    def _is_empty(self) -> bool:
        """Whether nothing is judged that this step could show."""
        return bool(self._unjudged)

    @property
    def _unjudged(self) -> str:
        """Why this step has nothing to show; empty where it has something."""
        diagnosis = self.session.diagnosis
        if self.NOTHING and diagnosis.profile.fit.verdict == "no":
            return f"No profile fits this log, so {self.NOTHING}. 1 tells what happened, and what would make one fit."
        if self.NEEDS_MISSION and diagnosis.run.checks:
            return f"No mission was flown, so {self.NOTHING}. 1 tells what happened."
        return ""

    def view(self) -> View:
        session = self.session
        if session.state == "data" and self._is_empty:
            why = self._unjudged
            return View(Content.styled(self.name, "bold"), lambda _: sentence(why))
        if session.state == "data":
            return self.view_of_diagnosis()
        title = Content.styled(self.name, "bold")
        if session.error is not None:
            return View(title, lambda _: failure_rows(session))
        if session.state == "empty":
            return View(title, lambda _: sentence("No log is open. 1 leads to the logs."))
        step, fraction = session.progress or ("starting", 0.0)
        bar = progress_bar(fraction, self.glyphs)
        return View(title, lambda _: Rows([labelled("Doing", step), labelled("Done", bar)]))

    @abstractmethod
    def view_of_diagnosis(self) -> View:
        """What to show once there is one."""


def failure_rows(session: Session) -> Rows:
    """Why there is no diagnosis, and what can still be looked at."""
    if session.error is None:
        return Rows([])
    rows = error_rows(session.error).rows
    return Rows([*rows, labelled("", "v shows what the log holds")] if session.is_readable else rows)
