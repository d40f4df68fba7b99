"""A profile of one robot carried over to another with few runs of the latter (paper, RQ2).

What the robots share is the structure: the source's graph is kept, completed by what the target's runs show where they
are many. Each mechanism starts from the source's, and what the source leaves of the target's runs is either one step
that they have in common (shrunk towards none) or, where there are enough missions and it predicts those left out
better, a Gaussian process beside a share of the source. Far from the target's runs the answer is the source's, shifted;
near them it is theirs.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from care_core.causal.graph import CausalGraph
from care_core.causal.kernel import Kernel
from care_core.causal.mechanisms import LEAST, Mechanism, solve, transformed
from care_core.causal.model import Model, OutcomeRecord, Training
from care_core.errors import LearningError
from care_core.learn.bootstrap import Finding, Reaches
from care_core.learn.completion import complete
from care_core.learn.fitting import METRIC, MIN_ROWS, OUTCOME, Effort, Fitted, Inputs, drawn, fit, left_out, logistic
from care_core.learn.outcomes import causes_of, find_stages, groups_that_move_together, inputs_of
from care_core.learn.relative import ENOUGH_PARTS, missions_of, relative
from care_core.learn.screening import screen_options
from care_core.learn.train import Learned, TrainSettings, assemble
from care_core.numbers import Bools, Floats
from care_core.profile.schema import Schema
from care_core.progress import Progress
from care_core.records import Record, replace
from care_core.variables import Role

TRUST = 10.0
"""Target runs that the source's own scale (a share of 1) and its own noise count as."""
FEWEST = 3
"""Fewer runs say nothing of what they have in common."""
ENOUGH_FOR_EFFECTS = 100
"""With fewer runs the graph and the effects stay the source's: a profile has some hundred variables."""


class OutOfSupport(Record):
    """An option of the target that left what the source was trained on, and the two spans."""

    option: str
    source: tuple[float, float]
    target: tuple[float, float]

    def __str__(self) -> str:
        (a, b), (c, d) = self.source, self.target
        return f"'{self.option}' is outside the source's support: {c:g} to {d:g}, trained on {a:g} to {b:g}"


def update(
    source: Model, schema: Schema, frame: pd.DataFrame, settings: TrainSettings, progress: Progress | None = None
) -> Model:
    """Carry a model over to the robot whose runs are in `frame`.

    Args:
        source: the model to start from.
        schema: the target's, with the same variables.
        frame: a checked table of the target's runs (`table.read_table`).

    Raises:
        LearningError: too few runs to have anything in common.
    """
    if len(frame) < FEWEST:
        raise LearningError(
            f"The table has {len(frame)} runs, {FEWEST} are needed.", hint="Record more missions of the target."
        )
    with threadpool_limits(1):
        return _update(source, schema, frame, settings, progress or (lambda _step, _share: None))


def _shifted_only(source: Model, schema: Schema, frame: pd.DataFrame, settings: TrainSettings) -> Model:
    """The source's model with its mechanisms moved to the target's runs."""
    outcomes, mechanisms = transfer_to(source, schema, frame, source.graph, np.random.default_rng(settings.seed))
    ratios = relative(frame, schema)
    notes = (
        f"Carried over from a model of {source.training.runs} runs: graph, effects and skill are that model's.",
        *(f"{option}." for option in out_of_support(source, schema, frame)),
    )
    runs = source.training.runs + len(frame)
    training = replace(source.training, origin=_origin(source, settings), runs=runs, notes=notes)
    summaries = {name: summary.with_values(ratios[name]) for name, summary in source.summaries.items()}
    return replace(
        source,
        schema_digest=schema.digest,
        outcomes=outcomes,
        mechanisms=mechanisms,
        summaries=summaries,
        training=training,
    )


def _origin(source: Model, settings: TrainSettings) -> str:
    return f"{source.training.origin.rstrip('.')}; carried over with {settings.origin}."


def _update(source: Model, schema: Schema, frame: pd.DataFrame, settings: TrainSettings, report: Progress) -> Model:
    if len(frame) < ENOUGH_FOR_EFFECTS:
        report("carrying the mechanisms over", 0.0)
        return _shifted_only(source, schema, frame, settings)
    rng = np.random.default_rng(settings.seed)
    report("completing the graph", 0.0)
    ratios = relative(frame, schema)
    completion = complete(ratios, schema, source.graph, screen_options(ratios, schema).kept)
    graph = completion.graph
    report("carrying the mechanisms over", 0.2)
    outcomes, mechanisms = transfer_to(source, schema, frame, graph, rng)
    training = Training(
        origin=_origin(source, settings),
        runs=len(frame),
        seed=settings.seed,
        alpha=source.training.alpha,
        resamples=source.training.resamples,
        screened_out=source.training.screened_out,
        direct_edges=(*source.training.direct_edges, *completion.direct),
        moves_together=groups_that_move_together(schema, ratios),
        notes=(
            f"Carried over from a model of {source.training.runs} runs: shares of resamples are that model's.",
            *(f"{option}." for option in out_of_support(source, schema, frame)),
            *completion.notes,
        ),
    )
    learned = Learned(graph, _support_of(source), outcomes, mechanisms, training)
    return assemble(frame, schema, learned, settings, rng, report)


