"""Flights of the real firmware with one parameter wrong at a time: which values lose a mission, and how that shows."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import cast

from care_core.metadata.causal_map import SIGNS, Sign
from care_core.metadata.fact import lines_of
from care_core.metadata.firmware import letter_of
from care_core.records import Record

TABLE = Path(__file__).with_name("screening.tsv")


_OF_LIFT = "Q_"


class ScreeningFlight(Record):
    """One flight with everything at its reference but one parameter."""

    reference: float
    value: float
    is_lost: bool
    first: frozenset[Sign]
    """The signs that came first, empty where nothing failed."""
    every: frozenset[Sign]
    refusals: frozenset[str]
    """What kept it from arming, as `plain_refusal` has it."""


def plain_refusal(text: str) -> str:
    """A refusal to arm without the numbers that change from flight to flight."""
    return re.sub(r"[\d.]+", "#", text.casefold()).strip()


def flights_of(name: str, kind: str) -> tuple[ScreeningFlight, ...]:
    """The screening flights of a parameter on a kind of vehicle; empty where it was not screened."""
    return tuple(map(_flight, _lines().get((name, letter_of(kind)), ())))


def screened(kind: str) -> tuple[str, ...]:
    """The parameters that were screened on a kind of vehicle; a plane has no lift motors."""
    own = (name for name, letter in _lines() if letter == letter_of(kind))
    return tuple(name for name in own if kind != "plane" or not name.startswith(_OF_LIFT))


@cache
def _lines() -> Mapping[tuple[str, str], tuple[str, ...]]:
    """The lines of each parameter and vehicle."""
    found: dict[tuple[str, str], list[str]] = {}
    for line in lines_of(TABLE)[1:]:
        name, vehicle, rest = line.split("\t", 2)
        found.setdefault((name, vehicle), []).append(rest)
    return {key: tuple(rests) for key, rests in found.items()}


@cache
def _flight(cells: str) -> ScreeningFlight:
    reference, value, first, others, refusals = cells.split("\t")
    early, later, why = _signs(first), _signs(others), frozenset(filter(None, refusals.split("; ")))
    return ScreeningFlight(float(reference), float(value), bool(early), early, early | later, why)


def _signs(text: str) -> frozenset[Sign]:
    signs = frozenset(text.split())
    assert signs <= frozenset(SIGNS), signs
    return cast(frozenset[Sign], signs)
