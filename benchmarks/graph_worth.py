"""What is the graph worth? The same training with the graph it learned, none, a wrong one, and the true one.

    python -m benchmarks.graph_worth [--robots 2] [--runs 60 400] [--faults 20]

Robots of `benchmarks.planted` (the control and the interaction), whose true graph is known. *None* lets every option
act on every metric and objective, *permuted* gives the learned graph's causes to other options. Printed per table size
and graph: how often the first cause of a failed run is one whose reset truly helps, wrong answers at high confidence,
and the Brier score of the promised fixes against interventions in the simulator.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import Any
from unittest.mock import patch

import numpy as np
import pandas as pd
from joblib import Parallel, delayed

from benchmarks.planted import METRICS, OPTIONS, WORLDS, Planted, Score, measure, show
from care_core.causal.graph import CausalGraph
from care_core.learn.structure import Structure, learn_structure
from care_core.profile.schema import Schema
from care_core.records import replace

ROBOTS = ("control", "interaction")
OBJECTIVES = ("success", "time")
TRUE = frozenset({
    ("o0", "lag"), ("o1", "lag"), ("o2", "load"), ("o3", "stuck"), ("o4", "time"), ("load", "stuck"),
    ("stuck", "success"), ("lag", "time"), ("load", "time"),
})  # fmt: skip

Change = Callable[[CausalGraph, np.random.Generator], frozenset[tuple[str, str]]]


def permuted(graph: CausalGraph, rng: np.random.Generator) -> frozenset[tuple[str, str]]:
    """The edges with every option's place taken by another's."""
    place = dict(zip(OPTIONS, np.roll(rng.permutation(OPTIONS), 1), strict=True))
    return frozenset((str(place.get(cause, cause)), effect) for cause, effect in graph.directed)


GRAPHS: dict[str, Change] = {
    "learned": lambda graph, _: graph.directed,
    "none": lambda _, __: frozenset((cause, effect) for cause in OPTIONS for effect in (*METRICS, *OBJECTIVES)),
    "permuted": permuted,
    "true": lambda _, __: TRUE,
}


def with_graph(name: str, world: Planted, seed: int, runs: int, faults: int) -> Score:
    """One robot, trained on a graph that was put in the learned one's place."""

    def changed(frame: pd.DataFrame, schema: Schema, **how: Any) -> Structure:
        found = learn_structure(frame, schema, **how)
        edges = GRAPHS[name](found.graph, np.random.default_rng(seed))
        return replace(found, graph=CausalGraph(found.graph.nodes, edges, frozenset()))

    with patch("care_core.learn.train.learn_structure", changed):
        return measure(world, seed, runs, faults)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--robots", type=int, default=2)
    parser.add_argument("--runs", type=int, nargs="+", default=[60, 400])
    parser.add_argument("--faults", type=int, default=20)
    parser.add_argument("--jobs", type=int, default=2)
    asked = parser.parse_args()
    worlds = [world for world in WORLDS if world.name in ROBOTS]
    for runs in asked.runs:
        tasks = [(name, world, seed) for name in GRAPHS for world in worlds for seed in range(asked.robots)]
        answers = Parallel(n_jobs=asked.jobs)(delayed(with_graph)(*task, runs, asked.faults) for task in tasks)
        scores = {name: Score() for name in GRAPHS}
        for (name, _, _), answer in zip(tasks, answers, strict=True):
            scores[name].add(answer)
        print(f"{runs} runs")
        show(scores)


if __name__ == "__main__":
    from benchmarks import graph_worth as here  # the other processes import by its name what they are given

    here.main()