def out_of_support(source: Model, schema: Schema, frame: pd.DataFrame) -> tuple[OutOfSupport, ...]:
    """Options with target values outside what the source was trained on: there, only the target's runs speak."""
    found = []
    for option in schema.options:
        low, high = float(frame[option.name].min()), float(frame[option.name].max())
        if not (source.supports(option.name, low) and source.supports(option.name, high)):
            summary = source.summaries[option.name]
            found.append(OutOfSupport(option.name, (summary.low, summary.high), (low, high)))
    return tuple(found)


def _support_of(source: Model) -> dict[Finding, float]:
    support: dict[Finding, float] = {edge: record.support for edge, record in source.edges.items()}
    support.update({frozenset((edge.source, edge.target)): edge.support for edge in source.bidirected})
    support.update({Reaches(*pair): e.support for pair, e in source.effects.items() if e.support is not None})
    return support


def transfer_to(
    source: Model,
    schema: Schema,
    frame: pd.DataFrame,
    graph: CausalGraph,
    rng: np.random.Generator,
    only: Collection[str] | None = None,
) -> tuple[dict[str, OutcomeRecord], dict[str, Mechanism]]:
    """The mechanisms of the source (`only` those keys, if given), refitted on the target's runs where they are enough,
    else as they were."""
    mechanisms: dict[str, Mechanism] = {}
    missions = missions_of(frame, schema)
    frame = frame.assign(**{v.name: _met(v.name, source, frame) for v in schema.contexts if v.name in source.summaries})
    for key in source.mechanisms if only is None else only:
        mechanism = source.mechanisms[key]
        name = key.removeprefix("stage:")
        rows, values = _observed(key, source, schema, frame)
        names = tuple(dict.fromkeys((*mechanism.inputs, *causes_of(name, graph, schema))))
        known = rows & frame[list(names)].notna().all(axis=1).to_numpy() & (values > LEAST[mechanism.transform])
        effort = METRIC if schema.variables[name].role is Role.METRIC and key == name else OUTCOME
        read = {mechanism.inputs[place] for place in mechanism.reads} | set(causes_of(name, graph, schema))
        inputs = replace(inputs_of(names, schema), read=np.array([name in read for name in names]))
        x = frame.loc[known, list(inputs.names)].to_numpy(dtype=float)
        groups = np.arange(len(x)) if missions is None else missions[known]
        mechanisms[key] = started_from(mechanism, x, values[known], inputs, groups, rng, effort)
    return dict(source.outcomes), mechanisms


def _met(name: str, source: Model, frame: pd.DataFrame) -> pd.Series[float]:
    """A context of the target's runs; where a run does not have it, the middle of what training held."""
    return frame[name].fillna(source.summaries[name].quantile(0.5))


def _observed(key: str, source: Model, schema: Schema, frame: pd.DataFrame) -> tuple[Bools, Floats]:
    """Which rows say something of a mechanism's target, and what; both of shape (n,)."""
    name = key.removeprefix("stage:")
    values = frame[name].to_numpy(dtype=float)
    for objective in schema.objectives:
        record = source.outcomes.get(objective.name)
        if record is None or key not in {stage.mechanism for stage in record.stages}:
            continue
        stage = next((s for s in find_stages(objective, schema, frame) if s.variable == name), None)
        if stage is None:
            return np.zeros(len(frame), dtype=bool), values
        return stage.reached, np.where(stage.passed, stage.passes, 1.0 - stage.passes)
    return ~np.isnan(values), values


def started_from(
    source: Mechanism,
    x: Floats,
    y: Floats,
    inputs: Inputs,
    groups: NDArray[np.int64],
    rng: np.random.Generator,
    effort: Effort,
) -> Mechanism:
    """The target's mechanism: the source's, moved or with a regression beside it, whichever predicts missions left out
    better; the source's as it is where there are next to no runs.

    Args:
        x: shape (n, p), inputs in their own units, columns named by `inputs`. y: shape (n,).
        groups: shape (n,), runs of one mission have one number: what a mission has in common is not the vehicle's.
    """
    if len(y) < FEWEST:
        return source
    kept = drawn(len(y), effort, rng)
    x, y, groups = x[kept], y[kept], groups[kept]
    moved = _moved(source, x, y, inputs, groups)
    if len(y) < MIN_ROWS or len(np.unique(groups)) < ENOUGH_PARTS or np.ptp(y) == 0:
        return moved.mechanism
    beside = _with_regression(source, x, y, inputs, groups, effort)
    return moved.mechanism if moved.loss <= beside.loss else beside.mechanism


