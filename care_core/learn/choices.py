"""Did operators choose options for reasons that no column holds? Asked of observational tables only.

An option that was chosen by something that also moves the mission is confounded with what it seems to do. The reason
itself is not seen, but it rarely sways one option alone: options that depend on each other, beyond what the contexts
explain, were chosen for a common reason that is not in the table.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd

from care_core.learn.regression import features
from care_core.learn.screening import bin_numbers, dependence, discoveries
from care_core.learn.table import normal_scores
from care_core.numbers import Floats
from care_core.profile.schema import Schema

RATE = 0.01
"""False discovery rate over all pairs of options."""


def chosen_together(frame: pd.DataFrame, schema: Schema, options: Sequence[str]) -> dict[str, str]:
    """Options that depend on another option given all contexts -> the option that each depends on most.

    Empty for a table of randomised options. A lone option that was chosen for a hidden reason is not found this way.
    """
    if not schema.observational or len(options) < 2:
        return {}
    met = np.column_stack([np.ones(len(frame)), *(_flexible(frame[c.name].to_numpy(float)) for c in schema.contexts)])
    chosen = normal_scores(frame[list(options)].to_numpy(dtype=float))
    left = chosen - met @ np.linalg.lstsq(met, chosen, rcond=None)[0]
    p = dependence(left, left)
    np.fill_diagonal(p, 1.0)
    found = discoveries(p, RATE)
    return {option: options[int(p[i].argmin())] for i, option in enumerate(options) if found[i].any()}


def _flexible(values: Floats) -> Floats:
    """A context as columns that let a choice follow it in any way: scores, magnitude, gaps, and steps."""
    bins = bin_numbers(normal_scores(values))
    return np.column_stack([features(values), *((bins == level).astype(float) for level in np.unique(bins)[1:])])
