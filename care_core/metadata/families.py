"""Families of names that a table writes as one."""

from __future__ import annotations

from collections.abc import Iterator


def expanded(pattern: str) -> Iterator[str]:
    """The names of a family: {1..16} stands for each of the numbers, {|2|A} for nothing, 2 or A; a name for itself."""
    before, brace, rest = pattern.partition("{")
    if not brace:
        yield pattern
        return
    choices, _, after = rest.partition("}")
    endings = list(expanded(after))
    for part in choices.split("|"):
        first, dots, last = part.partition("..")
        several = map(str, range(int(first), int(last) + 1)) if dots else [part]
        yield from (f"{before}{one}{ending}" for one in several for ending in endings)
