"""One-sided tolerance limits: what 95% of all runs stay below, as far as a few of them can tell.

A limit has a content (the share of runs that keep it) and a confidence (how often the method is right about that). The
interval is that of the 95% quantile itself, and its far end the limit: the 95/95 limit that acceptance tests use.
Sources: Hahn and Meeker, Statistical Intervals (1991), sections 4.6 (normal, by the noncentral t distribution) and 5.3
(distribution-free, by order statistics; Wilks 1941); NIST/SEMATECH e-Handbook, section 7.2.6.3.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache
from statistics import NormalDist

import numpy as np

from care_core.records import Record

CONTENT, CONFIDENCE = 0.95, 0.95
FEW = 5
"""Fewer runs hardly tell how much runs differ (the factor of three is 7.7): a known spread stands in for theirs."""
MANY = math.ceil(math.log(1 - CONFIDENCE) / math.log(CONTENT))
"""From 59 runs on the largest of them is a 95/95 limit, whatever their distribution."""
_STEPS, _HALVINGS = 400, 60


class Quantile(Record):
    """The 95% quantile of all runs: an interval that holds it with 90%, whose upper end is the tolerance limit."""

    low: float
    high: float
    method: str


def upper_quantile(values: Sequence[float], known_spread: float | None = None) -> Quantile | None:
    """What 95% of all runs like these stay below; None where so few do not tell and no spread is known.

    Args:
        values: one a run, on a scale where runs differ about as a normal distribution.
        known_spread: standard deviation of one run around another of its configuration, known from elsewhere. Runs of
            one day differ less than those of a year, so theirs is never taken to be smaller.
    """
    count = len(values)
    if count >= MANY:
        return _by_order(sorted(values))
    own = float(np.std(values, ddof=1)) if count > 1 else 0.0
    centre, spread = float(np.mean(values)), max(own, known_spread or 0.0)
    if count < FEW:
        if known_spread is None:
            return None
        low, high = (factor(count, None, share) for share in (1 - CONFIDENCE, CONFIDENCE))
        method = "normal, with the spread of the profile's training runs"
    else:
        low, high = (factor(count, count - 1, share) for share in (1 - CONFIDENCE, CONFIDENCE))
        method = "normal"
    return Quantile(centre + low * spread, centre + high * spread, method)


@cache
def factor(count: int, degrees: int | None, confidence: float) -> float:
    """k, so that mean + k spread lies above the 95% quantile with this probability.

    Args:
        count: runs of the mean. degrees: of freedom of the spread, None where it is known exactly.
    """
    z = NormalDist().inv_cdf(CONTENT)
    if degrees is None:
        return z + NormalDist().inv_cdf(confidence) / math.sqrt(count)
    # Probability of mean + k s > mu + z sigma, over the distribution of u = s / sigma (chi by its degrees).
    u = (np.arange(_STEPS) + 0.5) / _STEPS * (1 + 9 / math.sqrt(degrees))
    log_density = (degrees - 1) * np.log(u) - degrees * u**2 / 2
    weights = np.exp(log_density - log_density.max())
    weights /= weights.sum()
    low, high = -100.0, 1000.0
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        arguments = (math.sqrt(count / 2) * (middle * u - z)).tolist()
        above = float(weights @ [(1 + math.erf(a)) / 2 for a in arguments])
        low, high = (middle, high) if above < confidence else (low, middle)
    return (low + high) / 2


def _by_order(values: Sequence[float]) -> Quantile:
    """The runs' own ranks: the quantile lies above the r-th of n where fewer than r of n draws fall below it."""
    count = len(values)
    below = np.cumsum([_binomial(count, r) for r in range(count + 1)])  # below[r]: at most r runs under the quantile
    high = next(rank for rank in range(1, count + 1) if below[rank - 1] >= CONFIDENCE)
    low = max((rank for rank in range(1, count + 1) if below[rank - 1] <= 1 - CONFIDENCE), default=1)
    return Quantile(values[low - 1], values[high - 1], "distribution-free")


def _binomial(count: int, successes: int) -> float:
    logs = (
        math.lgamma(count + 1) - math.lgamma(successes + 1) - math.lgamma(count - successes + 1)
        + successes * math.log(CONTENT) + (count - successes) * math.log(1 - CONTENT)
    )  # fmt: skip
    return math.exp(logs)
