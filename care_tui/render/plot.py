"""A line over time in text: dots of braille, or stars where the terminal has only ASCII."""

from __future__ import annotations

from collections.abc import Sequence

_BITS = ((0x01, 0x02, 0x04, 0x40), (0x08, 0x10, 0x20, 0x80))
"""Bits of the dots of a braille cell: by column, from the top down."""

Column = tuple[float, float] | None


def dots_across(width: int, *, ascii: bool) -> int:
    """How many columns of dots fit into so many cells."""
    return width if ascii else 2 * width


def plot(columns: Sequence[Column], low: float, high: float, height: int, *, ascii: bool) -> list[str]:
    """Lines of cells, from the top down. A column is drawn from its least to its greatest value.

    Args:
        columns: per column of dots the values between which to draw; None where there is nothing.
        low: value of the lowest dot.
        high: value of the highest dot.
        height: lines of cells.
    """
    tall = height if ascii else 4 * height
    span = (high - low) or 1.0
    filled = [
        None if column is None else tuple(round((value - low) / span * (tall - 1)) for value in column)
        for column in columns
    ]
    if ascii:
        rows = range(tall - 1, -1, -1)
        return ["".join("*" if part and part[0] <= row <= part[1] else " " for part in filled) for row in rows]
    return ["".join(_cell(filled[x : x + 2], tall - 1 - 4 * line) for x in range(0, len(filled), 2))
            for line in range(height)]  # fmt: skip


def _cell(pair: Sequence[tuple[int, ...] | None], top: int) -> str:
    """Two columns of four dots, the highest at `top`."""
    bits = 0
    for column, part in enumerate(pair):
        for depth in range(4):
            if part is not None and part[0] <= top - depth <= part[1]:
                bits |= _BITS[column][depth]
    return chr(0x2800 + bits) if bits else " "
