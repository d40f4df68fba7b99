"""The signals that metrics and objectives are read from, drawn over the mission."""

from __future__ import annotations

import math
from functools import partial

from textual.content import Content

from care_core.application.case import Case
from care_core.application.viewing import Signal, Trace, signals_of, trace_of
from care_core.errors import CareError
from care_tui.pages.page import Fetch, Page, View, sentence
from care_tui.render.plot import dots_across, plot
from care_tui.render.rows import ASCII, Row, Rows, error_rows, padded, text
from care_tui.screens.panes import PanesScreen
from care_tui.widgets.choices import Listing

AXIS = 10
"""Cells for the numbers left of a plot."""


class SignalsPage(Page):
    name = "Signals"
    HELP = "Signals that the profile reads from the log, those that matter to the fault first. / filters, Esc leaves."

    def __init__(self, screen: PanesScreen, case: Case) -> None:
        super().__init__(screen)
        self._case = case
        self._found: Fetch[list[Signal]] = Fetch(self, "signals")
        self._traces: dict[tuple[Signal, int], Trace | CareError] = {}

    def enter(self) -> None:
        self._found.start(lambda: signals_of(self._case))

    def view(self) -> View:
        return self._found.view("Signals", self._show)

    def _show(self, signals: list[Signal]) -> View:
        title = Content("Signals behind the metrics, over the mission")
        if not signals:
            return View(title, lambda _: sentence("The profile reads no signal from this log."))
        listing = Listing(
            len(signals),
            lambda i, _width: (self._item(signals[i]),),
            lambda i: f"{signals[i].name} {' '.join(signals[i].used_by)}",
        )
        return View(title, lambda i: self._detail(None if i is None else signals[i]), listing)

    @staticmethod
    def _item(signal: Signal) -> Content:
        return padded(signal.name, 28, "bold") + text("  for " + ", ".join(signal.used_by), "dim")

    def _detail(self, signal: Signal | None) -> Rows:
        if signal is None:
            return Rows([])
        ascii = self.glyphs is ASCII
        width = max(self.screen.text.text_width - AXIS - 1, 10)
        columns = dots_across(width, ascii=ascii)
        trace = self._traces.get((signal, columns))
        if trace is None:
            work = partial(trace_of, self._case, signal, columns)
            self.screen.fetch("trace", lambda _job: work(), lambda answer: self._drawn(signal, columns, answer))
            return Rows([Row(text(signal.name, "bold")), Row(Content("Reading..."))])
        if isinstance(trace, CareError):
            return error_rows(trace)
        height = max(min(self.screen.text.size.height - 3, 16), 3)
        lines = plot(trace.columns, trace.low, trace.high, height, ascii=ascii)
        labels = {0: told(trace.high, trace), height - 1: told(trace.low, trace)}
        rows = [Row(text(f"{signal.name}  {trace.count} values", "bold"))]
        rows += [Row(Content(f"{labels.get(i, ''):>{AXIS}} {line}")) for i, line in enumerate(lines)]
        end = f"{trace.end_s:.0f} s"
        rows.append(Row(Content(f"{'':>{AXIS}} {f'{trace.start_s:.0f} s':<{max(width - len(end), 0)}}{end}")))
        return Rows(rows)

    def _drawn(self, signal: Signal, columns: int, answer: Trace | CareError) -> None:
        self._traces[signal, columns] = answer
        self.screen.draw()


def told(value: float, trace: Trace) -> str:
    """An end of the axis with as many digits as tell it from the other end."""
    span = trace.high - trace.low
    digits = 4 if span <= 0 else 2 + math.ceil(math.log10(max(abs(trace.high), abs(trace.low), span) / span))
    return f"{value:.{min(max(digits, 4), AXIS - 2)}g}"
