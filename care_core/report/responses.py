"""How the odds answer to the value of a parameter, as a curve in a page, or as a row for each of few values."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape
from itertools import groupby

from care_core.diagnose.records import Odds
from care_core.records import Record
from care_core.report.axes import Scale
from care_core.text import clean, listed, percent
from care_core.variables import Variable

FEW = 6
"""Values up to which each has a row of its own."""
_WIDE, _HIGH = 1000, 200
_CLOSE = 0.08
"""Ticks that are nearer to one another, as a share of the width, are left out."""


class Response(Record):
    """The odds that all objectives are met, by the value of one option, ascending."""

    option: Variable
    odds: tuple[Odds, ...]
    marks: tuple[tuple[float, str], ...] = ()
    """Values that are pointed at, and what they are."""

    @property
    def has_curve(self) -> bool:
        """Whether there are so many values that a curve is drawn."""
        return len(self.odds) > FEW and not self.option.labels

    @property
    def scale(self) -> Scale:
        return Scale(self.odds[0].value, self.odds[-1].value, self.option.is_log_scaled and self.odds[0].value > 0)

    @property
    def is_guessed(self) -> bool:
        """Whether a part of it is one."""
        return any(one.is_guess for one in self.odds)

    @property
    def told(self) -> list[str]:
        """The values that are pointed at, in words."""
        return [f"{self.option.show(value)} {words}" for value, words in sorted(self.marks)]

    def rows(self) -> list[tuple[str, str, str]]:
        """Each value with its odds, and what it is."""
        marks = dict(self.marks)
        return [
            (self.option.show(one.value), percent(one.p_ok), ", ".join(
                word for word in (marks.get(one.value, ""), "a guess" * one.is_guess) if word))
            for one in self.odds
        ]  # fmt: skip


def response_figure(response: Response, name: str) -> Iterator[str]:
    """A curve as a figure; `name` is unique in the page. What is a guess is broken."""
    option, scale = response.option, response.scale
    unit = f", {escape(clean(option.unit))}" if option.unit else ""
    yield f'<figure class="plot" id="{name}"><figcaption><code>{escape(clean(option.name))}</code>{unit}'
    guess = "; broken where no training run came near" if response.is_guessed else ""
    yield f'<span class="quiet">{escape(clean(listed(response.told)))}{guess}</span></figcaption>'
    yield '<div class="area"><div class="y" aria-hidden="true">'
    for percentage in (0, 50, 100):
        yield f'<span style="top:{100 - percentage}%">{percentage}%</span>'
    yield '</div><div class="field">'
    yield f'<svg viewBox="0 0 {_WIDE} {_HIGH}" preserveAspectRatio="none" role="img" aria-labelledby="{name}-text">'
    yield f'<desc id="{name}-text">{escape(clean(_words(response)))}</desc>'
    for y in (0.25, 0.5, 0.75):
        yield f'<path class="grid" d="M0 {y * _HIGH:.0f}H{_WIDE}"/>'
    for value, words in response.marks:
        at = scale.share(value) * _WIDE
        yield f'<path class="mark" d="M{at:.1f} 0V{_HIGH}"><title>{escape(words)}</title></path>'
    for style, points in _parts(response):
        yield f'<path class="line {style}" d="M{"L".join(points)}"/>'
    yield '</svg><div class="signs" aria-hidden="true">'
    for value, words in response.marks:
        share = scale.share(value)
        edge = " last" if share > 1 - _CLOSE else ""
        yield f'<span class="sign{edge}" style="left:{share:.2%}">{escape(words[:1].upper())}</span>'
    yield '</div></div><div class="x" aria-hidden="true">'
    for value in _ticks(scale):
        yield f'<span style="left:{scale.share(value):.2%}">{option.show(value)}</span>'
    yield "</div></div></figure>"


def _parts(response: Response) -> Iterator[tuple[str, list[str]]]:
    """The line in parts that are known and parts that are guesses, each reaching the one before."""
    scale, before = response.scale, ""
    for is_guess, odds in groupby(response.odds, lambda one: one.is_guess):
        points = [f"{scale.share(one.value) * _WIDE:.1f} {(1 - one.p_ok) * _HIGH:.1f}" for one in odds]
        yield "wanted" if is_guess else "line1", [before, *points] if before else points
        before = points[-1]


def _ticks(scale: Scale) -> list[float]:
    kept = [scale.low]
    for value in (*scale.ticks(), scale.high):
        if scale.share(value) - scale.share(kept[-1]) >= _CLOSE:
            kept.append(value)
    return kept


def _words(response: Response) -> str:
    """The curve in words, for who does not see it."""
    some = response.odds[:: max(len(response.odds) // 6, 1)]
    return "; ".join(f"{response.option.show(one.value)}: {percent(one.p_ok)}" for one in some)
