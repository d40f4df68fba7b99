"""Signals of a run as plots in a page: lines in SVG that stretch with it, numbers and marks beside them in HTML.

What is drawn are plain values (`Drawing`); `application.plotting` takes them from a log. Colours are the page's.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from html import escape

from care_core.diagnose.records import Fault
from care_core.records import Record
from care_core.report.axes import tick_time, time_ticks, value_ticks
from care_core.report.marks import Mark
from care_core.report.responses import Response
from care_core.text import LONG_S, clean, figures, log_time

Point = tuple[float, float]
"""Seconds of the log, and a value."""

_WIDE, _HIGH = 1000, 200
"""What the lines are drawn in; the page stretches it to its width."""
_TICKS_X, _TICKS_Y = 7, 4
"""Numbers at an axis at most, or one more."""
_MARGIN = 0.06
"""Share of the values' span that is free above and below them."""
_CLOSE = 0.045
"""Marks that are nearer, as a share of the width, share a sign."""


class Line(Record):
    """A signal; `segments` are apart where the log has a gap."""

    name: str
    segments: tuple[tuple[Point, ...], ...]
    is_wanted: bool = False
    """Whether it is what another line was to follow."""


class Limit(Record):
    """A value that the signal was to keep, and whose limit it is."""

    value: float
    words: str


class Band(Record):
    """The time of a finding that these signals show."""

    start_s: float
    end_s: float
    severity: str
    words: str


class Plot(Record):
    """Signals of one unit over the mission."""

    words: str
    """What it is, empty where that is not known."""
    source: str
    """Channel and fields."""
    unit: str
    read_for: tuple[str, ...]
    """Variables of the profile that are read from it."""
    lines: tuple[Line, ...]
    limits: tuple[Limit, ...] = ()
    bands: tuple[Band, ...] = ()
    matters: bool = True
    """Whether a finding, a fault or a causal path speaks of it."""

    @property
    def title(self) -> str:
        return self.words or self.source


class Drawing(Record):
    """What a page draws beside its text: the paths of the causes, and signals from `start_s` to `end_s` of the log."""

    faults: tuple[Fault, ...] = ()
    plots: tuple[Plot, ...] = ()
    marks: tuple[Mark, ...] = ()
    deadlines: tuple[Limit, ...] = ()
    """Limits of a time, in seconds of the log."""
    start_s: float = 0.0
    end_s: float = 1.0
    scale_end_s: float = math.inf
    """What comes later does not set the scale: what is down is thrown about."""
    since: str = "the start of the log"
    """What the seconds count from: that of the log, unless several runs are laid over each other."""
    responses: tuple[Response, ...] = ()
    """How the odds answer to each parameter that the fix changes."""


NOTHING_DRAWN = Drawing()


def plot_figure(plot: Plot, drawn: Drawing, name: str) -> Iterator[str]:
    """A plot as a figure; `name` is unique in the page.

    The SVG stretches with the page, so only what may stretch is in it: lines of constant width and bands.
    """
    frame = _Frame.of(plot, drawn)
    yield f'<figure class="plot" id="{name}">'
    yield from _caption(plot)
    yield '<div class="area"><div class="y" aria-hidden="true">'
    for value in frame.values:
        yield f'<span style="top:{frame.y_share(value):.1%}">{_number(value)}</span>'
    yield '</div><div class="field">'
    yield from _svg(plot, drawn, frame, name)
    yield '<div class="signs" aria-hidden="true">'
    for first, last, severity, x in _signs(drawn, frame):
        text = f"{first}" if first == last else f"{first}\u2013{last}"
        edge = " last" if x > 1 - _CLOSE else ""
        yield f'<span class="sign {severity}{edge}" style="left:{x:.2%}">{text}</span>'
    yield "</div>"
    for limit in plot.limits:
        if frame.low <= limit.value <= frame.high:
            side = " low" if frame.y_share(limit.value) < 0.2 else ""
            text = f"{escape(clean(limit.words))}: {figures(limit.value, 4)} {escape(clean(plot.unit))}".rstrip()
            yield f'<span class="limit{side}" style="top:{frame.y_share(limit.value):.1%}">{text}</span>'
    yield '</div><div class="x" aria-hidden="true">'
    for time_s in frame.times:
        unit = " s" if time_s == frame.times[-1] < LONG_S else ""
        yield f'<span style="left:{frame.x_share(time_s):.2%}">{tick_time(time_s)}{unit}</span>'
    yield "</div></div></figure>"


def _signs(drawn: Drawing, frame: _Frame) -> Iterator[tuple[int, int, str, float]]:
    """Marks that stand close to each other, as the numbers of the first and the last, the gravest, and a place."""
    groups: list[list[int]] = []
    places = [frame.x_share(mark.time_s) for mark in drawn.marks]
    for number, place in enumerate(places):
        if groups and place - places[groups[-1][0]] < _CLOSE:
            groups[-1].append(number)
        else:
            groups.append([number])
    for group in groups:
        gravest = min((drawn.marks[number] for number in group), key=lambda mark: mark.rank)
        middle = (places[group[0]] + places[group[-1]]) / 2
        yield group[0] + 1, group[-1] + 1, gravest.severity, middle


def _caption(plot: Plot) -> Iterator[str]:
    unit = f", {escape(clean(plot.unit))}" if plot.unit else ""
    named = f"<strong>{escape(clean(plot.words))}</strong>{unit} <code>{escape(clean(plot.source))}</code>"
    head = named if plot.words else f"<code>{escape(clean(plot.source))}</code>{unit}"
    yield f"<figcaption>{head}"
    if plot.read_for:
        yield f'<span class="quiet">read for {escape(clean(", ".join(plot.read_for)))}</span>'
    if len(plot.lines) > 1:
        yield '<span class="legend">'
        for style, line in zip(_styles(plot.lines), plot.lines, strict=True):
            yield f'<span class="key {style}">{escape(clean(line.name))}</span>'
        yield "</span>"
    yield "</figcaption>"


