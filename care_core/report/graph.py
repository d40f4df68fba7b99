"""`care.graph/1`: the causal graph of a profile, for other programs and for people. Files of it: `graph_files`."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Final, Literal

from care_core.causal.effects import Direction
from care_core.causal.model import EdgeRecord, PathRecord
from care_core.profile.schema import Schema
from care_core.profile.store import Profile
from care_core.records import field
from care_core.report.document import ProfileEntry, Share
from care_core.report.published import Document, publish
from care_core.text import clean, listed, wrapped

SCHEMA_ID: Final = "care.graph/1"
EFFECT_UNIT: Final = "standard deviations of the target"

NO_EFFECT = 0.005
"""An effect that would be printed as 0.00."""


class NodeEntry(Document, kw_only=True):
    name: str
    role: Literal["option", "context", "metric", "objective"]
    unit: str


class EdgeEntry(Document, kw_only=True):
    """A directed edge, or a hidden common cause of two variables, whose effect nobody knows."""

    source: str
    target: str
    kind: Literal["directed", "bidirected"]
    support: Share
    """Share of the bootstrap resamples that have it."""
    effect: float | None
    """Mean change of the target between two acceptable values of the source; below 0 where it falls."""
    low: float | None
    high: float | None
    direction: Direction


class PathEntry(Document, kw_only=True):
    """A path from an option to an objective, with the mean effect of its edges and the support of each."""

    objective: str
    nodes: list[str]
    ace: float
    low: float
    high: float
    direction: Direction
    edge_support: list[Share]


class GraphDocument(Document, kw_only=True):
    """What `care graph --json` prints."""

    schema_: Literal["care.graph/1"] = field(default=SCHEMA_ID, name="schema")
    profile: ProfileEntry
    runs: int
    resamples: int
    effect_unit: Literal["standard deviations of the target"] = EFFECT_UNIT
    nodes: list[NodeEntry]
    edges: list[EdgeEntry]
    paths: list[PathEntry]
    """Per objective the strongest ones, the best first."""
    cause: list[str]
    """The path of the cause of the run that was asked about; empty for a profile alone."""

    def has_on_path(self, edge: EdgeEntry) -> bool:
        """Whether the run's cause leads over an edge."""
        return edge.kind == "directed" and (edge.source, edge.target) in pairwise(self.cause)


def graph_document(profile: Profile, cause: Sequence[str] = ()) -> GraphDocument:
    """The graph of a profile; `cause` is a path of a run to be marked. Raises ProfileError where it is not trained."""
    schema, model = profile.schema, profile.model
    return GraphDocument(
        profile=ProfileEntry(
            name=clean(schema.name),
            version=clean(schema.version),
            platform=clean(schema.platform),
            origin=clean(profile.origin),
        ),
        runs=model.training.runs,
        resamples=model.training.resamples,
        nodes=[_node(name, schema) for name in model.graph.nodes],
        edges=[_edge(edge) for edge in (*model.edges.values(), *model.bidirected)],
        paths=[_path(path) for paths in model.paths.values() for path in paths],
        cause=[clean(name) for name in cause],
    )


def _node(name: str, schema: Schema) -> NodeEntry:
    variable = schema.variables[name]
    return NodeEntry(name=clean(name), role=variable.role.value, unit=clean(variable.unit))


def _edge(edge: EdgeRecord) -> EdgeEntry:
    if edge.kind == "bidirected":
        return publish(EdgeEntry, edge, effect=None, low=None, high=None)
    return publish(EdgeEntry, edge, effect=edge.signed_effect)


def _path(path: PathRecord) -> PathEntry:
    return publish(PathEntry, path)


def graph_text(document: GraphDocument, top: int) -> str:
    """The graph in lines: of each objective its parents and its `top` strongest paths."""
    return "\n".join(_lines(document, top)) + "\n"


def _lines(document: GraphDocument, top: int) -> Iterator[str]:
    profile = document.profile
    count = {kind: sum(edge.kind == kind for edge in document.edges) for kind in ("directed", "bidirected")}
    yield from wrapped(f"{profile.title} {profile.version}: {profile.platform}")
    yield from wrapped(
        f"{len(document.nodes)} variables, {count['directed']} directed edges and {count['bidirected']} hidden common"
        f" causes, learned from {document.runs} runs"
    )
    yield from wrapped(
        f"Effects are in {document.effect_unit}; support is the share of {document.resamples} bootstrap resamples that"
        " have an edge. A path has the mean effect of its edges and the support of the weakest."
    )
    if document.cause:
        yield from ("", "The path of this run's cause (* below)")
        yield from wrapped(_way(document.cause), first="  ", rest="    ")
    for node in document.nodes:
        if node.role == "objective":
            yield from _of_objective(document, node, top)


def _of_objective(document: GraphDocument, node: NodeEntry, top: int) -> Iterator[str]:
    name = node.name
    yield from ("", f"{name} ({node.unit})" if node.unit else name)
    yield from _parent_lines(document, name)
    hidden = [({edge.source, edge.target} - {name}).pop() for edge in document.edges if _is_hidden_cause(edge, name)]
    yield from wrapped(f"hidden common cause with {listed(hidden)}", "  ", "    ") if hidden else ()
    paths = [path for path in document.paths if path.objective == name]
    yield "  strongest paths" if paths else "  no path from a parameter"
    for path in paths[:top]:
        yield from wrapped(_way(path.nodes), f"  {path.ace:6.2f}  {min(path.edge_support, default=0.0):4.0%}  ")


def _parent_lines(document: GraphDocument, name: str) -> Iterator[str]:
    """The direct causes of a variable, the strongest first."""
    parents = [edge for edge in document.edges if edge.target == name and edge.kind == "directed"]
    felt = [edge for edge in parents if abs(edge.effect or 0.0) >= NO_EFFECT]
    width = max((len(edge.source) for edge in felt), default=0)
    yield f"  {'parent':<{width}}  effect  support" if felt else "  no parent with a measured effect"
    for edge in sorted(felt, key=lambda one: -abs(one.effect or 0.0)):
        turns = "  optimum inside its range" if edge.direction == "optimum inside" else ""
        mark = "*" if document.has_on_path(edge) else " "
        yield from wrapped(f"{edge.source:<{width}} {mark}{edge.effect:+6.2f}  {edge.support:7.0%}{turns}", "  ")
    rest = [edge.source for edge in parents if edge not in felt]
    yield from wrapped(f"no measured effect of its own: {', '.join(rest)}", "  ", "    ") if rest else ()


def _is_hidden_cause(edge: EdgeEntry, name: str) -> bool:
    return edge.kind == "bidirected" and name in (edge.source, edge.target)


def _way(nodes: Sequence[str]) -> str:
    return " -> ".join(nodes)
