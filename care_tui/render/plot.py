"""Lines over time in text: dots of braille, or stars where the terminal has only ASCII."""

from __future__ import annotations

from collections.abc import Sequence

from textual.content import Content

_BITS = ((0x01, 0x02, 0x04, 0x40), (0x08, 0x10, 0x20, 0x80))
"""Bits of the dots of a braille cell: by column, from the top down."""

EMPTY = 0x2800
"""The braille cell without a dot."""
WANTED = "$text-accent"
Column = tuple[float, float] | None


def dots_across(width: int, *, ascii: bool) -> int:
    """How many columns of dots fit into so many cells."""
    return width if ascii else 2 * width


def plot(
    columns: Sequence[Column],
    low: float,
    high: float,
    height: int,
    *,
    ascii: bool,
    wanted: Sequence[Column] = (),
    cursor: int | None = None,
    rule: str = "|",
) -> list[Content]:
    """Lines of cells, from the top down. A column is drawn from its least to its greatest value.

    Args:
        columns: per column of dots the values between which to draw; None where there is nothing.
        low: value of the lowest dot.
        high: value of the highest dot.
        height: lines of cells.
        wanted: what the line was to follow, drawn dotted behind it, and in a colour where there are colours.
        cursor: column of cells to mark by a line of `rule` where nothing else is drawn.
    """
    tall = height if ascii else 4 * height
    actual = _filled(columns, low, high, tall)
    # Every other column (in ASCII another sign), for a terminal without colours tells the two apart as well.
    behind = [part if ascii or x % 4 == 0 else None for x, part in enumerate(_filled(wanted, low, high, tall))]
    behind += [None] * (len(actual) - len(behind))
    across = 1 if ascii else 2
    lines = []
    for y in range(height):
        cells = []
        for x in range(0, len(actual), across):
            here, there = (
                (_star(parts[x], tall - 1 - y, sign) if ascii else _cell(parts[x : x + 2], tall - 1 - 4 * y))
                for parts, sign in ((actual, "*"), (behind, "."))
            )
            empty = rule if x // across == cursor else " "
            both = here if ascii and here != " " else there if here == " " else _together(here, there)
            cells.append((both, WANTED if here == " " != there else "") if both != " " else (empty, "dim"))
        lines.append(_assembled(cells))
    return lines


def _filled(columns: Sequence[Column], low: float, high: float, tall: int) -> list[tuple[int, int] | None]:
    """Per column its lowest and its highest dot."""
    span = (high - low) or 1.0

    def dot(value: float) -> int:
        return round((value - low) / span * (tall - 1))

    return [None if part is None else (dot(part[0]), dot(part[1])) for part in columns]


def _star(part: tuple[int, int] | None, row: int, sign: str) -> str:
    return sign if part is not None and part[0] <= row <= part[1] else " "


def _cell(pair: Sequence[tuple[int, int] | None], top: int) -> str:
    """Two columns of four dots, the highest at `top`."""
    bits = 0
    for column, part in enumerate(pair):
        for depth in range(4):
            if part is not None and part[0] <= top - depth <= part[1]:
                bits |= _BITS[column][depth]
    return chr(EMPTY + bits) if bits else " "


def _together(here: str, there: str) -> str:
    """The dots of both cells."""
    return here if there == " " else chr(EMPTY + ((ord(here) - EMPTY) | (ord(there) - EMPTY)))


def _assembled(cells: Sequence[tuple[str, str]]) -> Content:
    """Cells with their styles, neighbours of one style as one piece: each piece costs bytes."""
    pieces: list[tuple[str, str]] = []
    for sign, style in cells:
        if pieces and (pieces[-1][1] == style or sign == " "):
            pieces[-1] = pieces[-1][0] + sign, pieces[-1][1]
        else:
            pieces.append((sign, style if sign != " " else ""))
    return Content.assemble(*(piece if piece[1] else piece[0] for piece in pieces))
