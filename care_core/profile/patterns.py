"""How long a regular expression may look for a match: Python's engine tries every way in which its repetitions can
share a text, and no time limit ends it."""

from __future__ import annotations

import math
import sys
from typing import Any

if sys.version_info >= (3, 11):
    from re import _parser as parser  # type: ignore[attr-defined]
else:
    import sre_parse as parser


def repeats_of(pattern: str) -> float:
    """How many repetitions follow each other: the time is a power of the text's length with this exponent; infinite
    where one holds anything that fits a text in several ways. Raises re.error."""
    return _in_a_row(parser.parse(pattern))


def _in_a_row(items: Any) -> float:
    return sum(_repeats(str(name), argument) for name, argument in items)


def _repeats(name: str, argument: Any) -> float:
    """Of one part of a parsed expression: its name, and what it holds as `re` arranges it."""
    if "REPEAT" in name:
        least, most, inside = argument
        if most == 1 or _is_fixed(inside):
            return _in_a_row(inside) + float(most > 1 and least != most)
        return math.inf
    if name == "BRANCH":
        return max(map(_in_a_row, argument[1]))
    return sum(_in_a_row(part) for part in _parts(argument))


def _is_fixed(items: Any) -> bool:
    """Whether these fit a text in one way at most."""
    for name, argument in items:
        if "REPEAT" in str(name) or str(name) in ("BRANCH", "GROUPREF", "GROUPREF_EXISTS"):
            return False
        if not all(map(_is_fixed, _parts(argument))):
            return False
    return True


def _parts(argument: Any) -> list[Any]:
    """The expressions inside an argument, of a group or an assertion."""
    found = argument if isinstance(argument, tuple) else (argument,)
    return [one for one in found if isinstance(one, parser.SubPattern)]