def _moved(source: Mechanism, x: Floats, y: Floats, inputs: Inputs, groups: NDArray[np.int64]) -> Fitted:
    """The source moved by what the target's runs have in common: their mean error, shrunk towards none by as much as
    chance alone explains of it, counted in missions (James and Stein 1961, positive part). It is as unsure as the
    source, whose errors were seen on hundreds of runs, or more where these runs say so."""
    columns = x[:, [inputs.names.index(name) for name in source.inputs]]
    rest = _coded(source, y) - source.latent(columns)
    unknown = float((source.latent_sd(columns) ** 2).mean())
    # The levels of a mechanism's errors widen its noise, so the noise is what is left without them.
    wider = 1.0 if source.binary else max(float(np.var(source.calibration)), 1.0)
    expected = unknown + source.noise_sd**2
    count, mean = len(rest), float(rest.mean())
    pooled = (float(((rest - mean) ** 2).sum()) / wider + TRUST * expected) / (count - 1 + TRUST)
    variance = max(pooled, expected)
    step = float(np.sqrt(max(mean**2 - wider * variance / len(np.unique(groups)), 0.0)))
    noise = float(np.sqrt(variance - unknown))
    kernel = Kernel(np.zeros(0), additive=step, joint=0.0, noise=noise, idle=1)
    points = np.zeros((count, 0))
    errors, sd = left_out(kernel, points, rest, groups)
    sd = np.sqrt(sd**2 + unknown)
    mechanism = Mechanism(
        inputs=inputs.names,
        reads=np.zeros(0, dtype=np.int64),
        log_inputs=np.zeros(0, dtype=bool),
        centre=np.zeros(0),
        sd=np.zeros(0),
        kernel=kernel,
        points=points,
        targets=rest,
        weights=solve(kernel, points, rest),
        mean=0.0,
        scale=1.0,
        transform=source.transform,
        binary=source.binary,
        calibration=source.calibration,
        prior=(source, 1.0),
    )
    if not source.binary:
        return Fitted(mechanism, _loss_of(errors, sd))
    held_out = _coded(source, y) - errors
    return Fitted(mechanism, _loss_of_odds(source.calibration, held_out, y))


def _with_regression(
    source: Mechanism,
    x: Floats,
    y: Floats,
    inputs: Inputs,
    groups: NDArray[np.int64],
    effort: Effort,
) -> Fitted:
    """A share of the source's prediction, and a regression of what that leaves."""
    before = source.latent(x[:, [inputs.names.index(name) for name in source.inputs]])
    coded = _coded(source, y)
    share = _share(before, coded)
    rest = fit(x, coded - share * before, inputs, binary=False, effort=effort, transform="identity", groups=groups)
    mechanism = rest.mechanism
    carried = replace(mechanism, transform=source.transform, binary=source.binary, prior=(source, share))
    if not source.binary:
        return Fitted(carried, rest.loss)
    errors, _ = left_out(mechanism.kernel, mechanism.points, mechanism.targets, groups)
    held_out = coded - mechanism.scale * errors
    calibration = logistic(held_out, y)
    return Fitted(replace(carried, calibration=calibration), _loss_of_odds(calibration, held_out, y))


def _coded(source: Mechanism, y: Floats) -> Floats:
    return 2.0 * y - 1.0 if source.binary else transformed(y, source.transform)


def _loss_of(errors: Floats, sd: Floats) -> float:
    return float((np.log(sd) + 0.5 * (errors / sd) ** 2).mean())


def _loss_of_odds(calibration: Floats, latent: Floats, y: Floats) -> float:
    slope, offset = calibration
    logit = slope * latent + offset
    return float(np.logaddexp(0, np.where(y > 0.5, -logit, logit)).mean())


def _share(before: Floats, coded: Floats) -> float:
    """Slope of the target on the source's prediction, drawn towards 1 as by `TRUST` runs that obey the source."""
    centred = before - before.mean()
    variance = float(centred @ centred) / len(before)
    if variance == 0:
        return 1.0
    slope = float(centred @ (coded - coded.mean())) / (len(before) * variance)
    return (len(before) * slope + TRUST) / (len(before) + TRUST)
