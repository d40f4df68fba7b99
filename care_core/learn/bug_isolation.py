"""Cooperative bug isolation (Liblit et al. 2005): options of a run ranked by statistics of predicates, with no graph.

Names a cause as a knowledge source that owes nothing to the causal model, and cannot say why.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from care_core.numbers import Bools, Floats
from care_core.profile.schema import Schema
from care_core.records import Record
from care_core.variables import Variable

Config = Mapping[str, float]
BINS = 4
Z95 = 1.959964


class Predicate(Record):
    """ "Option within [low, high]": what cooperative bug isolation counts."""

    low: float
    high: float

    def holds(self, values: Floats) -> Bools:
        return (values >= self.low) & (values <= self.high)


def cooperative_bug_isolation(
    frame: pd.DataFrame, failed: Bools, config: Config, schema: Schema, suspects: Sequence[str]
) -> dict[str, float]:
    """Options with the Importance of the predicate that holds in this run (Liblit et al. 2005, section 3), best first.

    Predicates are the quantile bins of an option's training values (its reference a bin of its own). A predicate
    whose Increase is not above 0 with 95% confidence has no importance.
    """
    scores = {
        name: _importance(_predicate_of(frame, config[name], schema.variables[name]), frame[name].to_numpy(), failed)
        for name in suspects
    }
    return {name: scores[name] for name in sorted(suspects, key=lambda name: (-scores[name], name))}


def _predicate_of(frame: pd.DataFrame, value: float, option: Variable) -> Predicate:
    values = frame[option.name].to_numpy(dtype=float)
    if option.default is not None and value == option.default:
        return Predicate(value, value)
    off = values[values != option.default] if option.default is not None else values
    edges = np.quantile(off, np.linspace(0, 1, BINS + 1)) if len(off) else np.array([value, value])
    k = int(np.clip(np.searchsorted(edges, value, side="right") - 1, 0, len(edges) - 2))
    return Predicate(float(edges[k]), float(edges[k + 1]))


def _importance(predicate: Predicate, values: Floats, failed: Bools) -> float:
    true = predicate.holds(values)
    seen_failed, seen = int((true & failed).sum()), int(true.sum())
    if not seen_failed or not failed.any():
        return 0.0
    failure, context = seen_failed / seen, float(failed.mean())
    increase = failure - context
    error = np.sqrt(failure * (1 - failure) / seen + context * (1 - context) / len(failed))
    if increase - Z95 * error <= 0:
        return 0.0
    reach = np.log(seen_failed) / np.log(max(int(failed.sum()), 2))
    return 0.0 if reach <= 0 else float(2 / (1 / increase + 1 / reach))
