"""Makes text that came out of a log or a profile safe to print: nothing in it may steer the terminal."""

from __future__ import annotations

import unicodedata

_UNPRINTABLE = ("Cc", "Cf", "Cs", "Co", "Zl", "Zp")
"""Control, format (bidirectional overrides, zero width), surrogate, private use, line and paragraph separators."""


def clean(text: str) -> str:
    """The text on one line, with every character that could steer a terminal written as an escape (`\\x1b`)."""
    if text.isascii() and text.isprintable():
        return text
    return "".join(_shown(character) for character in text)


def _shown(character: str) -> str:
    if character in "\n\r\t":
        return " "
    if unicodedata.category(character) not in _UNPRINTABLE:
        return character
    return ascii(character)[1:-1]
