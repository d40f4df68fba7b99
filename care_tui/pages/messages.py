"""What the robot's software said, around the moment of failure."""

from __future__ import annotations

from typing import ClassVar

from textual.content import Content

from care_core.application.case import Case
from care_core.application.viewing import messages_of
from care_core.ecosystems.findings import Event
from care_tui.pages.page import Fetch, Page, View, sentence
from care_tui.render.objectives import meaning
from care_tui.render.rows import Row, Rows, labelled, text
from care_tui.screens.panes import PanesScreen
from care_tui.widgets.choices import Listing

LOUD = {"ERR", "WARN", "ERROR", "FATAL"}
NEAR_S = 0.5
"""A message is the one that a piece of evidence was found in when it is this near to it."""


class MessagesPage(Page):
    name = "Messages"
    HELP = (
        "Messages of the log in time order; ! marks warnings and errors, > what the diagnosis rests on. n goes to the "
        "next marked one, Enter to its moment in the plots, / filters, Esc leaves."
    )
    ENTER = "Plot"
    ACTIONS: ClassVar[frozenset[str]] = frozenset({"next_marked"})

    LIST = "most"

    def __init__(self, screen: PanesScreen, case: Case) -> None:
        super().__init__(screen)
        self._case = case
        self._found: Fetch[list[Event]] = Fetch(self, "messages")
        self._wanted: float | None = None
        self._placed = False

    def enter(self) -> None:
        self._found.start(lambda: messages_of(self._case))

    def view(self) -> View:
        return self._found.view("Messages of the log", self._show)

    def _show(self, messages: list[Event]) -> View:
        title = Content.assemble("Messages of the log", (f"  {len(messages)}{self._span()}", "dim"))
        if not messages:
            return View(Content("Messages of the log"), lambda _: sentence("The log holds no message in words."))
        listing = Listing(
            len(messages),
            lambda i, _width: (self._item(messages[i]),),
            lambda i: f"{messages[i].kind} {messages[i].text}",
        )
        index = None if self._placed else self._moment(messages)
        if self._wanted is not None:
            wanted = self._wanted
            index = min(range(len(messages)), key=lambda i: abs(messages[i].time_s - wanted))
        self._placed, self._wanted = True, None
        return View(title, lambda i: self._detail(None if i is None else messages[i]), listing, index)

    def look_at(self, moment_s: float) -> None:
        self._wanted = moment_s

    def moment_s(self) -> float | None:
        messages, index = self._found.answer, self.screen.choices.highlighted
        return messages[index].time_s if isinstance(messages, list) and messages and index is not None else None

    def open(self, index: int | None) -> None:
        self.walk.action_view("signals")

    def _span(self) -> str:
        mission = self._case.diagnosis.run.mission
        fits = self._case.diagnosis.profile.fit.verdict != "no"
        return f"; mission {mission.start_s:.1f} to {mission.end_s:.1f} s" if fits else ""

    def _moment(self, messages: list[Event]) -> int:
        """The first message that the diagnosis rests on, else the last of the mission."""
        marked = [i for i, message in enumerate(messages) if self._is_evidence(message)]
        end = self._case.diagnosis.run.mission.end_s
        before = [i for i, message in enumerate(messages) if message.time_s <= end]
        return marked[0] if marked else before[-1] if before else 0

    def _is_evidence(self, message: Event) -> bool:
        evidence = self._case.diagnosis.run.evidence
        return any(abs(part.time_s - message.time_s) < NEAR_S and part.text in message.text for part in evidence)

    def _item(self, message: Event) -> Content:
        mark = self.glyphs.here if self._is_evidence(message) else "!" if message.kind in LOUD else " "
        style = "bold" if mark != " " else ""
        return Content.assemble(f"{mark} {message.time_s:8.1f} s  {message.kind:<8} ") + text(message.text, style)

    def _detail(self, message: Event | None) -> Rows:
        if message is None:
            return Rows([])
        rows = [labelled(f"{message.time_s:.2f} s", message.text)]
        for part in self._case.diagnosis.run.evidence:
            if abs(part.time_s - message.time_s) < NEAR_S and part.text in message.text:
                points = f", points at {', '.join(part.options)}" if part.options else ""
                rows.append(Row(text(f"Evidence: {part.kind}{points}{meaning(part)}", "bold"), 2))
        return Rows(rows)

    def next_marked(self) -> None:
        """Go to the next warning, error or piece of evidence."""
        messages, here = self._found.answer, self.screen.choices.highlighted
        if isinstance(messages, list) and here is not None:
            marked = [i for i, m in enumerate(messages) if m.kind in LOUD or self._is_evidence(m)]
            if marked:
                self.screen.draw(index=next((i for i in marked if i > here), marked[0]))
            else:
                self.screen.say("No message is a warning, an error or evidence.")
