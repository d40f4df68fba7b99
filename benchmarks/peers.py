"""What the causal engine is measured against: rankings of a run's options that use no graph and cannot say why.

Each takes the same training table and the same run.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from sklearn.ensemble import ExtraTreesClassifier, GradientBoostingClassifier

from care_core.causal.mechanisms import columns
from care_core.learn.skill import all_met
from care_core.numbers import Bools, Floats
from care_core.profile.schema import Schema

Config = Mapping[str, float]
TREES = 400


def largest_deviation(config: Config, reference: Config, schema: Schema, suspects: Sequence[str]) -> list[str]:
    """Options by how far they are from the reference, as a share of their acceptable range."""
    distance = {name: schema.variables[name].distance(config[name], reference[name]) for name in suspects}
    return sorted(suspects, key=lambda name: (-distance[name], name))


class PlainClassifier:
    """Extremely randomised trees averaged with gradient boosting, on options alone: probability of meeting
    everything."""

    def __init__(self, frame: pd.DataFrame, met_all: Bools, options: Sequence[str], seed: int = 0) -> None:
        self.options = list(options)
        x = frame[self.options].to_numpy(dtype=float)
        self._trees = ExtraTreesClassifier(TREES, min_samples_leaf=2, random_state=seed).fit(x, met_all)
        self._boosting = GradientBoostingClassifier(random_state=seed).fit(x, met_all)

    def probability(self, configs: Sequence[Config]) -> Floats:
        """Predicted probability that every objective keeps its threshold, shape (m,)."""
        x = columns([dict(c) for c in configs], self.options)
        mean: Floats = (self._trees.predict_proba(x)[:, 1] + self._boosting.predict_proba(x)[:, 1]) / 2
        return mean

    def rank(self, config: Config, reference: Config, suspects: Sequence[str]) -> list[str]:
        """Options by the probability of meeting everything when each alone goes back to its reference."""
        reached = self.probability([{**config, name: reference[name]} for name in suspects])
        return [suspects[i] for i in np.argsort(-reached, kind="stable")]


def classifier_of(frame: pd.DataFrame, schema: Schema) -> PlainClassifier:
    """The classifier of a training table that reads options and contexts."""
    filled = frame.fillna({v.name: frame[v.name].median() for v in schema.contexts})
    inputs = [v.name for v in (*schema.options, *schema.contexts)]
    return PlainClassifier(filled, all_met(frame, schema) == 1.0, inputs)
