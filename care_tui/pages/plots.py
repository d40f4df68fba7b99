"""Signals of the log drawn over the mission: what was wanted beside what came of it, with what happened marked."""

from __future__ import annotations

import math
from typing import ClassVar

from rich.cells import cell_len
from textual.binding import Binding, BindingType
from textual.content import Content

from care_core.application.proof import Proof, Subject, proof_of
from care_core.application.signals import Signal, whole_of
from care_core.errors import CareError
from care_core.records import replace
from care_core.report.marks import Mark, marks_of
from care_core.text import seconds
from care_tui.pages.page import Page, View, enter_to, sentence, view_of
from care_tui.pages.proofs import figure_of, signals_in
from care_tui.render.plot import AXIS, LOWEST, Figure, dots_across, mark_rows
from care_tui.render.rows import ASCII, Glyphs, Row, Rows, error_rows, padded, text, without_middle
from care_tui.widgets.choices import Listing
from care_tui.workspace import Workspace

NAME_WIDTH = 14
LEAST_CHANNEL = 6
"""Cells in which a shortened channel still says something."""
AROUND = 3
"""Lines around a plot: what it is, what happened, and its times."""
MOST_TOLD = 6
"""Marks that are told below a plot."""
SHORTEST_S = 0.5
"""Nothing is drawn that is shorter."""
PROOF = "proof"
NOTHING = Proof(())

Span = tuple[float, float]


def signal_name(signal: Signal, width: int, glyphs: Glyphs) -> str:
    """A signal's name in so many cells: where it does not fit, its channel gives way, which many signals share."""
    room = width - cell_len(signal.field) - 1
    if room >= cell_len(signal.channel):
        return signal.name
    if room < LEAST_CHANNEL:
        return without_middle(signal.field, width, glyphs)
    return f"{without_middle(signal.channel, room, glyphs)} {signal.field}"


