"""Causal paths as a drawing: from the options on the left to the objective on the right, one box a variable.

Causes share their later steps, which are drawn once. A line carries the effect of the step in standard deviations and
the share of resamples that hold it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from html import escape

from care_core.diagnose.records import Cause, Fault, PathNode
from care_core.records import Record
from care_core.text import clean, figures

MOST = 4
"""Causes that are drawn, the best first."""
_CHARACTER, _PAD, _LINE = 7.3, 10, 17
"""Width of a character, room at the sides of a box, height of a line; in units of the drawing."""
_BOX, _GAP, _ROOM, _EDGE = 62, 74, 16, 4
"""Height of a box; free width between columns, free height between rows, and around all."""

_LEAST = 0.75
"""What a drawing is scaled down to at most before it is scrolled."""

Place = tuple[int, int]
"""Column and row."""


class _Edge(Record):
    """A step: `via` are the rows it passes in the columns between."""

    start: str
    end: str
    effect: float | None
    support: float | None
    via: tuple[Place, ...]
    is_first: bool
    """Whether it is on the path of the best cause."""


def paths_svg(fault: Fault, name: str) -> Iterator[str]:
    """The paths of a fault's causes; `name` is unique in the page."""
    causes = [cause for cause in fault.causes[:MOST] if len(cause.path) > 1]
    if not causes:
        return
    columns = _columns([[node.name for node in cause.path] for cause in causes])
    places, edges = _placed(causes, columns)
    texts = {node.name: _lines(node, cause, fault) for cause in reversed(causes) for node in cause.path}
    yield from _Drawing(places, texts).svg(edges, causes, fault, name)


def _columns(paths: Sequence[Sequence[str]]) -> dict[str, int]:
    """The column of each variable, from 0 on the right: as many steps from the objective as its longest way has.
    Options all stand in the last column, on the left."""
    columns: dict[str, int] = {}
    for _ in range(sum(map(len, paths))):  # each round carries a longest way one step farther; paths have no circles
        before = dict(columns)
        for path in paths:
            for start, end in zip(reversed(path[:-1]), reversed(path[1:]), strict=True):
                columns[start] = max(columns.get(start, 0), columns.setdefault(end, 0) + 1)
        if columns == before:
            break
    last = max(columns.values())
    return {**columns, **{path[0]: last for path in paths}}


def _placed(causes: Sequence[Cause], columns: Mapping[str, int]) -> tuple[dict[str, Place], list[_Edge]]:
    """A place for each variable, the best cause on top, and for each step that passes over columns one in each."""
    rows = [0] * (max(columns.values()) + 1)
    places: dict[str, Place] = {}
    edges: dict[tuple[str, str], _Edge] = {}

    def take(column: int) -> Place:
        rows[column] += 1
        return column, rows[column] - 1

    for cause in causes:
        for node, following in zip(cause.path, cause.path[1:], strict=False):
            if node.name not in places:
                places[node.name] = take(columns[node.name])
            if (node.name, following.name) not in edges:
                between = range(columns[node.name] - 1, columns[following.name], -1)
                via = tuple(take(column) for column in between)
                edges[node.name, following.name] = _Edge(
                    node.name, following.name, node.effect, node.support, via, cause is causes[0]
                )
        if cause.path[-1].name not in places:
            places[cause.path[-1].name] = take(columns[cause.path[-1].name])
    return places, list(edges.values())


def _lines(node: PathNode, cause: Cause, fault: Fault) -> tuple[str, ...]:
    """What stands in a box: the variable, its value in this run, and what it is held against."""
    unit = f" {node.unit}" if node.unit else ""
    if node is cause.path[0]:
        driven = cause.option.driven(cause.current, cause.is_assumed)
        suggested = "" if cause.suggested is None else f"suggested {cause.option.show(cause.suggested)}{unit}"
        return tuple(clean(line) for line in (node.name, f"driven {driven}{unit}", suggested))
    here = "not known" if node.value is None else f"{figures(node.value, 4)}{unit}"
    expected = "" if node.expected is None else f"{figures(node.expected)}{unit} expected"
    if node is cause.path[-1] and fault.objective.threshold is not None and fault.objective.variable.name == node.name:
        expected = f"wanted {fault.objective.threshold}{unit}"
    return tuple(clean(line) for line in (node.name, here, expected))


