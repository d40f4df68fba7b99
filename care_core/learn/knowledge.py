"""What people know to act on what (`known` in profile.yaml), put beside what the graph search found.

A search needs many missions to see an edge. An engineer knows without any that the landing speed acts on the time of
the last ten metres, though not by how much. Such edges join the learned graph; every mechanism is then fitted with
and without them, and the data choose (`outcomes`).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping

import pandas as pd

from care_core.causal.graph import CausalGraph
from care_core.learn.constraints import Constraints
from care_core.learn.table import varying
from care_core.profile.schema import Schema


def with_known(graph: CausalGraph, frame: pd.DataFrame, schema: Schema) -> CausalGraph:
    """The graph with every known edge between varying variables that the constraints and its own arrows allow."""
    constraints = Constraints.of(schema)
    differing = frozenset(varying(frame, schema.variables)) if schema.known else frozenset()
    possible = [edge for edge in sorted(schema.known) if differing.issuperset(edge) and not constraints.forbids(*edge)]
    children: dict[str, set[str]] = {name: set(graph.children(name)) for name in graph.nodes}
    for cause, effect in possible:
        if cause not in _reached(children, effect):
            children[cause].add(effect)
    edges = frozenset((cause, effect) for cause, effects in children.items() for effect in effects)
    return CausalGraph(graph.nodes, edges, graph.bidirected)


def _reached(children: Mapping[str, Collection[str]], start: str) -> set[str]:
    """`start` and everything downstream of it."""
    reached, ahead = {start}, [start]
    while ahead:
        new = set(children[ahead.pop()]) - reached
        reached |= new
        ahead += new
    return reached
