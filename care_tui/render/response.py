"""How the odds answer to the value of one parameter: a curve over its range, or a bar for each of few values."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Mapping, Sequence

from textual.content import Content

from care_core.application.case import Odds
from care_core.report.axes import value_ticks
from care_core.variables import Variable
from care_tui.render.odds import promise
from care_tui.render.plot import AXIS, Column, dots_across, plot
from care_tui.render.rows import ASCII, Glyphs, Row, cut, padded, text

FEW = 6
"""Values up to which each has a line of its own."""
TICKS = {0.0: "0 %", 0.5: "50 %", 1.0: "100 %"}


def response_rows(
    option: Variable, odds: Sequence[Odds], marks: Mapping[float, str], width: int, height: int, glyphs: Glyphs
) -> list[Row]:
    """The odds that every objective is met, by the value of an option.

    Args:
        odds: by value, ascending. marks: values that are pointed at, and what they are.
        height: lines of all of it.
    """
    head = Row(cut(text(f"{option.name}, {option.unit}" if option.unit else option.name, "bold"), width, glyphs))
    if len(odds) <= FEW or option.labels:
        return [head, *_bars(option, odds, marks, glyphs)]
    wide = max(width - AXIS, 10)
    pointers = _pointers(option, odds, marks, wide, glyphs)
    high = max(height - len(pointers) - (3 if any(one.is_guess for one in odds) else 2), 4)
    lines = plot(
        _columns(option, odds, wide, glyphs, guesses=False), 0.0, 1.0, high, ascii=glyphs is ASCII,
        wanted=_columns(option, odds, wide, glyphs, guesses=True),
    )  # fmt: skip
    labels = {round((1.0 - share) * (high - 1)): words for share, words in TICKS.items()}
    rows = [Row(Content.styled(f"{labels.get(y, ''):>{AXIS - 1}} ", "dim") + line) for y, line in enumerate(lines)]
    guess = "dotted: no training run came near, a guess"
    dotted = [Row(text(f"{'':>{AXIS}}{guess}", "dim"))] if any(one.is_guess for one in odds) else []
    return [head, *rows, Row(_scale(option, odds, wide)), *pointers, *dotted]


def _bars(option: Variable, odds: Sequence[Odds], marks: Mapping[float, str], glyphs: Glyphs) -> list[Row]:
    names = [option.show(one.value) for one in odds]
    width = max((len(name) for name in names), default=0) + 2
    rows = []
    for name, one in zip(names, odds, strict=True):
        said = [word for word in (marks.get(one.value, ""), "a guess" if one.is_guess else "") if word]
        line = padded(name, width) + promise(one.p_ok, glyphs)
        rows.append(Row(line + text(f"  {', '.join(said)}", "dim") if said else line))
    return rows


def _columns(option: Variable, odds: Sequence[Odds], wide: int, glyphs: Glyphs, *, guesses: bool) -> list[Column]:
    """Per column of dots the odds at its value, between the two values that were asked for; those near which a training
    run came, or the guesses."""
    places = [_place(option, odds, one.value) for one in odds]
    across = dots_across(wide, ascii=glyphs is ASCII)
    columns: list[Column] = []
    for x in range(across):
        share = x / (across - 1)
        after = min(max(bisect_right(places, share), 1), len(odds) - 1)
        one, other = odds[after - 1], odds[after]
        part = (share - places[after - 1]) / (places[after] - places[after - 1])
        value = one.p_ok + (other.p_ok - one.p_ok) * min(max(part, 0.0), 1.0)
        is_guess = (one if part < 0.5 else other).is_guess
        columns.append((value, value) if is_guess is guesses else None)
    return columns


def _place(option: Variable, odds: Sequence[Odds], value: float) -> float:
    """Where a value stands between the first and the last, 0 to 1, on the option's scale."""
    low, high = odds[0].value, odds[-1].value
    value = min(max(value, low), high)
    if option.is_log_scaled and low > 0:
        return math.log(value / low) / math.log(high / low)
    return (value - low) / (high - low)


def _scale(option: Variable, odds: Sequence[Odds], wide: int) -> Content:
    """Both ends, and round values between them where there is room."""
    low, high = odds[0].value, odds[-1].value
    cells = [" "] * wide
    for value in (low, high, *_round_values(low, high, is_log=option.is_log_scaled)):
        words = option.show(value)
        first = min(round(_place(option, odds, value) * (wide - 1)), wide - len(words))
        if first >= 0 and not "".join(cells[max(first - 2, 0) : first + len(words) + 2]).strip():
            cells[first : first + len(words)] = words
    return Content.styled(f"{'':>{AXIS}}{''.join(cells)}", "dim")


def _round_values(low: float, high: float, *, is_log: bool) -> list[float]:
    if not is_log:
        return list(value_ticks(low, high, 5))
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    values = [step * 10.0**decade for decade in decades for step in (1, 2, 5)]
    return [value for value in values if low < value < high]


def _pointers(
    option: Variable, odds: Sequence[Odds], marks: Mapping[float, str], wide: int, glyphs: Glyphs
) -> list[Row]:
    """A line for each value that is pointed at: its sign below the curve, the words on the side that has room."""
    rows = []
    for value, what in sorted(marks.items()):
        at = round(_place(option, odds, value) * (wide - 1))
        words = f"{option.show(value)} {what}"
        if at + len(words) + 2 <= wide:
            line = f"{'':>{at}}{glyphs.up} {words}"
        else:
            line = f"{words:>{max(at - 1, len(words))}} {glyphs.up}"
        rows.append(Row(text(f"{'':>{AXIS}}{line}", "bold")))
    return rows
