"""What the robot's software said, around the moment of failure."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import groupby
from typing import ClassVar

from textual.binding import Binding, BindingType
from textual.content import Content

from care_core.application.proof import Subject
from care_core.application.viewing import messages_of
from care_core.ecosystems.findings import Event
from care_core.records import Record
from care_core.text import number_of, seconds
from care_tui.pages.page import Page, View, enter_to, sentence, view_of
from care_tui.render.objectives import meaning
from care_tui.render.rows import Row, Rows, labelled, text
from care_tui.widgets.choices import Listing

LOUD = {"ERR", "WARN", "ERROR", "FATAL"}
NEAR_S = 0.5
"""A message is the one that a piece of evidence was found in when it is this near to it."""
MESSAGES = "messages"


class Repeated(Record):
    """A message, and how often it came again at once, until when."""

    message: Event
    count: int = 1
    end_s: float = 0.0


def folded(messages: Iterable[Event]) -> list[Repeated]:
    """Messages of which one that is said again and again is told once."""
    said: list[Repeated] = []
    for _, same in groupby(messages, key=lambda message: (message.kind, message.text)):
        first, *others = same
        said.append(Repeated(first, 1 + len(others), others[-1].time_s if others else first.time_s))
    return said


class MessagesPage(Page):
    HELP = (
        "Messages of the log in time order, one that was said several times running told once; ! marks warnings and "
        "errors, a pointer what the diagnosis rests on. n goes "
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
        found = None if case is None else self.fetched(MESSAGES, lambda: folded(messages_of(case)))
        return view_of("Messages", found, self._show)

    def _show(self, messages: list[Repeated]) -> View:
        if not messages:
            return View(Content("Messages"), lambda _: sentence("The log holds no message in words."))
        listing = Listing(
            len(messages),
            lambda i, _width: (self._item(messages[i]),),
            lambda i: self._words(messages[i]),
        )
        index = None if self._placed else self._moment(messages)
        if self._wanted is not None:
            wanted = self._wanted
            index = min(range(len(messages)), key=lambda i: _apart(messages[i], wanted))
        self._placed, self._wanted = True, None
        title = Content(f"{number_of(sum(one.count for one in messages), 'message')}{self._span()}")
        return View(title, lambda i: self._detail(None if i is None else messages[i]), listing, index)

    def look_at(self, moment_s: float | None, subject: Subject | None) -> None:
        self._wanted = moment_s

    @property
    def _messages(self) -> list[Repeated]:
        found = self._answers.get(MESSAGES)
        return found if isinstance(found, list) else []

    def moment_s(self) -> float | None:
        messages, index = self._messages, self.index
        return messages[index].message.time_s if messages and index is not None else None

    def action_open(self) -> None:
        """Show the plots at the moment of this message."""
        self.go("plots", self.moment_s())

    def _span(self) -> str:
        mission = self.session.diagnosis.run.mission
        fits = self.session.diagnosis.profile.fit.verdict != "no"
        return f"; the mission is from {seconds(mission.start_s)} to {seconds(mission.end_s)}" if fits else ""

    def _moment(self, messages: list[Repeated]) -> int:
        """The first message that the diagnosis rests on, else the last of the mission."""
        marked = [i for i, one in enumerate(messages) if self._evidence(one)]
        end = self.session.diagnosis.run.mission.end_s
        before = [i for i, one in enumerate(messages) if one.message.time_s <= end]
        return marked[0] if marked else before[-1] if before else 0

    def _evidence(self, one: Repeated) -> list[str]:
        """What the diagnosis takes from a message."""
        evidence = self.session.diagnosis.run.evidence
        found = [part for part in evidence if _apart(one, part.time_s) < NEAR_S and part.text in one.message.text]
        points = ((part, f", points at {', '.join(part.options)}" if part.options else "") for part in found)
        return [f"Evidence: {part.kind}{options}{meaning(part)}" for part, options in points]

    def _words(self, one: Repeated) -> str:
        """What `/` searches in: all that is told of a message."""
        return " ".join([one.message.kind, one.message.text, *self._evidence(one)])

    def _item(self, one: Repeated) -> Content:
        message = one.message
        mark = self.glyphs.here if self._evidence(one) else "!" if message.kind in LOUD else " "
        style = "bold" if mark != " " else ""
        again = f"  ({one.count} times)" if one.count > 1 else ""
        head = f"{mark} {seconds(message.time_s):>9}  {message.kind:<8} "
        return Content(head) + text(message.text, style) + text(again, "dim")

    def _detail(self, one: Repeated | None) -> Rows:
        if one is None:
            return Rows([])
        until = f" ({one.count} times, until {seconds(one.end_s)})" if one.count > 1 else ""
        rows = [labelled(seconds(one.message.time_s), f"{one.message.text}{until}")]
        return Rows([*rows, *(Row(text(told, "bold"), 2) for told in self._evidence(one))])

    def action_next_marked(self) -> None:
        """Go to the next warning, error or piece of evidence."""
        messages, here = self._messages, self.index
        if here is None:
            return
        marked = [i for i, one in enumerate(messages) if one.message.kind in LOUD or self._evidence(one)]
        if marked:
            self.show(next((i for i in marked if i > here), marked[0]))
        else:
            self.say("No message is a warning, an error or evidence.")


def _apart(one: Repeated, time_s: float) -> float:
    """Seconds from a message to a moment; none while it was said again and again."""
    return max(one.message.time_s - time_s, time_s - one.end_s, 0.0)
