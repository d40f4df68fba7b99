"""Signals of the log drawn over the mission: what was wanted over what came of it, with what happened marked."""

from __future__ import annotations

import math
from functools import partial
from typing import ClassVar

from textual.content import Content

from care_core.application.case import Case
from care_core.application.signals import Signal, Trace, signals_of, trace_of, whole_of
from care_core.errors import CareError
from care_core.report.marks import Mark, marks_of
from care_core.text import clean, seconds
from care_tui.pages.page import Fetch, Page, View, sentence
from care_tui.render.health import sign_of
from care_tui.render.plot import WANTED, dots_across, plot
from care_tui.render.rows import ASCII, Row, Rows, error_rows, padded, text
from care_tui.screens.panes import PanesScreen
from care_tui.widgets.choices import Listing

AXIS = 10
"""Cells for the numbers left of a plot."""
HIGHEST, MOST_TOLD = 16, 6
"""Lines of a plot at most, and of the marks that are told below it."""
SHORTEST_S = 0.5
"""Nothing is drawn that is shorter."""

Span = tuple[float, float]


class SignalsPage(Page):
    name = "Signals"
    HELP = (
        "Signals of the log, those that matter to the fault first; what was wanted is dotted. + and - draw less and "
        "more of the time around the moment, n goes to the next mark, Enter to the messages of the moment. / filters, "
        "Esc leaves."
    )
    ENTER = "Messages"
    LIST = "least"
    FITS = True
    ACTIONS: ClassVar[frozenset[str]] = frozenset({"closer", "farther", "next_marked"})

    def __init__(self, screen: PanesScreen, case: Case) -> None:
        super().__init__(screen)
        self._case = case
        self._found: Fetch[list[Signal]] = Fetch(self, "signals")
        self._traces: dict[tuple[Signal, Span, int], Trace | CareError] = {}
        self._whole = whole_of(case)
        self._span = self._whole
        self._moment: float | None = None
        self._marks = marks_of(case.diagnosis)

    def enter(self) -> None:
        self._found.start(lambda: signals_of(self._case))

    def view(self) -> View:
        return self._found.view("Signals", self._show)

    def _show(self, signals: list[Signal]) -> View:
        title = Content(f"Signals from {seconds(self._span[0])} to {seconds(self._span[1])}")
        if self._moment is not None:
            title += Content.styled(f"  at {seconds(self._moment)}", "bold")
        if not signals:
            return View(title, lambda _: sentence("The log holds no signal that is known here."))
        listing = Listing(
            len(signals),
            lambda i, _width: (self._item(signals[i]),),
            lambda i: f"{signals[i].name} {signals[i].wanted_name} {' '.join(signals[i].used_by)}",
        )
        return View(title, lambda i: self._detail(None if i is None else signals[i]), listing)

    @staticmethod
    def _item(signal: Signal) -> Content:
        line = padded(signal.name, 28, "bold")
        if signal.wanted_name:
            line += text(f"  to follow {signal.wanted_name}")
        return line + text("  for " + ", ".join(signal.used_by), "dim") if signal.used_by else line

    def _detail(self, signal: Signal | None) -> Rows:
        if signal is None:
            return Rows([])
        ascii, width = self.glyphs is ASCII, max(self.screen.text.text_width - AXIS - 1, 10)
        asked = (signal, self._span, dots_across(width, ascii=ascii))
        trace = self._traces.get(asked)
        if trace is None:
            work = partial(trace_of, self._case, *asked)
            self.screen.fetch("trace", lambda _job: work(), lambda answer: self._drawn(asked, answer))
            return Rows([Row(text(signal.name, "bold")), Row(Content("Reading..."))])
        return error_rows(trace) if isinstance(trace, CareError) else Rows(self._rows(signal, trace, width))

    def _rows(self, signal: Signal, trace: Trace, width: int) -> list[Row]:
        """The plot, the marks of what happened below it, the axis, and the marks in words as far as there is room."""
        told = [mark for mark in self._marks if trace.start_s <= mark.time_s <= trace.end_s]
        room = self.screen.text.size.height - 3
        below = min(len(told), MOST_TOLD, max(room - 6, 0))
        height = max(min(room - below, HIGHEST), 3)
        cursor = None if self._moment is None else self._place(self._moment, trace, width)
        lines = plot(
            trace.columns, trace.low, trace.high, height,
            ascii=self.glyphs is ASCII, wanted=trace.wanted, cursor=cursor, rule=self.glyphs.line,
        )  # fmt: skip
        labels = {0: shown(trace.high, trace), height - 1: shown(trace.low, trace)}
        rows = [Row(self._head(signal, trace))]
        rows += [Row(Content(f"{labels.get(i, ''):>{AXIS}} ") + line) for i, line in enumerate(lines)]
        signs = [" "] * width
        for mark in reversed(told):
            signs[self._place(mark.time_s, trace, width)] = sign_of(mark, self.glyphs)
        rows.append(Row(Content(f"{'':>{AXIS}} {''.join(signs)}")))
        start, end = seconds(trace.start_s), seconds(trace.end_s)
        rows.append(Row(Content(f"{'':>{AXIS}} {start:<{max(width - len(end), 0)}}{end}")))
        near = sorted(sorted(told, key=self._weight)[:below], key=lambda mark: mark.time_s)
        return rows + [
            Row(text(f"{sign_of(mark, self.glyphs)} {seconds(mark.time_s):>8}  {mark.words}"), 12) for mark in near
        ]

    def _head(self, signal: Signal, trace: Trace) -> Content:
        head = Content.assemble((clean(signal.name), "bold"), f"  {trace.count} values")
        if not trace.wanted:
            return head
        sign = ". " if self.glyphs is ASCII else ""
        return head + Content("  ") + Content.styled(f"{sign}{clean(signal.wanted_name)} (wanted)", WANTED)

    def _weight(self, mark: Mark) -> tuple[float, float]:
        """Marks that are told first: those around the moment, else the gravest."""
        return (mark.rank, mark.time_s) if self._moment is None else (abs(mark.time_s - self._moment), mark.time_s)

    @staticmethod
    def _place(time_s: float, trace: Trace, width: int) -> int:
        share = (time_s - trace.start_s) / max(trace.end_s - trace.start_s, 1e-9)
        return min(max(int(share * width), 0), width - 1)

    def _drawn(self, asked: tuple[Signal, Span, int], answer: Trace | CareError) -> None:
        self._traces[asked] = answer
        if self.is_shown:
            self.screen.draw()

    # The moment, and how much is drawn around it

    def look_at(self, moment_s: float) -> None:
        self._moment = moment_s
        if not self._span[0] <= moment_s <= self._span[1]:
            self._span = min(self._whole[0], moment_s), max(self._whole[1], moment_s)

    def moment_s(self) -> float | None:
        return self._moment

    def open(self, index: int | None) -> None:
        self.walk.action_view("messages")

    def closer(self) -> None:
        """Draw half of the time, around the moment."""
        self._zoom(0.5)

    def farther(self) -> None:
        """Draw twice the time, at most the whole log."""
        self._zoom(2.0)

    def _zoom(self, by: float) -> None:
        start, end = self._span
        middle = (start + end) / 2 if self._moment is None else self._moment
        half = max((end - start) / 2 * by, SHORTEST_S / 2)
        log = self._case.log
        last = max(self._whole[1], 0.0 if log is None else log.duration_s)
        low = max(min(middle - half, last - 2 * half), 0.0)
        self._span = low, min(low + 2 * half, last)
        self.screen.draw()

    def next_marked(self) -> None:
        """Go to the next mark of what happened, the first after the last."""
        if not self._marks:
            self.screen.say("Nothing is marked in this log.")
            return
        here = -math.inf if self._moment is None else self._moment
        mark = next((mark for mark in self._marks if mark.time_s > here), self._marks[0])
        self.look_at(mark.time_s)
        self.screen.draw()
        self.screen.say(f"{seconds(mark.time_s)}  {mark.words}")


def shown(value: float, trace: Trace) -> str:
    """An end of the axis with as many digits as tell it from the other end."""
    span = trace.high - trace.low
    digits = 4 if span <= 0 else 2 + math.ceil(math.log10(max(abs(trace.high), abs(trace.low), span) / span))
    return f"{value:.{min(max(digits, 4), AXIS - 2)}g}"
