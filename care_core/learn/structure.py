"""A runs table and a schema to a causal graph: screening, FCI, entropic resolution, residual edges (paper, Alg. 1)."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
import pandas as pd

from care_core.causal.graph import CausalGraph
from care_core.errors import LearningError
from care_core.learn.choices import chosen_together
from care_core.learn.completion import DirectEdge, complete
from care_core.learn.constraints import Constraints
from care_core.learn.discovery import FisherZ, Pag, discover
from care_core.learn.orientation import resolve
from care_core.learn.relative import relative
from care_core.learn.screening import pairwise_correlation, screen_options
from care_core.learn.table import normal_scores, varying
from care_core.profile.schema import Schema
from care_core.records import Record
from care_core.variables import Role

REPEATS = 0.98
"""Rank correlation from which two metrics say the same thing."""


class Structure(Record, eq=False):
    """What was learned. `graph` has all variables of the schema; those set aside stand alone in it."""

    graph: CausalGraph
    dropped_options: tuple[str, ...]
    direct: tuple[DirectEdge, ...]
    """Option to objective edges that were allowed, because the metrics do not carry the whole effect."""
    notes: tuple[str, ...]


def learn_structure(frame: pd.DataFrame, schema: Schema, *, alpha: float = 0.01, rng: np.random.Generator) -> Structure:
    """Learn the causal graph of a platform from its runs.

    Args:
        frame: a checked table (`table.read_table`), one row a run. Values that have a nominal are compared by their
            ratio to it.
        alpha: significance level of the independence tests.
        rng: starts of the latent search.

    Raises:
        LearningError: no option, or no objective, varies.
    """
    frame = relative(frame, schema)
    differing = varying(frame, schema.variables)
    for role in (Role.OPTION, Role.OBJECTIVE):
        if not any(schema.variables[name].role is role for name in differing):
            raise LearningError(
                f"No {role.value} varies in the table, so no effect can be learned.",
                hint="Add runs with other configurations and outcomes.",
            )
    constraints = Constraints.of(schema)
    screening = screen_options(frame, schema)
    # What was asked and what flew was drawn without regard to the options, so it hides nothing; a few dozen missions
    # cannot show what it does either: that is in the nominals, and in what people know.
    given = [] if schema.observational else [v.name for v in schema.contexts if v.about != "world"]
    searched = [name for name in differing if name not in {*screening.dropped, *given}]
    columns = {name: frame[name].to_numpy(dtype=float) for name in searched}
    test = FisherZ(np.column_stack(list(columns.values())))
    pag = discover(searched, test, constraints, alpha=alpha)
    resolved = resolve(pag, columns, constraints, rng)
    graph = CausalGraph(
        tuple(schema.variables),
        frozenset(edge for edge in resolved.directed if not constraints.forbids(*edge)),
        resolved.bidirected,
    )
    completion = complete(frame, schema, graph, screening.kept)
    together = chosen_together(frame, schema, screening.kept)
    return Structure(
        graph=_with_hidden_reasons(completion.graph, pag, together, constraints),
        dropped_options=screening.dropped,
        direct=completion.direct,
        notes=(
            *(f"'{name}' never varies in the table." for name in schema.variables if name not in differing),
            *_repeats(frame, [v.name for v in schema.metrics if v.name in differing]),
            *resolved.notes,
            *completion.notes,
            *(
                f"'{option}' was chosen together with '{other}' for a reason that no context holds; what it seems to "
                "do may be that reason's doing."
                for option, other in together.items()
            ),
        ),
    )


def _with_hidden_reasons(
    graph: CausalGraph, pag: Pag, options: Collection[str], constraints: Constraints
) -> CausalGraph:
    """A hidden common cause between each of these options and all that it was found beside in the mission."""
    beside = {*graph.directed, *((edge.a, edge.b) for edge in pag.edges), *((edge.b, edge.a) for edge in pag.edges)}
    arcs = {(a, b) for a, b in beside if a in options and constraints.roles[b] in (Role.METRIC, Role.OBJECTIVE)}
    return CausalGraph(graph.nodes, graph.directed, graph.bidirected | arcs)


def _repeats(frame: pd.DataFrame, metrics: Sequence[str]) -> list[str]:
    """Pairs of metrics of which each hides the other's causes and effects from the search."""
    scores = normal_scores(frame[list(metrics)].to_numpy(dtype=float))
    r, _ = pairwise_correlation(scores, scores)
    return [
        f"'{metrics[i]}' and '{metrics[j]}' nearly repeat each other (rank correlation {r[i, j]:.2f}); keep one."
        for i, j in zip(*np.nonzero(np.triu(np.abs(r) > REPEATS, k=1)), strict=True)
    ]
