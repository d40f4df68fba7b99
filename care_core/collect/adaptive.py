"""Which configurations to drive next: where the objectives are known least, or where two suspects part.

The model is a Gaussian process an objective over the options' ranges (scikit-learn), since it knows its own ignorance
after few runs. What a run would tell is the information it gains about each objective, 1/2 log(1 + s^2/n^2) with the
variance s^2 of the mean and n^2 of the noise (MacKay 1992), summed over the objectives. Two suspects are told apart
where the model without the one and the model without the other predict most differently (Hunter and Reiner 1965).
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from care_core.collect.sampling import points
from care_core.collect.space import Config, Space
from care_core.errors import UsageError
from care_core.extras import install_hint
from care_core.numbers import Floats
from care_core.records import Record

CANDIDATES = 384
"""Configurations to choose from; each round draws new ones."""
LEAST_RUNS = 5
"""Known values of an objective below which nothing is made of it."""
MOST_RUNS = 400
"""Runs behind a model, the last ones: a Gaussian process over n runs costs n^3 time."""

_NEAR = 0.15
"""Share of the ranges of two suspects within which one run says what another says."""


class Known(Record, eq=False):
    """What earlier runs gave: their configurations, and per objective its values, NaN where a run has none."""

    configs: Sequence[Config]
    objectives: Mapping[str, Sequence[float]]


def choose(
    space: Space, known: Known, count: int, *, at_reference: float, seed: int, apart: tuple[str, str] | None = None
) -> list[dict[str, float]]:
    """The configurations to drive next, the most telling first.

    Args:
        at_reference: share of the options of a candidate that stay at their reference.
        apart: two options; None: whatever the objectives are known least for.

    Raises:
        UsageError: scikit-learn is not installed, or the limits leave too little to choose from.
    """
    candidates = points(space, "sobol", max(CANDIDATES, count), at_reference, seed)
    at = np.array([space.shares(config) for config in candidates])
    runs = np.array([space.shares(config) for config in known.configs]).reshape(-1, at.shape[1])
    objectives = [scored for _, values in sorted(known.objectives.items()) if (scored := _scores(values)) is not None]
    if not objectives:
        return candidates[:count]
    if apart is None:
        order = _least_known(runs, objectives, at, count)
    else:
        names = [axis.name for axis in space.axes]
        order = _parting(runs, objectives, at, count, (names.index(apart[0]), names.index(apart[1])))
    return [candidates[place] for place in order]


def _scores(values: Sequence[float]) -> Floats | None:
    """Values on a scale of ranks, which no heavy tail bends; None where nothing can be learned of them."""
    from care_core.learn.table import normal_scores

    scores = normal_scores(np.asarray(values, float))
    known = np.isfinite(scores)
    return scores if known.sum() >= LEAST_RUNS and np.ptp(scores[known]) > 0 else None


def _least_known(runs: Floats, objectives: Sequence[Floats], at: Floats, count: int) -> list[int]:
    """Places of candidates, one after the other: each chosen run is reckoned with, whatever it will give."""
    models = [_fitted(runs, scores) for scores in objectives]
    covariances = [model.covariance(at) for model in models]
    chosen: list[int] = []
    for _ in range(count):
        gain = np.zeros(len(at))
        for model, covariance in zip(models, covariances, strict=True):
            gain += 0.5 * np.log1p(np.maximum(np.diag(covariance), 0.0) / model.noise)
        gain[chosen] = -np.inf
        best = int(gain.argmax())
        chosen.append(best)
        for model, covariance in zip(models, covariances, strict=True):
            column = covariance[:, best].copy()
            np.subtract(covariance, np.outer(column, column) / (column[best] + model.noise), out=covariance)
    return chosen


def _parting(
    runs: Floats, objectives: Sequence[Floats], at: Floats, count: int, suspects: tuple[int, int]
) -> list[int]:
    parted = np.zeros(len(at))
    for scores in objectives:
        (a, a_variance), (b, b_variance) = (_without(runs, scores, at, suspect) for suspect in suspects)
        parted += (a - b) ** 2 / (1.0 + a_variance + b_variance)
    chosen: list[int] = []
    own = at[:, list(suspects)]
    weight = np.ones(len(at))
    for _ in range(count):
        best = int(np.where(weight > 0, parted * weight, -np.inf).argmax())
        chosen.append(best)
        weight *= 1 - np.exp(-0.5 * (np.linalg.norm(own - own[best], axis=1) / _NEAR) ** 2)
        weight[chosen] = 0.0
    return chosen


def _without(runs: Floats, scores: Floats, at: Floats, suspect: int) -> tuple[Floats, Floats]:
    """Mean and variance of an objective at the candidates by a model that cannot see one option."""
    seen = [place for place in range(runs.shape[1]) if place != suspect]
    model = _fitted(runs[:, seen], scores)
    covariance = model.covariance(at[:, seen])
    return model.mean(at[:, seen]), np.maximum(np.diag(covariance), 0.0)


class _Process(Record, eq=False):
    """A fitted Gaussian process; `noise` is its variance on the scale of the scores."""

    regressor: Any
    noise: float

    def mean(self, at: Floats) -> Floats:
        return np.asarray(self.regressor.predict(at))

    def covariance(self, at: Floats) -> Floats:
        """Of the mean at these places, without noise, shape (n, n)."""
        covariance = np.array(self.regressor.predict(at, return_cov=True)[1])
        return covariance - np.eye(len(at)) * self.noise


def _fitted(runs: Floats, scores: Floats) -> _Process:
    """A length an option, so that those which nothing depends on drop out."""
    try:
        from sklearn.exceptions import ConvergenceWarning
        from sklearn.gaussian_process import GaussianProcessRegressor
        from sklearn.gaussian_process.kernels import ConstantKernel, Matern, WhiteKernel
    except ModuleNotFoundError as err:
        message = f"Adaptive sampling needs {err.name}, which is not installed."
        raise UsageError(message, hint=f"{install_hint('learn')}.") from err
    known = np.flatnonzero(np.isfinite(scores))[-MOST_RUNS:]
    lengths = np.full(runs.shape[1], 1.0)
    kernel = ConstantKernel(1.0, (0.05, 20.0)) * Matern(lengths, (0.1, 30.0), nu=2.5) + WhiteKernel(0.3, (0.01, 2.0))
    regressor = GaussianProcessRegressor(kernel, random_state=0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # a length at its bound is what is wanted
        regressor.fit(runs[known], scores[known])
    return _Process(regressor, float(regressor.kernel_.k2.noise_level))
