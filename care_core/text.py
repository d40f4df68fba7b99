"""Text that came out of a log or a file, made safe to show: nothing in it may steer a terminal or a document."""

from __future__ import annotations

import textwrap
import unicodedata

WIDTH = 80
"""Columns of plain text for people."""


def clean(text: str) -> str:
    """The text on one line; a character that could steer a terminal is written as its escape, such as `\\x1b`."""
    if text.isascii() and text.isprintable():
        return text
    return "".join(_shown(character) for character in text)


def _shown(character: str) -> str:
    if character in "\n\r\t":
        return " "
    # Not printable are control, format (bidirectional overrides, zero width), private and unassigned characters.
    return character if character.isprintable() or unicodedata.category(character) == "Zs" else ascii(character)[1:-1]


def wrapped(text: str, first: str = "", rest: str | None = None) -> list[str]:
    """The text, made safe, in lines of at most `WIDTH` columns; `rest` indents the later ones, as wide as `first` if
    not given."""
    indent = " " * len(first) if rest is None else rest
    return textwrap.wrap(clean(text), WIDTH, initial_indent=first, subsequent_indent=indent, break_on_hyphens=False)