class PlotsPage(Page):
    HELP = (
        "Signals of the log, those first that prove what the cursor was on; what was wanted has a colour of its own, "
        "and the time of the finding is shaded. + and - draw less and more of the time around the moment, n goes to "
        "the next mark, x keeps a signal in view below the others, as many as there is room for, Enter leads to the "
        "messages of the moment. / filters."
    )
    FITS = True
    BINDINGS: ClassVar[list[BindingType]] = [
        enter_to("Messages"),
        Binding(
            "plus,right_square_bracket",
            "zoom(0.5)",
            "Closer",
            key_display="+",
            id="signals.closer",
            tooltip="Draw half of the time around the moment",
        ),
        Binding(
            "minus,left_square_bracket",
            "zoom(2.0)",
            "Farther",
            key_display="-",
            id="signals.farther",
            tooltip="Draw twice the time around the moment, at most the whole log",
        ),
        Binding("n", "next_marked", "Next mark", id="signals.next"),
        Binding("x", "keep", "Keep beside", id="signals.beside"),
    ]

    def __init__(self, workspace: Workspace, *, id: str | None = None) -> None:
        super().__init__(workspace, id=id)
        case = workspace.session.case
        assert case is not None
        self._case = case
        self._whole: Span | None = None
        self._span: Span = (0.0, 1.0)
        self._moment: float | None = None
        self._subject: Subject | None = None
        self._kept: list[Signal] = []
        self._marks = marks_of(case.diagnosis)

    # What is drawn

    def look_at(self, moment_s: float | None, subject: Subject | None) -> None:
        self._moment, self._subject = moment_s, subject
        self.forget(PROOF)
        if moment_s is not None and not self._span[0] <= moment_s <= self._span[1]:
            self._span = min(self._span[0], moment_s), max(self._span[1], moment_s)
        if self.is_mounted:
            self.choices.move_to(0)  # the signal that proves it comes first

    def view(self) -> View:
        case, subject, session = self._case, self._subject, self.session

        def work() -> Proof:
            signals = signals_in(session, case)
            found = proof_of(case, subject, signals) if subject is not None else NOTHING
            shown = {one.name for one in found.signals}
            others = tuple(one for one in signals if one.name not in shown)
            return replace(found, signals=(*found.signals, *others))

        return view_of("Plots", self.fetched(PROOF, work), self._show)

    def _show(self, proof: Proof) -> View:
        if self._whole is None:
            self._whole = self._span = whole_of(self._case)
        signals = proof.signals
        if not signals:
            return View(Content("Plots"), lambda _: sentence("The log holds no signal that is known here."))
        at = "" if self._moment is None else f", at {seconds(self._moment)}"
        title = Content(f"{seconds(self._span[0])} to {seconds(self._span[1])}{at}")
        listing = Listing(
            len(signals),
            lambda i, width: (self._item(signals[i], width),),
            lambda i: f"{signals[i].name} {signals[i].wanted_name} {' '.join(signals[i].used_by)}",
        )
        return View(title, lambda i: self._detail(None if i is None else signals[i], proof), listing)

    def _item(self, signal: Signal, width: int) -> Content:
        mark = f"{self.glyphs.root if signal in self._kept else ' '} "
        name = signal_name(signal, width - len(mark), self.glyphs)
        line = Content(mark) + padded(name, NAME_WIDTH, "bold")
        if signal.wanted_name:
            line += text(f"  {'beside' if signal.is_beside else 'to follow'} {signal.wanted_name}")
        return line + text("  for " + ", ".join(signal.used_by), "dim") if signal.used_by else line

    def _detail(self, signal: Signal | None, proof: Proof) -> Rows:
        if signal is None:
            return Rows([])
        width, height = self.reader.room
        shown = [signal, *(one for one in self._kept if one != signal)][: self._most]
        told = self._told(max(height - len(shown) * (LOWEST + 6), 0))
        each = (height - len(told)) // len(shown)
        rows: list[Row] = []
        for one in shown:
            figure = self._figure(one, proof, width, has_legend=not told)
            if isinstance(figure, CareError):
                rows += error_rows(figure).rows
            elif figure is None:
                rows.append(Row(Content.assemble(text(one.name, "bold"), "  Reading...")))
            else:
                rows += figure.rows(width, each, self.glyphs)
        return Rows([*rows, *mark_rows(told, self.glyphs)])

    @property
    def _most(self) -> int:
        """Signals that can be drawn one below the other."""
        return max(self.reader.room.height // (LOWEST + AROUND), 1)

    def _figure(self, signal: Signal, proof: Proof, width: int, *, has_legend: bool) -> Figure | CareError | None:
        columns, span, case = dots_across(max(width - AXIS, 10), ascii=self.glyphs is ASCII), self._span, self._case
        question = f"{signal.name} {span} {columns} {proof.start_s}"
        found = self.fetched(question, lambda: figure_of(case, signal, proof, span, columns))
        if not isinstance(found, Figure):
            return found
        return replace(found, cursor_s=self._moment, has_legend=has_legend)

    def _told(self, room: int) -> list[Mark]:
        """Marks in words as far as there is room: those around the moment, else the gravest."""
        inside = [mark for mark in self._marks if self._span[0] <= mark.time_s <= self._span[1]]
        near = sorted(inside, key=self._weight)[: min(room, MOST_TOLD)]
        return sorted(near, key=lambda mark: mark.time_s)

    def _weight(self, mark: Mark) -> tuple[float, float]:
        return (mark.rank, mark.time_s) if self._moment is None else (abs(mark.time_s - self._moment), mark.time_s)

    # The moment, and how much is drawn around it

    def moment_s(self) -> float | None:
        return self._moment

    def action_open(self) -> None:
        """Show the messages of the moment."""
        self.go("messages", self._moment)

    def action_zoom(self, by: float) -> None:
        """Draw half or twice of the time around the moment, at most the whole log."""
        start, end = self._span
        middle = (start + end) / 2 if self._moment is None else self._moment
        self._draw_around(middle, max((end - start) / 2 * by, SHORTEST_S / 2))

    def _draw_around(self, middle: float, half: float) -> None:
        log, whole = self._case.log, self._whole or self._span
        last = max(whole[1], 0.0 if log is None else log.duration_s)
        low = max(min(middle - half, last - 2 * half), 0.0)
        self._span = low, min(low + 2 * half, last)
        self.show()

    def action_next_marked(self) -> None:
        """Go to the next mark of what happened, the first after the last; as much of the time is drawn as before."""
        if not self._marks:
            self.say("Nothing is marked in this log.")
            return
        here = self._start if self._moment is None else self._moment
        mark = next((mark for mark in self._marks if mark.time_s > here), self._marks[0])
        self._moment = mark.time_s
        if self._span[0] <= mark.time_s <= self._span[1]:
            self.show()
        else:
            self._draw_around(mark.time_s, (self._span[1] - self._span[0]) / 2)
        if self._kept:  # else it is told below the plot
            self.say(f"{seconds(mark.time_s)}  {mark.words}")

    @property
    def _start(self) -> float:
        """Where marks are looked for from: the end of the finding that is shown, else the beginning of what is
        drawn."""
        found = self._answers.get(PROOF)
        end_s = found.end_s if isinstance(found, Proof) else None
        return math.nextafter(self._span[0], -math.inf) if end_s is None else end_s

    def action_keep(self) -> None:
        """Keep the signal under the cursor in view below the others, or let it go; the one that was kept first goes
        where there is no room for one more."""
        found = self._answers.get(PROOF)
        if not isinstance(found, Proof) or self.index is None:
            return
        here, most = found.signals[self.index], self._most - 1
        if here in self._kept:
            self._kept.remove(here)
        elif most:
            self._kept = [*self._kept, here][-most:]
        else:
            self.say("There is no room for a second plot.")
        self.show()
