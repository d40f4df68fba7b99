"""From a runs table to a partial ancestral graph (paper, Alg. 1, lines 3 and 4): FCI.

The adjacency search is ours, on whole arrays of conditioning sets: causal-learn tests one set at a time, also for pairs
that are independent by design, and searches possible d-separating sets of any size. The orientation rules are
causal-learn's. Its background knowledge is not used: it turns a forbidden `X <- Y` into a tail at X, so that a purely
confounded pair comes out as `X --> Y` and the search for a latent cause never sees it. Here what a variable cannot
cause becomes an arrowhead, and a tail is only given to what was drawn at random or met (`Constraints.is_exogenous`).
"""

from __future__ import annotations

import contextlib
import io
from collections.abc import Iterable, Iterator, Sequence
from enum import Enum
from functools import lru_cache, partial
from itertools import combinations
from math import comb
from typing import NamedTuple, Protocol

import numpy as np
from causallearn.graph.Edge import Edge as CausalLearnEdge
from causallearn.graph.Endpoint import Endpoint
from causallearn.graph.GeneralGraph import GeneralGraph
from causallearn.graph.GraphNode import GraphNode
from causallearn.search.ConstraintBased.FCI import rule8, ruleR1, ruleR2, ruleR3, ruleR4B
from numpy.typing import NDArray
from scipy.special import erfc, ndtri

from care_core.learn.constraints import Constraints
from care_core.learn.table import normal_scores
from care_core.numbers import Bools, Floats
from care_core.records import Record

IntArray = NDArray[np.int64]
SeparatingSets = dict[tuple[int, int], frozenset[int]]

SHRINK = 1e-3
"""Weight of the identity in the correlation matrix: metrics that nearly repeat each other leave it invertible."""
MAX_GIVEN = 3
"""Largest conditioning set among neighbours (anytime FCI, Spirtes 2001: stopping early keeps arrowheads valid)."""
MAX_GIVEN_BEYOND = 2
"""Largest conditioning set among possibly d-separating nodes that are not neighbours."""
BATCH = 100_000
"""Independence tests answered in one call: bounds memory, not accuracy."""
MAX_PATTERNS = 12
"""Most patterns of missing values told apart; beyond, the most alike are merged."""
CLEAR = 4.0
"""Evidence (difference of squared z-scores) from which an unshielded triple is oriented: odds of about 7 to 1."""


class Mark(Enum):
    """The end of an edge: `TAIL` a cause, `ARROW` not a cause, `CIRCLE` either."""

    TAIL = "-"
    ARROW = ">"
    CIRCLE = "o"


class PagEdge(Record):
    """An edge `a *-* b` with the marks at its two ends; a comes before b in the graph's nodes."""

    a: str
    b: str
    at_a: Mark
    at_b: Mark


class Pag(Record):
    """A partial ancestral graph: what the independences among the variables say of their causes."""

    nodes: tuple[str, ...]
    edges: tuple[PagEdge, ...]


class Middle(Enum):
    """What the middle of an unshielded triple is."""

    COLLIDER = "collider"
    NONCOLLIDER = "noncollider"
    AMBIGUOUS = "ambiguous"


Middles = dict[tuple[int, int, int], Middle]


class IndependenceTest(Protocol):
    """p-values of independence of x[i] and y[i] given the columns given[i], for all i at once."""

    def p_values(self, x: IntArray, y: IntArray, given: IntArray) -> Floats:
        """x and y: shape (k,); given: shape (k, d). Returns shape (k,), NaN where the pair cannot be tested."""


