"""Does the diagnosis keep its promises where the truth is planted? One table, fixed for good.

    python -m benchmarks.planted [--robots 2] [--seed 0] [--runs 400] [--faults 20]

A small simulated robot in eight worlds, each with one thing that breaks naive diagnosis. A profile is trained on each
(resamples included, so that confidence means what it means in the field), failed runs are diagnosed by the engine, and
every answer is compared with what interventions in the simulator do. Noise has a part that the next run under the same
conditions meets again (correlation `PERSISTS`), and a tenth of the training runs were repeated, half under the same
conditions and half on another day.

Per world: failed runs; those in which some single reset truly helps; how often the first cause is one of these, and the
same for the plain classifier; answers at high confidence, and how many of them are wrong; promised probability of the
suggested fixes against the truth (share of 400 simulated next missions under the same conditions that meet everything);
Brier score of the promise, and of the probabilities of every reset (each option alone, and all of them), of the plain
classifier's of the same, and of those with the engine's abduction of the failed run; the odds of the reference as told
and as they are, whatever a run met; how often the engine abstains, and how often there was indeed nothing to name.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from threadpoolctl import threadpool_limits

from benchmarks.diagnosis import abducted
from benchmarks.peers import PlainClassifier
from care_core.causal.model import Model
from care_core.diagnose.judging import judge, query_of
from care_core.diagnose.ranking import deviating
from care_core.diagnose.records import Cause, Diagnosis
from care_core.diagnose.triage import diagnose
from care_core.learn.train import TrainSettings, train
from care_core.numbers import Floats
from care_core.profile.model import write_model
from care_core.profile.schema import Schema
from care_core.profile.store import Profile
from care_core.records import Record, Struct, field, replace
from care_core.run import LogInfo, MissionInfo, ProfileChoice, Run, Unavailable, Value
from care_core.variables import Role, Threshold, Variable

OPTIONS = tuple(f"o{i}" for i in range(8))
METRICS = ("lag", "load", "stuck")
REFERENCE = 0.5
PERSISTS = 0.6
"""Correlation of the noise of two runs under the same conditions."""
KEPT = 0.5
"""Share of the options that stay at their reference."""
NEXT = 400
WORTH = 0.1
"""Probability that a reset must add to count as help, or half of what the best one adds."""
RESAMPLES = 12
SOURCES = ("lag", "load", "stuck", "time", "wind")


class Planted(Record):
    """One world. The control has none of these."""

    name: str
    nonlinear: bool = False
    """An optimum inside a range, and a step."""
    interaction: bool = False
    """Two options that matter only together."""
    hidden_cause: float = 0.0
    """How strongly something that no column holds moves two metrics."""
    no_mediator: bool = False
    """The metric that carries the effect is not recorded."""
    span: tuple[float, float] = (0.0, 1.0)
    """What training drew options from; failed runs draw from the whole range."""
    swayed: tuple[str, ...] = ()
    """Options without effect that operators chose by the hidden wind; the table is declared observational."""
    gains: tuple[float, ...] = (1.0,) * 5
    """How strongly each option that acts does, as a multiple of this robot's."""
    known: frozenset[tuple[str, str]] = frozenset()
    """What the profile declares to act on what."""

    @property
    def schema(self) -> Schema:
        options = [Variable(name, Role.OPTION, range=(0.0, 1.0), default=REFERENCE) for name in OPTIONS]
        metrics = [
            Variable("load", Role.METRIC),
            Variable("stuck", Role.METRIC, "bool"),
            *([] if self.no_mediator else [Variable("lag", Role.METRIC)]),
        ]
        objectives = [
            Variable("success", Role.OBJECTIVE, "bool", kind="functional", threshold=Threshold("==", 1)),
            Variable("time", Role.OBJECTIVE, unit="s", kind="non-functional", threshold=Threshold("<=", 135)),
        ]
        return Schema(
            name="planted", version="1", platform="Planted robot", doc="", match={}, logs=(), mission={}, evidence=(),
            observational=bool(self.swayed), variables={v.name: v for v in (*options, *metrics, *objectives)},
            known=self.known, digest="d" * 64,
        )  # fmt: skip

    def drive(self, options: Floats, noise: Floats) -> pd.DataFrame:
        """What missions record. options: (n, 8), noise: (n, 5), standard normal."""
        s = 3 * (options - REFERENCE)
        s[:, : len(self.gains)] *= self.gains
        lag, load, stuck, time, wind = noise.T
        first: Floats = 1.4 * (s[:, 0] ** 2) if self.nonlinear else 1.1 * s[:, 0]
        if self.interaction:
            first = np.where((s[:, 0] > 0.2) & (s[:, 1] > 0.2), 2.2, 0.0)
        second = 1.5 * (s[:, 2] > 0.4) if self.nonlinear else 0.9 * s[:, 2]
        push = 1.4 * wind if self.swayed else self.hidden_cause * np.sign(wind)
        lag = first + (0.0 if self.interaction else 0.6 * s[:, 1]) + 0.5 * lag + push
        load = second + 0.5 * load + (0.0 if self.swayed else self.hidden_cause * np.sign(wind))
        is_stuck = 1.3 * s[:, 3] + 0.7 * load + 0.6 * stuck > 2.0
        took = 100 * np.exp(0.13 * lag + 0.08 * load + 0.04 * s[:, 4] + 0.04 * time)
        frame = pd.DataFrame(options, columns=list(OPTIONS)).assign(lag=lag, load=load, stuck=is_stuck.astype(float))
        frame["success"] = 1.0 - is_stuck
        frame["time"] = np.where(is_stuck, np.nan, took)
        recorded: pd.DataFrame = frame[list(self.schema.variables)]
        return recorded

    def draw(self, n: int, rng: np.random.Generator, span: tuple[float, float]) -> tuple[Floats, Floats]:
        """Options and noise of n missions."""
        options = np.where(rng.random((n, 8)) < KEPT, REFERENCE, rng.uniform(*span, (n, 8)))
        noise = rng.normal(size=(n, len(SOURCES)))
        for name in self.swayed:
            chosen = REFERENCE + 0.2 * noise[:, SOURCES.index("wind")] + 0.08 * rng.normal(size=n)
            options[:, OPTIONS.index(name)] = np.clip(chosen, 0.0, 1.0)
        return options, noise


