"""The probability that every objective is met, as runs that were left out of training tell it.

Objectives are predicted one by one, and what is not known of one is partly what is not known of the next: a mission
that is kept in one way is more often kept in all than the product of the single probabilities says, the more so the
more objectives there are.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from care_core.numbers import Floats, logistic, logit
from care_core.records import Record

_NEAREST = 0.002
"""No held-out probability counts as nearer than this to 0 or 1."""
_LEAST = 1e-12
_BELIEVED = np.array([0.0, 1.0])
_DOUBT = np.diag([1.0, 4.0])
"""Offset and slope that are believed without runs, and how firmly (precision)."""
_STEPS, _NO_STEP = 50, 1e-9


class AllObjectives(Record):
    """Platt's logistic (1999) of the logit of the product of the single probabilities, as far as runs show it."""

    offset: float = 0.0
    slope: float = 1.0
    best: float = 0.0
    """Share that met everything where most did: nothing more is made of a smaller product."""

    @classmethod
    def of(cls, curve: Sequence[tuple[float, float, int]]) -> AllObjectives:
        """Fit to held-out runs: rows of the mean predicted probability, the share that met everything, and the runs."""
        if not curve:
            return cls()
        predicted, share, runs = np.array(curve, dtype=float).T
        x = np.column_stack([np.ones(len(curve)), logit(predicted, _NEAREST)])

        def loss(theta: Floats) -> float:
            odds, off = x @ theta, theta - _BELIEVED
            return float((runs * (np.logaddexp(0.0, odds) - share * odds)).sum() + 0.5 * off @ _DOUBT @ off)

        theta, least = _BELIEVED, loss(_BELIEVED)
        for _ in range(_STEPS):
            p = logistic(x @ theta)
            gradient = x.T @ (runs * (share - p)) - _DOUBT @ (theta - _BELIEVED)
            step = np.linalg.solve((x.T * (runs * p * (1 - p))) @ x + _DOUBT, gradient)
            # A whole Newton step leads away from the best where the curve is flat.
            while (now := loss(theta + step)) > least and np.abs(step).max() > _NO_STEP:
                step = step / 2
            if now >= least:
                break
            theta, least = theta + step, now
        best = float(((runs * share + 0.5) / (runs + 1.0)).max())
        return cls(float(theta[0]), max(float(theta[1]), 0.0), best)

    def of_product(self, product: Floats) -> Floats:
        """Probability that everything is met, for products of the single probabilities of any shape."""
        return np.minimum(logistic(self.offset + self.slope * logit(product, _LEAST)), np.maximum(product, self.best))
