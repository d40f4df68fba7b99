"""Few runs of a robot: what do documentation and the profile of a related robot add?

    python -m benchmarks.related [--robots 2] [--runs 25 50 100] [--faults 20]

Robots of `benchmarks.planted` (the control and the interaction), learned from few runs: from nothing; with the true
edges declared (`known` in profile.yaml, what documentation says acts on what); carried over by `care update` from the
profile of another robot, learned from 400 of its runs, whose options act in the same directions but each by another
factor, up to half as much or twice (a related robot) or up to a fourth or four times (all that is known is the sign).
Those profiles as they are, without any run, stand last. Columns as in `benchmarks.planted`.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from threadpoolctl import threadpool_limits

from benchmarks.graph_worth import ROBOTS, TRUE
from benchmarks.planted import RESAMPLES, WORLDS, Planted, Score, measure, show, training_table
from care_core.causal.model import Model
from care_core.learn.train import TrainSettings, train
from care_core.learn.transfer import update
from care_core.profile.schema import Schema
from care_core.records import replace

SOURCE_RUNS = 400
FACTORS = {"related": 2.0, "signs": 4.0}
"""How much more or less an option of the other robot may do."""
Way = Literal["nothing", "known", "related", "signs", "related as it is", "signs as they are"]
LEARNING: tuple[Way, ...] = ("nothing", "known", "related", "signs")
WAYS: tuple[Way, ...] = (*LEARNING, "related as it is", "signs as they are")
"""Without a run the size of the table says nothing: the last two are asked once."""


def other_robot(world: Planted, seed: int, factor: float) -> Model:
    """The profile of a robot whose options act by other factors."""
    rng = np.random.default_rng([seed, int(factor), 99])
    gains = np.exp(rng.uniform(-np.log(factor), np.log(factor), len(world.gains)))
    other = replace(world, gains=tuple(gains.tolist()))
    settings = TrainSettings(seed=seed, resamples=RESAMPLES, folds=0, n_jobs=1)
    with threadpool_limits(1):
        return train(training_table(other, SOURCE_RUNS, rng), other.schema, settings)


def one(world: Planted, seed: int, runs: int, faults: int, way: Way, others: Mapping[str, Model]) -> Score:
    """One robot, learned in one way; `others` are the profiles of other robots by `FACTORS`."""
    if way == "nothing":
        return measure(world, seed, runs, faults)
    if way == "known":
        return measure(replace(world, known=TRUE), seed, runs, faults)
    source = others[way.split()[0]]

    def learn(frame: pd.DataFrame, schema: Schema, settings: TrainSettings) -> Model:
        return update(source, schema, frame, settings) if way in FACTORS else source

    return measure(world, seed, runs, faults, learn)


def all_ways(world: Planted, seed: int, sizes: Sequence[int], faults: int) -> dict[int, dict[str, Score]]:
    """One robot, learned in all ways from tables of each size."""
    others = {name: other_robot(world, seed, factor) for name, factor in FACTORS.items()}
    return {
        runs: {way: one(world, seed, runs, faults, way, others) for way in WAYS if runs == sizes[-1] or way in LEARNING}
        for runs in sizes
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", type=int, default=2)
    parser.add_argument("--runs", type=int, nargs="+", default=[25, 50, 100])
    parser.add_argument("--faults", type=int, default=20, help="failed runs asked of each robot")
    parser.add_argument("--jobs", type=int, default=2)
    asked = parser.parse_args()
    robots = [(world, seed) for world in WORLDS if world.name in ROBOTS for seed in range(asked.robots)]
    tasks = (delayed(all_ways)(world, seed, asked.runs, asked.faults) for world, seed in robots)
    answers = Parallel(n_jobs=asked.jobs)(tasks)
    for runs in asked.runs:
        scores: dict[str, Score] = {}
        for answer in answers:
            for way, score in answer[runs].items():
                scores.setdefault(way, Score()).add(score)
        print(f"{runs} runs")
        show(scores)


if __name__ == "__main__":
    main()