WORLDS = (
    Planted("control"),
    Planted("nonlinear", nonlinear=True),
    Planted("interaction", interaction=True),
    Planted("hidden cause", hidden_cause=0.9),
    Planted("missing mediator", no_mediator=True),
    Planted("outside support", span=(0.25, 0.75)),
    Planted("one confounded option", swayed=("o5",)),
    Planted("two confounded options", swayed=("o5", "o6")),
)


def again(noise: Floats, n: int, rng: np.random.Generator) -> Floats:
    """What n next missions under the conditions of one meet. noise: (5,) -> (n, 5)."""
    fresh = rng.normal(size=(n, len(noise)))
    met: Floats = PERSISTS * noise + np.sqrt(1 - PERSISTS**2) * fresh
    return met


def training_table(world: Planted, runs: int, rng: np.random.Generator) -> pd.DataFrame:
    """Runs on days of their own, but for a tenth that repeat an earlier configuration: on its day, or on another."""
    options, noise = world.draw(runs, rng, world.span)
    day = np.arange(runs)
    for i in range(runs - runs // 10, runs):
        first = i - runs // 2
        options[i] = options[first]
        if i % 2:
            noise[i], day[i] = again(noise[first], 1, rng)[0], day[first]
    table: pd.DataFrame = world.drive(options, noise).assign(conditions=day)
    return table


class Score(Struct, eq=False):
    faults: int = 0
    helped: int = 0
    right: int = 0
    plain_right: int = 0
    high: int = 0
    high_wrong: int = 0
    abstained: int = 0
    abstained_rightly: int = 0
    promised: list[float] = field(default_factory=list)
    kept: list[float] = field(default_factory=list)
    asked: list[float] = field(default_factory=list)
    """Probabilities of every reset of every failed run, and in `true` what they are."""
    plain_asked: list[float] = field(default_factory=list)
    """The same by the plain classifier, and in `plain_abducted` with the engine's abduction of the run."""
    plain_abducted: list[float] = field(default_factory=list)
    true: list[float] = field(default_factory=list)
    odds: list[float] = field(default_factory=list)
    """Of the reference, whatever a run met: what each diagnosis goes by, and in `true_odds` what they are."""
    true_odds: list[float] = field(default_factory=list)

    def add(self, other: Score) -> None:
        for name in self.__struct_fields__:
            setattr(self, name, getattr(self, name) + getattr(other, name))


Learn = Callable[[pd.DataFrame, Schema, TrainSettings], Model]


def measure(world: Planted, seed: int, runs: int, faults: int, learn: Learn = train) -> Score:
    """One robot: train, fail, diagnose, intervene."""
    with threadpool_limits(1), tempfile.TemporaryDirectory() as folder:
        rng = np.random.default_rng([seed, [each.name for each in WORLDS].index(world.name)])
        frame = training_table(world, runs, rng)
        schema = world.schema
        write_model(
            learn(frame, schema, TrainSettings(seed=seed, resamples=RESAMPLES, folds=0, n_jobs=1)), Path(folder)
        )
        profile = Profile(Path(folder), schema)
        met = (frame["success"] == 1) & (frame["time"] <= 135)
        plain = PlainClassifier(frame, met.to_numpy(), OPTIONS, seed)
        options, noise = world.draw(60 * faults, rng, (0.0, 1.0))
        flown = world.drive(options, noise)
        failed = np.flatnonzero(~((flown["success"] == 1) & (flown["time"] <= 135)))
        score = Score()
        for i in failed[_leaves_support(world, options[failed])][:faults]:
            _judge(score, world, profile, plain, flown.iloc[i].to_dict(), noise[i])
        return score


def _leaves_support(world: Planted, options: Floats) -> Floats:
    """Failed runs to ask about: where training was narrower, those that an option took outside."""
    low, high = world.span
    outside = ((options[:, :4] < low) | (options[:, :4] > high)).any(axis=1)
    return np.asarray(outside | (world.span == (0.0, 1.0)))


def _judge(
    score: Score, world: Planted, profile: Profile, plain: PlainClassifier, row: Mapping[str, float], noise: Floats
) -> None:
    config = {name: row[name] for name in OPTIONS}
    choice = ProfileChoice("planted", "1", "Planted robot", "")
    judged = judge(_run_of(world.schema, row), world.schema, profile.model)
    diagnosis = diagnose(judged, profile, choice, top=10)
    off = deviating(config, dict.fromkeys(OPTIONS, REFERENCE))
    now = true_probability(world, config, noise)
    resets = [{**config, name: REFERENCE} for name in off]
    true = [true_probability(world, reset, noise) for reset in resets]
    gain = {name: kept - now for name, kept in zip(off, true, strict=True)}
    everything = dict.fromkeys(OPTIONS, REFERENCE)
    engine = query_of(judged, profile)
    score.asked.extend(engine.probability([*resets, everything]))
    score.plain_asked.extend(plain.probability([*resets, everything]))
    score.plain_abducted.extend(abducted(plain, config, [*resets, everything], 1))
    score.odds.extend(replace(engine, observed={}).probability([everything]))
    score.true_odds.append(true_odds(world, everything))
    score.true.extend([*true, true_probability(world, everything, noise)])
    enough = max(WORTH, max(gain.values(), default=0.0) / 2)
    helps = {name for name in off if gain[name] >= enough}
    first = first_cause(diagnosis)
    score.faults += 1
    score.helped += bool(helps)
    score.right += first is not None and first.option.name in helps
    score.plain_right += bool(off) and plain.rank(config, dict.fromkeys(OPTIONS, REFERENCE), off)[0] in helps
    if first is not None and first.confidence == "high":
        score.high += 1
        score.high_wrong += first.option.name not in helps
    if diagnosis.fix is None:
        score.abstained += 1
        score.abstained_rightly += not helps
    else:
        changed = {change.option.name: change.suggested for change in diagnosis.fix.changes}
        score.promised.append(diagnosis.fix.p_fixed)
        score.kept.append(true_probability(world, {**config, **changed}, noise))


def true_probability(world: Planted, config: Mapping[str, float], noise: Floats) -> float:
    """Share of next missions under the same conditions that meet everything, the options set by intervention."""
    options = np.tile([config[name] for name in OPTIONS], (NEXT, 1))
    flown = world.drive(options, again(noise, NEXT, np.random.default_rng(7)))
    return float(((flown["success"] == 1) & (flown["time"] <= 135)).mean())


def true_odds(world: Planted, config: Mapping[str, float]) -> float:
    """Share of missions that meet everything, whatever they meet."""
    options = np.tile([config[name] for name in OPTIONS], (10 * NEXT, 1))
    flown = world.drive(options, np.random.default_rng(8).normal(size=(10 * NEXT, len(SOURCES))))
    return float(((flown["success"] == 1) & (flown["time"] <= 135)).mean())


def first_cause(diagnosis: Diagnosis) -> Cause | None:
    """The cause that the report names first, of all its faults; None where it names none."""
    causes = [cause for fault in diagnosis.faults for cause in fault.causes if not cause.is_lead]
    return min(causes, key=lambda cause: (cause.rank, -cause.contribution), default=None)


def _run_of(schema: Schema, row: Mapping[str, float]) -> Run:
    gone = Unavailable("the mission ended before")
    known: dict[str, Value] = {name: gone if np.isnan(value) else value for name, value in row.items()}
    return Run(
        config={name: row[name] for name in OPTIONS},
        context={},
        metrics={v.name: known[v.name] for v in schema.metrics},
        objectives={v.name: known[v.name] for v in schema.objectives},
        settings={},
        log=LogInfo("planted.bin", "dataflash-bin", None, 100.0, "0" * 64),
        mission=MissionInfo(1, 1, 0.0, 100.0, ended=True, fits=True),
    )


def show(scores: Mapping[str, Score]) -> None:
    print(f"{'world':24s}{'failed':>7s}{'helped':>7s}{'rank 1':>7s}{'plain':>7s}{'high':>6s}{'wrong':>6s}"
          f"{'promise':>9s}{'truth':>7s}{'Brier':>7s}{'resets':>7s}{'plain':>7s}{'abd.':>7s}"
          f"{'ref.':>6s}{'truth':>7s}{'abstains':>9s}{'rightly':>8s}")  # fmt: skip
    for name, s in scores.items():
        promised, kept = np.array(s.promised), np.array(s.kept)
        means = (float(np.mean(v)) if len(v) else float("nan") for v in (promised, kept))
        resets = [brier(np.array(p), np.array(s.true)) for p in (s.asked, s.plain_asked, s.plain_abducted)]
        print(f"{name:24s}{s.faults:7d}{s.helped:7d}{s.right:7d}{s.plain_right:7d}{s.high:6d}{s.high_wrong:6d}"
              "{:9.2f}{:7.2f}".format(*means) + f"{brier(promised, kept):7.3f}"
              "{:7.3f}{:7.3f}{:7.3f}".format(*resets) + f"{np.mean(s.odds):6.2f}{np.mean(s.true_odds):7.2f}"
              f"{s.abstained:9d}{s.abstained_rightly:8d}")  # fmt: skip


def brier(promised: Floats, kept: Floats) -> float:
    """The expected Brier score of promises against missions that succeed with the probabilities `kept`."""
    return float(((promised - kept) ** 2 + kept * (1 - kept)).mean()) if len(kept) else float("nan")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", type=int, default=2)
    parser.add_argument("--seed", type=int, default=0, help="of the first robot; the others follow")
    parser.add_argument("--runs", type=int, default=400)
    parser.add_argument("--faults", type=int, default=20, help="failed runs asked of each robot")
    parser.add_argument("--jobs", type=int, default=2)
    args = parser.parse_args()
    tasks = [(world, seed) for world in WORLDS for seed in range(args.seed, args.seed + args.robots)]
    answers = Parallel(n_jobs=args.jobs)(delayed(measure)(w, seed, args.runs, args.faults) for w, seed in tasks)
    scores: dict[str, Score] = {}
    for (world, _), answer in zip(tasks, answers, strict=True):
        scores.setdefault(world.name, Score()).add(answer)
    everything = Score()
    for score in scores.values():
        everything.add(score)
    show({**scores, "all": everything})


if __name__ == "__main__":
    from benchmarks import planted as here  # the other processes import by its name what they are given

    here.main()
