"""Operators chose the options by what they met: who is fooled?

    python -m benchmarks.observational [--robots 4] [--runs 800]

Simulated robots (`tests/robots.py`) whose table was not randomised: three options follow the wind, which also moves a
metric that the objectives hang on. Once the wind is a context in the table, once no column holds it. Asked of 12 failed
runs a robot: does the reset of the first-ranked option really help (the probability of meeting everything rises by half
of what the best single reset gives, at least 0.1), and how far is the predicted probability of every single reset from
the true one (1000 simulated missions each, the option set by intervention)? A reset is named only where its predicted
probability reaches those below which `care` abstains; "wrong" ones would have cost a field day, "fooled" are those of
them that the wind chose. Where an option whose effect is not identified is as likely a cause, `care` names none and
asks for a run with it changed: "asks well" counts those that really help.

What is true here is whatever a mission meets, so `care` and the plain classifier answer without the outcome of the run.
Told of it (the classifier by the engine's own abduction), both promise the next mission under the run's conditions,
which is less; the option that the classifier names first stays the same.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from joblib import Parallel, delayed

from benchmarks.diagnosis import abducted
from benchmarks.peers import PlainClassifier
from care_core.causal.counterfactual import CounterfactualQuery
from care_core.causal.model import Model
from care_core.diagnose.advice import MIN_PROBABILITY
from care_core.diagnose.ranking import deviating, suspects
from care_core.diagnose.reference import profile_config
from care_core.learn.outcomes import met
from care_core.learn.train import TrainSettings, train
from care_core.numbers import Floats
from care_core.profile.schema import Schema
from care_core.records import Struct, field
from tests.robots import Chosen, Robot, declared_random, random_robot

FAULTS = 12
TRUTH = 1000
WORTH = 0.1
CARE, PLAIN = "care", "plain classifier"
TOLD = {CARE: "care, told of the run", PLAIN: "plain classifier, told of it"}
METHODS = (CARE, TOLD[CARE], "care, declared as randomised", PLAIN, TOLD[PLAIN])


class Score(Struct, eq=False):
    """`fooled`: options named first that were chosen by the wind and do not help."""

    asked: int = 0
    right: int = 0
    wrong: int = 0
    fooled: int = 0
    asked_well: int = 0
    misses: list[float] = field(default_factory=list)
    swayed_misses: list[float] = field(default_factory=list)
    """Errors of the probabilities, over the options that followed the wind."""


class Answer(NamedTuple):
    """Options, the likeliest cause first, the probability after resetting each, and what a run would have to tell."""

    ranking: list[str]
    probabilities: dict[str, float]
    told: dict[str, float]
    """The probabilities given that the run failed, and with `care` what it measured."""
    asks: str | None = None


class _Care:
    def __init__(self, frame: pd.DataFrame, schema: Schema, seed: int) -> None:
        self.schema = schema
        self.model: Model = train(frame, schema, TrainSettings(seed=seed, resamples=0, folds=0, n_jobs=1))
        self.bounds = {o.name: o.threshold for o in schema.objectives if o.threshold is not None}
        self.refused = {option for (option, objective), effect in self.model.effects.items() if not effect.identified}

    def answer(self, row: Mapping[str, float], reference: Mapping[str, float]) -> Answer:
        config = {**reference, **{v.name: row[v.name] for v in (*self.schema.options, *self.schema.contexts)}}
        here = {**reference, **{c.name: row[c.name] for c in self.schema.contexts}}
        seen = {
            v.name: row[v.name] for v in (*self.schema.metrics, *self.schema.objectives) if np.isfinite(row[v.name])
        }
        query = CounterfactualQuery(
            self.model, config, seen, self.bounds, reference=here, variables=self.schema.variables
        )
        best: dict[str, float] = {}
        unknown: dict[str, float] = {}
        for objective in self.bounds:
            for suspect in suspects(query, objective, self.schema.known):
                if suspect.contribution > 0:
                    kind = best if suspect.is_identified else unknown
                    kind[suspect.option] = max(kind.get(suspect.option, 0.0), suspect.contribution)
        fresh = CounterfactualQuery(self.model, config, {}, self.bounds)
        asked = [name for name in deviating(config, here) if name not in self.refused]
        resets = [{**config, name: here[name]} for name in asked]
        promised, told = (_by_option(asked, each.probability(resets)) if asked else {} for each in (fresh, query))
        asks = max(unknown, key=unknown.__getitem__, default=None)
        asks = asks if asks is not None and unknown[asks] > max(best.values(), default=0.0) else None
        ranking = [] if asks else sorted(best, key=lambda name: -best[name])
        return Answer(ranking, promised, told, asks)


def compare(chosen: Chosen, seed: int, n: int) -> dict[str, Score]:
    robot = random_robot(np.random.default_rng(seed), chosen=chosen, inert=4)
    schema = robot.schema
    frame = robot.drive(n, np.random.default_rng(1000 + seed))
    kept = np.all([np.nan_to_num(met(o, frame, schema)) == 1.0 for o in schema.objectives], axis=0)
    options = [o.name for o in schema.options]
    engines = {CARE: _Care(frame, schema, seed), METHODS[2]: _Care(frame, declared_random(schema), seed)}
    plain = PlainClassifier(frame, kept, options, seed)
    reference = profile_config(schema, engines[CARE].model)
    scores = {name: Score() for name in METHODS}
    fresh = robot.drive(n, np.random.default_rng(2000 + seed))
    failed = ~np.all([np.nan_to_num(met(o, fresh, schema)) == 1.0 for o in schema.objectives], axis=0)
    for _, row in fresh[failed].head(FAULTS).iterrows():
        run = {str(k): float(v) for k, v in row.items()}
        config = {name: run[name] for name in options}
        off = deviating(config, {name: reference[name] for name in options})
        truth = {name: _true_probability(robot, {**config, name: reference[name]}, run) for name in off}
        worth = max(truth.values()) - _true_probability(robot, config, run)
        helps = {name for name in off if truth[name] - _true_probability(robot, config, run) >= max(WORTH, worth / 2)}
        answers = {name: engine.answer(run, reference) for name, engine in engines.items()}
        answers[PLAIN] = _plain_answer(plain, config, reference, off)
        answers |= {told: answers[name]._replace(probabilities=answers[name].told) for name, told in TOLD.items()}
        for name, (ranking, promised, _, asks) in answers.items():
            score = scores[name]
            score.misses += [abs(promised[option] - truth[option]) for option in promised]
            score.swayed_misses += [abs(promised[o] - truth[o]) for o in promised if o in robot.swayed]
            if helps:
                named = ranking[0] if ranking and promised[ranking[0]] >= MIN_PROBABILITY else None
                score.asked += 1
                score.right += named in helps
                score.wrong += named is not None and named not in helps
                score.asked_well += asks in helps
                score.fooled += named is not None and named not in helps and named in robot.swayed
    return scores


def _plain_answer(
    plain: PlainClassifier, config: Mapping[str, float], reference: Mapping[str, float], off: Sequence[str]
) -> Answer:
    resets = [{**config, name: reference[name]} for name in off]
    promised, told = plain.probability(resets), abducted(plain, config, resets, 1)
    return Answer(plain.rank(config, reference, off), _by_option(off, promised), _by_option(off, told))


def _by_option(options: Sequence[str], probabilities: Floats) -> dict[str, float]:
    return dict(zip(options, probabilities.tolist(), strict=True))


def _true_probability(robot: Robot, config: Mapping[str, float], run: Mapping[str, float]) -> float:
    """Share of missions that meet everything, options set, in this run's wind where the table holds it."""
    frame = robot.drive(TRUTH, np.random.default_rng(7), config, run.get("wind"))
    return float(
        np.all([np.nan_to_num(met(o, frame, robot.schema)) == 1.0 for o in robot.schema.objectives], axis=0).mean()
    )


