"""What this run's metrics say about its options, where the predicted probability says little.

A run that takes too long shows where: its last ten metres took a minute more than the reference would. That is a
symptom, a metric that is off in the direction that goes with missing the objective. It points at the options that moved
it: those that its mechanism, or what people know of the platform, says act on it. The probability of a whole mission
takes many runs to be learned, a phase or an error that few options act on needs few.
"""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence

import numpy as np

from care_core.causal.counterfactual import Config, CounterfactualQuery
from care_core.causal.graph import Edge
from care_core.causal.mechanisms import LEAST, Mechanism, columns, transformed
from care_core.records import Record
from care_core.run import Evidence

UNLEARNED = 0.02
"""Effect of a known cause over its whole range, in standard deviations of the metric, where no run shows more."""
SAID = 1.0
_SAID: Mapping[str, float] = {"refusal": 10.0, "found": 5.0}
"""Standard deviations that a message naming an option counts for, by its kind: a refusing check leaves no room for
others, and what was found to have lost the mission little."""


class Pointer(Record):
    """How much of a run's symptoms an option accounts for (0 to 1), and the metric that shows it best, if any."""

    share: float
    metric: str | None


NOTHING = Pointer(0.0, None)
ROUNDING = 1e-9
"""What is less is nothing: the same sum in another order differs by as much. Where no option moves a metric, the last
digits would draw lots for the one to be blamed."""


def pointers(
    query: CounterfactualQuery, objective: str, names: Sequence[str], known: Container[Edge], said: Sequence[Evidence]
) -> dict[str, Pointer]:
    """What the metrics and the messages of this run say about the options `names`. The shares add up to 1, or are 0.

    A symptom weighs as much as it shows of the miss: its distance from what the reference would give, in standard
    deviations of the training runs, times its correlation with missing the objective. It is split by how much of it
    goes away when each option alone goes back.
    """
    shown: dict[str, dict[str, float]] = {name: {} for name in names}
    for metric, correlation in query.model.correlated_metrics.get(objective, {}).items():
        for name, part in _split(query, metric, correlation, names, known).items():
            shown[name][metric] = part
    spoken = dict.fromkeys(names, 0.0)
    for message in said if query.variables[objective].kind == "functional" else ():
        for name in spoken.keys() & set(message.options):
            spoken[name] += _SAID.get(message.kind, SAID) / len(message.options)
    total = {name: spoken[name] + sum(shown[name].values()) for name in names}
    whole = sum(total.values()) or 1.0
    return {
        name: Pointer(total[name] / whole, max(shown[name], key=shown[name].__getitem__, default=None))
        for name in names
    }


def better_than_expected(query: CounterfactualQuery, objective: str) -> frozenset[str]:
    """Metrics that go with missing the objective and are on the other side of what the reference would give: what this
    run lost was not lost there."""
    found = set()
    for metric, correlation in query.model.correlated_metrics.get(objective, {}).items():
        value = _coded(query, metric)
        if value is not None:
            (expected,) = _latent(query, query.model.mechanisms[metric], [query.reference])
            if correlation * (value - expected) < 0:
                found.add(metric)
    return frozenset(found)


def _coded(query: CounterfactualQuery, metric: str) -> float | None:
    """A metric of this run on the scale of its mechanism; None where it is not known or has no place there."""
    mechanism, seen = query.model.mechanisms[metric], query.known(metric)
    if seen is None or (not mechanism.binary and seen <= LEAST[mechanism.transform]):
        return None
    return 2 * seen - 1 if mechanism.binary else float(transformed(np.array(seen), mechanism.transform))


def _split(
    query: CounterfactualQuery, metric: str, correlation: float, names: Sequence[str], known: Container[Edge]
) -> Mapping[str, float]:
    mechanism, value = query.model.mechanisms[metric], _coded(query, metric)
    if value is None or not names:
        return {}
    reference = query.reference
    configs = [reference, query.config, *({**query.config, name: reference[name]} for name in names)]
    expected, here, *back = _latent(query, mechanism, configs)
    scale = _scale(query, metric, mechanism)
    off = (value - expected) / scale
    if correlation * off <= 0:
        return {}
    moved = {}
    for name, there in zip(names, back, strict=True):
        step = float(np.sign(off)) * (here - there) / scale
        moved[name] = step if step > ROUNDING else 0.0
        if (name, metric) in known:
            moved[name] += UNLEARNED * query.variables[name].distance(reference[name], query.config[name])
    whole = sum(moved.values())
    return {name: correlation * off * part / whole for name, part in moved.items() if part > 0}


def _scale(query: CounterfactualQuery, metric: str, mechanism: Mechanism) -> float:
    """How far training runs differ in a metric; of one that has a nominal, in the logarithm of its ratio to it."""
    summary = query.model.summaries.get(metric)
    if mechanism.nominal is None or summary is None or not summary.mean > 0:
        return mechanism.scale
    return max(summary.sd / summary.mean, mechanism.scale)


def _latent(query: CounterfactualQuery, mechanism: Mechanism, configs: Sequence[Config]) -> list[float]:
    latent: list[float] = query.posteriors.at(mechanism, columns(configs, mechanism.inputs)).latent.tolist()
    return latent