class _Drawing(Record):
    places: Mapping[str, Place]
    texts: Mapping[str, tuple[str, ...]]

    @property
    def widths(self) -> list[float]:
        """Width of each column, by its longest text."""
        columns = max(column for column, _ in self.places.values()) + 1
        widths = [0.0] * columns
        for name, (column, _) in self.places.items():
            longest = max(len(self.texts[name][0]) * 1.06, *map(len, self.texts[name][1:]))
            widths[column] = max(widths[column], longest * _CHARACTER + 2 * _PAD)
        return widths

    def left(self, column: int) -> float:
        widths = self.widths
        return _EDGE + sum(widths[column + 1 :]) + _GAP * (len(widths) - 1 - column)

    def middle(self, place: Place) -> float:
        return _EDGE + place[1] * (_BOX + _ROOM) + _BOX / 2

    def svg(self, edges: Sequence[_Edge], causes: Sequence[Cause], fault: Fault, name: str) -> Iterator[str]:
        rows = max(row for _, row in (*self.places.values(), *(place for edge in edges for place in edge.via))) + 1
        width = self.left(0) + self.widths[0] + _EDGE
        height = rows * (_BOX + _ROOM) - _ROOM + 2 * _EDGE
        yield (
            f'<svg class="paths" viewBox="0 0 {width:.0f} {height:.0f}" role="img" '
            f'style="max-width:{width:.0f}px;min-width:{width * _LEAST:.0f}px" '
            f'aria-labelledby="{name}-title {name}-text">'
        )
        objective = escape(clean(fault.objective.variable.name))
        yield f'<title id="{name}-title">Causal paths to {objective}</title>'
        yield f'<desc id="{name}-text">{escape(" ".join(_alt_text(cause) for cause in causes))}</desc>'
        ordered = sorted(edges, key=lambda edge: edge.is_first)
        for edge in ordered:
            yield from self._edge(edge)
        for node, place in self.places.items():
            yield from self._box(node, place, causes, fault)
        for edge in ordered:
            branches = sum(other.start == edge.start for other in ordered) > 1
            yield from self._label(edge, branches=branches)
        yield "</svg>"

    def _edge(self, edge: _Edge) -> Iterator[str]:
        start, end = self.places[edge.start], self.places[edge.end]
        x, y = self.left(start[0]) + self.widths[start[0]], self.middle(start)
        path = f"M{x:.1f} {y:.1f}"
        for place in (*edge.via, end):
            to_x, to_y = self.left(place[0]), self.middle(place)
            if place == end:
                to_x -= 7
            half = (x + to_x) / 2
            path += f"C{half:.1f} {y:.1f} {half:.1f} {to_y:.1f} {to_x:.1f} {to_y:.1f}"
            x, y = to_x, to_y
            if place != end:
                x = self.left(place[0]) + self.widths[place[0]]
                path += f"H{x:.1f}"
        strength = 1.2 + 1.6 * min(abs(edge.effect or 0.0), 1.5)
        seldom = " seldom" if edge.support is not None and edge.support < 0.5 else ""
        first = " first" if edge.is_first else ""
        yield f'<path class="step{first}{seldom}" stroke-width="{strength:.1f}" d="{path}"/>'
        yield f'<path class="head{first}" d="M{x + 7:.1f} {y:.1f}l-9 -4.5v9z"/>'

    def _label(self, edge: _Edge, *, branches: bool) -> Iterator[str]:
        """Effect above the line, support below it, where it leaves its variable; where several do, half way."""
        start = self.places[edge.start]
        after = edge.via[0] if edge.via else self.places[edge.end]
        x = self.left(start[0]) + self.widths[start[0]] + _GAP / 2 - 5
        y = (self.middle(start) + self.middle(after)) / 2 if branches else self.middle(start)
        if edge.effect is not None:
            yield f'<text class="effect" x="{x:.1f}" y="{y - 6:.1f}">{_signed(edge.effect)}</text>'
        if edge.support is not None and math.isfinite(edge.support):
            yield f'<text class="support" x="{x:.1f}" y="{y + 16:.1f}">in {edge.support:.0%}</text>'

    def _box(self, name: str, place: Place, causes: Sequence[Cause], fault: Fault) -> Iterator[str]:
        x, y = self.left(place[0]), self.middle(place) - _BOX / 2
        role = "option" if any(cause.path[0].name == name for cause in causes) else "metric"
        if any(cause.path[-1].name == name for cause in causes):
            role = "objective"
        first = " first" if any(node.name == name for node in causes[0].path) else ""
        yield f'<rect class="box {role}{first}" x="{x:.1f}" y="{y:.1f}" width="{self.widths[place[0]]:.1f}" '
        yield f'height="{_BOX}" rx="6"/>'
        lines = [line for line in self.texts[name] if line]
        top = y + (_BOX - len(lines) * _LINE) / 2 + 12.5
        for number, line in enumerate(lines):
            style = ("name", "value", "against")[number]
            yield f'<text class="{style}" x="{x + _PAD:.1f}" y="{top + number * _LINE:.1f}">{escape(line)}</text>'


def _signed(effect: float) -> str:
    return f"{effect:+.2f}".replace("-", "\u2212")


def _alt_text(cause: Cause) -> str:
    """A path in words, for who does not see it."""
    steps = [cause.path[0].name]
    for node, following in zip(cause.path, cause.path[1:], strict=False):
        effect = "" if node.effect is None else f" (effect {node.effect:+.2f}"
        support = (
            "" if node.support is None or node.support != node.support else f", in {node.support:.0%} of resamples"
        )
        steps.append(f"leads to {following.name}{effect}{support}{')' if effect else ''}")
    return clean(f"{cause.rank}: {' '.join(steps)}.")
