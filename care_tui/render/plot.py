"""Lines over time in text: dots of braille, or stars where the terminal has only ASCII."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import pairwise

from textual.content import Content

from care_core.application.signals import Signal, Trace
from care_core.ecosystems.dictionary import Field
from care_core.records import Record
from care_core.report.axes import tick_time, time_ticks, value_ticks
from care_core.report.marks import Mark
from care_core.text import LONG_S, clean, seconds
from care_tui.render.health import sign_of
from care_tui.render.rows import ASCII, Glyphs, Row, cut, text

_BITS = ((0x01, 0x02, 0x04, 0x40), (0x08, 0x10, 0x20, 0x80))
"""Bits of the dots of a braille cell: by column, from the top down."""

EMPTY = 0x2800
"""The braille cell without a dot."""
ACTUAL, WANTED = "$text-accent", "$text-primary"
AXIS = 9
"""Cells for the numbers left of a plot, with a gap."""
LOWEST = 4
"""Lines of a plot at least."""
LOWEST_WITH_LEGEND = 10
"""Lines of a plot with what stands around it, from which on one is left for what the signs on its axis mean."""
Column = tuple[float, float] | None
Cells = tuple[int, int]


def dots_across(width: int, *, ascii: bool) -> int:
    """How many columns of dots fit into so many cells."""
    return width if ascii else 2 * width


def plot(  # noqa: PLR0913 (a plot has all of these)
    columns: Sequence[Column],
    low: float,
    high: float,
    height: int,
    *,
    ascii: bool,
    wanted: Sequence[Column] = (),
    cursor: int | None = None,
    rule: str = "|",
    span: Cells | None = None,
    zero: str = "",
    shaded: str = " ",
) -> list[Content]:
    """Lines of cells, from the top down. A column is drawn from its least to its greatest value.

    Args:
        columns: per column of dots the values between which to draw; None where there is nothing.
        low: value of the lowest dot.
        high: value of the highest dot.
        height: lines of cells.
        wanted: what the line was to follow, drawn dotted behind it, and in a colour where there are colours.
        cursor: column of cells to mark by a line of `rule` where nothing else is drawn.
        span: the first and the last column of cells that are shaded, with the sign `shaded`.
        zero: what the line of zero is drawn with, where it lies between both ends.
    """
    tall = height if ascii else 4 * height
    actual = _filled(columns, low, high, tall)
    # Every other column (in ASCII another sign), for a terminal without colours tells the two apart as well.
    behind = [part if ascii or x % 4 == 0 else None for x, part in enumerate(_filled(wanted, low, high, tall))]
    behind += [None] * (len(actual) - len(behind))
    dots, behind_dots = _dots(actual, tall, ascii=ascii), _dots(behind, tall, ascii=ascii)
    at_zero = _row(0.0, low, high, height) if zero and low < 0 < high else None
    lines = []
    for y in range(height):
        cells = []
        for place in range(len(actual) if ascii else (len(actual) + 1) // 2):
            here, there = dots.get((place, y), 0), behind_dots.get((place, y), 0)
            if here or there:
                sign = ("*" if here else ".") if ascii else chr(EMPTY + (here | there))
                cells.append((sign, ACTUAL if here else WANTED))
            else:
                shade = span is not None and span[0] <= place <= span[1]
                cells.append((rule if place == cursor else zero if y == at_zero else shaded if shade else " ", "dim"))
        lines.append(assembled(cells))
    return lines


def _filled(columns: Sequence[Column], low: float, high: float, tall: int) -> list[tuple[int, int] | None]:
    """Per column its lowest and its highest dot."""
    span = (high - low) or 1.0

    def dot(value: float) -> int:
        return min(max(round((value - low) / span * (tall - 1)), 0), tall - 1)

    return _joined([None if part is None else (dot(part[0]), dot(part[1])) for part in columns])


def _joined(parts: Sequence[tuple[int, int] | None]) -> list[tuple[int, int] | None]:
    """Neighbours of which each goes half of the way to the other, so that a line is not broken where it is steep."""
    joined = list(parts)

    def reach(place: int, low: int, high: int) -> None:
        part = joined[place] or (low, high)
        joined[place] = min(part[0], low), max(part[1], high)

    for place, (one, following) in enumerate(pairwise(parts)):
        if one is None or following is None:
            continue
        middle = (max(one[0], following[0]) + min(one[1], following[1])) // 2
        if one[1] < following[0]:
            reach(place, one[0], middle)
            reach(place + 1, middle + 1, following[1])
        elif following[1] < one[0]:
            reach(place, middle + 1, one[1])
            reach(place + 1, following[0], middle)
    return joined


def _dots(parts: Sequence[tuple[int, int] | None], tall: int, *, ascii: bool) -> dict[Cells, int]:
    """The bits of every cell in which there are dots, by column and by line from the top down."""
    across, deep = (1, 1) if ascii else (2, 4)
    cells: dict[Cells, int] = {}
    for x, part in enumerate(parts):
        if part is None:
            continue
        top, bottom = tall - 1 - part[1], tall - 1 - part[0]
        for y in range(top // deep, bottom // deep + 1):
            bits = _BITS[x % across][max(top - deep * y, 0) : bottom - deep * y + 1]
            cells[x // across, y] = cells.get((x // across, y), 0) | sum(bits)
    return cells


def dot_sign(dots: Collection[tuple[int, int]]) -> str:
    """The braille sign of these dots of a cell, by column and by row from the top down."""
    return chr(EMPTY + sum(_BITS[x][y] for x, y in dots))


def assembled(cells: Sequence[tuple[str, str]]) -> Content:
    """Cells with their styles, neighbours of one style as one piece: each piece costs bytes."""
    pieces: list[tuple[str, str]] = []
    for sign, style in cells:
        if pieces and (pieces[-1][1] == style or sign == " "):
            pieces[-1] = pieces[-1][0] + sign, pieces[-1][1]
        else:
            pieces.append((sign, style))
    return Content.assemble(*(piece if piece[1] else piece[0] for piece in pieces))


class Figure(Record):
    """A signal drawn over a span of the log, with all that stands around it."""

    signal: Signal
    meaning: Field
    trace: Trace
    marks: Sequence[Mark] = ()
    start_s: float | None = None
    end_s: float | None = None
    """The time of the finding that it shows."""
    cursor_s: float | None = None
    has_legend: bool = True
    """Whether the signs on the axis are told below it, where there is room."""

    def rows(self, width: int, height: int, glyphs: Glyphs) -> list[Row]:
        """The figure in so many cells: what it is, the plot, what happened, and the axis of time."""
        trace, wide = self.trace, max(width - AXIS, 10)
        legend = self._legend(width, wide, glyphs) if self.has_legend and height >= LOWEST_WITH_LEGEND else []
        high = max(height - 3 - len(legend), LOWEST)
        span = self._span(wide)
        cursor = None if self.cursor_s is None else self._place(self.cursor_s, wide)
        lines = plot(
            trace.columns, trace.low, trace.high, high, ascii=glyphs is ASCII, wanted=trace.wanted, cursor=cursor,
            rule=glyphs.line, span=span, zero=glyphs.rule,
            shaded=glyphs.shade,
        )  # fmt: skip
        labels = value_labels(trace.low, trace.high, high)
        rows = [Row(cut(self._head(glyphs), width, glyphs))]
        rows += [Row(Content.styled(f"{labels.get(y, ''):>{AXIS - 1}} ", "dim") + line) for y, line in enumerate(lines)]
        return [*rows, Row(self._signs(wide, span, glyphs)), Row(self._times(wide)), *legend]

    def _head(self, glyphs: Glyphs) -> Content:
        unit = f", {self.meaning.unit}" if self.meaning.unit else ""
        named = text(f"{self.meaning.label}{unit}", "bold")
        head = Content.assemble(named, "  " if self.meaning.label else "", text(self.signal.name, f"bold {ACTUAL}"))
        if not self.trace.wanted:
            return head
        sign, why = ". " if glyphs is ASCII else "", "beside" if self.signal.is_beside else "wanted"
        return head + Content.styled(f"  {sign}{clean(self.signal.wanted_name)} ({why})", WANTED)

    def _drawn(self, wide: int) -> dict[int, Mark]:
        """The marks in the time that is drawn, by their cell: of those in one the first."""
        drawn: dict[int, Mark] = {}
        for mark in self.marks:
            if self.trace.start_s <= mark.time_s <= self.trace.end_s:
                drawn.setdefault(self._place(mark.time_s, wide), mark)
        return drawn

    def _legend(self, width: int, wide: int, glyphs: Glyphs) -> list[Row]:
        """What each sign on the axis means, by the first of its kind; the gravest first, as far as they fit."""
        first: dict[str, Mark] = {}
        for mark in sorted(self._drawn(wide).values(), key=lambda mark: mark.rank):
            first.setdefault(sign_of(mark, glyphs), mark)
        line = f"{'':>{AXIS - 2}}"
        for sign, mark in first.items():
            told = f"  {sign} {clean(mark.words)}"
            if len(line) + len(told) <= width:
                line += told
        return [Row(text(line, "dim"))] if line.strip() else []

    def _signs(self, wide: int, span: Cells | None, glyphs: Glyphs) -> Content:
        """What happened, and the time of the finding as a line."""
        signs = [" "] * wide
        if span is not None:
            signs[span[0] : span[1] + 1] = glyphs.rule * (span[1] + 1 - span[0])
        for place, mark in self._drawn(wide).items():
            signs[place] = sign_of(mark, glyphs)
        return Content(f"{'':>{AXIS}}{''.join(signs)}")

    def _times(self, wide: int) -> Content:
        """Round times below the plot; the last says its unit."""
        cells = [" "] * (wide + AXIS)
        ticks = time_ticks(self.trace.start_s, self.trace.end_s, max(wide // 14, 2))
        for time_s in ticks:
            words = tick_time(time_s) + (" s" if time_s == ticks[-1] < LONG_S else "")
            first = min(AXIS + self._place(time_s, wide), len(cells) - len(words))
            cells[first : first + len(words)] = words
        return Content.styled("".join(cells), "dim")

    def _span(self, wide: int) -> Cells | None:
        start_s, end_s = self.start_s, self.end_s
        if start_s is None or end_s is None or end_s < self.trace.start_s or start_s > self.trace.end_s:
            return None
        return self._place(start_s, wide), self._place(end_s, wide)

    def _place(self, time_s: float, wide: int) -> int:
        share = (time_s - self.trace.start_s) / max(self.trace.end_s - self.trace.start_s, 1e-9)
        return min(max(int(share * wide), 0), wide - 1)


def value_labels(low: float, top: float, high: int) -> dict[int, str]:
    """Round numbers at the nearest of the lines of a plot, and both ends where there is no round one."""
    if not low < top:
        return {high - 1: _number(low)}
    ticks = {_row(value, low, top, high): _number(value) for value in value_ticks(low, top, max(high // 3, 2))}
    return ticks or {0: _number(top), high - 1: _number(low)}


def pointer_row(words: str, at: int, wide: int, glyphs: Glyphs) -> Row:
    """A sign below a column of cells of a plot, with words on the side that has room."""
    line = f"{'':>{at}}{glyphs.up} {words}"
    if len(line) > wide:
        line = f"{words:>{max(at - 1, len(words))}} {glyphs.up}"
    return Row(text(f"{'':>{AXIS}}{line}", "bold"))


def mark_rows(marks: Sequence[Mark], glyphs: Glyphs) -> list[Row]:
    """Marks in words, below the figure whose axis has their signs."""
    return [Row(text(f"{sign_of(mark, glyphs)} {seconds(mark.time_s):>8}  {mark.words}"), 12) for mark in marks]


def _row(value: float, low: float, high: float, height: int) -> int:
    """The line of cells of a value, from the top down."""
    return min(max(round((high - value) / ((high - low) or 1.0) * (height - 1)), 0), height - 1)


def _number(value: float) -> str:
    """A round number in the cells beside the axis."""
    shown = f"{value:.6g}"
    return shown if len(shown) < AXIS else f"{value:.2g}"
