"""A frame on its way to the terminal, in fewer bytes: Textual sets and resets the style of every piece of text, and
writes every empty cell, which a slow link pays for."""

from __future__ import annotations

import re
from functools import lru_cache

from rich.cells import cell_len

_PART = re.compile(
    r"\x1b\[(?P<style>[\d;]*)m|\n?\x1b\[(?P<row>\d+);(?P<column>\d+)H|(?P<blank> +)"
    r"|(?P<text>[^\x1b\r\n ]+(?: [^\x1b\r\n ]+)*)|(?P<other>[\r\n])"
)
_STRANGE = re.compile(r"\x1b(?!\[[\d;]*m|\[\d+;\d+H)")
"""What a frame does not hold: questions, modes, links."""
_SHORTEST, _SHORTEST_GAP = 4, 12
"""Empty cells that are longer to write than to erase: to the end of a line (EL), and before more text, where the cursor
has to pass over them, too (ECH and CUF, ECMA-48 sections 8.3.38 and 8.3.20)."""
_FILLED = re.compile(r"4|7|9|21|53|4\d|10\d")
"""Styles that show in an empty cell: underlined, reversed, struck out, overlined, and backgrounds."""


def lean(frame: str, width: int) -> str:
    """The same picture on a terminal of this width."""
    return frame if _STRANGE.search(frame) else _Writer(width).written(frame)


@lru_cache(1024)
def _essence(style: str) -> tuple[str, bool]:
    """A style without the colours that hold anyway, and whether an empty cell shows it."""
    codes, kept, is_filled = iter(style.split(";")), list[str](), False
    for code in codes:
        if code in ("", "0", "39", "49"):
            continue
        kept.append(code)
        is_filled = is_filled or _FILLED.fullmatch(code) is not None
        if code in ("38", "48"):
            kept.append(next(codes))
            kept += [next(codes) for _ in range(1 if kept[-1] == "5" else 3)]
    return ";".join(kept), is_filled


class _Writer:
    """Writes a frame again: a style only where it changes, and empty cells only where something follows them."""

    def __init__(self, width: int) -> None:
        self._width = width
        self._out: list[str] = []
        self._style, self._wanted = ("", False), ("", False)
        self._column, self._blanks = 0, 0

    def written(self, frame: str) -> str:
        move = ""
        for part in _PART.finditer(frame):
            style, row, column, blank, text, other = part.groups()
            if style is not None:
                self._wanted = _essence(style)
            elif row is not None:
                self._end_line()
                move, self._column = f"\x1b[{row};{column}H", int(column) - 1
            else:
                if move:
                    self._out.append(move)
                    move = ""
                self._write(blank, text or other)
        self._end_line()
        self._set(("", False))
        return "".join(self._out) + move

    def _write(self, blank: str | None, text: str) -> None:
        if blank and not self._wanted[1]:
            self._blanks += len(blank)
            self._column += len(blank)
            return
        self._fill()
        self._set(self._wanted)
        self._out.append(blank or text)
        self._column += len(blank) if blank else cell_len(text)

    def _fill(self) -> None:
        """Write the empty cells that are still to be written; their colour does not matter."""
        if self._blanks:
            if self._style[1]:
                self._set(("", False))
            gap = self._blanks
            self._out.append(" " * gap if gap < _SHORTEST_GAP else f"\x1b[{gap}X\x1b[{gap}C")
            self._blanks = 0

    def _end_line(self) -> None:
        if self._blanks >= _SHORTEST and self._column == self._width:
            if self._style[1]:
                self._set(("", False))
            self._out.append("\x1b[K")
            self._blanks = 0
        self._fill()

    def _set(self, style: tuple[str, bool]) -> None:
        if style != self._style:
            now = style[0]
            self._out.append(f"\x1b[{now}m" if not now or not self._style[0] else f"\x1b[0;{now}m")
            self._style = style
