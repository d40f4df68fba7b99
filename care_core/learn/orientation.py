"""From a partial ancestral graph to an acyclic directed mixed graph, by entropy (paper, Alg. 1, lines 5 to 17).

Arrowheads and tails that FCI found stay; only circles are resolved. Domain constraints always hold.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import xlogy

from care_core.causal.graph import Edge
from care_core.learn.constraints import Constraints
from care_core.learn.discovery import Mark, Pag, PagEdge
from care_core.numbers import Floats
from care_core.records import Record
from care_core.variables import Role

BINS = 8
THRESHOLD = 0.8
"""A latent cause is accepted below this share of the smaller entropy of the pair (Kocaoglu et al. 2020)."""
BETAS = (0.01, 0.03, 0.1, 0.3)
"""Weights of the latent's entropy against the dependence it leaves; one search each."""
RESTARTS = 4
ITERATIONS = 150


class Resolved(Record):
    """The edges of the mixed graph, and what had to give way for it to have no cycle."""

    directed: frozenset[Edge]
    bidirected: frozenset[Edge]
    notes: tuple[str, ...]


def resolve(pag: Pag, columns: Mapping[str, Floats], constraints: Constraints, rng: np.random.Generator) -> Resolved:
    """Turn every edge of the partial graph into a directed or a bidirected one.

    `a o-> b` and `a o-o b`: bidirected if a low-entropy latent explains the pair. Otherwise `a --> b`, or for
    `a o-o b` the direction with the smaller exogenous entropy. Edges are taken in the order of certainty (FCI's own,
    then by strength), and one that would close a cycle takes the other direction where its marks allow it, else it
    becomes bidirected.

    Args:
        columns: per node, shape (n_runs,), NaN for missing.
        rng: starts of the latent search; the pairs are taken in a fixed order.
    """
    readings = [_read(edge, columns, constraints, rng) for edge in pag.edges]
    # Edges that FCI settled come first, then the stronger ones: the last to come is the one that closes a cycle.
    readings.sort(key=lambda r: (-r.settled, -r.strength, r.ways))
    downstream: dict[str, set[str]] = {node: {node} for node in pag.nodes}
    directed: set[Edge] = set()
    bidirected: set[Edge] = set()
    notes = []
    for reading in readings:
        open_ways = [(a, b) for a, b in reading.ways if a not in downstream[b]]
        if reading.ways and open_ways != list(reading.ways):
            notes.append(_cycle_note(reading.ways[0], open_ways))
        if not open_ways:
            bidirected.add(reading.pair)
            continue
        cause, effect = open_ways[0]
        directed.add((cause, effect))
        for reached in downstream.values():
            if cause in reached:
                reached.update(downstream[effect])
    return Resolved(frozenset(directed), frozenset(bidirected), tuple(notes))


class _Reading(Record):
    """What an edge may become: its directed `ways`, best first; none means bidirected."""

    pair: Edge
    ways: tuple[Edge, ...]
    settled: bool
    strength: float


def _read(edge: PagEdge, columns: Mapping[str, Floats], constraints: Constraints, rng: np.random.Generator) -> _Reading:
    pair = (min(edge.a, edge.b), max(edge.a, edge.b))
    ways = [
        (cause, effect)
        for cause, effect, at_cause, at_effect in (
            (edge.a, edge.b, edge.at_a, edge.at_b),
            (edge.b, edge.a, edge.at_b, edge.at_a),
        )
        if at_cause is not Mark.ARROW and at_effect is not Mark.TAIL and not constraints.never_causes(cause, effect)
    ]
    joint = joint_distribution(columns[edge.a], columns[edge.b])
    strength = mutual_information(joint)
    # The search finds a latent behind many a plain effect of an option, and misses those that operators followed
    # (benchmarks/observational.py): `choices` answers for options.
    of_option = Role.OPTION in (constraints.roles[edge.a], constraints.roles[edge.b])
    if Mark.TAIL in (edge.at_a, edge.at_b) or not ways or of_option:
        return _Reading(pair, tuple(ways), True, strength)
    if has_latent_cause(joint, rng):
        return _Reading(pair, (), False, strength)
    if len(ways) == 2 and not points_forward(joint):
        ways.reverse()
    return _Reading(pair, tuple(ways), False, strength)


def _cycle_note(first: Edge, open_ways: Sequence[Edge]) -> str:
    taken = f"{open_ways[0][0]} -> {open_ways[0][1]}" if open_ways else f"{first[0]} <-> {first[1]}"
    return f"{first[0]} -> {first[1]} would close a cycle; {taken} was taken."


