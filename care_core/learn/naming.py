"""Ways to name the causes of a fault file: the paper's rule, the engine, a ranking by deviation, bug isolation."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from care_core.causal.counterfactual import Config, CounterfactualQuery
from care_core.causal.graph import CausalGraph
from care_core.causal.model import EdgeRecord, EffectRecord, Model
from care_core.diagnose.ranking import suspects
from care_core.learn.bug_isolation import cooperative_bug_isolation
from care_core.learn.fault_files import FAULTY_RUNS, FaultFile
from care_core.learn.outcomes import met
from care_core.learn.transfer import transfer_to
from care_core.numbers import Bools
from care_core.profile.schema import Schema
from care_core.records import replace
from care_core.variables import Threshold

SLOPES = 3
"""The paper's rule names the options of so many largest slopes."""
TIE = 9
"""Decimals to which slopes are compared: beyond them only rounding differs."""
MIDDLE = 0.9
"""Share of the good runs whose values count as usual where options were drawn at random."""


def by_paper_rule(schema: Schema, fault: FaultFile) -> frozenset[str]:
    """The rule of the artifact behind the paper (Hossen et al. 2023), declared: every option among the three largest
    distinct magnitudes of the objective's slope on that option alone, all columns scaled to a standard deviation of 1,
    ties kept.

    The graph plays no part in it: the functional that the artifact evaluates has no adjustment, since nothing causes
    an option. Options that never vary have no slope and are left out; the artifact lets rounding choose among them.
    """
    y = fault.runs[fault.objective].to_numpy(dtype=float)
    varying = [option.name for option in schema.options if fault.varies(option.name)]
    if not varying or np.ptp(y) == 0:
        return frozenset()
    x = fault.runs[varying].to_numpy(dtype=float)
    slopes = np.round(np.abs([np.corrcoef(column, y)[0, 1] for column in x.T]), TIE)
    least = np.unique(slopes)[-SLOPES:][0]
    return frozenset(name for name, slope in zip(varying, slopes, strict=True) if slope >= least)


def by_engine(schema: Schema, model: Model, fault: FaultFile) -> list[str]:
    """Options by what the engine of `care triage` says they cost the faulty runs, on average, the costliest first."""
    bound = _bound_of(schema, fault)
    measured = [v.name for v in (*schema.metrics, *schema.objectives) if v.name in fault.runs]
    total: dict[str, float] = {}
    for i, config in enumerate(_configs(schema, fault)):
        seen = {name: float(fault.runs[name].iloc[i]) for name in measured}
        usual = usual_values(schema, fault, config)
        query = CounterfactualQuery(
            model, config, seen, {fault.objective: bound}, reference=usual, variables=schema.variables
        )
        for suspect in suspects(query, fault.objective, schema.known):
            total[suspect.option] = total.get(suspect.option, 0.0) + suspect.weight / FAULTY_RUNS
    return [name for name in sorted(total, key=lambda name: (-total[name], name)) if total[name] > 0]


def taught_by(schema: Schema, model: Model, fault: FaultFile) -> Model:
    """The model carried over to the runs of the file (as `care update` does), every option that varies in it a
    possible cause: what lies outside the profile's training support only the file can tell."""
    varying = [option.name for option in schema.options if fault.varies(option.name)]
    links = {(option, fault.objective) for option in varying}
    graph = CausalGraph(model.graph.nodes, model.graph.directed | links, model.graph.bidirected)
    outcome = model.outcomes[fault.objective]
    keys = [stage.mechanism for stage in outcome.stages] or [outcome.mechanism]
    _, mechanisms = transfer_to(model, schema, fault.runs, graph, np.random.default_rng(0), only=keys)
    edges = {(a, b): EdgeRecord(source=a, target=b, kind="directed", support=1.0) for a, b in links}
    effects = {
        (a, b): EffectRecord(
            option=a, objective=b, identified=True, functional="", effect=0.0, low=0.0, high=0.0, direction="none"
        )
        for a, b in links
    }
    return replace(
        model,
        graph=graph,
        mechanisms={**model.mechanisms, **mechanisms},
        edges={**edges, **model.edges},
        effects={**effects, **model.effects},
    )


