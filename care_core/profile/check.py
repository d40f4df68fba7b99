"""Is a profile what it says it is? Recomputes from its own files what can be recomputed with numpy alone."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from care_core.causal.mechanisms import Mechanism, solve
from care_core.causal.model import Model
from care_core.profile.schema import Schema
from care_core.profile.store import Profile
from care_core.variables import Role

TOLERANCE = 1e-3
"""Relative difference that rounding to the digits stored can make."""


def problems(profile: Profile) -> tuple[str, ...]:
    """What in the files contradicts itself, one sentence each; empty for a sound profile.

    Raises:
        ProfileError: the profile cannot be read at all.
    """
    schema, model = profile.schema, profile.model
    return (*_graph(schema, model), *_paths(schema, model), *_effects(schema, model), *_mechanisms(model))


def _graph(schema: Schema, model: Model) -> Iterator[str]:
    unknown = set(model.graph.nodes) - set(schema.variables)
    if unknown:
        yield f"The graph has nodes that profile.yaml does not declare: {', '.join(sorted(unknown))}."
    for edge in (*model.edges.values(), *model.bidirected):
        if not 0 <= edge.support <= 1:
            yield f"The support of {edge.source} -> {edge.target} is {edge.support:g}, not a share."
    for source, target in model.edges:
        if target in schema.variables and schema.variables[target].role is Role.OPTION:
            yield f"{source} -> {target}: nothing causes an option."
        if source in schema.variables and schema.variables[source].role is Role.OBJECTIVE:
            role = schema.variables[target].role if target in schema.variables else None
            if role is not Role.OBJECTIVE:
                yield f"{source} -> {target}: an objective causes nothing but objectives."


def _paths(schema: Schema, model: Model) -> Iterator[str]:
    """Eq. 2: a path's ACE is the mean effect of its edges, and paths are ranked by it."""
    for objective, paths in model.paths.items():
        for path in paths:
            edges = [model.edges.get(edge) for edge in pairwise(path.nodes)]
            text = " -> ".join(path.nodes)
            if any(edge is None for edge in edges):
                yield f"The path {text} runs over an edge that is not in the graph."
                continue
            mean = float(np.mean([edge.effect for edge in edges if edge is not None]))
            if not np.isclose(mean, path.ace, rtol=TOLERANCE, atol=1e-5):
                yield f"The ACE of {text} is {path.ace:g}, its edges give {mean:g}."
            if path.nodes[-1] != objective or schema.variables[path.nodes[0]].role is not Role.OPTION:
                yield f"The path {text} does not lead from an option to {objective}."
        if any(a.ace < b.ace for a, b in pairwise(paths)):
            yield f"The paths to {objective} are not in the order of their ACE."


def _effects(schema: Schema, model: Model) -> Iterator[str]:
    for (option, objective), effect in model.effects.items():
        if option not in model.graph.ancestors(objective):
            yield f"{option} has an effect on {objective} but no path to it."
        if effect.identified and not effect.functional:
            yield f"The effect of {option} on {objective} is called identified, but no functional is given."


def _mechanisms(model: Model) -> Iterator[str]:
    """The stored weights solve (K + noise) w = targets."""
    for key, mechanism in model.mechanisms.items():
        if not _weights_hold(mechanism):
            yield f"The weights of '{key}' do not follow from its points and targets."


def _weights_hold(mechanism: Mechanism) -> bool:
    again = solve(mechanism.kernel, mechanism.points, mechanism.targets)
    scale = float(np.abs(again).max(initial=0.0)) or 1.0
    here = bool(np.allclose(mechanism.weights, again, rtol=TOLERANCE, atol=TOLERANCE * scale))
    return here and (mechanism.prior is None or _weights_hold(mechanism.prior[0]))
