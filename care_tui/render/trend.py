"""How past runs went: verdicts and changes as signs, and below them each objective with its limit, run by run."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import repeat

from textual.content import Content

from care_core.application.viewing import Past
from care_core.report.document import ObjectiveEntry
from care_tui.render.plot import ACTUAL, AXIS, LOWEST, WANTED, Column, plot, pointer_row, value_labels
from care_tui.render.rows import ASCII, Glyphs, Row, cut, measure, sign_of_status, text

WIDEST = 8
"""Cells that a run takes at most."""


def trend_rows(runs: Sequence[Past], here: int, width: int, height: int, glyphs: Glyphs) -> list[Row]:
    """Runs in so many cells and lines: of more than fit the newest, or those from an older one on that is pointed at.

    Args:
        runs: oldest first.
        here: the one that is pointed at.
    """
    wide = max(width - AXIS, 10)
    words = f"{runs[here].at[:10]}, {here + 1} of {len(runs)} runs"
    first = min(here, max(len(runs) - wide, 0))
    shown, here = runs[first : first + wide], here - first
    each = min(max(wide // len(shown), 1), WIDEST)
    names = measured(shown)
    high = max((height - 4) // max(len(names), 1) - 2, LOWEST)
    drawn = [row for name in names for row in _objective(name, shown, here, each, high, width, glyphs)]
    verdicts = _signs("verdict", [sign_of_status(run.status, glyphs) for run in shown], each)
    changes = _signs("changed", [Content("P" if run.changed else " ") for run in shown], each)
    return [verdicts, changes, Row(Content()), *drawn, pointer_row(words, here * each + each // 2, wide, glyphs)]


def measured(runs: Sequence[Past]) -> list[str]:
    """The objectives that have a value in some of the runs and are no mere yes or no."""
    entries = [entry for run in runs for entry in run.report.objectives]
    return list(dict.fromkeys(one.name for one in entries if one.value is not None and one.kind != "functional"))


def _signs(words: str, signs: Sequence[Content], each: int) -> Row:
    """A sign for each run, in the middle of its cells."""
    cells = (sign.pad_left(each // 2).pad_right(each - each // 2 - 1) for sign in signs)
    return Row(Content.assemble((f"{words:>{AXIS - 1}} ", "dim"), *cells))


def _objective(
    name: str, runs: Sequence[Past], here: int, each: int, high: int, width: int, glyphs: Glyphs
) -> list[Row]:
    """The values of an objective, the limits of the runs behind them."""
    entries = [next((one for one in run.report.objectives if one.name == name), None) for run in runs]
    values = [None if one is None else one.value for one in entries]
    limits = [None if one is None or one.threshold is None else one.threshold.value for one in entries]
    known = [value for value in (*values, *limits) if value is not None]
    low, top = min(known), max(known)
    dots = each if glyphs is ASCII else 2 * each
    lines = plot(
        _steps(values, dots), low, top, high, ascii=glyphs is ASCII, wanted=_steps(limits, dots),
        cursor=here * each + each // 2, rule=glyphs.line,
    )  # fmt: skip
    labels = value_labels(low, top, high)
    rows = [Row(Content.styled(f"{labels.get(y, ''):>{AXIS - 1}} ", "dim") + line) for y, line in enumerate(lines)]
    return [Row(cut(_head(name, entries[here]), width, glyphs)), *rows, Row(Content())]


def _head(name: str, entry: ObjectiveEntry | None) -> Content:
    """What an objective was in the run that is pointed at."""
    value, unit = (None, "") if entry is None else (entry.value, entry.unit)
    told = "not evaluated" if value is None else measure(value, unit)
    bound = None if entry is None else entry.threshold
    limit = "" if bound is None else f"  limit {bound} {unit}".rstrip() + " (dotted)"
    return Content.assemble(text(name, "bold"), "  ", (told, f"bold {ACTUAL}"), text(limit, WANTED))


def _steps(values: Sequence[float | None], dots: int) -> list[Column]:
    """So many columns of dots for each run."""
    return [None if value is None else (value, value) for value in values for _ in repeat(None, dots)]
