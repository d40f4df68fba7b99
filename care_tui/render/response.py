"""How the odds answer to the value of one parameter: a curve over its range, or a bar for each of few values."""

from __future__ import annotations

from bisect import bisect_right

from textual.content import Content

from care_core.report.responses import Response
from care_tui.render.odds import promise
from care_tui.render.plot import AXIS, LOWEST, Column, dots_across, plot, pointer_row
from care_tui.render.rows import ASCII, Glyphs, Row, cut, padded, text

TICKS = {0.0: "0%", 0.5: "50%", 1.0: "100%"}
GUESS = "dotted: no training run came near, a guess"


def response_rows(response: Response, width: int, height: int, glyphs: Glyphs) -> list[Row]:
    """The odds that every objective is met, by the value of an option, in so many cells and lines."""
    option = response.option
    head = Row(cut(text(f"{option.name}, {option.unit}" if option.unit else option.name, "bold"), width, glyphs))
    if not response.has_curve:
        return [head, *_bars(response, glyphs)]
    wide = max(width - AXIS, 10)
    dotted = [Row(text(f"{'':>{AXIS}}{GUESS}", "dim"))] if response.is_guessed else []
    below = [Row(_scale(response, wide)), *_pointers(response, wide, glyphs), *dotted]
    high = max(height - len(below) - 1, LOWEST)
    known, guessed = _columns(response, dots_across(wide, ascii=glyphs is ASCII))
    lines = plot(known, 0.0, 1.0, high, ascii=glyphs is ASCII, wanted=guessed)
    labels = {round((1.0 - share) * (high - 1)): words for share, words in TICKS.items()}
    rows = [Row(Content.styled(f"{labels.get(y, ''):>{AXIS - 1}} ", "dim") + line) for y, line in enumerate(lines)]
    return [head, *rows, *below]


def _bars(response: Response, glyphs: Glyphs) -> list[Row]:
    named = response.rows()
    width = max((len(name) for name, _, _ in named), default=0) + 2
    lines = [
        padded(name, width) + promise(one.p_ok, glyphs) + text(f"  {what}", "dim")
        for (name, _, what), one in zip(named, response.odds, strict=True)
    ]
    return [Row(line) for line in lines]


def _columns(response: Response, across: int) -> tuple[list[Column], list[Column]]:
    """Per column of dots the odds at its value, between the two values that were asked for: where a training run came
    near, and where they are a guess."""
    scale, odds = response.scale, response.odds
    places = [scale.share(one.value) for one in odds]
    known: list[Column] = [None] * across
    guessed: list[Column] = [None] * across
    for x in range(across):
        share = x / (across - 1)
        after = min(max(bisect_right(places, share), 1), len(odds) - 1)
        one, other = odds[after - 1], odds[after]
        part = (share - places[after - 1]) / (places[after] - places[after - 1])
        value = one.p_ok + (other.p_ok - one.p_ok) * min(max(part, 0.0), 1.0)
        columns = guessed if (one if part < 0.5 else other).is_guess else known
        columns[x] = value, value
    return known, guessed


def _scale(response: Response, wide: int) -> Content:
    """Both ends, and round values between them where there is room."""
    scale, cells = response.scale, [" "] * wide
    for value in (scale.low, scale.high, *scale.ticks()):
        words = response.option.show(value)
        first = min(round(scale.share(value) * (wide - 1)), wide - len(words))
        if first >= 0 and not "".join(cells[max(first - 2, 0) : first + len(words) + 2]).strip():
            cells[first : first + len(words)] = words
    return Content.styled(f"{'':>{AXIS}}{''.join(cells)}", "dim")


def _pointers(response: Response, wide: int, glyphs: Glyphs) -> list[Row]:
    """A line for each value that is pointed at: its sign below the curve, the words on the side that has room."""
    return [
        pointer_row(
            f"{response.option.show(value)} {what}", round(response.scale.share(value) * (wide - 1)), wide, glyphs
        )
        for value, what in sorted(response.marks)
    ]
