"""Simulated robots with a known causal graph: options -> metrics -> objectives, options drawn at random."""

from __future__ import annotations

import numpy as np
import pandas as pd

from care_core.causal.graph import CausalGraph
from care_core.numbers import Floats
from care_core.profile.schema import Schema
from care_core.variables import Role, Variable


def schema_of(roles: dict[str, Role], *, observational: bool = False) -> Schema:
    """A schema with these variables; options range from 0 to 1."""
    variables = {
        name: Variable(
            name,
            role,
            range=(0.0, 1.0) if role is Role.OPTION else None,
            default=0.5 if role is Role.OPTION else None,
            kind="non-functional" if role is Role.OBJECTIVE else None,
        )
        for name, role in roles.items()
    }
    return Schema(
        name="simulated",
        version="1",
        platform="simulated",
        doc="",
        match={},
        logs=(),
        observational=observational,
        mission={},
        evidence=(),
        variables=variables,
    )


def simulate(
    n: int,
    rng: np.random.Generator,
    *,
    options: int = 6,
    inert: int = 4,
    metrics: int = 4,
    contexts: int = 0,
    hidden: int = 0,
    objectives: int = 1,
    noise: float = 0.6,
) -> tuple[pd.DataFrame, Schema, CausalGraph]:
    """Runs of a random robot, its schema and its true graph.

    Each of `options` moves one or two metrics, each of `inert` moves nothing. A metric may move later metrics. Each
    objective is moved by two metrics (or by the only one). Every `hidden` cause is a coin that moves two metrics.
    Mechanisms are monotonic with some bend, and a tenth of the metrics' scale is skewed.

    Args:
        n: number of runs.
        rng: draws the graph, the effects and the runs.
    """
    option_names = [f"option_{i}" for i in range(options)]
    inert_names = [f"inert_{i}" for i in range(inert)]
    context_names = [f"context_{i}" for i in range(contexts)]
    metric_names = [f"metric_{i}" for i in range(metrics)]
    objective_names = [f"objective_{i}" for i in range(objectives)]
    directed: set[tuple[str, str]] = set()
    for i, name in enumerate(option_names):
        extra = [int(rng.integers(metrics))] if rng.random() < 0.5 else []
        directed |= {(name, metric_names[j]) for j in {i % metrics, *extra}}
    directed |= {(name, metric_names[i % metrics]) for i, name in enumerate(context_names)}
    directed |= {
        (metric_names[i], metric_names[j]) for j in range(metrics) for i in range(j) if rng.random() < 1 / metrics
    }
    for name in objective_names:
        causes = rng.choice(metrics, size=min(2, metrics), replace=False)
        directed |= {(metric_names[i], name) for i in causes}
    pairs = [tuple(sorted(rng.choice(metric_names, size=2, replace=False).tolist())) for _ in range(hidden)]
    roles = {
        **dict.fromkeys([*option_names, *inert_names], Role.OPTION),
        **dict.fromkeys(context_names, Role.CONTEXT),
        **dict.fromkeys(metric_names, Role.METRIC),
        **dict.fromkeys(objective_names, Role.OBJECTIVE),
    }
    graph = CausalGraph(tuple(roles), frozenset(directed), frozenset((a, b) for a, b in pairs))
    shared = {name: np.zeros(n) for name in metric_names}
    for a, b in pairs:
        coin = rng.choice([-1.5, 1.5], size=n)
        shared[a] = shared[a] + coin
        shared[b] = shared[b] + coin
    columns: dict[str, Floats] = {}
    for name in graph.topological_order():
        parents = graph.parents(name)
        if not parents and roles[name] in (Role.OPTION, Role.CONTEXT):
            columns[name] = rng.uniform(0, 1, n)
            continue
        value = noise * rng.normal(size=n) + shared.get(name, 0.0)
        for parent in parents:
            cause = (columns[parent] - columns[parent].mean()) / columns[parent].std()
            value = value + rng.choice([-1, 1]) * rng.uniform(0.5, 1.0) * (cause + 0.2 * np.tanh(cause))
        columns[name] = value + 0.1 * np.exp(value / value.std())
    return pd.DataFrame({name: columns[name] for name in roles}), schema_of(roles), graph