class FisherZ:
    """Fisher's z on normal scores, each test on the runs that have all its variables.

    Correlations over whatever runs each pair has would mix populations: an option that ends missions early moves the
    mean speed of all flights, but not that of the accomplished ones, and only those have a mission time.

    Args:
        data: shape (n_runs, n_columns), NaN for missing.
    """

    def __init__(self, data: Floats) -> None:
        self._scores = normal_scores(data)
        self._missing, self._pattern = _missing_patterns(np.isnan(data))
        self._by_pattern: dict[int, tuple[Floats, Bools, int]] = {}

    def p_values(self, x: IntArray, y: IntArray, given: IntArray) -> Floats:
        patterns = np.bitwise_or.reduce(self._pattern[np.column_stack([x, y, given])], axis=1)
        p = np.empty(len(x))
        for pattern in np.unique(patterns).tolist():
            tests = patterns == pattern
            p[tests] = self._on(pattern, x[tests], y[tests], given[tests])
        return p

    def _on(self, pattern: int, x: IntArray, y: IntArray, given: IntArray) -> Floats:
        if pattern not in self._by_pattern:
            self._by_pattern[pattern] = self._correlations(pattern)
        correlation, varies, n = self._by_pattern[pattern]
        r = np.clip(_partial_correlation(correlation, x, y, given), -1 + 1e-12, 1 - 1e-12)
        z = np.sqrt(max(n - given.shape[1] - 3, 0)) * np.abs(np.arctanh(r))
        return np.asarray(np.where(varies[x] & varies[y], erfc(z / np.sqrt(2)), np.nan))

    def _correlations(self, pattern: int) -> tuple[Floats, Bools, int]:
        """Correlations, which columns vary, and the number of runs, over the runs that have these columns."""
        lacking = [rows for bit, rows in enumerate(self._missing) if pattern >> bit & 1]
        known = ~np.any(lacking, axis=0) if lacking else np.ones(len(self._scores), dtype=bool)
        scores = np.nan_to_num(self._scores[known])
        scores = scores - scores.mean(axis=0) if len(scores) else scores
        length = np.sqrt((scores**2).sum(axis=0))
        varies = length > 1e-6
        scores = scores / np.where(varies, length, np.inf)
        correlation = (1 - SHRINK) * (scores.T @ scores)
        np.fill_diagonal(correlation, 1.0)
        return correlation, varies, len(scores)


def _partial_correlation(correlation: Floats, x: IntArray, y: IntArray, given: IntArray) -> Floats:
    """By recursion on the conditioning set, all tests at once."""
    if not given.shape[1]:
        return np.asarray(correlation[x, y])
    rest, last = given[:, :-1], given[:, -1]
    r_xy = _partial_correlation(correlation, x, y, rest)
    r_xl = _partial_correlation(correlation, x, last, rest)
    r_yl = _partial_correlation(correlation, y, last, rest)
    return np.asarray((r_xy - r_xl * r_yl) / np.sqrt((1 - r_xl**2) * (1 - r_yl**2)))


def _missing_patterns(missing: Bools) -> tuple[list[Bools], IntArray]:
    """The patterns of missing runs among the columns, and per column the bit of its pattern (0: complete).

    Patterns that differ in few runs are merged (their columns lose the runs of both), until there are few patterns.

    Args:
        missing: shape (n_runs, n_columns).
    """
    tolerance = 0.01
    while True:
        patterns: list[Bools] = []
        bits = np.zeros(missing.shape[1], dtype=np.int64)
        for column in np.flatnonzero(missing.any(axis=0)).tolist():
            rows = missing[:, column]
            place = next((i for i, seen in enumerate(patterns) if (seen != rows).mean() <= tolerance), len(patterns))
            patterns[place:] = [patterns[place] | rows, *patterns[place + 1 :]] if place < len(patterns) else [rows]
            bits[column] = 1 << place
        if len(patterns) <= MAX_PATTERNS:
            return patterns, bits
        tolerance *= 2


def discover(
    names: Sequence[str],
    test: IndependenceTest,
    constraints: Constraints,
    *,
    alpha: float = 0.01,
    max_given: int = MAX_GIVEN,
    max_given_beyond: int = MAX_GIVEN_BEYOND,
) -> Pag:
    """FCI over the named columns, with the constraints as arrowheads.

    Assumes no selection bias (rules R5 to R7 are left out). Rules R9 and R10 only add tails, which the entropic step
    supplies as well, and cost as much as all the rest together on dense graphs: left out.

    Args:
        alpha: significance level of each independence test; larger means more edges.
    """
    separated = np.array([[a == b or constraints.separates(a, b) for b in names] for a in names])
    explains = np.array([[constraints.may_explain(a, b) for b in names] for a in names])
    adjacent, sets = _neighbour_search(~separated, explains, test, alpha, max_given)
    exogenous = [constraints.is_exogenous(name) for name in names]
    middles = _middles(adjacent, sets, test, exogenous)
    marks = _with_colliders(_known_marks(names, adjacent, constraints), middles)
    if _search_beyond(marks, adjacent, sets, explains, test, alpha, max_given_beyond):
        middles = _middles(adjacent, sets, test, exogenous)
        marks = _with_colliders(_known_marks(names, adjacent, constraints), middles)
    return _closed_under_rules(names, marks, adjacent, sets, middles, test, alpha)


