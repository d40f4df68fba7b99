"""What the pages of the six steps share: the session, and what to show before there is a diagnosis."""

from __future__ import annotations

from abc import abstractmethod
from typing import ClassVar

from textual.content import Content

from care_tui.pages.page import Page, View, sentence
from care_tui.render.rows import Rows, error_rows, labelled, progress_bar
from care_tui.session import Session


class StepPage(Page):
    """One step of the walk."""

    @property
    def session(self) -> Session:
        return self.walk.session


class DiagnosisPage(StepPage):
    """A step that needs a diagnosis: says so while there is none."""

    NOTHING: ClassVar[str] = ""
    """What there is not where no profile fits; empty for a step that has something to show all the same."""

    def works(self, action: str) -> bool:
        return super().works(action) and self.session.state == "data" and not self._is_empty

    @property
    def _is_empty(self) -> bool:
        return bool(self.NOTHING) and self.session.diagnosis.profile.fit.verdict == "no"

    def view(self) -> View:
        session = self.session
        if session.state == "data" and self._is_empty:
            why = f"No profile fits this log, so {self.NOTHING}. 1 tells what happened, and what would make one fit."
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
