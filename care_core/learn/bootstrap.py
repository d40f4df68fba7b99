"""How often an edge is learned again from a part of the runs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

import numpy as np
import pandas as pd
from joblib import Parallel, delayed

from care_core.causal.graph import Edge
from care_core.errors import LearningError
from care_core.learn.structure import learn_structure
from care_core.profile.schema import Schema

SHARE = 0.632
"""Share of the runs in a resample: as many different runs as a bootstrap resample has. They are drawn without
replacement, since a run that is there twice passes for two independent ones in every test of the graph search."""
AnyEdge = Edge | frozenset[str]
"""A directed edge as (cause, effect), a bidirected one as the set of its ends."""


def edge_support(
    frame: pd.DataFrame,
    schema: Schema,
    *,
    resamples: int = 50,
    rng: np.random.Generator,
    n_jobs: int = 1,
    alpha: float = 0.01,
) -> Mapping[AnyEdge, float]:
    """Share of resamples whose learned graph holds the edge; edges of no resample are left out.

    Screening is part of every resample, so the share covers the whole way from the table to the graph.

    Args:
        rng: draws the resamples; the answer does not depend on `n_jobs`.
        n_jobs: processes.
    """
    seeds = rng.bit_generator.seed_seq.spawn(resamples)  # type: ignore[attr-defined]  # numpy's stub lacks spawn
    tasks = (delayed(_edges_of_resample)(frame, schema, seed, alpha) for seed in seeds)
    counts: Counter[AnyEdge] = Counter()
    for edges in Parallel(n_jobs=min(n_jobs, resamples))(tasks) if resamples else ():
        counts.update(edges)
    return {edge: count / resamples for edge, count in counts.items()}


def _edges_of_resample(
    frame: pd.DataFrame, schema: Schema, seed: np.random.SeedSequence, alpha: float
) -> tuple[AnyEdge, ...]:
    rng = np.random.default_rng(seed)
    rows = rng.choice(len(frame), size=round(SHARE * len(frame)), replace=False)
    resample = frame.iloc[np.sort(rows)].reset_index(drop=True)
    try:
        graph = learn_structure(resample, schema, alpha=alpha, rng=rng).graph
    except LearningError:  # a rare outcome may be in no run of the resample
        return ()
    return (*sorted(graph.directed), *(frozenset(edge) for edge in sorted(graph.bidirected)))
