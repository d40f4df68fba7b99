"""Pages by their names. A view is imported when it is asked for: none of them is needed for the first frame."""

from __future__ import annotations

from importlib import import_module

from care_tui.pages.page import Page
from care_tui.workspace import Workspace

_CLASSES = {
    "logs": "LogsPage",
    "log": "AccountPage",
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
_MODULES = {"log": "account"}


def make_page(name: str, workspace: Workspace, id: str) -> Page:
    """The page of that name, for the log that is open."""
    module = import_module(f"care_tui.pages.{_MODULES.get(name, name)}")
    page: Page = getattr(module, _CLASSES[name])(workspace, id=id)
    return page


def page_classes() -> list[type[Page]]:
    """Every kind of page."""
    return [
        getattr(import_module(f"care_tui.pages.{_MODULES.get(name, name)}"), kind) for name, kind in _CLASSES.items()
    ]
