"""Parameters of one plugin that stand below the name of another: one mistake, told once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from care_core.lint.lists import Raised
from care_core.lint.problems import LintedFile, Problem
from care_core.lint.scopes import Keys, Place, Scoped
from care_core.metadata import navigation
from care_core.metadata.navigation import STACKS

_MANY = 5
"""Names of another plugin from which on they are told as one: of two similar plugins a few are left over."""


def foreign(file: LintedFile, result: Scoped) -> Iterator[Raised]:
    """Names that a plugin does not read and one other of the same node does, where they are many."""
    by_part: dict[tuple[Keys, Keys], list[Place]] = {}
    for place in result.places:
        if place.owners and not _is_read(result, place):
            by_part.setdefault((place.owners, place.scope), []).append(place)
    for (owners, _), places in by_part.items():
        theirs = {other: _of(result, other, places) for other in _beside(result, owners)}
        other = max(theirs, key=lambda one: len(theirs[one]), default="")
        if other and len(theirs[other]) >= _MANY:
            yield Raised(_problem(file, result, owners, other, theirs[other]), theirs[other])


def _is_read(result: Scoped, place: Place) -> bool:
    return any(navigation.known(result.ros, owner, place.name) for owner in place.owners)


def _of(result: Scoped, other: str, places: Sequence[Place]) -> list[Place]:
    return [one for one in places if navigation.known(result.ros, other, one.name)]


def _beside(result: Scoped, owners: Keys) -> Iterator[str]:
    """The other plugins of the same node; a node itself has none."""
    node = navigation.node_of(result.ros, owners[0])
    if node == owners[0]:
        return
    for one in navigation.owners(result.ros):
        if one not in owners and one != node and navigation.node_of(result.ros, one) == node:
            yield one


def _problem(file: LintedFile, result: Scoped, owners: Keys, other: str, places: Sequence[Place]) -> Problem:
    first, *more = places
    text = f"{first.name} and {len(more)} more are parameters of {other}: {owners[0]} does not read them."
    hint = f"Leave them out, or load {other} and write them below its name."
    others = [one.entry for one in more]
    return file.warning("misplaced-key", first.entry, text, hint, STACKS[result.ros], others)
