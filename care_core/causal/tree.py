"""What leads to a variable, or comes of it, as a tree of the strongest edges."""

from __future__ import annotations

import heapq
from collections.abc import Iterator
from typing import Literal

from care_core.causal.model import EdgeRecord, Model
from care_core.records import Record

Way = Literal["causes", "effects"]
Path = tuple[str, ...]


class Branch(Record):
    """A variable, the edge that joins it to the one before, and what is joined to it in turn."""

    name: str
    edge: EdgeRecord | None = None
    branches: tuple[Branch, ...] = ()
    is_elsewhere: bool = False
    """Whether its branches stand at another place of the tree."""


def tree_of(model: Model, node: str, way: Way, count: int) -> Branch:
    """At most so many branches from a variable: those with the largest product of effects on the way to them. Siblings
    stand from the largest effect to the smallest; what is reached twice is followed on its stronger way alone.

    Args:
        way: whether edges are followed from effect to cause, or from cause to effect.
    """
    kept: dict[Path, list[Path]] = {}
    followed: set[str] = set()
    waiting: list[tuple[float, Path]] = [(-1.0, (node,))]
    while waiting and sum(map(len, kept.values())) < count:
        weight, path = heapq.heappop(waiting)
        if len(path) > 1:
            kept.setdefault(path[:-1], []).append(path)
        if path[-1] not in followed:
            followed.add(path[-1])
            for edge, name in _edges(model, path[-1], way):
                heapq.heappush(waiting, (weight * min(abs(edge.effect), 1.0), (*path, name)))
    return _branch(model, (node,), way, kept, None)


def _branch(model: Model, path: Path, way: Way, kept: dict[Path, list[Path]], edge: EdgeRecord | None) -> Branch:
    edges = {name: edge for edge, name in _edges(model, path[-1], way)}
    longer = sorted(kept.get(path, ()), key=lambda one: -abs(edges[one[-1]].effect))
    branches = tuple(_branch(model, one, way, kept, edges[one[-1]]) for one in longer)
    is_elsewhere = not branches and any(other[-1] == path[-1] for other in kept)
    return Branch(path[-1], edge, branches, is_elsewhere)


def _edges(model: Model, node: str, way: Way) -> Iterator[tuple[EdgeRecord, str]]:
    """The edges of a variable with what is at their other end."""
    for name in model.graph.parents(node) if way == "causes" else model.graph.children(node):
        source, target = (name, node) if way == "causes" else (node, name)
        known = model.edges.get((source, target))
        yield known or EdgeRecord(source=source, target=target, kind="directed", support=0.0), name
