"""Pages by their names. A view is imported when it is asked for: none of them is needed for the first frame."""

from __future__ import annotations

from importlib import import_module

from care_tui.pages.page import Page
from care_tui.workspace import Workspace

_CLASSES = {
    "logs": "LogsPage",
    "log": "LogPage",
    "objectives": "ObjectivesPage",
    "causes": "CausesPage",
    "fix": "FixPage",
    "diff": "DiffPage",
    "report": "ReportPage",
    "messages": "MessagesPage",
    "plots": "PlotsPage",
    "map": "MapPage",
    "graph": "GraphPage",
    "history": "HistoryPage",
    "contents": "ContentsPage",
    "missions": "MissionsPage",
    "profiles": "ProfilesPage",
}


def make_page(name: str, workspace: Workspace, id: str) -> Page:
    """The page of that name, for the log that is open."""
    return page_class(name)(workspace, id=id)


def page_class(name: str) -> type[Page]:
    """The class of that page."""
    found: type[Page] = getattr(import_module(f"care_tui.pages.{name}"), _CLASSES[name])
    return found
