"""The pages beside the walk. Imported when one is asked for: none of them is needed for the first frame."""

from __future__ import annotations

from care_tui.pages.contents import ContentsPage
from care_tui.pages.graph import GraphPage
from care_tui.pages.history import HistoryPage
from care_tui.pages.messages import MessagesPage
from care_tui.pages.missions import MissionsPage
from care_tui.pages.page import Page
from care_tui.pages.profiles import ProfilesPage
from care_tui.pages.signals import SignalsPage
from care_tui.screens.panes import PanesScreen
from care_tui.session import Session


def view_of(name: str, screen: PanesScreen, session: Session, subject: str | None) -> Page:
    """The page of that name for the log that is open; `subject` is the variable that the operator looks at."""
    case, log = session.case, session.path
    if name == "history":
        return HistoryPage(screen)
    if name == "profiles":
        return ProfilesPage(screen, None if case is None else case.diagnosis.profile.name)
    if name == "contents":
        assert log is not None
        return ContentsPage(screen, log)
    assert case is not None
    if name == "missions":
        return MissionsPage(screen, case)
    if name == "graph":
        return GraphPage(screen, case, subject)
    return MessagesPage(screen, case) if name == "messages" else SignalsPage(screen, case)
