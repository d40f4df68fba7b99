"""What does a campaign have to drive so that the odds of the reference are told right?

    python -m benchmarks.reference_odds [--robots 8] [--runs 300]

A simulated robot whose reference is tuned: of its 24 options each of 14 that act does harm both ways, some much, most
little. Campaigns of the same size leave the reference in about as many options in every run (`alike`), or in few in
some runs and in many in others, as `care collect` plans them. Asked are the reference itself and 1000 configurations
as they are met, with 15% of the options off: the mean odds told and the true share, Brier score and log loss; of the
mission time how far missions are from what was predicted (the mean of the logarithm is the bias), and how many lie in
the 80% interval.
"""

from __future__ import annotations

import argparse

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from threadpoolctl import threadpool_limits

from care_core.causal.counterfactual import CounterfactualQuery
from care_core.causal.model import Model, Training
from care_core.collect.sampling import points
from care_core.collect.space import Axis, Space
from care_core.learn.fitting import OUTCOME
from care_core.learn.outcomes import fit_outcomes
from care_core.learn.structure import learn_structure
from care_core.numbers import Floats
from care_core.profile.schema import Schema
from care_core.variables import Role, Threshold, Variable

OPTIONS = tuple(Variable(f"o{i}", Role.OPTION, range=(0.0, 1.0), default=0.3) for i in range(24))
ACTING = 14
REFERENCE = 0.3
AT_REFERENCE = 0.65
OFF = 0.15
LIMIT_S = 125.0
ASKED = 1000
WAYS = ("alike", "as planned")
COLUMNS = ("reference", "true", "field", "true", "Brier", "log loss", "time: bias", "rms", "in 80%")

SCHEMA = Schema(
    name="tuned", version="1", platform="Tuned robot", doc="", match={}, logs=(), mission={}, evidence=(),
    observational=False, known=frozenset(), digest="d" * 64,
    variables={
        v.name: v
        for v in (
            *OPTIONS,
            Variable("stuck", Role.METRIC, "bool"),
            Variable("load", Role.METRIC),
            Variable("success", Role.OBJECTIVE, "bool", kind="functional", threshold=Threshold("==", 1)),
            Variable("time", Role.OBJECTIVE, unit="s", kind="non-functional", threshold=Threshold("<=", LIMIT_S)),
        )
    },
)  # fmt: skip


def drive(options: Floats, slower: Floats, riskier: Floats, rng: np.random.Generator) -> pd.DataFrame:
    """What missions record. options: (n, 24). slower, riskier: what each option off its reference does, (24,)."""
    off = (options - REFERENCE) / (1.0 - REFERENCE)
    harm = np.where(off > 0, off, -off / REFERENCE * (1.0 - REFERENCE))[:, :ACTING]
    load = harm @ slower[:ACTING] + 0.3 * rng.normal(size=len(options))
    stuck = harm @ riskier[:ACTING] + 0.8 * rng.normal(size=len(options)) > 1.3
    took = 100 * np.exp(0.12 * load + 0.05 * rng.normal(size=len(options)))
    frame = pd.DataFrame(options, columns=[option.name for option in OPTIONS])
    frame = frame.assign(load=load, stuck=stuck.astype(float), success=1.0 - stuck, time=np.where(stuck, np.nan, took))
    recorded: pd.DataFrame = frame[list(SCHEMA.variables)]
    return recorded


def met(frame: pd.DataFrame) -> Floats:
    """1 where a mission met everything, shape (n,)."""
    return ((frame["success"] == 1) & (frame["time"] <= LIMIT_S)).to_numpy(dtype=float)


def one(seed: int, runs: int, way: str) -> Floats:
    """One robot: a campaign, its mechanisms, what they say. The values of COLUMNS."""
    rng = np.random.default_rng(seed)
    slower, riskier = rng.exponential(0.35, len(OPTIONS)), rng.exponential(0.28, len(OPTIONS))
    space = Space([Axis(option, 0.0, 1.0) for option in OPTIONS], {o.name: REFERENCE for o in OPTIONS}, [])
    planned = points(space, "sobol", runs - 1, AT_REFERENCE, seed, alike=way == "alike")
    configs = np.array([[config[o.name] for o in OPTIONS] for config in (space.reference, *planned)])
    with threadpool_limits(1):
        frame = drive(configs, slower, riskier, rng)
        graph = learn_structure(frame, SCHEMA, rng=rng).graph
        outcomes, mechanisms = fit_outcomes(frame, SCHEMA, graph, rng, effort=OUTCOME)
    model = Model(
        schema_digest="", graph=graph, edges={}, bidirected=(), effects={}, paths={}, outcomes=outcomes, summaries={},
        skill={}, training=Training(origin="", runs=runs, seed=0, alpha=0.01, resamples=0), mechanisms=mechanisms,
    )  # fmt: skip
    bounds = {v.name: v.threshold for v in SCHEMA.objectives if v.threshold is not None}
    at_reference = np.full((ASKED, len(OPTIONS)), REFERENCE)
    field = np.where(rng.random(at_reference.shape) < OFF, rng.random(at_reference.shape), REFERENCE)
    asked = [dict(zip(SCHEMA.variables, row, strict=False)) for row in (at_reference[0], *field)]
    query = CounterfactualQuery(model, asked[0], {}, bounds)
    told = query.probability(asked)
    flown = drive(field, slower, riskier, rng)
    true, took = met(flown), flown["time"].to_numpy(dtype=float)
    predicted, ended = query.predict("time", asked[1:]), np.isfinite(took)
    error = np.log(took / predicted.value)[ended]
    return np.array([
        told[0], met(drive(at_reference, slower, riskier, rng)).mean(), told[1:].mean(), true.mean(),
        ((told[1:] - true) ** 2).mean(), -np.log(np.where(true == 1, told[1:], 1 - told[1:])).mean(),
        error.mean(), np.sqrt((error**2).mean()),
        ((predicted.low <= took) & (took <= predicted.high))[ended].mean(),
    ])  # fmt: skip


def main() -> None:
    """Print the table: the mean over the robots, and the farthest odds of a reference."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--robots", type=int, default=8)
    parser.add_argument("--runs", type=int, default=300)
    parser.add_argument("--jobs", type=int, default=2)
    asked = parser.parse_args()
    tasks = [(seed, asked.runs, way) for way in WAYS for seed in range(asked.robots)]
    answers = np.array(Parallel(n_jobs=asked.jobs)(delayed(one)(*task) for task in tasks))
    print(f"{asked.robots} robots, {asked.runs} runs each\n{'':12s}" + "".join(f"{name:>12s}" for name in COLUMNS))
    for way, found in zip(WAYS, answers.reshape(len(WAYS), asked.robots, -1), strict=True):
        print(f"{way:12s}" + "".join(f"{value:12.3f}" for value in found.mean(axis=0)))
        off = np.abs(found[:, 0] - found[:, 1])
        print(f"{'':12s}odds of the reference off by {off.mean():.3f} in the mean, {off.max():.3f} at most")


if __name__ == "__main__":
    main()
