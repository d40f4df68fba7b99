"""Runs table + schema -> the learned half of a profile (paper, Alg. 1; effects by Eq. 1, paths by Eq. 2)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from care_core.causal.effects import Effect, acceptable_values, along, average_causal_effect
from care_core.causal.graph import CausalGraph
from care_core.causal.mechanisms import JITTER, LEAST, Mechanism, transformed
from care_core.causal.model import EdgeRecord, EffectRecord, Model, OutcomeRecord, PathRecord, Summary, Training
from care_core.causal.paths import CausalPath, Ways
from care_core.learn.bootstrap import Finding, Reaches
from care_core.learn.bootstrap import support as measure_support
from care_core.learn.fitting import METRIC, MIN_ROWS, OUTCOME, UNUSED, slopes
from care_core.learn.identification import identify, is_answered_by
from care_core.learn.knowledge import with_known
from care_core.learn.mediation import with_mediation
from care_core.learn.outcomes import (
    FEW_RUNS,
    Outcomes,
    Question,
    ask,
    ask_total,
    badness,
    groups_that_move_together,
    put_together,
    questions_of_objectives,
    varying_options,
)
from care_core.learn.processes import answers, kept_processes
from care_core.learn.relative import of_ratios, relative
from care_core.learn.repeats import carry_over, reference_runs
from care_core.learn.robustness import robustness
from care_core.learn.skill import cross_validated_skill
from care_core.learn.structure import Structure, learn_structure
from care_core.learn.table import varying
from care_core.numbers import Floats
from care_core.profile.schema import Schema
from care_core.progress import Progress
from care_core.records import Record, replace

Edge = tuple[str, str]

BACKGROUND = 32
"""Training runs over which an effect is averaged."""
EFFECT_RESAMPLES = 20
"""Bootstrap resamples behind the intervals of effects (mechanisms are refitted with their kernels kept)."""
TOP_PATHS = 20
CORRELATED_Z = 1.96
"""How many standard errors a correlation must be off 0 before a metric counts as correlated."""
QUANTILES = np.linspace(0, 1, 21)


class TrainSettings(Record):
    """What steers training. `n_jobs` processes share the bootstrap; the answer does not depend on them."""

    seed: int = 0
    alpha: float = 0.01
    resamples: int = 50
    folds: int = 5
    """Parts of the cross-validation; 0 leaves the skill out."""
    n_jobs: int = 2
    origin: str = "not stated"


def train(frame: pd.DataFrame, schema: Schema, settings: TrainSettings, progress: Progress | None = None) -> Model:
    """Learn a profile's model from a table of runs (one row a mission, columns named as in the schema).

    Raises:
        LearningError: too few runs, or no option has an effect that the table can show.
    """
    with threadpool_limits(1), kept_processes():
        return _train(frame, schema, settings, progress or (lambda _step, _share: None))


def _train(frame: pd.DataFrame, schema: Schema, settings: TrainSettings, report: Progress) -> Model:
    rng = np.random.default_rng(settings.seed)
    report("learning the graph", 0.0)
    structure = learn_structure(frame, schema, alpha=settings.alpha, rng=rng)
    report(f"bootstrapping the graph, {settings.resamples} resamples", 0.1)
    support = measure_support(
        frame, schema, resamples=settings.resamples, rng=rng, n_jobs=settings.n_jobs, alpha=settings.alpha
    )
    graph = structure.graph
    report("fitting mechanisms", 0.4)
    outcomes, mechanisms = _fit_all(frame, schema, graph, settings, rng)
    outcomes = with_mediation(outcomes, mechanisms, with_known(graph, frame, schema), frame, schema)
    training = _training(frame, schema, structure, settings)
    training = replace(training, carry_over=carry_over(frame, schema, outcomes, mechanisms))
    learned = Learned(with_weak(graph, frame, schema, (outcomes, mechanisms)), support, outcomes, mechanisms, training)
    return assemble(frame, schema, learned, settings, rng, report)


class Learned(Record, eq=False):
    """A graph as found in runs, the share of resamples that hold each finding, and the mechanisms on it."""

    graph: CausalGraph
    support: Mapping[Finding, float]
    outcomes: Mapping[str, OutcomeRecord]
    mechanisms: Mapping[str, Mechanism]
    training: Training


def assemble(
    frame: pd.DataFrame,
    schema: Schema,
    learned: Learned,
    settings: TrainSettings,
    rng: np.random.Generator,
    report: Progress,
) -> Model:
    """Measure effects and skill on the table, and put the model together."""
    report("measuring effects", 0.6)
    graph, support = with_known(learned.graph, frame, schema), learned.support
    resamples = _Resamples.draw(len(frame), rng)
    ratios = relative(frame, schema)
    edges = _edge_effects(ratios, of_ratios(schema), graph, settings, resamples)
    report("cross-validating", 0.8)
    skill = cross_validated_skill(frame, schema, learned.graph, rng, folds=settings.folds, n_jobs=settings.n_jobs)
    return Model(
        schema_digest=schema.digest,
        graph=graph,
        edges={edge: _edge_record(edge, "directed", support, edges) for edge in sorted(graph.directed)},
        bidirected=tuple(_edge_record(edge, "bidirected", support, edges) for edge in sorted(graph.bidirected)),
        effects=_total_effects(frame, ratios, schema, graph, learned.outcomes, learned.mechanisms, resamples, support),
        paths=_paths(schema, graph, edges, support),
        outcomes=learned.outcomes,
        summaries=summaries(ratios, schema),
        correlated_metrics=_correlated_metrics(ratios, schema, learned.mechanisms),
        skill=skill,
        training=learned.training,
        mechanisms=learned.mechanisms,
    )


class _Resamples(Record):
    """Row numbers of each bootstrap resample, shape (EFFECT_RESAMPLES, n): the same for every mechanism."""

    rows: NDArray[np.int64]

    @classmethod
    def draw(cls, n: int, rng: np.random.Generator) -> _Resamples:
        return cls(rng.integers(0, n, size=(EFFECT_RESAMPLES, n)))


class _Measured(Record):
    """Eq. 1 on the whole table, and its magnitude in each resample, shape (EFFECT_RESAMPLES,)."""

    effect: Effect
    resampled: Floats

    def interval(self, support: float) -> tuple[float, float]:
        """5% and 95% of the magnitudes in resamples."""
        return _interval(self.resampled, support)


def _interval(resampled: Floats, support: float) -> tuple[float, float]:
    """5% and 95% of the magnitudes, the share of resamples in which the graph lacks the effect counted as zero."""
    low, high = (
        0.0 if share <= 1 - support else np.quantile(resampled, 1 - (1 - share) / support) for share in (0.05, 0.95)
    )
    return float(low), float(high)


def _measure(
    names: Sequence[str], mechanism: Mechanism, frame: pd.DataFrame, schema: Schema, resamples: _Resamples,
    sd: float | None = None,
) -> dict[str, _Measured]:  # fmt: skip
    """Eq. 1 of each named input on the mechanism's target, averaged over a background of training runs.

    Args:
        sd: what the target is scaled by, the mechanism's own scale when None.
    """
    if not names:
        return {}
    raw = frame[list(mechanism.inputs)].dropna().to_numpy(dtype=float)
    background = raw[:: max(1, len(raw) // BACKGROUND)][:BACKGROUND]
    levels = [acceptable_values(schema.variables[name], frame[name]) for name in names]
    grids = []
    for name, values in zip(names, levels, strict=True):
        grid = np.repeat(background, len(values), axis=0)
        grid[:, mechanism.inputs.index(name)] = np.tile(values, len(background))
        grids.append(grid)
    stacked, ends = np.vstack(grids), np.cumsum([len(grid) for grid in grids])[:-1]
    if sd is None:
        sd = 0.5 * mechanism.scale if mechanism.binary else mechanism.scale

    # One kernel serves the fit and all its resamples: only the weights of the training points differ.
    among = mechanism.kernel.among(mechanism.points)
    weights = np.column_stack([mechanism.weights, *(_reweighted(mechanism, among, rows) for rows in resamples.rows)])
    cross = mechanism.kernel(mechanism.scaled(stacked), mechanism.points)
    latent = mechanism.mean + mechanism.scale * (cross @ weights) + mechanism.known(stacked)[:, None]

    def effects(answer: Floats) -> list[Effect]:
        responses = [part.reshape(len(background), -1).mean(axis=0) for part in np.split(answer, ends)]
        return [average_causal_effect(response, sd) for response in responses]

    whole, *drawn = [effects(answer) for answer in (mechanism.probability_of(latent) if mechanism.binary else latent).T]
    magnitudes = np.array([[effect.magnitude for effect in resample] for resample in drawn])
    return {name: _Measured(whole[i], magnitudes[:, i]) for i, name in enumerate(names)}


def _reweighted(mechanism: Mechanism, among: Floats, rows: NDArray[np.int64]) -> Floats:
    """Weights of all training points, shape (n,), when the mechanism rests on a resample and its kernel is kept.

    Args:
        among: covariance of the training points with each other, shape (n, n).
    """
    chosen = (rows % len(mechanism.targets))[: len(mechanism.targets)]
    covariance = among[np.ix_(chosen, chosen)]
    covariance[np.diag_indices_from(covariance)] += mechanism.kernel.noise**2 + JITTER
    weights = np.zeros(len(mechanism.targets))
    np.add.at(weights, chosen, np.linalg.solve(covariance, mechanism.targets[chosen]))
    return weights


def with_weak(graph: CausalGraph, frame: pd.DataFrame, schema: Schema, learned: Outcomes) -> CausalGraph:
    """The graph with an edge to every objective from each option that its mechanisms read and no path leads from, where
    runs are few from every option."""
    if schema.observational:
        return graph
    options = varying_options(frame, schema)
    read = dict.fromkeys(varying(frame, [v.name for v in schema.objectives]), options)
    if len(frame) >= FEW_RUNS:
        outcomes, mechanisms = learned
        used = {
            key: {
                one.inputs[place] for place, slope in zip(one.reads, slopes(one.kernel), strict=True) if slope > UNUSED
            }
            for key, one in mechanisms.items()
        }
        read = {
            name: tuple(option for option in options if any(option in used[key] for key in one.mechanisms))
            for name, one in outcomes.items()
        }
    weak = {(option, name) for name, from_ in read.items() for option in from_ if option not in graph.ancestors(name)}
    return CausalGraph(graph.nodes, graph.directed | weak, graph.bidirected)


def _fit_all(
    frame: pd.DataFrame, schema: Schema, graph: CausalGraph, settings: TrainSettings, rng: np.random.Generator
) -> Outcomes:
    """Every objective, and every metric as a function of the options that cause it."""
    of_objectives = questions_of_objectives(frame, schema, graph, rng, effort=OUTCOME)
    asked = (
        ask_total(metric.name, frame, schema, graph, np.random.default_rng([settings.seed, i]), effort=METRIC)
        for i, metric in enumerate(schema.metrics)
    )
    questions = [*(question for one in of_objectives for question in one.questions), *filter(None, asked)]
    fitted = answers([question.answer for question in questions], settings.n_jobs)
    of_metrics = sum(len(one.questions) for one in of_objectives)
    outcomes, mechanisms = put_together(of_objectives, fitted[:of_metrics])
    named = zip(questions[of_metrics:], fitted[of_metrics:], strict=True)
    return outcomes, mechanisms | {question.target: mechanism for question, mechanism in named}


def _edge_effects(
    frame: pd.DataFrame, schema: Schema, graph: CausalGraph, settings: TrainSettings, resamples: _Resamples
) -> dict[Edge, _Measured]:
    """Direct effect of every directed edge: the child's mechanism over all its parents, the others held.

    An edge from an option that shares a hidden cause with its effect has none that the runs could tell, and carries
    no path.
    """

    def asked(i: int, child: str) -> Question | None:
        rng = np.random.default_rng([settings.seed, i])
        parents = sorted(graph.parents(child))
        return ask([parents], child, frame, schema, rng, effort=METRIC) if parents else None

    questions = [asked(i, child) for i, child in enumerate(graph.topological_order())]
    calls = [
        partial(_effects_on_child, question, frame, schema, graph, resamples)
        for question in questions
        if question is not None
    ]
    return {edge: effect for part in answers(calls, settings.n_jobs) for edge, effect in part.items()}


def _effects_on_child(
    question: Question, frame: pd.DataFrame, schema: Schema, graph: CausalGraph, resamples: _Resamples
) -> dict[Edge, _Measured]:
    child = question.target
    parents = sorted(graph.parents(child))
    effects = _measure(parents, question.answer(), frame, schema, resamples)
    hidden = {option.name for option in schema.options} & {*graph.siblings(child)}
    return {(parent, child): effect for parent, effect in effects.items() if parent not in hidden}


def _edge_record(
    edge: Edge, kind: str, support: Mapping[Finding, float], effects: Mapping[Edge, _Measured]
) -> EdgeRecord:
    measured = effects.get(edge) if kind == "directed" else None
    seen = support.get(edge if kind == "directed" else frozenset(edge), 0.0)
    low, high = measured.interval(seen if support else 1.0) if measured else (0.0, 0.0)
    return EdgeRecord(
        source=edge[0],
        target=edge[1],
        kind="directed" if kind == "directed" else "bidirected",
        support=seen,
        effect=measured.effect.magnitude if measured else 0.0,
        low=low,
        high=high,
        direction=measured.effect.direction if measured else "none",
    )


def _target_sd(mechanism: Mechanism, ratios: pd.Series[float]) -> float | None:
    """How far runs differ in a target that has a nominal: what is left when it is divided out under the reference."""
    if mechanism.nominal is None:
        return None
    known = ratios[ratios > 0].to_numpy(dtype=float)
    return float(np.log(known).std())


def _total_effects(
    frame: pd.DataFrame,
    ratios: pd.DataFrame,
    schema: Schema,
    graph: CausalGraph,
    outcomes: Mapping[str, OutcomeRecord],
    mechanisms: Mapping[str, Mechanism],
    resamples: _Resamples,
    support: Mapping[Finding, float],
) -> dict[Edge, EffectRecord]:
    """Every option with a directed path to an objective: is the effect identified, and how large is it?

    `identified` is said only where the mechanisms, regressions on the exogenous variables, give the effect.
    """
    records: dict[Edge, EffectRecord] = {}
    for objective, outcome in outcomes.items():
        robust = robustness(frame, schema, objective)
        keys = [stage.mechanism for stage in outcome.stages] or [outcome.mechanism]
        options = [v.name for v in schema.options if v.name in graph.ancestors(objective)]
        by_stage = [
            _measure(
                [name for name in options if name in m.inputs],
                m,
                frame,
                schema,
                resamples,
                _target_sd(m, ratios[objective]),
            )
            for m in (mechanisms[key] for key in keys)
        ]
        for option in options:
            answer = identify(graph, option, objective)
            # A functional objective is as sensitive to an option as its most sensitive stage.
            measured = [effects[option] for effects in by_stage if option in effects]
            if not measured:
                continue
            best = max(measured, key=lambda m: m.effect.magnitude)
            inputs = {name for key in keys for name in mechanisms[key].inputs}
            seen = support.get(Reaches(option, objective), 0.0)
            low, high = best.interval(seen if support else 1.0)
            records[option, objective] = EffectRecord(
                option=option,
                objective=objective,
                identified=answer.identified and is_answered_by(graph, option, objective, inputs),
                functional=answer.functional,
                adjustment=tuple(answer.adjustment),
                effect=best.effect.magnitude,
                low=low,
                high=high,
                direction=best.effect.direction,
                support=seen,
                robustness=robust[option].value if option in robust else None,
                strongest=robust[option].strongest if option in robust else None,
            )
    return records


def _paths(
    schema: Schema, graph: CausalGraph, edges: Mapping[Edge, _Measured], support: Mapping[Finding, float]
) -> dict[str, tuple[PathRecord, ...]]:
    """Alg. 2: the top paths of each objective, with the interval of their mean edge effect over resamples, which have a
    path as often as its rarest edge at most."""
    ways = Ways(graph, {edge: measured.effect.magnitude for edge, measured in edges.items()})
    options = {option.name for option in schema.options}

    def record(path: CausalPath, objective: str) -> PathRecord:
        drawn = np.mean([edges[edge].resampled for edge in path.edges], axis=0)
        seen = min(support.get(edge, 0.0) for edge in path.edges)
        low, high = _interval(drawn, seen if support else 1.0)
        return PathRecord(
            objective=objective,
            nodes=path.nodes,
            ace=path.ace,
            low=low,
            high=high,
            direction=along([edges[edge].effect.direction for edge in path.edges]),
            edge_support=tuple(support.get(edge, 0.0) for edge in path.edges),
        )

    return {
        objective.name: tuple(record(path, objective.name) for path in ways.ranked(objective.name, options, TOP_PATHS))
        for objective in schema.objectives
        if objective.name in graph.nodes
    }


def _correlated_metrics(
    frame: pd.DataFrame, schema: Schema, mechanisms: Mapping[str, Mechanism]
) -> dict[str, dict[str, float]]:
    """Per objective the metrics that go with missing it: correlation with how bad it was, where it is sure not to be 0.

    Each on the scale of its mechanism, so that a metric times its correlation says how much of the miss it shows.
    """
    found: dict[str, dict[str, float]] = {}
    for objective in schema.objectives:
        bad = badness(objective, frame, schema)
        for metric in schema.metrics:
            mechanism = mechanisms.get(metric.name)
            if mechanism is None:
                continue
            values = frame[metric.name].to_numpy(dtype=float)
            values = transformed(np.where(values > LEAST[mechanism.transform], values, np.nan), mechanism.transform)
            both = np.isfinite(values) & np.isfinite(bad)
            if both.sum() < MIN_ROWS or np.ptp(values[both]) == 0 or np.ptp(bad[both]) == 0:
                continue
            r = float(np.corrcoef(values[both], bad[both])[0, 1])
            if abs(r) > CORRELATED_Z / np.sqrt(both.sum()):
                found.setdefault(objective.name, {})[metric.name] = r
    return found


def summaries(frame: pd.DataFrame, schema: Schema) -> dict[str, Summary]:
    """What the runs hold of each variable."""
    held: dict[str, Summary] = {}
    for name in schema.variables:
        if name not in frame:
            continue
        values = frame[name].to_numpy(dtype=float)
        values = values[np.isfinite(values)]
        if len(values):
            held[name] = Summary(
                count=len(values),
                mean=float(values.mean()),
                sd=float(values.std()),
                quantiles=tuple(float(q) for q in np.quantile(values, QUANTILES)),
            )
    return held


def _training(frame: pd.DataFrame, schema: Schema, structure: Structure, settings: TrainSettings) -> Training:
    return Training(
        origin=settings.origin,
        runs=len(frame),
        seed=settings.seed,
        alpha=settings.alpha,
        resamples=settings.resamples,
        screened_out=tuple(structure.dropped_options),
        direct_edges=tuple((a, b, p) for a, b, p in structure.direct),
        moves_together=groups_that_move_together(schema, relative(frame, schema)),
        reference=reference_runs(frame, schema),
        notes=tuple(structure.notes),
    )
