"""Which way of finding the graph is best? Simulated robots with known graphs, alternatives side by side.

    python -m benchmarks.discovery [--robots 12] [--runs 400 1500]
    python -m benchmarks.discovery --latent

The robots (`tests/robots.py`) have codes, counts, heavy tails and yes-or-no metrics, effects that bend or have an
optimum inside, two options that matter only together, a context that confounds, hidden causes, and refused missions
without metrics. Printed per alternative: structural Hamming distance to the true graph (pairs whose edges differ) and
F1 of "this option has a directed path to this objective", means over the robots with the standard error of the
difference to the default, robot by robot. `--latent`: which hidden causes of a pair of metrics the latent search finds.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from unittest import mock

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from threadpoolctl import threadpool_limits

from care_core.causal.graph import CausalGraph
from care_core.learn.completion import RATE, complete
from care_core.learn.constraints import Constraints
from care_core.learn.discovery import FisherZ, IndependenceTest, IntArray, discover
from care_core.learn.orientation import has_latent_cause, joint_distribution, resolve
from care_core.learn.screening import screen_options
from care_core.learn.table import normal_scores
from care_core.numbers import Floats
from care_core.profile.schema import Schema
from care_core.records import Record
from tests.robots import random_robot


class Pearson(FisherZ):
    """Fisher's z on the values as they are."""

    def __init__(self, data: Floats) -> None:
        super().__init__(data)
        sd = np.nanstd(data, axis=0)
        self._scores = (data - np.nanmean(data, axis=0)) / np.where(sd > 0, sd, 1.0)


class WithMagnitudes:
    """Fisher's z on normal scores and on their magnitudes, given both: sees an optimum inside. Smallest p, times 3."""

    def __init__(self, data: Floats) -> None:
        scores = normal_scores(data)
        self._columns = data.shape[1]
        self._test = FisherZ(np.column_stack([scores, np.abs(scores)]))

    def p_values(self, x: IntArray, y: IntArray, given: IntArray) -> Floats:
        both = np.column_stack([given, given + self._columns]) if given.shape[1] else given
        k = self._columns
        p = np.array([self._test.p_values(a, b, both) for a, b in ((x, y), (x + k, y), (x, y + k))])
        known = np.where(np.isnan(p).all(axis=0), np.nan, np.nanmin(np.where(np.isnan(p), 1.0, p), axis=0))
        return np.asarray(np.minimum(3 * known, 1.0))


class Way(Record):
    """One way from a table to a graph."""

    test: Callable[[Floats], IndependenceTest] = FisherZ
    alpha: float = 0.01
    completion_rate: float | None = RATE
    """False discovery rate of the completion; None: none."""
    entropic: bool = True

    def learn(self, frame: pd.DataFrame, schema: Schema) -> CausalGraph:
        constraints = Constraints.of(schema)
        screening = screen_options(frame, schema)
        names = [v for v in schema.variables if frame[v].nunique() > 1 and v not in screening.dropped]
        columns = {name: frame[name].to_numpy(dtype=float) for name in names}
        pag = discover(names, self.test(np.column_stack(list(columns.values()))), constraints, alpha=self.alpha)
        no_latent = mock.patch("care_core.learn.orientation.has_latent_cause", return_value=False)
        with nullcontext() if self.entropic else no_latent:
            resolved = resolve(pag, columns, constraints, np.random.default_rng(0))
        directed = frozenset(edge for edge in resolved.directed if not constraints.forbids(*edge))
        graph = CausalGraph(tuple(schema.variables), directed, resolved.bidirected)
        if self.completion_rate is None:
            return graph
        return complete(frame, schema, graph, screening.kept, rate=self.completion_rate).graph


WAYS: Mapping[str, Way] = {
    "default": Way(),
    "Pearson": Way(Pearson),
    "scores and magnitudes": Way(WithMagnitudes),
    "alpha 0.001": Way(alpha=0.001),
    "alpha 0.05": Way(alpha=0.05),
    "completion at 0.1": Way(completion_rate=0.1),
    "completion at 0.01": Way(completion_rate=0.01),
    "magnitudes, completion at 0.01": Way(WithMagnitudes, completion_rate=0.01),
    "without completion": Way(completion_rate=None),
    "Pearson, no completion": Way(Pearson, completion_rate=None),
    "magnitudes, no completion": Way(WithMagnitudes, completion_rate=None),
    "without latent search": Way(entropic=False),
}


