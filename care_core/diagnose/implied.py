"""What a run says of the parameters that its log does not hold.

They are taken to be at their reference. Where a metric of the run lies far from what that gives, and one of them alone
acts on it and brings it back, its value is read off the metric: a landing that took three times as long was set so.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np

from care_core.causal.mechanisms import LEAST, Mechanism, columns, transformed
from care_core.causal.model import Model
from care_core.numbers import Floats
from care_core.profile.schema import Schema
from care_core.records import Record
from care_core.run import Run, is_known
from care_core.text import figures
from care_core.variables import Variable

FAR = 3.0
"""Standard deviations from which a metric is not what the reference gives."""
NEAR = 1.0
"""Within so many it is what a value gives."""
STEPS = 21
"""Values of a parameter that are tried, over its acceptable range."""


MOST = 0.25
"""Share of the parameters that may be lacking: among more, too many would give the same."""


class Implied(Record):
    """The value of a parameter that a metric of the run speaks for, and what the reference gives of that metric."""

    option: Variable
    value: float
    metric: Variable
    seen: float
    expected: float

    def __str__(self) -> str:
        seen = f"{self.metric.name} {figures(self.seen)} {self.metric.unit}".rstrip()
        value = f"{self.option.show(self.value)} {self.option.unit}".rstrip()
        return (
            f"{self.option.name} is not in the log: {seen} speaks for about {value}, {figures(self.expected)} expected"
        )


def implied(run: Run, schema: Schema, model: Model, reference: Mapping[str, float]) -> dict[str, Implied]:
    """Per parameter that no source of the run holds and a metric tells of, its value; none where nothing speaks.

    Args:
        reference: the configuration that the run is judged against, with what it met.
    """
    lacking = [option for option in schema.options if option.name not in run.config]
    if not lacking or len(lacking) > MOST * len(schema.options):
        return {}
    config = {**reference, **run.config}
    found: dict[str, tuple[float, Implied]] = {}
    for far, one in _spoken_for(run, schema, model, config, lacking):
        if one.option.name not in found or far > found[one.option.name][0]:
            found[one.option.name] = far, one
    return {name: one for name, (_, one) in found.items()}


def _spoken_for(
    run: Run, schema: Schema, model: Model, config: Mapping[str, float], lacking: Collection[Variable]
) -> Iterator[tuple[float, Implied]]:
    """How far each metric is off, with the one parameter that brings it back."""
    for name, mechanism in model.mechanisms.items():
        metric, seen = schema.variables.get(name), run.metrics.get(name)
        if metric is None or mechanism.binary or not is_known(seen) or seen <= LEAST[mechanism.transform]:
            continue
        off = _off(mechanism, seen, [config])[0]
        if abs(off) <= FAR:
            continue
        acting = [o for o in lacking if (o.name, name) in schema.known or o.name in model.graph.parents(name)]
        tried = [(option, value) for option in acting for value in _values(option)]
        if not tried:
            continue
        left = np.abs(_off(mechanism, seen, [{**config, option.name: value} for option, value in tried]))
        best = {option.name: (option, value) for (option, value), z in zip(tried, left, strict=True) if z <= NEAR}
        if len(best) == 1:
            ((option, _),) = best.values()
            of_it = [i for i, (one, _) in enumerate(tried) if one is option]
            value = tried[min(of_it, key=lambda i: float(left[i]))][1]
            expected = float(mechanism.expected(columns([config], mechanism.inputs))[0])
            yield float(abs(off)), Implied(option, value, metric, seen, expected)


def _off(mechanism: Mechanism, seen: float, configs: Sequence[Mapping[str, float]]) -> Floats:
    """How far a value is from what each configuration gives, in standard deviations of single runs; shape (m,)."""
    x = columns(configs, mechanism.inputs)
    there = mechanism.posterior(x)
    value = float(transformed(np.array([seen]), mechanism.transform)[0])
    return np.asarray((value - there.latent) / np.sqrt(there.variance + mechanism.noise_at(x) ** 2))


def _values(option: Variable) -> list[float]:
    """Values over the acceptable range: steps of a ratio where that is how changes are judged."""
    if option.labels:
        return [code for code, _ in option.labels]
    if option.range is None:
        return []
    low, high = option.range
    steps = np.geomspace(low, high, STEPS) if option.is_log_scaled else np.linspace(low, high, STEPS)
    return [option.snap(float(value)) for value in steps]
