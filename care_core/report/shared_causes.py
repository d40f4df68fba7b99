"""Objectives that move together share their causes, which a reader wants to see once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

F = TypeVar("F")
Paths = Sequence[Sequence[str]]


def together(faults: Sequence[F], paths: Callable[[F], Paths]) -> list[list[F]]:
    """Faults in groups; the causes of the last of a group are those of all.

    Args:
        paths: of a fault, the path of each cause as names of nodes, best cause first. Faults share a group where each
            path of the one begins with the path of the other: time moved by the option, and energy moved by the time.
    """
    groups: list[list[F]] = []
    for fault in faults:
        group = next((group for group in groups if _lead_on(paths(group[-1]), paths(fault))), None)
        if group is None:
            groups.append([fault])
        else:
            group.append(fault)
    return groups


def _lead_on(short: Paths, long: Paths) -> bool:
    pairs = zip(short, long, strict=False)
    return bool(short) and len(short) == len(long) and all([*b[: len(a)]] == [*a] for a, b in pairs)