def show(title: str, parts: list[dict[str, Score]]) -> None:
    print(f"\n{title}")
    print(f"  {'method':30s} {'faults':>6s} {'right':>6s} {'wrong':>6s} {'fooled':>7s} {'no answer':>10s} "
          f"{'asks well':>10s} {'p error':>11s} {'swayed':>7s}")  # fmt: skip
    for name in METHODS:
        mine = [part[name] for part in parts]
        asked, right, wrong, fooled, well = (
            sum(getattr(s, key) for s in mine) for key in ("asked", "right", "wrong", "fooled", "asked_well")
        )
        misses = [m for s in mine for m in s.misses]
        swayed = [m for s in mine for m in s.swayed_misses]
        far = f"{np.mean(swayed):.3f}" if swayed else "none"
        print(f"  {name:30s} {asked:>6d} {right:>6d} {wrong:>6d} {fooled:>7d} {asked - right - wrong:>10d} "
              f"{well:>10d} {np.mean(misses):>11.3f} {far:>7s}")  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", type=int, default=4)
    parser.add_argument("--runs", type=int, default=800)
    parser.add_argument("--jobs", type=int, default=2)
    args = parser.parse_args()
    cases: dict[str, Chosen] = {
        "chosen by the wind, which the table holds": "by context",
        "chosen by the wind, which no column holds": "by something hidden",
    }
    for title, chosen in cases.items():
        tasks = (delayed(compare)(chosen, seed, args.runs) for seed in range(args.robots))
        show(f"{title} ({args.robots} robots x {args.runs} runs)", Parallel(n_jobs=args.jobs)(tasks))


if __name__ == "__main__":
    from benchmarks import observational as here  # the other processes import by its name what they are given

    here.main()