def hamming(found: CausalGraph, truth: CausalGraph) -> int:
    """Pairs of nodes between which the edges differ."""

    def edges(graph: CausalGraph) -> dict[frozenset[str], frozenset[tuple[str, ...]]]:
        marks: dict[frozenset[str], set[tuple[str, ...]]] = {}
        for edge in graph.directed:
            marks.setdefault(frozenset(edge), set()).add(edge)
        for edge in graph.bidirected:
            marks.setdefault(frozenset(edge), set()).add(("hidden",))
        return {pair: frozenset(kinds) for pair, kinds in marks.items()}

    ours, theirs = edges(found), edges(truth)
    return sum(ours.get(pair) != theirs.get(pair) for pair in {*ours, *theirs})


def ancestor_f1(found: CausalGraph, truth: CausalGraph, schema: Schema) -> float:
    options = {option.name for option in schema.options}
    pairs = [
        {(option, y.name) for y in schema.objectives for option in options & graph.ancestors(y.name)}
        for graph in (found, truth)
    ]
    return 2 * len(pairs[0] & pairs[1]) / max(len(pairs[0]) + len(pairs[1]), 1)


def measure(seed: int, runs: int) -> dict[str, tuple[float, float, float]]:
    """Per way: distance, F1 and seconds on one robot."""
    robot = random_robot(np.random.default_rng(seed))
    frame = robot.drive(runs, np.random.default_rng(10_000 + seed))
    answers = {}
    with threadpool_limits(1):
        for name, way in WAYS.items():
            started = time.monotonic()
            graph = way.learn(frame, robot.schema)
            took = time.monotonic() - started
            answers[name] = (
                float(hamming(graph, robot.graph)),
                ancestor_f1(graph, robot.graph, robot.schema),
                took,
            )
    return answers


def show(runs: int, answers: list[dict[str, tuple[float, float, float]]]) -> None:
    print(f"\n{len(answers)} robots x {runs} runs")
    print(f"| {'way':30s} | distance | against default | F1 of causes | against default | s |")
    print("|---|---|---|---|---|---|")
    default = np.array([answer["default"] for answer in answers])
    for name in WAYS:
        mine = np.array([answer[name] for answer in answers])
        gain = mine - default
        error = gain.std(axis=0, ddof=1) / np.sqrt(len(gain))
        against = [f"{gain[:, k].mean():+.2f} +- {error[k]:.2f}" if name != "default" else "" for k in (0, 1)]
        distance, f1, seconds = mine.mean(axis=0)
        print(f"| {name:30s} | {distance:.1f} | {against[0]} | {f1:.3f} | {against[1]} | {seconds:.2f} |")


PAIRS, PAIR_RUNS = 12, 400


def show_latent() -> None:
    """Pairs of metrics that only a hidden cause, or only a direct effect, correlates: how many are called latent?"""
    for kind in ("normal hidden cause", "hidden cause of two states", "direct effect"):
        for r in (0.5, 0.8):
            pairs = [joint_distribution(*_pair(kind, r, np.random.default_rng(seed))) for seed in range(PAIRS)]
            found = sum(has_latent_cause(joint, np.random.default_rng(seed)) for seed, joint in enumerate(pairs))
            print(f"{kind:27s} correlation {r}: called latent {found} of {PAIRS}")


def _pair(kind: str, r: float, rng: np.random.Generator) -> tuple[Floats, Floats]:
    cause, own, other = rng.normal(size=(3, PAIR_RUNS))
    if kind == "direct effect":
        return cause, r * cause + np.sqrt(1 - r**2) * own
    cause = np.sign(cause) if kind == "hidden cause of two states" else cause
    return np.sqrt(r) * cause + np.sqrt(1 - r) * own, np.sqrt(r) * cause + np.sqrt(1 - r) * other


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--latent", action="store_true", help="only which hidden causes are found")
    parser.add_argument("--robots", type=int, default=12)
    parser.add_argument("--runs", type=int, nargs="+", default=[400, 1500])
    parser.add_argument("--jobs", type=int, default=2)
    args = parser.parse_args()
    if args.latent:
        show_latent()
        return
    for runs in args.runs:
        show(runs, Parallel(n_jobs=args.jobs)(delayed(measure)(seed, runs) for seed in range(args.robots)))


if __name__ == "__main__":
    from benchmarks import discovery as here  # the other processes import by its name what they are given

    here.main()