def joint_distribution(x: Floats, y: Floats) -> Floats:
    """Joint frequencies of two columns over the rows that both have, in up to `BINS` equally filled bins each.

    A column with at most `BINS` different values keeps them.
    """
    both = np.isfinite(x) & np.isfinite(y)
    i, j = _levels(x[both]), _levels(y[both])
    counts = np.zeros((i.max(initial=0) + 1, j.max(initial=0) + 1))
    np.add.at(counts, (i, j), 1.0)
    return np.asarray(counts / max(both.sum(), 1))


def _levels(values: Floats) -> NDArray[np.int64]:
    levels = np.unique(values)
    if len(levels) > BINS:
        levels = np.unique(np.quantile(values, np.arange(1, BINS) / BINS))
        values = np.searchsorted(levels, values, side="right").astype(float)
    return np.asarray(np.unique(values, return_inverse=True)[1], dtype=np.int64)


def entropy(p: Floats) -> float:
    """Shannon entropy in nats of a distribution of any shape."""
    return float(-xlogy(p, p).sum())


def mutual_information(joint: Floats) -> float:
    """I(X;Y) in nats of a joint distribution of shape (k, l)."""
    return entropy(joint.sum(axis=1)) + entropy(joint.sum(axis=0)) - entropy(joint)


def has_latent_cause(joint: Floats, rng: np.random.Generator) -> bool:
    """Whether a latent Z with H(Z) < 0.8 min(H(X), H(Y)) makes X and Y independent.

    Args:
        joint: shape (k, l), frequencies of the pair.
    """
    bound = THRESHOLD * min(entropy(joint.sum(axis=1)), entropy(joint.sum(axis=0)))
    # H(Z) >= I(X;Y) for every Z that explains the pair.
    return mutual_information(joint) < bound and latent_entropy(joint, rng) < bound


def latent_entropy(joint: Floats, rng: np.random.Generator, *, leftover: float = 0.001) -> float:
    """Smallest entropy found of a Z that leaves at most `leftover` nats of I(X;Y|Z); infinite if none was found.

    LatentSearch (Kocaoglu et al. 2020, Alg. 1): the update q(z|x,y) ~ q(z|x) q(z|y) / q(z)^(1-beta) does not
    increase I(X;Y|Z) + beta H(Z). All weights and restarts run at once.

    Args:
        joint: shape (k, l).
        rng: starting points.
    """
    states = min(joint.shape)
    beta = np.repeat(BETAS, RESTARTS)[:, None, None, None]
    q = rng.dirichlet(np.full(states, 0.3), size=(len(beta), *joint.shape))
    tiny = 1e-300
    for _ in range(ITERATIONS):
        xyz = q * joint[..., None]
        xz, yz, z = xyz.sum(axis=2), xyz.sum(axis=1), xyz.sum(axis=(1, 2))
        given_x = xz / np.maximum(xz.sum(axis=-1, keepdims=True), tiny)
        given_y = yz / np.maximum(yz.sum(axis=-1, keepdims=True), tiny)
        q = given_x[:, :, None] * given_y[:, None] / np.maximum(z[:, None, None], tiny) ** (1 - beta)
        q /= np.maximum(q.sum(axis=-1, keepdims=True), tiny)
    xyz = q * joint[..., None]
    xz, yz, z = xyz.sum(axis=2), xyz.sum(axis=1), xyz.sum(axis=(1, 2))
    h_z = -xlogy(z, z).sum(axis=-1)
    h_xz, h_yz = -xlogy(xz, xz).sum(axis=(1, 2)), -xlogy(yz, yz).sum(axis=(1, 2))
    left = h_xz + h_yz + xlogy(xyz, xyz).sum(axis=(1, 2, 3)) - h_z
    return float(h_z[left <= leftover].min(initial=np.inf))


def points_forward(joint: Floats) -> bool:
    """Whether X -> Y needs less exogenous entropy than Y -> X (Alg. 1, lines 11 to 14)."""
    return exogenous_entropy(joint) < exogenous_entropy(joint.T)


def exogenous_entropy(joint: Floats) -> float:
    """Entropy of the smallest noise E, found greedily, with Y = f(X, E) and E independent of X.

    Such an E couples the conditionals p(Y|x) of all x (Kocaoglu et al. 2017, greedy minimum-entropy coupling).

    Args:
        joint: shape (k, l), X along the rows.
    """
    weights = joint.sum(axis=1)
    left = joint[weights > 0] / weights[weights > 0, None]
    masses = []
    while left.sum() > 1e-9 * len(left):
        largest = left.argmax(axis=1)
        mass = left[np.arange(len(left)), largest].min()
        left[np.arange(len(left)), largest] -= mass
        masses.append(mass)
    return entropy(np.array(masses))
