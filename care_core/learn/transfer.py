"""A profile of one robot carried over to another with few runs of the latter (paper, RQ2).

What the robots share is the structure: the source's graph is kept, completed by what the target's runs show. Each
mechanism starts from the source's: the target's value is a share of what the source predicts plus a Gaussian process
learned on what that leaves. Far from the target's runs the answer is the source's, shifted; near them it is theirs.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from care_core.causal.graph import CausalGraph
from care_core.causal.mechanisms import LEAST, FloatArray, Mechanism, transformed
from care_core.causal.model import Model, OutcomeRecord, Training
from care_core.errors import LearningError
from care_core.learn.bootstrap import Finding, Reaches
from care_core.learn.completion import complete
from care_core.learn.fitting import METRIC, MIN_ROWS, OUTCOME, Effort, Inputs, fit_mechanism, left_out, logistic
from care_core.learn.outcomes import causes_of, find_stages, groups_that_move_together, inputs_of
from care_core.learn.relative import relative
from care_core.learn.screening import screen_options
from care_core.learn.train import Learned, TrainSettings, assemble
from care_core.profile.schema import Schema
from care_core.variables import Role

TRUST = 10.0
"""Target runs that the source's own scale (a share of 1) counts as."""

Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class OutOfSupport:
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
        LearningError: fewer runs than a mechanism needs.
    """
    if len(frame) < MIN_ROWS:
        raise LearningError(
            f"The table has {len(frame)} runs, {MIN_ROWS} are needed.", hint="Record more missions of the target."
        )
    with threadpool_limits(1):
        return _update(source, schema, frame, settings, progress or (lambda _step, _share: None))


def _update(source: Model, schema: Schema, frame: pd.DataFrame, settings: TrainSettings, report: Progress) -> Model:
    rng = np.random.default_rng(settings.seed)
    report("completing the graph", 0.0)
    ratios = relative(frame, schema)
    completion = complete(ratios, schema, source.graph, screen_options(ratios, schema).kept)
    graph = completion.graph
    report("carrying the mechanisms over", 0.2)
    outcomes, mechanisms = carry_over(source, schema, frame, graph, rng)
    training = Training(
        origin=f"{source.training.origin.rstrip('.')}; carried over with {settings.origin}.",
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


def carry_over(
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
    for key in source.mechanisms if only is None else only:
        mechanism = source.mechanisms[key]
        name = key.removeprefix("stage:")
        rows, values = _observed(key, source, schema, frame)
        names = tuple(dict.fromkeys((*mechanism.inputs, *causes_of(name, graph, schema))))
        known = rows & frame[list(names)].notna().all(axis=1).to_numpy() & (values > LEAST[mechanism.transform])
        enough = int(known.sum()) >= MIN_ROWS and np.ptp(values[known]) > 0
        effort = METRIC if schema.variables[name].role is Role.METRIC and key == name else OUTCOME
        read = {mechanism.inputs[place] for place in mechanism.reads} | set(causes_of(name, graph, schema))
        inputs = dataclasses.replace(inputs_of(names, schema), read=np.array([name in read for name in names]))
        x = frame.loc[known, list(inputs.names)].to_numpy(dtype=float)
        mechanisms[key] = started_from(mechanism, x, values[known], inputs, rng, effort) if enough else mechanism
    return dict(source.outcomes), mechanisms


def _observed(key: str, source: Model, schema: Schema, frame: pd.DataFrame) -> tuple[NDArray[np.bool_], FloatArray]:
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
    source: Mechanism, x: FloatArray, y: FloatArray, inputs: Inputs, rng: np.random.Generator, effort: Effort
) -> Mechanism:
    """The target's mechanism: a share of the source's prediction, and a regression of what that leaves.

    Args:
        x: shape (n, p), inputs in their own units, columns named by `inputs`. y: shape (n,).
    """
    if len(y) > effort.points:
        keep = np.sort(rng.choice(len(y), effort.points, replace=False))
        x, y = x[keep], y[keep]
    places = [inputs.names.index(name) for name in source.inputs]
    before = source.latent(x[:, places])
    coded = 2.0 * y - 1.0 if source.binary else transformed(y, source.transform)
    share = _share(before, coded)
    rest = fit_mechanism(x, coded - share * before, inputs, binary=False, rng=rng, effort=effort, transform="identity")
    carried = dataclasses.replace(rest, transform=source.transform, binary=source.binary, prior=(source, share))
    if not source.binary:
        return carried
    errors, _ = left_out(rest.kernel, rest.points, rest.targets)
    held_out = coded - rest.scale * errors
    return dataclasses.replace(carried, calibration=logistic(held_out, y))


def _share(before: FloatArray, coded: FloatArray) -> float:
    """Slope of the target on the source's prediction, drawn towards 1 as by `TRUST` runs that obey the source."""
    centred = before - before.mean()
    variance = float(centred @ centred) / len(before)
    if variance == 0:
        return 1.0
    slope = float(centred @ (coded - coded.mean())) / (len(before) * variance)
    return (len(before) * slope + TRUST) / (len(before) + TRUST)
