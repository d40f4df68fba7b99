"""What rules for a vehicle's documented parameters have in common, whoever documents them."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Container, Iterable, Iterator, Sequence
from difflib import get_close_matches

from care_core.lint.problems import Entry, LintedFile, Problem
from care_core.metadata.fact import Fact
from care_core.text import listed

_ALIKE = 0.84
"""Least likeness of a name to the one that is meant, of difflib: one letter off in names of seven and more."""


def meant_instead(name: str, held: Container[str], known: Iterable[str]) -> str:
    """The parameter of a vehicle that an unknown name is a slip of the pen for, with the same numbers in it; empty
    where none is alike, or the file holds it as well."""
    like = [one for one in known if one[:1] == name[:1] and abs(len(one) - len(name)) <= 2]
    close = get_close_matches(name, like, n=3, cutoff=_ALIKE)
    numbers = re.findall(r"\d+", name)
    return next((one for one in close if one not in held and re.findall(r"\d+", one) == numbers), "")


def share_known(names: Collection[str], known_in: Callable[[str], Collection[object]]) -> float:
    """The share of the names that lists know."""
    return sum(bool(known_in(name)) for name in names) / max(len(names), 1)


def not_listed(file: LintedFile, entry: Entry, value: float, fact: Fact) -> Problem:
    """A value that is none of those of a list."""
    codes = [f"{code:g}" for code, _ in fact.values]
    text = f"{entry.name} is {value:g}, which is none of the values of {fact.source}."
    hint = f"They are {', '.join(codes[:12])}{', ...' if len(codes) > 12 else ''}."
    return file.warning("not-in-values", entry, text, hint, fact.source)


def unknown_bits(file: LintedFile, entry: Entry, value: float, facts: Sequence[Fact]) -> Iterator[Problem]:
    """Bits of a value that none of several releases documents; the last is named."""
    if value <= 0 or not value.is_integer():
        return
    unknown = [bit for bit in range(32) if int(value) >> bit & 1 and not any(bit in one.bits for one in facts)]
    if unknown:
        source = facts[-1].source
        bits = f"bit {unknown[0]} is" if len(unknown) == 1 else f"bits {listed([str(bit) for bit in unknown])} are"
        text = f"{entry.name} is {value:g}: {bits} not defined in {source}."
        yield file.note("not-in-values", entry, text, "", source)