def _svg(plot: Plot, drawn: Drawing, frame: _Frame, name: str) -> Iterator[str]:
    yield (
        f'<svg viewBox="0 0 {_WIDE} {_HIGH}" preserveAspectRatio="none" role="img" '
        f'aria-labelledby="{name}-title {name}-text">'
    )
    yield f'<title id="{name}-title">{escape(clean(plot.title))} over the mission</title>'
    yield f'<desc id="{name}-text">{escape(clean(_alt_text(plot, drawn)))}</desc>'
    for band in plot.bands:
        left, right = frame.x(max(band.start_s, drawn.start_s)), frame.x(min(band.end_s, drawn.end_s))
        yield (
            f'<rect class="band {band.severity}" x="{left:.1f}" y="0" width="{max(right - left, 2):.1f}" '
            f'height="{_HIGH}"><title>{escape(clean(band.words))}</title></rect>'
        )
    for value in frame.values:
        yield f'<path class="grid" d="M0 {frame.y(value):.1f}H{_WIDE}"/>'
    for number, mark in enumerate(drawn.marks, start=1):
        title = f"{number}: {clean(mark.words)}, {log_time(mark.time_s)}"
        yield f'<path class="mark {mark.severity}" d="M{frame.x(mark.time_s):.1f} 0V{_HIGH}"><title>'
        yield f"{escape(title)}</title></path>"
    for limit in drawn.deadlines:
        if drawn.start_s < limit.value < drawn.end_s:
            yield f'<path class="bound" d="M{frame.x(limit.value):.1f} 0V{_HIGH}"><title>'
            yield f"{escape(clean(limit.words))}</title></path>"
    for limit in plot.limits:
        if frame.low <= limit.value <= frame.high:
            yield f'<path class="bound" d="M0 {frame.y(limit.value):.1f}H{_WIDE}"/>'
    for style, line in zip(_styles(plot.lines), plot.lines, strict=True):
        yield f'<path class="line {style}" d="{frame.path(line)}"/>'
    yield "</svg>"


def _styles(lines: Sequence[Line]) -> list[str]:
    """A class a line: what was wanted looks like what was to follow it, dotted."""
    numbers = iter(range(1, 9))
    return ["wanted" if line.is_wanted else f"line{next(numbers, 8)}" for line in lines]


def _alt_text(plot: Plot, drawn: Drawing) -> str:
    """The plot in words, for who does not see it."""
    parts = []
    for line in plot.lines:
        values = [value for segment in line.segments for _, value in segment]
        if values:
            span = f"{figures(min(values))} to {figures(max(values))} {plot.unit}".rstrip()
            parts.append(f"{clean(line.name)}{' (wanted)' if line.is_wanted else ''}: {span}")
    parts += [f"{clean(limit.words)}: {figures(limit.value)} {plot.unit}".rstrip() for limit in plot.limits]
    parts += [f"{clean(b.words)} from {log_time(b.start_s)}" for b in plot.bands]
    return f"{log_time(drawn.start_s)} to {log_time(drawn.end_s)} from {drawn.since}. {'; '.join(parts)}."


class _Frame(Record):
    """From seconds and values to places."""

    start_s: float
    end_s: float
    low: float
    high: float
    times: tuple[float, ...]
    """Ticks in seconds of the log."""
    values: tuple[float, ...]

    @classmethod
    def of(cls, plot: Plot, drawn: Drawing) -> _Frame:
        points = [point for line in plot.lines for segment in line.segments for point in segment]
        values = [value for time_s, value in points if time_s <= drawn.scale_end_s] or [value for _, value in points]
        low, high = min(values), max(values)
        span = high - low or max(abs(high), 1.0)
        # A limit is drawn where it does not press the signal flat; else the signal kept it by far.
        near = [limit.value for limit in plot.limits if low - span <= limit.value <= high + span]
        low, high = min((low, *near)), max((high, *near))
        pad = (high - low) * _MARGIN or max(abs(high), 1.0) * 0.1
        low, high = low - pad, high + pad
        times = time_ticks(drawn.start_s, drawn.end_s, _TICKS_X)
        return cls(drawn.start_s, drawn.end_s, low, high, times, value_ticks(low, high, _TICKS_Y))

    def x_share(self, time_s: float) -> float:
        return min(max((time_s - self.start_s) / max(self.end_s - self.start_s, 1e-9), 0.0), 1.0)

    def y_share(self, value: float) -> float:
        return (self.high - value) / (self.high - self.low)

    def x(self, time_s: float) -> float:
        return self.x_share(time_s) * _WIDE

    def y(self, value: float) -> float:
        """A place in the field; what is outside the scale runs along its edge."""
        return min(max(self.y_share(value), 0.0), 1.0) * _HIGH

    def path(self, line: Line) -> str:
        """The line as path data; a single value between two gaps is a dash."""
        parts = []
        for segment in line.segments:
            places = [f"{self.x(time_s):.1f} {self.y(value):.1f}" for time_s, value in segment]
            parts.append(f"M{'L'.join(places)}" if len(places) > 1 else f"M{places[0]}h2")
        return "".join(parts)


def _number(value: float) -> str:
    return f"{value:.6g}".replace("-", "\u2212")
