"""How strong would a hidden cause have to be to explain an effect away? Asked where operators chose the options.

The robustness value (Cinelli and Hazlett 2020, Eq. 18) of a linear regression on normal scores: the share of what is
left of both the option and the objective, given all other options and contexts, that a hidden cause of both must
explain to bring the effect to zero. No table can tell whether there is such a cause; beside it stands the share that
the strongest recorded one explains.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd

from care_core.learn.fitting import MIN_ROWS
from care_core.learn.outcomes import badness
from care_core.learn.table import normal_scores, varying
from care_core.numbers import Floats
from care_core.profile.schema import Schema
from care_core.records import Record


class Robustness(Record):
    """`value`: share of both that a hidden cause must explain. `strongest`: share of the objective that any other
    recorded option or context explains."""

    value: float
    strongest: float


def robustness(frame: pd.DataFrame, schema: Schema, objective: str) -> Mapping[str, Robustness]:
    """Per option that varies; empty where the table is randomised or says too little of the objective."""
    names = list(varying(frame, [v.name for v in (*schema.options, *schema.contexts)]))
    y = badness(schema.variables[objective], frame, schema)
    known = np.isfinite(y) & frame[names].notna().all(axis=1).to_numpy()
    freedom = int(known.sum()) - len(names) - 1
    if not schema.observational or freedom < MIN_ROWS or np.ptp(y[known]) == 0:
        return {}
    explained = dict(zip(names, _partial(normal_scores(frame.loc[known, names]), normal_scores(y[known])), strict=True))
    options = {option.name for option in schema.options}
    return {
        name: Robustness(_value(share), max((s for other, s in explained.items() if other != name), default=0.0))
        for name, share in explained.items()
        if name in options
    }


def _partial(x: Floats, y: Floats) -> Floats:
    """Squared partial correlation of each column with y given all the others, shape (p,)."""
    joint = np.column_stack([x, y])
    precision = np.linalg.pinv(np.cov(joint, rowvar=False))
    scale = np.maximum(np.diag(precision), 1e-12)
    share: Floats = np.clip(precision[:-1, -1] ** 2 / (scale[:-1] * scale[-1]), 0.0, 1 - 1e-9)
    return share


def _value(share: float) -> float:
    f2 = share / (1.0 - share)
    return float((np.sqrt(f2**2 + 4 * f2) - f2) / 2)
