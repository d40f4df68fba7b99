"""What people know to act on what (`known` in profile.yaml), put beside what the graph search found.

A search needs many missions to see an edge. An engineer knows without any that the landing speed acts on the time of
the last ten metres, though not by how much. Such edges join the learned graph; every mechanism is then fitted with
and without them, and the data choose (`outcomes`).
"""

from __future__ import annotations

import pandas as pd

from care_core.causal.graph import CausalGraph
from care_core.learn.constraints import Constraints
from care_core.profile.schema import Schema


def with_known(graph: CausalGraph, frame: pd.DataFrame, schema: Schema) -> CausalGraph:
    """The graph with every known edge between varying variables that the constraints and its own arrows allow."""
    constraints = Constraints.of(schema)
    for cause, effect in sorted(schema.known):
        possible = frame[cause].nunique() > 1 and frame[effect].nunique() > 1 and not constraints.forbids(cause, effect)
        if possible and cause != effect and cause not in graph.descendants(effect):
            graph = CausalGraph(graph.nodes, graph.directed | {(cause, effect)}, graph.bidirected)
    return graph
