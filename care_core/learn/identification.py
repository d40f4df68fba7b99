"""Can the effect of an option on an objective be computed from the runs, and with what adjustment?

Identification is ananke's (one-line ID, Richardson et al. 2017). Its `functional()` prints to stdout and its text
changes with the hash seed, so the functional is written here, from the same parts in sorted order.
"""

from __future__ import annotations

from collections.abc import Collection

from ananke.graphs import ADMG
from ananke.identification import OneLineID

from care_core.causal.graph import CausalGraph
from care_core.records import Record


class Identification(Record):
    """Whether p(objective | do(option)) follows from the runs, and how.

    `functional` is empty where it does not. With `by_adjustment`, averaging p(objective | option, adjustment) over
    the runs' `adjustment` gives the effect, so a regression does; without it, an identified effect needs the
    functional itself.
    """

    identified: bool
    functional: str
    by_adjustment: bool
    adjustment: tuple[str, ...]


def identify(graph: CausalGraph, option: str, objective: str) -> Identification:
    """Identify the effect of one option on one objective.

    Only the ancestors of the objective matter; the others are left out first, which changes no answer and makes
    the query quick.
    """
    ancestral = graph.subgraph(graph.ancestors(objective))
    if option not in ancestral.nodes or option == objective:
        return Identification(True, f"p({objective})", True, ())
    if not ancestral.parents(option) and not any(option in edge for edge in ancestral.bidirected):
        # Nothing, seen or hidden, acts on it: seeing its value is setting it. A query would say so, slowly.
        return Identification(True, f"p({objective}|{option})", True, ())
    query = OneLineID(
        ADMG(
            list(ancestral.nodes),
            di_edges=sorted(ancestral.directed),
            bi_edges=sorted(ancestral.bidirected),
        ),
        treatments=[option],
        outcomes=[objective],
    )
    if not query.id():
        return Identification(False, "", False, ())
    adjustment = _adjustment(ancestral, option, objective)
    if adjustment is None:
        return Identification(True, _functional(query, objective), False, ())
    held = ",".join(adjustment)
    functional = f"sum_{{{held}}} p({objective}|{option},{held}) p({held})" if held else f"p({objective}|{option})"
    return Identification(True, functional, True, adjustment)


def _functional(query: OneLineID, objective: str) -> str:
    """Sum over the other relevant variables of the product, per district D, of q(D | the variables that are fixed).

    The order of fixing does not change a kernel, so the fixed variables are sorted.
    """
    summed = ",".join(sorted(query.ystar - {objective}))
    kernels = sorted(
        f"phi_{{{','.join(sorted(fixed))}}}(p(V))" if fixed else "p(V)" for fixed in query.fixing_orders.values()
    )
    return (f"sum_{{{summed}}} " if summed else "") + " ".join(kernels)


def _adjustment(graph: CausalGraph, option: str, objective: str) -> tuple[str, ...] | None:
    """The first that blocks every path but the causal ones: nothing, the option's causes, every allowed ancestor.

    The last is the canonical adjustment set (Perkovic et al. 2018): if it fails, so does every other.
    """
    mediators = graph.descendants(option) & graph.ancestors(objective) - {option}
    allowed = graph.ancestors(option, objective) - graph.descendants(*mediators) - {option}
    for candidate in (set[str](), allowed.intersection(graph.parents(option)), allowed):
        if _blocks(graph, option, objective, candidate):
            return tuple(sorted(candidate))
    return None


def is_answered_by(graph: CausalGraph, option: str, objective: str, inputs: Collection[str]) -> bool:
    """Whether a regression of the objective on these exogenous variables gives the option's effect.

    An effect that is identified only through metrics (the front door) is not: nothing here computes its functional.
    """
    return _blocks(graph, option, objective, {*inputs} - {option})


def _blocks(graph: CausalGraph, option: str, objective: str, held: Collection[str]) -> bool:
    """Whether `held` blocks every path but the causal ones."""
    mediators = graph.descendants(option) & graph.ancestors(objective) - {option}
    first_steps = {(option, node) for node in graph.children(option) if node in mediators}
    backdoor = CausalGraph(graph.nodes, graph.directed - first_steps, graph.bidirected)
    return backdoor.m_separated(option, objective, held)
