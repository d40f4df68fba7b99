"""The pages of the app, by one name each in tabs, help, palette and settings."""

from __future__ import annotations

from typing import Literal

from care_core.records import Record

Need = Literal["nothing", "log", "diagnosis"]


_SHORT = {
    "messages": "Msgs",
    "history": "Hist",
    "contents": "Cont",
    "missions": "Miss",
    "profiles": "Prof",
}


class PageInfo(Record):
    """A page: its name in the code, the keys that lead to it, its title, and what it shows."""

    name: str
    keys: str
    title: str
    about: str
    needs: Need = "diagnosis"

    @property
    def key(self) -> str:
        """The key that its tab names."""
        return self.keys.rsplit(",", 1)[-1]

    @property
    def binding(self) -> str:
        """What settings call the binding of its keys."""
        return f"{'step' if self in STEPS else 'view'}.{self.name}"

    @property
    def short(self) -> str:
        """The title where the terminal is too narrow for all of them."""
        return _SHORT.get(self.name, self.title)


STEPS = (
    PageInfo("log", "1", "Log", "What happened in the run", "nothing"),
    PageInfo("objectives", "2", "Objectives", "What the mission is judged by"),
    PageInfo("causes", "3", "Causes", "What explains the fault, with its proof"),
    PageInfo("fix", "4", "Fix", "What to change, and what that would bring"),
    PageInfo("diff", "5", "Diff", "The change as lines of the configuration"),
    PageInfo("report", "6", "Report", "The report as it will be written"),
)
VIEWS = (
    PageInfo("messages", "f3,m", "Messages", "What the robot's software said"),
    PageInfo("plots", "f4,p", "Plots", "The signals of the log, those that prove what is under the cursor first"),
    PageInfo("map", "f9,M", "Map", "Where the robot went, and the way that it was asked to go"),
    PageInfo("graph", "f2,w", "Graph", "The causal model around the fault"),
    PageInfo("history", "f5,y", "History", "Past runs with trends, two side by side", "nothing"),
    PageInfo("contents", "f7,v", "Contents", "What the log holds: channels, parameters, damage", "log"),
    PageInfo("missions", "f8,t", "Missions", "The missions of the log with their verdicts"),
    PageInfo("profiles", "f6,b", "Profiles", "The installed profiles and their model cards", "nothing"),
)
LOGS = PageInfo("logs", "L", "Logs", "The logs there are, with their verdicts as they are known", "nothing")
PAGES = {page.name: page for page in (*STEPS, *VIEWS, LOGS)}
NAMES = tuple(page.name for page in STEPS)
