"""What the robot's software said, around the moment of failure."""

from __future__ import annotations

from typing import ClassVar

from textual.binding import Binding, BindingType
from textual.content import Content

from care_core.application.proof import Subject
from care_core.application.viewing import messages_of
from care_core.ecosystems.findings import Event
from care_core.text import number_of, seconds
from care_tui.pages.page import Page, View, enter_to, sentence, view_of
from care_tui.render.objectives import meaning
from care_tui.render.rows import Row, Rows, labelled, text
from care_tui.widgets.choices import Listing

LOUD = {"ERR", "WARN", "ERROR", "FATAL"}
NEAR_S = 0.5
"""A message is the one that a piece of evidence was found in when it is this near to it."""
MESSAGES = "messages"


class MessagesPage(Page):
    HELP = (
        "Messages of the log in time order; ! marks warnings and errors, a pointer what the diagnosis rests on. n goes "
        "to the next marked one, Enter to its moment in the plots, / filters, Esc leaves."
    )
    BINDINGS: ClassVar[list[BindingType]] = [
        enter_to("Plots"),
        Binding("n", "next_marked", "Next marked", id="messages.next"),
    ]
    _wanted: float | None = None
    _placed = False

    def view(self) -> View:
        case = self.session.case
        found = None if case is None else self.fetched(MESSAGES, lambda: messages_of(case))
        return view_of("Messages", found, self._show)

    def _show(self, messages: list[Event]) -> View:
        if not messages:
            return View(Content("Messages"), lambda _: sentence("The log holds no message in words."))
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
        title = Content(f"{number_of(len(messages), 'message')}{self._span()}")
        return View(title, lambda i: self._detail(None if i is None else messages[i]), listing, index)

    def look_at(self, moment_s: float | None, subject: Subject | None) -> None:
        self._wanted = moment_s

    @property
    def _messages(self) -> list[Event]:
        found = self._answers.get(MESSAGES)
        return found if isinstance(found, list) else []

    def moment_s(self) -> float | None:
        messages, index = self._messages, self.index
        return messages[index].time_s if messages and index is not None else None

    def action_open(self) -> None:
        """Show the plots at the moment of this message."""
        self.go("plots", self.moment_s())

    def _span(self) -> str:
        mission = self.session.diagnosis.run.mission
        fits = self.session.diagnosis.profile.fit.verdict != "no"
        return f"; the mission is from {seconds(mission.start_s)} to {seconds(mission.end_s)}" if fits else ""

    def _moment(self, messages: list[Event]) -> int:
        """The first message that the diagnosis rests on, else the last of the mission."""
        marked = [i for i, message in enumerate(messages) if self._is_evidence(message)]
        end = self.session.diagnosis.run.mission.end_s
        before = [i for i, message in enumerate(messages) if message.time_s <= end]
        return marked[0] if marked else before[-1] if before else 0

    def _is_evidence(self, message: Event) -> bool:
        evidence = self.session.diagnosis.run.evidence
        return any(abs(part.time_s - message.time_s) < NEAR_S and part.text in message.text for part in evidence)

    def _item(self, message: Event) -> Content:
        mark = self.glyphs.here if self._is_evidence(message) else "!" if message.kind in LOUD else " "
        style = "bold" if mark != " " else ""
        return Content.assemble(f"{mark} {seconds(message.time_s):>9}  {message.kind:<8} ") + text(message.text, style)

    def _detail(self, message: Event | None) -> Rows:
        if message is None:
            return Rows([])
        rows = [labelled(seconds(message.time_s), message.text)]
        for part in self.session.diagnosis.run.evidence:
            if abs(part.time_s - message.time_s) < NEAR_S and part.text in message.text:
                points = f", points at {', '.join(part.options)}" if part.options else ""
                rows.append(Row(text(f"Evidence: {part.kind}{points}{meaning(part)}", "bold"), 2))
        return Rows(rows)

    def action_next_marked(self) -> None:
        """Go to the next warning, error or piece of evidence."""
        messages, here = self._messages, self.index
        if here is None:
            return
        marked = [i for i, m in enumerate(messages) if m.kind in LOUD or self._is_evidence(m)]
        if marked:
            self.show(next((i for i in marked if i > here), marked[0]))
        else:
            self.say("No message is a warning, an error or evidence.")
