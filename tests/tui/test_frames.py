"""Frames in fewer bytes: the same picture, whatever is in it."""

from __future__ import annotations

import re

import pytest
from rich.cells import cell_len

from care_tui.frames import lean

WIDTH, HEIGHT = 20, 4
Cell = tuple[str, str]


def picture(*writes: str) -> list[list[Cell]]:
    """What a terminal shows: a character and a style for each cell. An empty cell has the style that it shows."""
    rows: list[list[Cell]] = [[("#", "")] * WIDTH for _ in range(HEIGHT)]
    x = y = 0
    style = ""
    for part in re.finditer(r"\x1b\[([\d;]*)([mHKXC])|\n|[^\x1b\n]", "".join(writes)):
        if part[2] == "m":
            style = "" if part[1].split(";")[0] in ("", "0") else style
            style = ";".join(filter(None, (style, re.sub(r"^0;?", "", part[1]))))
        elif part[2] == "H":
            row, column = part[1].split(";")
            y, x = int(row) - 1, int(column) - 1
        elif part[2] == "K":
            rows[y][x:] = [(" ", "")] * (WIDTH - x)
        elif part[2] == "X":
            rows[y][x : x + int(part[1])] = [(" ", style if "44" in style else "")] * int(part[1])
        elif part[2] == "C":
            x += int(part[1])
        elif part[0] == "\n":
            y += 1
        else:
            shown = "" if part[0] == " " and "7" not in style and "44" not in style else style
            rows[y][x : x + cell_len(part[0])] = [(part[0], shown)] * cell_len(part[0])
            x += cell_len(part[0])
    return rows


def plain(rows: list[list[Cell]]) -> list[list[Cell]]:
    """With no mention of colours that hold anyway."""
    return [
        [(text, ";".join(c for c in style.split(";") if c not in ("39", "49"))) for text, style in row] for row in rows
    ]


FRAMES = {
    "text and what is empty": "\x1b[1;1H\x1b[1;39;49mFix\x1b[0m\x1b[39;49m" + " " * 17 + "\x1b[0m\n\x1b[2;1H",
    "an empty line": "\x1b[3;1H\x1b[39;49m" + " " * WIDTH + "\x1b[0m\x1b[1;1H",
    "a bar that is reversed": "\x1b[2;1H\x1b[1;7;39;49m on"
    + " " * 17
    + "\x1b[0m\n\x1b[3;1H\x1b[39;49mx\x1b[0m\x1b[1;1H",
    "a background to the end": "\x1b[2;1H\x1b[39;44m" + " " * WIDTH + "\x1b[0m\x1b[1;1H",
    "a gap between colours": "\x1b[1;3H\x1b[31;49mred\x1b[0m\x1b[39;49m      \x1b[0m\x1b[32;49mgreen\x1b[0m\x1b[1;1H",
    "a long gap after a bar": "\x1b[1;2H\x1b[44;49mbar\x1b[0m\x1b[39;49m"
    + " " * 14
    + "\x1b[0m\x1b[32;49m|\x1b[0m\x1b[1;1H",
    "what is empty, and not to the end": "\x1b[4;2H\x1b[39;49m          \x1b[0m\x1b[1;1H",
    "wide characters": "\x1b[1;1H\x1b[39;49m漢字" + " " * 16 + "\x1b[0m\x1b[1;1H",
    "a colour of many": "\x1b[1;1H\x1b[38;5;39;49ma\x1b[0m\x1b[38;2;39;49;0;49mb\x1b[0m\x1b[1;1H",
}


@pytest.mark.parametrize("frame", FRAMES.values(), ids=FRAMES.keys())
def test_a_lean_frame_is_the_same_picture_in_no_more_bytes(frame: str) -> None:
    written = lean(frame, WIDTH)
    assert plain(picture(written)) == plain(picture(frame))
    assert len(written) < len(frame)


def test_a_line_is_erased_only_to_the_end_of_the_terminal() -> None:
    assert "\x1b[K" in lean(FRAMES["an empty line"], WIDTH)
    assert "\x1b[K" not in lean(FRAMES["an empty line"], WIDTH + 1)
    assert "\x1b[K" not in lean(FRAMES["an empty line"], 0), "its width is not known yet"


def test_a_long_gap_is_erased_and_passed_over() -> None:
    assert "\x1b[14X\x1b[14C" in lean(FRAMES["a long gap after a bar"], WIDTH)
    assert "X" not in lean(FRAMES["a gap between colours"], WIDTH)


@pytest.mark.parametrize("sequence", ["\x1b[?1049h", "\x1b[6n", "\x1b]52;c;YQ==\x07", "\x1b[2J\x1b[39;49m     \x1b[0m"])
def test_what_is_no_frame_is_written_as_it_is(sequence: str) -> None:
    assert lean(sequence, WIDTH) == sequence
