"""A track and the way that was asked for, in text: dots of braille, or stars where the terminal has only ASCII."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Sequence
from itertools import pairwise

from textual.content import Content

from care_core.application.track import Point, Way
from care_core.report.marks import Mark
from care_core.text import figures
from care_tui.render.health import sign_of
from care_tui.render.plot import ACTUAL, WANTED, assembled, dot_sign
from care_tui.render.rows import ASCII, Glyphs, Row, Rows

_TALL = 2.0
"""How much higher than wide a cell is."""
_RULER, _ABOUT = 14, 1.0 + 1e-9
"""Cells of the ruler at most, and what rounding adds to a power of ten."""
_OTHERWISE = {"E": "!"}
"""Signs of moments that mean something else on a map."""
_LEAST_M = 2.0
"""Metres that a map shows at least: a robot that stood has not wandered all over it."""


class _Canvas:
    """Dots of both lines, and signs above them. A dot is half a cell wide, a quarter high; in ASCII it is a cell."""

    def __init__(self, way: Way, width: int, height: int, *, ascii: bool) -> None:
        points = [*way.track, *way.legs]
        self.ascii, self.width, self.height = ascii, width, height
        self.across, self.down = (1, 1) if ascii else (2, 4)
        east, north = [x for x, _ in points], [y for _, y in points]
        wide, high = max(max(east) - min(east), _LEAST_M), max(max(north) - min(north), _LEAST_M)
        self.left = (min(east) + max(east) - wide) / 2
        self.top = (min(north) + max(north) + high) / 2
        self.metres = max(wide / max(width - 1, 1), high / max((height - 1) * _TALL, 1))
        """Metres that a cell is wide."""
        self.left -= (width * self.metres - wide) / 2

    def dot(self, point: Point) -> tuple[int, int]:
        x = (point[0] - self.left) / self.metres * self.across
        y = (self.top - point[1]) / (self.metres * _TALL) * self.down
        return (min(max(round(x), 0), self.width * self.across - 1), min(max(round(y), 0), self.height * self.down - 1))

    def line(self, points: Sequence[Point]) -> Iterator[tuple[int, int]]:
        """Every dot of the way through these points."""
        dots = [self.dot(point) for point in points]
        for (x1, y1), (x2, y2) in pairwise(dots):
            steps = max(abs(x2 - x1), abs(y2 - y1), 1)
            yield from ((round(x1 + (x2 - x1) * i / steps), round(y1 + (y2 - y1) * i / steps)) for i in range(steps))
        yield from dots[-1:]

    def cells(self, dots: Iterator[tuple[int, int]], *, dotted: bool = False) -> dict[tuple[int, int], str]:
        """The cells that a line fills; a dotted one keeps every other dot."""
        found: dict[tuple[int, int], set[tuple[int, int]]] = {}
        for x, y in dots:
            if not dotted or self.ascii or (x + y) % 3 == 0:
                found.setdefault((x // self.across, y // self.down), set()).add((x % self.across, y % self.down))
        sign = "." if dotted else "*"
        return {cell: sign if self.ascii else dot_sign(bits) for cell, bits in found.items()}


def map_rows(
    way: Way, marks: Sequence[Mark], width: int, height: int, glyphs: Glyphs, here_s: float | None = None
) -> list[Row]:
    """The map in so many cells, with what its signs mean.

    Args:
        here_s: the time of which the place is marked, seconds of the log.
    """
    signs = [sign_of(mark, glyphs) for mark in marks]
    told = [(_at(way, mark.time_s), _OTHERWISE.get(sign, sign)) for mark, sign in zip(marks, signs, strict=True)]
    legend = _legend(way, {sign for _, sign in told}, glyphs, is_here=here_s is not None)
    room = 1 + len(Rows([legend]).wrap(width))
    canvas = _Canvas(way, width, max(height - room, 4), ascii=glyphs is ASCII)
    legs = canvas.cells(canvas.line(way.legs), dotted=True) if way.legs else {}
    drawn = {cell: (sign, WANTED) for cell, sign in legs.items()}
    drawn |= {cell: (sign, ACTUAL) for cell, sign in canvas.cells(canvas.line(way.track)).items()}
    faults = [(point, sign) for point, sign in told if sign == glyphs.fault]
    # What is drawn later covers what was there: both ends stay in view beneath nothing but a fault.
    ends = [(way.track[0], "S"), (way.track[-1], "E")]
    here = [] if here_s is None else [(_at(way, here_s), "@")]
    for point, sign in (*((corner, "o") for corner in way.legs), *told, *ends, *faults, *here):
        x, y = canvas.dot(point)
        drawn[x // canvas.across, y // canvas.down] = sign, "bold $text-error" if sign == glyphs.fault else "bold"
    rows = [Row(assembled([drawn.get((x, y), (" ", "")) for x in range(canvas.width)])) for y in range(canvas.height)]
    return [*rows, Row(Content(_scale(canvas.metres, glyphs))), legend]


def _scale(metres: float, glyphs: Glyphs) -> str:
    """A bar as long as the longest of 1, 2 or 5 metres, or tens of them, that is no longer than the ruler.

    Args:
        metres: that a cell is wide.
    """
    power = 10.0 ** math.floor(math.log10(metres * _RULER))
    long = max(step * power for step in (1, 2, 5) if step * power <= metres * _RULER * _ABOUT)
    return f"{glyphs.rule * max(round(long / metres), 1)} {figures(long, 2)} m"


def _legend(way: Way, seen: Collection[str], glyphs: Glyphs, *, is_here: bool) -> Row:
    """What the signs of a map mean."""
    asked = ("  ... asked for, o its corners", WANTED) if way.legs else ""
    here = "  @ here" if is_here else ""
    words = ((glyphs.fault, "fault"), ("!", "warning"), ("C", "crash"), ("F", "failsafe"), ("R", "recovery"))
    meant = "".join(f"  {sign} {word}" for sign, word in words if sign in seen)
    return Row(Content.assemble((f"{glyphs.root} track", ACTUAL), "  S start  E end", here, meant, asked))


def _at(way: Way, time_s: float) -> Point:
    """Where the robot was at this time."""
    place = min(range(len(way.times_s)), key=lambda i: abs(way.times_s[i] - time_s))
    return way.track[place]