def _neighbour_search(
    possible: Bools, explains: Bools, test: IndependenceTest, alpha: float, max_given: int
) -> tuple[Bools, SeparatingSets]:
    """The order-independent adjacency search (PC-stable), keeping the set with the largest p-value.

    The most independent set, not the first found, decides on colliders: it is the least likely to be a chance find.
    Pairs that are independent by design have the empty set.
    """
    adjacent = possible.copy()
    sets: SeparatingSets = {}
    for i, j in zip(*np.nonzero(~possible), strict=True):
        sets[int(i), int(j)] = frozenset()
    for size in range(max_given + 1):
        neighbours = [np.flatnonzero(row) for row in adjacent]
        questions = []
        for x, y in _pairs(adjacent):
            useful = explains[:, x] | explains[:, y]
            useful[[x, y]] = False
            questions.append(_Question(x, y, [neighbours[node][useful[neighbours[node]]] for node in (x, y)]))
        _separate(adjacent, sets, _independences(questions, size, test, alpha))
        if max(map(len, neighbours), default=0) <= size:
            break
    return adjacent, sets


def _search_beyond(
    marks: IntArray,
    adjacent: Bools,
    sets: SeparatingSets,
    explains: Bools,
    test: IndependenceTest,
    alpha: float,
    max_given: int,
) -> bool:
    """Removes edges separated only by nodes that are not neighbours (Possible-D-SEP). Whether there was any."""
    found_any = False
    reach = [_possibly_separating(marks, adjacent, x) for x in range(len(adjacent))]
    neighbours = [set(np.flatnonzero(row).tolist()) for row in adjacent]
    for size in range(1, max_given + 1):
        questions = []
        for x, y in _pairs(adjacent):
            useful = explains[:, x] | explains[:, y]
            pools = [
                np.array([n for n in sorted(reach[node] - {other}) if useful[n]], dtype=np.int64)
                for node, other in ((x, y), (y, x))
                if reach[node] - neighbours[node] - {other}
            ]
            questions.append(_Question(x, y, pools))
        found = _independences(questions, size, test, alpha)
        _separate(adjacent, sets, found)
        found_any = found_any or bool(found)
    return found_any


class _Question(NamedTuple):
    """Is the pair independent given some nodes of one of the pools?"""

    x: int
    y: int
    pools: list[IntArray]


