"""How often an edge, or a way from an option to an objective, is learned again from a part of the runs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from functools import partial

import numpy as np
import pandas as pd

from care_core.causal.graph import Edge
from care_core.errors import LearningError
from care_core.learn.processes import answers
from care_core.learn.structure import learn_structure
from care_core.profile.schema import Schema
from care_core.records import Record

SHARE = 0.632
"""Share of the runs in a resample: as many different runs as a bootstrap resample has. They are drawn without
replacement, since a run that is there twice passes for two independent ones in every test of the graph search."""


class Reaches(Record):
    """That an option has a directed path to an objective, whichever metrics it goes through."""

    option: str
    objective: str


Finding = Edge | frozenset[str] | Reaches
"""A directed edge as (cause, effect), a bidirected one as the set of its ends, or an option that reaches an objective.

Metrics that repeat each other share the resamples between them: each edge is seen in few, the effect in all."""


def support(
    frame: pd.DataFrame,
    schema: Schema,
    *,
    resamples: int = 50,
    rng: np.random.Generator,
    n_jobs: int = 1,
    alpha: float = 0.01,
) -> Mapping[Finding, float]:
    """Share of resamples whose learned graph holds each finding; those of no resample are left out.

    Screening is part of every resample, so the share covers the whole way from the table to the graph.

    Args:
        rng: draws the resamples; the answer does not depend on `n_jobs`.
        n_jobs: processes.
    """
    seeds = rng.bit_generator.seed_seq.spawn(resamples)  # type: ignore[attr-defined]  # numpy's stub lacks spawn
    counts: Counter[Finding] = Counter()
    for findings in answers([partial(_findings, frame, schema, seed, alpha) for seed in seeds], n_jobs):
        counts.update(findings)
    return {finding: count / resamples for finding, count in counts.items()}


def _findings(frame: pd.DataFrame, schema: Schema, seed: np.random.SeedSequence, alpha: float) -> tuple[Finding, ...]:
    rng = np.random.default_rng(seed)
    rows = rng.choice(len(frame), size=round(SHARE * len(frame)), replace=False)
    resample = frame.iloc[np.sort(rows)].reset_index(drop=True)
    try:
        graph = learn_structure(resample, schema, alpha=alpha, rng=rng).graph
    except LearningError:  # a rare outcome may be in no run of the resample
        return ()
    options = {option.name for option in schema.options}
    reached = (
        Reaches(option, objective.name)
        for objective in schema.objectives
        for option in sorted(options & set(graph.ancestors(objective.name)))
    )
    return (*sorted(graph.directed), *(frozenset(edge) for edge in sorted(graph.bidirected)), *reached)
