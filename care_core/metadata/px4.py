"""PX4's parameters by release, from the table beside this module."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path

from care_core.files import read_small_text
from care_core.metadata.fact import Fact, FactType, codes, expanded, number
from care_core.records import Record

_TABLE = Path(__file__).with_name("px4.tsv")
RELEASES = ("1.6", "1.7", "1.8", "1.9", "1.10", "1.11", "1.12", "1.13", "1.14", "1.15", "1.16", "1.17", "1.18")
SOURCE = "PX4's parameter reference"
_TYPES: Mapping[str, FactType] = {"f": "float", "i": "int", "b": "bool"}


class _Row(Record):
    releases: tuple[str, ...]
    cells: tuple[str, ...]


def known_in(name: str) -> frozenset[str]:
    """The releases that document a parameter; empty for none."""
    return frozenset().union(*(row.releases for row in _rows().get(name, ())))


def names() -> Iterable[str]:
    """Every parameter of the table."""
    return _rows().keys()


def facts_of(name: str, releases: Iterable[str] = RELEASES) -> tuple[Fact, ...]:
    """What these releases say of a parameter, the newest last; several where they differ."""
    wanted = frozenset(releases)
    return tuple(_fact(name, row, told) for row in _rows().get(name, ()) if (told := wanted.intersection(row.releases)))


def span(releases: Iterable[str]) -> str:
    """Releases in words: PX4 1.15, or PX4 1.13 to 1.17."""
    told = sorted(releases, key=RELEASES.index)
    return f"PX4 {told[0]}" if len(told) == 1 else f"PX4 {told[0]} to {told[-1]}"


def _fact(name: str, row: _Row, releases: Iterable[str]) -> Fact:
    kind, low, high, unit, values, bits, default, flags = row.cells
    told = span(releases)
    return Fact(
        name,
        "PX4",
        f"{SOURCE}, {told}",
        type=_TYPES[kind],
        default=default,
        low=number(low),
        high=number(high),
        values=tuple((code, "") for code in codes(values)),
        bits=frozenset(map(int, codes(bits))),
        unit=unit,
        reboot="R" in flags,
        releases=told,
    )


@cache
def _rows() -> Mapping[str, list[_Row]]:
    found: dict[str, list[_Row]] = {}
    lines = [line for line in read_small_text(_TABLE).splitlines() if not line.startswith("#")][1:]
    for line in lines:
        pattern, releases, *cells = line.split("\t")
        row = _Row(_releases(releases), tuple(cells))
        for name in expanded(pattern):
            found.setdefault(name, []).append(row)
    return found


def _releases(text: str) -> tuple[str, ...]:
    """1.14-1.16 is three of them, nothing is all."""
    first, dash, last = text.partition("-")
    if not text:
        return RELEASES
    start, end = RELEASES.index(first), RELEASES.index(last if dash else first)
    return RELEASES[start : end + 1]
