"""The causal graph: an acyclic directed mixed graph (ADMG) over the profile's variables. No data in it."""

from __future__ import annotations

import heapq
from collections.abc import Collection, Iterable
from functools import cached_property

from care_core.records import Record, force_setattr

Edge = tuple[str, str]
"""A directed edge as (cause, effect), or a bidirected edge as its two ends in sorted order."""


class CausalGraph(Record, dict=True):
    """What Alg. 1 returns: `directed` edges (D) and `bidirected` edges (B, a hidden common cause).

    A pair may hold both kinds. The ends of a bidirected edge are kept sorted, whatever order they are given in.

    Raises:
        ValueError: a node is named twice or an edge names an unknown node, joins a node to itself or closes a cycle.
    """

    nodes: tuple[str, ...]
    directed: frozenset[Edge] = frozenset()
    bidirected: frozenset[Edge] = frozenset()

    def __post_init__(self) -> None:
        for name, value in {
            "nodes": tuple(self.nodes),
            "directed": frozenset(self.directed),
            "bidirected": frozenset((min(a, b), max(a, b)) for a, b in self.bidirected),
        }.items():
            force_setattr(self, name, value)
        self._check_names()
        _ = self._order  # a cycle is an error here

    @cached_property
    def _parents(self) -> dict[str, tuple[str, ...]]:
        return _heads(self.nodes, ((b, a) for a, b in self.directed))

    @cached_property
    def _children(self) -> dict[str, tuple[str, ...]]:
        return _heads(self.nodes, self.directed)

    @cached_property
    def _siblings(self) -> dict[str, tuple[str, ...]]:
        return _heads(self.nodes, [*self.bidirected, *((b, a) for a, b in self.bidirected)])

    def _check_names(self) -> None:
        known = set(self.nodes)
        if len(known) != len(self.nodes):
            raise ValueError("a node is named twice")
        for a, b in (*self.directed, *self.bidirected):
            if a not in known or b not in known:
                raise ValueError(f"edge ({a}, {b}) names an unknown node")
            if a == b:
                raise ValueError(f"edge ({a}, {b}) joins a node to itself")

    @cached_property
    def _order(self) -> tuple[str, ...]:
        """Kahn's algorithm, ties in the order of `nodes`."""
        rank = {node: i for i, node in enumerate(self.nodes)}
        missing = {node: len(self._parents[node]) for node in self.nodes}
        ready = [rank[node] for node in self.nodes if not missing[node]]
        order: list[str] = []
        while ready:
            node = self.nodes[heapq.heappop(ready)]
            order.append(node)
            for child in self._children[node]:
                missing[child] -= 1
                if not missing[child]:
                    heapq.heappush(ready, rank[child])
        if len(order) < len(self.nodes):
            raise ValueError(f"directed edges close a cycle among {sorted(set(self.nodes) - set(order))}")
        return tuple(order)

    def parents(self, node: str) -> tuple[str, ...]:
        """Direct causes, in the order of `nodes`."""
        return self._of(self._parents, node)

    def children(self, node: str) -> tuple[str, ...]:
        """Direct effects, in the order of `nodes`."""
        return self._of(self._children, node)

    def siblings(self, node: str) -> tuple[str, ...]:
        """Nodes that share a hidden cause with this one, in the order of `nodes`."""
        return self._of(self._siblings, node)

    def ancestors(self, *nodes: str) -> frozenset[str]:
        """The nodes and all their causes, direct or not."""
        return self._closure(self._parents, nodes)

    def descendants(self, *nodes: str) -> frozenset[str]:
        """The nodes and all their effects, direct or not."""
        return self._closure(self._children, nodes)

    def topological_order(self) -> tuple[str, ...]:
        """All nodes, causes before effects, ties in the order of `nodes`."""
        return self._order

    def m_separated(self, a: str, b: str, given: Collection[str] = ()) -> bool:
        """Whether every path between the two nodes is blocked by `given` (m-separation, Richardson 2003)."""
        blocked, opened = set(given), self.ancestors(*given)
        # A step is a node and whether it was entered through an arrowhead.
        ahead = [*self._steps(a, True), *self._steps(a, False)]
        seen: set[tuple[str, bool]] = set()
        while ahead:
            node, by_arrowhead = ahead.pop()
            if node == b:
                return False
            if (node, by_arrowhead) in seen:
                continue
            seen.add((node, by_arrowhead))
            if node not in blocked:
                ahead += self._steps(node, False)
            if (node in opened) if by_arrowhead else (node not in blocked):
                ahead += self._steps(node, True)
        return True

    def _steps(self, node: str, by_arrowhead: bool) -> list[tuple[str, bool]]:
        """The steps that leave a node by an arrowhead at it, or by a tail."""
        if by_arrowhead:
            return [(n, False) for n in self.parents(node)] + [(n, True) for n in self.siblings(node)]
        return [(n, True) for n in self.children(node)]

    def subgraph(self, nodes: Collection[str]) -> CausalGraph:
        """The graph on some of its nodes, with the edges among them."""
        kept = set(nodes)
        return CausalGraph(
            tuple(node for node in self.nodes if node in kept),
            frozenset(edge for edge in self.directed if kept.issuperset(edge)),
            frozenset(edge for edge in self.bidirected if kept.issuperset(edge)),
        )

    def _of(self, table: dict[str, tuple[str, ...]], node: str) -> tuple[str, ...]:
        if node not in table:
            raise ValueError(f"unknown node {node!r}")
        return table[node]

    def _closure(self, table: dict[str, tuple[str, ...]], nodes: Iterable[str]) -> frozenset[str]:
        seen: set[str] = set()
        ahead = list(nodes)
        while ahead:
            node = ahead.pop()
            if node not in seen:
                seen.add(node)
                ahead.extend(self._of(table, node))
        return frozenset(seen)


def _heads(nodes: tuple[str, ...], edges: Iterable[Edge]) -> dict[str, tuple[str, ...]]:
    """For each node the other ends of the edges that start at it, in the order of `nodes`."""
    rank = {node: i for i, node in enumerate(nodes)}
    found: dict[str, list[str]] = {node: [] for node in nodes}
    for a, b in edges:
        found[a].append(b)
    return {node: tuple(sorted(heads, key=rank.__getitem__)) for node, heads in found.items()}
