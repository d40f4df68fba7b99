"""ArduPilot's parameters by kind of vehicle and release, from the table beside this module."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path

from care_core.metadata.fact import Fact, codes, expanded, lines_of, number
from care_core.metadata.words import word_of
from care_core.records import Record

_TABLE = Path(__file__).with_name("ardupilot.tsv")
_BEGINNING = 2
"""Letters that every pattern of the table begins with before it branches."""
_DEFAULTS = Path(__file__).with_name("ardupilot_defaults.tsv")
SOURCE = "ArduPilot's parameter list"
VEHICLES: Mapping[str, str] = {
    "copter": "C", "heli": "C", "plane": "P", "quadplane": "P", "rover": "R", "sub": "S", "tracker": "T", "blimp": "B",
}  # fmt: skip
"""The letter of a kind of vehicle in the table."""
RELEASES: Mapping[str, tuple[str, ...]] = {
    "C": ("3.5", "3.6", "3.7", "4.0", "4.1", "4.2", "4.3", "4.4", "4.5", "4.6", "4.7", "4.8"),
    "P": ("3.8", "3.9", "3.10", "4.0", "4.1", "4.2", "4.3", "4.4", "4.5", "4.6", "4.7", "4.8"),
    "R": ("3.4", "3.5", "3.6", "4.0", "4.1", "4.2", "4.4", "4.5", "4.6", "4.7", "4.8"),
    "S": ("3.4", "3.5", "3.6", "4.0", "4.1", "4.5", "4.7", "4.8"),
    "T": ("4.5", "4.6", "4.7", "4.8"),
    "B": ("4.7", "4.8"),
}
NAMES = {"C": "Copter", "P": "Plane", "R": "Rover", "S": "Sub", "T": "Tracker", "B": "Blimp"}


class Release(Record):
    """A release of one vehicle's firmware."""

    vehicle: str
    """A letter of the table."""
    version: str

    def __str__(self) -> str:
        return f"{NAMES[self.vehicle]} {self.version}"


ALL = tuple(Release(vehicle, version) for vehicle, versions in RELEASES.items() for version in versions)


class _Row(Record):
    releases: frozenset[Release]
    cells: tuple[str, ...]


def known_in(name: str) -> frozenset[Release]:
    """The releases that document a parameter; empty for none."""
    return frozenset().union(*(row.releases for row in _rows().get(name, ())))


def names() -> Iterable[str]:
    """Every parameter of the table."""
    return _rows().keys()


def facts_of(name: str, releases: Iterable[Release] = ALL) -> tuple[Fact, ...]:
    """What these releases say of a parameter, the newest last; several where they differ."""
    wanted = frozenset(releases)
    return tuple(_fact(name, row, row.releases & wanted) for row in _rows_of(name) if row.releases & wanted)


def fact_of(name: str, kind: str, version: tuple[int, ...] | None = None) -> Fact | None:
    """What a vehicle's firmware says of a parameter; the newest release that knows it where the version is unknown."""
    letter = VEHICLES.get(kind)
    exact = None if version is None else ".".join(map(str, version[:2]))
    own = [one for one in ALL if one.vehicle == letter]
    for releases in ([one for one in own if one.version == exact], own, ALL):
        found = facts_of(name, releases)
        if found:
            return max(found, key=lambda fact: _newest(fact.releases))
    return None


def firmware_default(name: str, kind: str) -> float | None:
    """The firmware's own default of a parameter that a bundled profile models, as the parameter counts it; None where
    it is not known."""
    return _defaults().get((name, VEHICLES.get(kind, "")))


@cache
def _defaults() -> Mapping[tuple[str, str], float]:
    rows = (line.split("\t") for line in lines_of(_DEFAULTS)[1:])
    return {(name, vehicle): float(value) for name, vehicle, value in rows}


def _newest(releases: str) -> tuple[int, ...]:
    return max(tuple(map(int, version.split("."))) for version in re.findall(r"\d+\.\d+", releases))


def _fact(name: str, row: _Row, releases: Iterable[Release]) -> Fact:
    low, high, unit, values, bits, flags = row.cells
    told = sorted(releases, key=ALL.index)
    span = str(told[0]) if len(told) == 1 else f"{told[0]} to {told[-1]}"
    return Fact(
        name,
        NAMES[told[-1].vehicle],
        f"{SOURCE}, {span}",
        low=number(low),
        high=number(high),
        values=tuple((code, "") for code in codes(values)),
        bits=frozenset(int(code) for code in codes(bits)),
        unit=unit,
        reboot="R" in flags,
        read_only="O" in flags,
        releases=span,
        line=word_of("ardupilot", name).line,
    )


@cache
def _rows() -> Mapping[str, list[_Row]]:
    found: dict[str, list[_Row]] = {}
    for lines in _lines().values():
        for pattern, line in lines:
            row = _row(line)
            for name in expanded(pattern):
                found.setdefault(name, []).append(row)
    return found


@cache
def _rows_of(name: str) -> tuple[_Row, ...]:
    """The rows of one parameter: whoever asks of a few need not read them all."""
    lines = _lines().get(name[:_BEGINNING], ())
    like = ((pattern, line) for pattern, line in lines if name.startswith(pattern.partition("{")[0]))
    return tuple(_row(line) for pattern, line in like if name in expanded(pattern))


@cache
def _lines() -> Mapping[str, list[tuple[str, str]]]:
    """The lines of the table with their patterns, by the letters that every name of a pattern begins with."""
    found: dict[str, list[tuple[str, str]]] = {}
    for line in lines_of(_TABLE)[1:]:
        pattern, _, _ = line.partition("\t")
        found.setdefault(pattern[:_BEGINNING], []).append((pattern, line))
    return found


def _row(line: str) -> _Row:
    _, releases, *cells = line.split("\t")
    return _Row(_releases(releases), tuple(cells))


@cache
def _releases(text: str) -> frozenset[Release]:
    """Releases out of "C4.1-4.3,4.6- R": a vehicle's letter, and spans of its releases."""
    found = set()
    for part in text.split():
        vehicle, versions = part[0], RELEASES[part[0]]
        for span in part[1:].split(",") if part[1:] else ("-",):
            first, dash, last = span.partition("-")
            start = versions.index(first) if first else 0
            end = versions.index(last) if last else len(versions) - 1 if dash else start
            found |= {Release(vehicle, version) for version in versions[start : end + 1]}
    return frozenset(found)