def _independences(
    questions: Iterable[_Question], size: int, test: IndependenceTest, alpha: float
) -> list[tuple[int, int, frozenset[int]]]:
    """The pairs that some set of this size separates, each with the set given which it looks most independent."""
    found = []
    batch: list[tuple[_Question, IntArray]] = []
    waiting = 0
    for question in questions:
        given = [pool[_choices(len(pool), size)] for pool in (question.pools if size else question.pools[:1])]
        sets = np.concatenate(given) if given else np.zeros((0, size), dtype=np.int64)
        # A pair with very many sets is split, so that memory stays bounded.
        for part in np.array_split(sets, 1 + len(sets) // BATCH) if len(sets) else ():
            batch.append((question, part))
            waiting += len(part)
            if waiting >= BATCH:
                found += _most_independent(batch, test, alpha)
                batch, waiting = [], 0
    return _best_of(found + _most_independent(batch, test, alpha))


def _most_independent(
    batch: Sequence[tuple[_Question, IntArray]], test: IndependenceTest, alpha: float
) -> list[tuple[float, int, int, frozenset[int]]]:
    """Per pair and its sets: the largest p-value and its set, where that is above alpha."""
    if not batch:
        return []
    counts = [len(sets) for _, sets in batch]
    given = np.concatenate([sets for _, sets in batch])
    x, y = (np.repeat([question[end] for question, _ in batch], counts) for end in (0, 1))
    # A pair never seen to vary together shows no dependence. A set whose runs leave one of the pair constant has
    # selected runs, not explained the dependence seen in the others.
    p = np.nan_to_num(test.p_values(x, y, given), nan=0.0 if given.shape[1] else 1.0)
    found = []
    for (question, sets), own in zip(batch, np.split(p, np.cumsum(counts)[:-1]), strict=True):
        best = int(own.argmax())
        if own[best] > alpha:
            found.append((float(own[best]), question.x, question.y, frozenset(sets[best].tolist())))
    return found


def _best_of(found: Iterable[tuple[float, int, int, frozenset[int]]]) -> list[tuple[int, int, frozenset[int]]]:
    """One set a pair: the one with the largest p-value, the first of equal ones."""
    best: dict[tuple[int, int], tuple[float, frozenset[int]]] = {}
    for p, x, y, given in found:
        if (x, y) not in best or p > best[x, y][0]:
            best[x, y] = p, given
    return [(x, y, given) for (x, y), (_, given) in best.items()]


@lru_cache(maxsize=512)
def _choices(count: int, size: int) -> IntArray:
    """All ways to take `size` of `count` places, shape (ways, size)."""
    return np.array(list(combinations(range(count), size)), dtype=np.int64).reshape(comb(count, size), size)


def _pairs(adjacent: Bools) -> Iterator[tuple[int, int]]:
    for x, y in zip(*np.nonzero(np.triu(adjacent)), strict=True):
        yield int(x), int(y)


def _separate(adjacent: Bools, sets: SeparatingSets, found: Iterable[tuple[int, int, frozenset[int]]]) -> None:
    for x, y, given in found:
        adjacent[x, y] = adjacent[y, x] = False
        sets[x, y] = sets[y, x] = given


# Marks as a matrix: marks[i, j] is the mark at j of the edge between i and j, 0 where there is none.
_NONE, _CIRCLE, _ARROW, _TAIL = 0, 1, 2, 3


def _known_marks(names: Sequence[str], adjacent: Bools, constraints: Constraints) -> IntArray:
    """Circles, except what the constraints say: an arrowhead at what cannot cause, a tail at what is exogenous."""
    marks = adjacent.astype(np.int64) * _CIRCLE
    for i, j in zip(*np.nonzero(adjacent), strict=True):
        if constraints.never_causes(names[j], names[i]) or constraints.is_exogenous(names[i]):
            marks[i, j] = _ARROW
        elif constraints.is_exogenous(names[j]):
            marks[i, j] = _TAIL
    return marks


def _middles(adjacent: Bools, sets: SeparatingSets, test: IndependenceTest, exogenous: Sequence[bool]) -> Middles:
    """What the middle of every unshielded triple is, by how independent its ends are with and without it.

    A weak cause and an effect two steps away often look independent given nothing at all; taking the separating set
    at its word makes the middle a collider and turns a causal chain into a hidden confounder. The evidence is the
    difference of squared z-scores (twice the log-likelihood ratio of the two readings); below `CLEAR` the triple is
    ambiguous and orients nothing.

    Triples `x --> m *-* y` with an exogenous x all ask the same question, whether m is a cause of y: their evidence
    is added up, so that one chance independence among many options does not decide. Where it says that m is a cause
    of y, m is no collider towards y for any other neighbour either, whatever their own triple looks like: among
    metrics, paths that nearly cancel are common.
    """
    triples = [
        (x, middle, y)
        for middle in range(len(adjacent))
        for x, y in combinations(np.flatnonzero(adjacent[middle]).tolist(), 2)
        if not (adjacent[x, y] or exogenous[middle] or (exogenous[x] and exogenous[y]))
    ]
    evidence = dict(zip(triples, _evidence(triples, sets, test), strict=True))
    pooled: dict[tuple[int, int], float] = {}
    for (x, middle, y), own in evidence.items():
        if exogenous[x] or exogenous[y]:
            question = middle, (y if exogenous[x] else x)
            pooled[question] = pooled.get(question, 0.0) + own
    readings = {}
    for (x, middle, y), own in evidence.items():
        asked = [pooled[middle, end] for end in (x, y) if (middle, end) in pooled]
        decisive = exogenous[x] or exogenous[y] or min(asked, default=0.0) <= -CLEAR
        readings[x, middle, y] = _reading(min(asked) if decisive else own)
    return readings


def _reading(evidence: float) -> Middle:
    if abs(evidence) < CLEAR:
        return Middle.AMBIGUOUS
    return Middle.COLLIDER if evidence > 0 else Middle.NONCOLLIDER


def _evidence(triples: Sequence[tuple[int, int, int]], sets: SeparatingSets, test: IndependenceTest) -> list[float]:
    """By how much conditioning on the middle raises the squared z-score of the ends; 0 if that cannot be tested."""
    without = [(x, y, sorted(sets[x, y] - {middle})) for x, middle, y in triples]
    beside = [(x, y, [*given, middle]) for (x, y, given), (_, middle, _) in zip(without, triples, strict=True)]
    before, after = (ndtri(np.maximum(_p_of(test, tests), 1e-300) / 2) ** 2 for tests in (without, beside))
    return [0.0 if np.isnan(difference) else float(difference) for difference in after - before]


def _p_of(test: IndependenceTest, tests: Sequence[tuple[int, int, Sequence[int]]]) -> Floats:
    """p-values of single tests with conditioning sets of any size, shape (len(tests),)."""
    p = np.ones(len(tests))
    sizes = np.array([len(given) for _, _, given in tests], dtype=np.int64)
    for size in np.unique(sizes).tolist():
        chosen = np.flatnonzero(sizes == size).tolist()
        x, y = np.array([tests[i][:2] for i in chosen], dtype=np.int64).T
        given = np.array([tests[i][2] for i in chosen], dtype=np.int64).reshape(len(chosen), size)
        p[chosen] = test.p_values(x, y, given)
    return p


def _p_value(test: IndependenceTest, x: int, y: int, given: Sequence[int]) -> float:
    return float(_p_of(test, [(x, y, given)])[0])


def _with_colliders(known: IntArray, middles: Middles) -> IntArray:
    """Rule R0: arrowheads at the colliders of unshielded triples."""
    marks: IntArray = known.copy()
    for (x, middle, y), kind in middles.items():
        if kind is Middle.COLLIDER and _TAIL not in (marks[x, middle], marks[y, middle]):
            marks[x, middle] = marks[y, middle] = _ARROW
    return marks


def _possibly_separating(marks: IntArray, adjacent: Bools, start: int) -> set[int]:
    """Nodes reached from `start` by paths whose every inner node is a collider or part of a triangle."""
    steps = [(start, int(node)) for node in np.flatnonzero(adjacent[start])]
    seen = set(steps)
    while steps:
        before, node = steps.pop()
        for after in np.flatnonzero(adjacent[node]).tolist():
            collider = marks[before, node] == _ARROW and marks[after, node] == _ARROW
            if after not in (before, start) and (collider or adjacent[before, after]) and (node, after) not in seen:
                seen.add((node, after))
                steps.append((node, after))
    return {node for _, node in seen}


_ENDPOINTS = {_CIRCLE: Endpoint.CIRCLE, _ARROW: Endpoint.ARROW, _TAIL: Endpoint.TAIL}


def _closed_under_rules(
    names: Sequence[str],
    marks: IntArray,
    adjacent: Bools,
    sets: SeparatingSets,
    middles: Middles,
    test: IndependenceTest,
    alpha: float,
) -> Pag:
    """Applies rules R1 to R4 and R8 of FCI until none does; they never touch a mark that is not a circle."""
    nodes = [GraphNode(name) for name in names]
    graph = GeneralGraph(nodes)
    for i, j in _pairs(adjacent):
        ends = _ENDPOINTS[int(marks[j, i])], _ENDPOINTS[int(marks[i, j])]
        graph.add_edge(CausalLearnEdge(nodes[i], nodes[j], *ends))

    chains = [
        (nodes[ends[0]], nodes[middle], nodes[ends[1]])
        for (x, middle, y), kind in middles.items()
        for ends in ((x, y), (y, x))
        if kind is Middle.NONCOLLIDER
    ]
    # causal-learn prints, in some versions whatever `verbose` says; stdout is for data.
    with contextlib.redirect_stdout(io.StringIO()):
        changed = True
        while changed:
            changed = False
            for chain in chains:
                changed = ruleR1(*chain, graph, None, changed)
            for i, j in _pairs(adjacent):
                for middle in np.flatnonzero(adjacent[i] & adjacent[j]).tolist():
                    changed = ruleR2(nodes[i], nodes[middle], nodes[j], graph, None, changed)
                    changed = ruleR2(nodes[j], nodes[middle], nodes[i], graph, None, changed)
            changed = ruleR3(graph, sets, None, changed)
            changed = ruleR4B(graph, -1, None, partial(_p_value, test), alpha, sets, changed, None)
            changed = rule8(graph, nodes, changed)
    edges = []
    for i, j in _pairs(adjacent):
        at_i, at_j = graph.get_endpoint(nodes[j], nodes[i]), graph.get_endpoint(nodes[i], nodes[j])
        edges.append(PagEdge(names[i], names[j], Mark[at_i.name], Mark[at_j.name]))
    return Pag(tuple(names), tuple(edges))