def _bound_of(schema: Schema, fault: FaultFile) -> Threshold:
    """The profile's threshold where the faulty runs miss it; else, as they were given as faulty, one between them and
    what the other runs mostly reached."""
    bound = schema.variables[fault.objective].fixed
    values = fault.runs[fault.objective].to_numpy(dtype=float)
    assert bound is not None, "an objective of a profile with faults has a threshold"
    faulty, usual = values[:FAULTY_RUNS], float(np.median(values[FAULTY_RUNS:]))
    if not any(bound.met(value) for value in faulty):
        return bound
    nearest = faulty[np.argmin(np.abs(faulty - usual))]
    return replace(bound, value=float((nearest + usual) / 2))


def by_deviation(schema: Schema, model: Model, fault: FaultFile) -> list[str]:
    """Options by the share of the faulty runs in which they are off what the other runs mostly had (an option off in
    every faulty run can explain them all), then by their total effect on the objective in the model (Eq. 1), then by
    how far off they are. An option that was never off and has no effect in the model is not named."""
    faulty = fault.runs[:FAULTY_RUNS]
    reference = pd.DataFrame([usual_values(schema, fault, row) for row in _configs(schema, fault)])
    keys: dict[str, tuple[float, float, float, str]] = {}
    for option in schema.options:
        distance = np.abs(faulty[option.name].to_numpy(dtype=float) - reference[option.name].to_numpy())
        record = model.effects.get((option.name, fault.objective))
        effect = record.effect if record is not None and record.identified else 0.0
        if distance.any() or effect > 0:
            far = float(distance.max()) / (model.summaries[option.name].sd or 1.0)
            keys[option.name] = (-float((distance > 0).mean()), -effect, -far, option.name)
    return sorted(keys, key=lambda name: keys[name])


def _configs(schema: Schema, fault: FaultFile) -> list[dict[str, float]]:
    """The configurations of the faulty runs."""
    rows = fault.runs[:FAULTY_RUNS].to_dict("records")
    return [{option.name: float(row[option.name]) for option in schema.options} for row in rows]


def usual_values(schema: Schema, fault: FaultFile, config: Config) -> dict[str, float]:
    """What the other runs of the file mostly had, per option: the value of more than half of them. Where they were
    drawn at random no single value is usual: it is the nearest to this configuration's in the middle `MIDDLE` of the
    runs that kept the objective."""
    others = fault.runs[FAULTY_RUNS:]
    kept = others[met(schema.variables[fault.objective], others, schema) == 1.0]
    usual = {}
    for option in schema.options:
        counts = others[option.name].value_counts()
        if counts.iloc[0] > len(others) / 2:
            usual[option.name] = float(counts.index[0])
        else:
            low, high = (kept if len(kept) else others)[option.name].quantile([0.5 - MIDDLE / 2, 0.5 + MIDDLE / 2])
            nearest = float(np.clip(config[option.name], low, high))
            usual[option.name] = nearest if nearest == config[option.name] else option.snap(nearest)
    return usual


def by_bug_isolation(schema: Schema, fault: FaultFile) -> list[str]:
    """Options whose predicate, true in a faulty run, has importance above zero in the runs of the file, best first."""
    failed: Bools = np.nan_to_num(met(schema.variables[fault.objective], fault.runs, schema), nan=0.0) == 0.0
    failed[:FAULTY_RUNS] = True
    options = [option.name for option in schema.options]
    best: dict[str, float] = {}
    for config in _configs(schema, fault):
        for name, importance in cooperative_bug_isolation(fault.runs, failed, config, schema, options).items():
            best[name] = max(best.get(name, 0.0), importance)
    return [name for name in sorted(best, key=lambda name: (-best[name], name)) if best[name] > 0]


def outside_support(schema: Schema, model: Model, faults: Sequence[FaultFile]) -> list[tuple[str, str]]:
    """(fault, true cause) pairs in which a faulty run's value lies outside what the profile was trained on."""
    names = {option.name for option in schema.options}
    return [
        (fault.name, option)
        for fault in faults
        for option in sorted(fault.true & names)
        if not all(model.supports(option, float(value)) for value in fault.runs[option][:FAULTY_RUNS])
    ]
