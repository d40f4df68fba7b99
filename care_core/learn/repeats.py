"""How much of a run's noise does the next one meet again? From training runs that repeat a configuration.

Pairs of runs with equal options, told apart by whether they met the same conditions (`rows.CONDITIONS`; where the
table does not say, every run is another day). Of each pair the errors left by all other runs are jointly Gaussian;
their covariance is what is not known of the mechanism plus a share of the noise (`abduction`). The share is the mean
under its likelihood and a uniform prior, so few pairs leave it near the middle.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
import pandas as pd

from care_core.causal.mechanisms import JITTER, LEAST, Mechanism, transformed
from care_core.causal.model import UNKNOWN_CARRY_OVER, NoiseCarryOver, OutcomeRecord, ReferenceRuns
from care_core.learn.outcomes import find_stages
from care_core.learn.relative import configurations_of, is_reference
from care_core.learn.skill import all_met
from care_core.numbers import Bools, Floats
from care_core.profile.schema import Schema
from care_core.tables.rows import CONDITIONS

SHARES = np.linspace(0.025, 0.975, 20)
MOST_RUNS = 800
"""Runs behind the errors of a pair; a kernel over n runs costs n^3 time."""

Pairs = Sequence[tuple[int, int]]


def reference_runs(frame: pd.DataFrame, schema: Schema) -> ReferenceRuns:
    """How many runs were made with every option at its reference, and how many of them missed an objective: what is
    counted of missions that fail by chance."""
    at = is_reference(frame, schema)
    return ReferenceRuns(runs=int(at.sum()), failed=int((all_met(frame, schema)[at] == 0.0).sum()))


def carry_over(
    frame: pd.DataFrame, schema: Schema, outcomes: Mapping[str, OutcomeRecord], mechanisms: Mapping[str, Mechanism]
) -> dict[str, NoiseCarryOver]:
    """Per objective and metric on the way to one, where the table repeats configurations; empty where it does not."""
    same, another = repeated(frame, schema)
    if not same and not another:
        return {}
    found = {}
    asked = {name: [s.mechanism for s in outcome.stages] or [outcome.mechanism] for name, outcome in outcomes.items()}
    asked |= {name: [name] for outcome in outcomes.values() if outcome.mediation for name in outcome.mediation.metrics}
    for name, keys in asked.items():
        targets = [_targets(key, name, frame, schema) for key in keys]
        both = [
            _share(part, [(mechanisms[key], y) for key, y in zip(keys, targets, strict=True)], frame, unknown)
            for part, unknown in ((same, UNKNOWN_CARRY_OVER.same), (another, UNKNOWN_CARRY_OVER.another))
        ]
        (of_same, n_same), (of_another, n_another) = both
        # What another day has in common with this one, the same conditions have too.
        found[name] = NoiseCarryOver(same=max(of_same, of_another), another=of_another, pairs=(n_same, n_another))
    return found


def repeated(frame: pd.DataFrame, schema: Schema) -> tuple[Pairs, Pairs]:
    """Rows of one configuration, each with the next one: under the same conditions, and on another day."""
    met = frame[CONDITIONS].to_numpy() if CONDITIONS in frame else np.full(len(frame), np.nan)
    pairs: tuple[list[tuple[int, int]], list[tuple[int, int]]] = ([], [])
    for rows in frame.groupby(configurations_of(frame, schema)).indices.values():
        for a, b in pairwise(rows):
            is_same = not pd.isna(met[a]) and met[a] == met[b]
            pairs[0 if is_same else 1].append((int(a), int(b)))
    return pairs


def _targets(key: str, objective: str, frame: pd.DataFrame, schema: Schema) -> Floats:
    """What a mechanism was fitted on, NaN where a run says nothing of it; shape (n,)."""
    if not key.startswith("stage:"):
        return frame[key].to_numpy(dtype=float)
    name = key.removeprefix("stage:")
    stage = next((s for s in find_stages(schema.variables[objective], schema, frame) if s.variable == name), None)
    if stage is None:
        return np.full(len(frame), np.nan)
    one = stage.passed if stage.passes == 1.0 else ~stage.passed
    return np.where(stage.reached, 2.0 * one - 1.0, np.nan)


def _share(
    pairs: Pairs, fitted: Sequence[tuple[Mechanism, Floats]], frame: pd.DataFrame, unknown: float
) -> tuple[float, int]:
    """The share and the number of pairs behind it; `unknown` without any."""
    likelihood, count = np.zeros(len(SHARES)), 0
    for mechanism, y in fitted:
        values = y if mechanism.binary else np.where(y > LEAST[mechanism.transform], y, np.nan)
        known = np.isfinite(values) & frame[list(mechanism.inputs)].notna().all(axis=1).to_numpy()
        usable = [pair for pair in pairs if known[list(pair)].all()]
        if usable and mechanism.kernel.variance > 0:
            likelihood += _log_likelihood(mechanism, values, known, usable, frame)
            count += len(usable)
    if not count:
        return unknown, 0
    weight = np.exp(likelihood - likelihood.max())
    return float((SHARES * weight).sum() / weight.sum()), count


def _log_likelihood(mechanism: Mechanism, values: Floats, known: Bools, pairs: Pairs, frame: pd.DataFrame) -> Floats:
    """Of every share, shape (len(SHARES),)."""
    paired = {row for pair in pairs for row in pair}
    rest = [int(row) for row in np.flatnonzero(known) if row not in paired]
    rows = [*sorted(paired), *rest[:: max(1, -(-len(rest) // MOST_RUNS))]]
    place = {row: i for i, row in enumerate(rows)}
    x = frame.iloc[rows][list(mechanism.inputs)].to_numpy(dtype=float)
    points = mechanism.scaled(x)
    y = (transformed(values[rows], mechanism.transform) - mechanism.known(x) - mechanism.mean) / mechanism.scale
    noise = mechanism.kernel.noise**2 + JITTER
    inverse = np.linalg.inv(mechanism.kernel.among(points) + np.eye(len(rows)) * noise)
    weighted = inverse @ y
    total = np.zeros(len(SHARES))
    for pair in pairs:
        at = [place[row] for row in pair]
        covariance = np.linalg.inv(inverse[np.ix_(at, at)])  # of the pair, given all other runs
        errors = covariance @ weighted[at]
        for i, share in enumerate(SHARES):
            joint = covariance + share * noise * np.array([[0.0, 1.0], [1.0, 0.0]])
            total[i] -= 0.5 * (np.linalg.slogdet(joint)[1] + errors @ np.linalg.solve(joint, errors))
    return total
