"""What parameters do, in one line each, and the unit where their source names none: our own words."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import NamedTuple

from care_core.files import read_small_text
from care_core.metadata.fact import expanded

TABLE = Path(__file__).with_name("words.tsv")


class Word(NamedTuple):
    """A parameter in words; empty where nobody wrote any."""

    unit: str
    line: str


_NOTHING = Word("", "")


def word_of(ecosystem: str, name: str, owner: str = "") -> Word:
    """The words for a parameter as one owner reads it, else as all do.

    Args:
        ecosystem: ros or ardupilot.
    """
    words = _words()
    return words.get((ecosystem, owner, name)) or words.get((ecosystem, "", name)) or _NOTHING


@cache
def _words() -> Mapping[tuple[str, str, str], Word]:
    found: dict[tuple[str, str, str], Word] = {}
    for line in read_small_text(TABLE).splitlines():
        if line and not line.startswith("#"):
            ecosystem, owner, name, unit, text = line.split("\t")
            word = Word(unit, text)
            found |= {(ecosystem, owner, one): word for one in expanded(name)}
    return found
