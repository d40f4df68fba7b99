"""What metrics carry of an objective's error, estimated from no more runs than tell it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from care_core.causal.kernel import Kernel
from care_core.learn import mediation
from care_core.learn.fitting import Effort, left_out
from care_core.learn.outcomes import fit_outcomes, fit_total
from care_core.numbers import Floats
from tests.simulated import simulate

QUICK = Effort(points=150, iterations=10)


def test_many_runs_tell_what_some_of_them_tell(monkeypatch: pytest.MonkeyPatch) -> None:
    frame, schema, graph = simulate(600, np.random.default_rng(0), options=3, inert=0, metrics=2)
    rng = np.random.default_rng(0)
    outcomes, mechanisms = fit_outcomes(frame, schema, graph, rng, effort=QUICK)
    for metric in schema.metrics:
        found = fit_total(metric.name, frame, schema, graph, rng, effort=QUICK)
        assert found is not None
        mechanisms[metric.name] = found
    sizes: list[int] = []

    def counted(kernel: Kernel, points: Floats, *others: Any) -> object:
        sizes.append(len(points))
        return left_out(kernel, points, *others)

    monkeypatch.setattr(mediation, "left_out", counted)
    (whole,) = mediation.with_mediation(outcomes, mechanisms, graph, frame, schema).values()
    assert set(sizes) == {600}
    monkeypatch.setattr(mediation, "MOST_RUNS", 300)
    (part,) = mediation.with_mediation(outcomes, mechanisms, graph, frame, schema).values()
    assert set(sizes) == {600, 300}
    assert whole.mediation is not None
    assert part.mediation is not None
    assert part.mediation.metrics == whole.mediation.metrics
    assert part.mediation.weights == pytest.approx(whole.mediation.weights, abs=0.2)
