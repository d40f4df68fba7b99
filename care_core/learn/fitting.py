"""Fitting mechanisms: Gaussian processes whose input relevances are learned under a sparse prior.

Marginal likelihood (Rasmussen and Williams 2006, Eq. 5.8) with a log-Cauchy-like penalty on every relevance, so
an input that explains nothing ends near zero and costs nothing, which is what makes few missions suffice.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotrf, dpotri, dpotrs
from scipy.optimize import minimize

from care_core.causal.kernel import Kernel
from care_core.causal.mechanisms import JITTER, Mechanism, Transform, solve, transformed
from care_core.causal.nominal import Nominal
from care_core.errors import LearningError
from care_core.numbers import Bools, Floats
from care_core.records import Record, replace


class Effort(Record):
    """How hard to fit: training rows a mechanism keeps (more are thinned at random: a kernel over n rows costs n^2
    memory and n^3 time) and steps of the optimiser."""

    points: int
    iterations: int
    folds: int = 0
    """Parts of the runs that are left out in turn to learn how far off a mechanism is on what it never saw."""


OUTCOME = Effort(points=600, iterations=60, folds=5)
"""For objectives: probabilities and fixes rest on them."""
METRIC = Effort(points=300, iterations=30)
"""For metrics and edges: they draw the path and size its edges."""
RELEVANCE_SCALE = 0.1
"""Relevance below which an input counts as unused in the penalty."""
UNUSED = 0.02
"""An input is left out where one standard deviation of it moves the target by less, in standard deviations, but not
among few runs: what they hardly show they have not ruled out."""
WEAK = 0.2
"""Least relevance of any option where runs are few: the slope it may have before runs show one."""
NOISE, BINARY_NOISE = 0.02, 0.3
"""Least noise, as a share of the target's standard deviation. Yes-or-no outcomes near a limit go either way: a
regression that reproduces every one of them has learned them by heart."""
RESIDUAL_LEVELS = 101
CACHED = 65_536
"""Numbers that fitting works on at a time, which then stay in the processor's cache."""
MIN_ROWS = 20
FARTHEST = 4.0
"""Standard deviations that a run is off at most where sets of inputs are compared: one of them decides nothing."""
MANY_RUNS = 1000
"""From so many runs on folds begin where all runs led, for a fifth of the runs moves little. Of fewer, runs left out
have a hand in that: of 196 missions of rovers intervals of 80% held 71% and not 76%."""


Rows = NDArray[np.int64] | slice


class Fold(NamedTuple):
    """Runs that are left out, shape (n,), and which of the others a fit keeps."""

    out: Bools
    kept: Rows


class Fitted(Record, eq=False):
    """A mechanism, and how badly it predicts runs that it does not know: mean negative log likelihood."""

    mechanism: Mechanism
    loss: float


class Inputs(Record):
    """What a mechanism may depend on: names, which of them act as ratios, and which the regression may read; the
    others are arguments of the nominal only. Arrays have shape (len(names),)."""

    names: tuple[str, ...]
    log: Bools
    read: Bools
    nominal: Nominal | None = None
    """What physics says of a positive target; its arguments are among the names."""
    least: float = 0.0
    """No relevance ends below it; where it is above 0 no input is left out, however little it moves."""

    @classmethod
    def all_read(cls, names: Sequence[str], log: Bools) -> Inputs:
        return cls(tuple(names), log, np.ones(len(names), dtype=bool))


def fit_mechanism(
    x: Floats,
    y: Floats,
    inputs: Inputs,
    *,
    binary: bool,
    rng: np.random.Generator,
    effort: Effort = OUTCOME,
    transform: Transform | None = None,
) -> Mechanism:
    """The mechanism of `fit` on as many runs as it keeps, each a mission of its own, for a target without a nominal."""
    kept = drawn(len(y), effort, rng)
    return fit(x[kept], y[kept], inputs, binary=binary, effort=effort, transform=transform).mechanism


def fit(
    x: Floats,
    y: Floats,
    inputs: Inputs,
    *,
    binary: bool,
    effort: Effort = OUTCOME,
    transform: Transform | None = None,
    groups: NDArray[np.int64] | None = None,
    start: Kernel | None = None,
) -> Fitted:
    """Fit one mechanism.

    Args:
        x: shape (n, p), inputs in their own units. y: shape (n,), 0 or 1 when `binary`. No NaN. All n are kept: see
            `drawn`.
        transform: the scale of the target, `best_transform` when None.
        groups: shape (n,), runs that are left out together have one number (`relative.left_out_together`). Errors are
            those of a model that knows no run of the same number; each run is its own when None.
        start: where the search for a kernel begins, of the inputs that are read; in the middle of all when None.

    Raises:
        LearningError: too few rows.
    """
    if len(y) < MIN_ROWS:
        raise LearningError(f"A mechanism needs {MIN_ROWS} runs, the table has {len(y)}.", hint="Record more missions.")
    transform, coded = _coded(x, y, inputs, transform, binary=binary)
    reads = np.flatnonzero(inputs.read)
    log, seen = inputs.log[reads], x[:, reads]
    raw = np.where(log, np.log(np.where(log, np.maximum(seen, 1e-12), 1.0)), seen)
    centre, sd = raw.mean(axis=0), raw.std(axis=0)
    sd = np.where(sd > 0, sd, 1.0)
    points = ((raw - centre) / sd).astype(np.float32).astype(float)
    mean, scale = float(coded.mean()), float(coded.std()) or 1.0
    targets = ((coded - mean) / scale).astype(np.float32).astype(float)
    kernel = _fit_kernel(points, targets, effort.iterations, BINARY_NOISE if binary else NOISE, inputs.least, start)
    used = (slopes(kernel) > UNUSED) | (inputs.least > 0)
    kernel = replace(kernel, relevance=kernel.relevance[used], idle=int((~used).sum()))
    points = points[:, used]
    errors, error_sd = left_out(kernel, points, targets, groups)
    calibration = logistic(mean + scale * (targets - errors), y) if binary else residual_levels(errors / error_sd)
    mechanism = Mechanism(
        inputs=inputs.names,
        reads=reads[used],
        nominal=inputs.nominal,
        log_inputs=log[used],
        centre=centre[used],
        sd=sd[used],
        kernel=kernel,
        points=points,
        targets=targets,
        weights=solve(kernel, points, targets),
        mean=mean,
        scale=scale,
        transform=transform,
        binary=binary,
        calibration=calibration,
    )
    return Fitted(mechanism, _loss(mechanism, errors, error_sd))


def _coded(
    x: Floats, y: Floats, inputs: Inputs, transform: Transform | None, *, binary: bool
) -> tuple[Transform, Floats]:
    """The scale of a target, and the target on it: of a formula's mechanism what the formula leaves."""
    nominal = inputs.nominal
    if nominal is not None:
        transform = "log"
    transform = "identity" if binary else transform or best_transform(y)
    coded = 2.0 * y - 1.0 if binary else transformed(y, transform)
    if nominal is not None:
        coded = coded - np.log(nominal.of(x[:, [inputs.names.index(name) for name in nominal.inputs]]))
    return transform, coded


def drawn(n: int, effort: Effort, rng: np.random.Generator) -> Rows:
    """The rows that a fit keeps of n."""
    return slice(None) if n <= effort.points else np.sort(rng.choice(n, effort.points, replace=False))


def drawn_folds(groups: NDArray[np.int64], effort: Effort, rng: np.random.Generator) -> tuple[Fold, ...]:
    """Which runs are left out in turn, those of one number together; none where there are too few.

    Args:
        groups: as for `fit`.
    """
    numbers, place = np.unique(groups, return_inverse=True)
    if effort.folds < 2 or len(numbers) < 2 * effort.folds:
        return ()
    fold = (rng.permutation(len(numbers)) % effort.folds)[place.ravel()]
    if len(groups) - np.bincount(fold).max() < MIN_ROWS:
        return ()
    out = [fold == k for k in range(effort.folds)]
    return tuple(Fold(own, drawn(int((~own).sum()), effort, rng)) for own in out)


def _without_each(
    folds: Sequence[Fold], x: Floats, y: Floats, groups: NDArray[np.int64], refit: Callable[..., Fitted]
) -> Iterator[tuple[Bools, Mechanism]]:
    """The runs of each fold in turn, and the mechanism of those of the others that a fit keeps."""
    for out, kept in folds:
        yield out, refit(x[~out][kept], y[~out][kept], groups=groups[~out][kept]).mechanism


def tested_on_runs_left_out(
    mechanism: Mechanism,
    x: Floats,
    y: Floats,
    inputs: Inputs,
    *,
    effort: Effort,
    groups: NDArray[np.int64],
    folds: Sequence[Fold],
) -> Mechanism:
    """The mechanism with the errors of mechanisms that were fitted without the runs they are tested on.

    `left_out` keeps the relevances and the noise that all runs together chose, which flatters: intervals of 80% held
    72% of the times of missions that are new altogether, and 59% of those of new configurations in a campaign of 191
    flights of one mission; these hold 74% there. Cross-conformal levels (Vovk 2015; Barber et al. 2021, CV+) hold what
    they promise as far as the next run is one like these.

    Args:
        x, y, inputs, groups: of all runs, as for `fit`; `mechanism` is what it made of those that it keeps.
        folds: of `drawn_folds`. Without any the mechanism stays as it is.
    """
    if not folds:
        return mechanism
    read = np.zeros(len(inputs.names), dtype=bool)
    read[mechanism.reads] = True
    start, again = None, effort
    if len(y) >= MANY_RUNS:  # half the steps from there end as near to the best as all from the middle would
        start, again = mechanism.kernel, replace(effort, iterations=effort.iterations // 2)
    errors = np.empty(len(y))
    refit = partial(
        fit, inputs=replace(inputs, read=read), binary=False, effort=again, transform=mechanism.transform, start=start
    )
    for out, others in _without_each(folds, x, y, groups, refit):
        sd = np.sqrt(others.latent_sd(x[out]) ** 2 + others.noise_sd**2)
        errors[out] = (transformed(y[out], mechanism.transform) - others.latent(x[out])) / sd
    return replace(mechanism, calibration=residual_levels(errors))


class Held(Record, eq=False):
    """What mechanisms that did not know a run said of it, on the transformed scale; and how badly: its negative log
    likelihood, that of one `FARTHEST` standard deviations off at most. Both of shape (n,)."""

    latent: Floats
    loss: Floats


def held_out(
    x: Floats, y: Floats, inputs: Inputs, *, binary: bool, effort: Effort, groups: NDArray[np.int64],
    folds: Sequence[Fold],
) -> Held:  # fmt: skip
    """Fit without each fold in turn, and ask about the runs in it. Half of the steps are as good here: what is compared
    is which inputs carry over to runs that no fit has seen.

    Args:
        x, y, inputs, groups: of all runs, as for `fit`. folds: at least one.
    """
    again = replace(effort, iterations=effort.iterations // 2)
    latent, loss = np.empty(len(y)), np.empty(len(y))
    refit = partial(fit, inputs=inputs, binary=binary, effort=again)
    for out, mechanism in _without_each(folds, x, y, groups, refit):
        there = mechanism.posterior(x[out])
        latent[out] = there.latent
        if binary:
            p = mechanism.probability_of(there.latent)
            loss[out] = -np.log(np.where(y[out] > 0.5, p, 1 - p))
        else:
            sd = np.sqrt(there.variance + mechanism.noise_at(x[out]) ** 2)
            error = np.abs(transformed(y[out], mechanism.transform) - there.latent) / sd
            loss[out] = np.log(sd) + 0.5 * np.minimum(error, FARTHEST) ** 2
    return Held(latent, loss)


def _loss(mechanism: Mechanism, errors: Floats, error_sd: Floats) -> float:
    """Mean negative log likelihood of the runs, each given those of other missions."""
    if not mechanism.binary:
        error_sd = mechanism.scale * error_sd
        return float((np.log(error_sd) + 0.5 * (mechanism.scale * errors / error_sd) ** 2).mean())
    slope, offset = mechanism.calibration
    coded = mechanism.mean + mechanism.scale * mechanism.targets
    logit = slope * (coded - mechanism.scale * errors) + offset
    return float(np.logaddexp(0, np.where(coded > 0, -logit, logit)).mean())


def best_transform(y: Floats) -> Transform:
    """The scale on which the target is least skewed: times and energies act as ratios, counts have heavy tails."""
    choices: list[Transform] = ["identity"]
    if (y > 0).all():
        choices.append("log")
    if (y >= 0).all():
        choices.append("log1p")
    return min(choices, key=lambda choice: abs(_skewness(transformed(y, choice))))


def _skewness(values: Floats) -> float:
    sd = values.std()
    return 0.0 if sd == 0 else float((((values - values.mean()) / sd) ** 3).mean())


def _fit_kernel(
    points: Floats, targets: Floats, iterations: int, least_noise: float, least: float, start: Kernel | None
) -> Kernel:
    p = points.shape[1]
    if p == 0 or np.ptp(targets) == 0:
        return Kernel(np.zeros(p), 0.0, 0.0, 1.0)
    begin = np.r_[np.full(p, 0.3), 1.0, 1.0, 0.5]
    if start is not None:
        begin = np.maximum(np.r_[start.relevance, start.additive, start.joint, start.noise], 1e-9)
    bounds = [(max(-6.0, np.log(max(least, 1e-9))), 2.0)] * p + [(-4.0, 3.0)] * 2 + [(np.log(least_noise), 1.0)]
    best = minimize(
        _Posterior(points, targets),
        np.log(begin),
        jac=True,
        method="L-BFGS-B",
        bounds=bounds,
        options={"maxiter": iterations},
    )
    theta = np.exp(best.x)
    return Kernel(theta[:p], float(theta[p]), float(theta[p + 1]), float(theta[p + 2]))


def slopes(kernel: Kernel) -> Floats:
    """What one standard deviation of each input moves the target by, as the kernel expects it before any run, shape
    (p,). A relevance alone does not say: with a large amplitude a small one is a straight line."""
    p = max(1, len(kernel.relevance))
    slopes: Floats = np.hypot(kernel.additive / np.sqrt(p), kernel.joint) * kernel.relevance
    return slopes


@lru_cache(maxsize=2)
def _below(n: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows and columns of the places below the diagonal of a matrix of n rows."""
    return np.tril_indices(n, -1)


def _pairs(points: Floats) -> Floats:
    """Squared distance of every pair of points by input, shape (p, n (n - 1) / 2): what is left of a symmetric matrix,
    in the order of its rows below the diagonal."""
    rows, others = _below(len(points))
    squared = np.empty((points.shape[1], len(rows)))
    for column, distances in zip(points.T, squared, strict=True):
        np.subtract(column[rows], column[others], out=distances)
    return np.multiply(squared, squared, out=squared)


class _Posterior:
    """The negative logarithm of the posterior of a kernel, to be minimised.

    It keeps the memory that it works in: an optimiser asks a hundred times, and pages that are new each time cost more
    than all sums.
    """

    def __init__(self, points: Floats, targets: Floats) -> None:
        self._targets = targets
        self._squared = squared = _pairs(points)
        n, pairs = len(targets), squared.shape[1]
        self._rows, self._others = _below(n)
        # Columns of LAPACK lie one behind the other.
        self._matrix = np.empty(n * n)
        self._places = self._others * n + self._rows
        self._together, self._mean, self._one, self._other = np.empty((4, pairs))
        self._leaning = np.empty_like(squared)
        self._part = np.empty((len(squared), max(1, CACHED // len(squared))))

    def __call__(self, log_theta: Floats) -> tuple[float, Floats]:
        """Value and gradient with respect to the logarithms of (relevances, additive, joint, noise)."""
        targets, p = self._targets, len(self._squared)
        relevance, (additive, joint, noise) = np.exp(log_theta[:p]), np.exp(log_theta[p:])
        self._measure(relevance)
        chol, failed = dpotrf(self._covariance(additive, joint, noise), lower=1, clean=0, overwrite_a=1)
        if failed:
            return 1e10, np.zeros_like(log_theta)
        alpha, _ = dpotrs(chol, targets, lower=1)
        value = 0.5 * targets @ alpha + np.log(np.diag(chol)).sum()
        inverse, _ = dpotri(chol, lower=1, overwrite_c=1)  # below the diagonal, in place of the factor
        trace = 0.5 * float(np.trace(inverse) - alpha @ alpha)
        acting, with_others = self._sensitivities(inverse, alpha, additive**2 / p, joint**2)
        pull = relevance**2 * (self._squared @ with_others + self._leaning @ acting)
        ratio = (relevance / RELEVANCE_SCALE) ** 2
        gradient = np.r_[
            -pull + 2 * ratio / (1 + ratio),
            2 * (p * float(acting @ self._mean) + additive**2 * trace),
            2 * (float(with_others.sum()) + joint**2 * trace),
            2 * noise**2 * trace,
        ]
        return float(value + np.log1p(ratio).sum()), gradient

    def _measure(self, relevance: Floats) -> None:
        """The joint part of the kernel of every pair, the mean over the inputs of its parts, and each part times its
        squared distance. So many pairs at a time stay in the processor's cache."""
        rate = -0.5 * (relevance**2)[:, None]
        p, width = self._part.shape
        for begin in range(0, len(self._mean), width):
            some = slice(begin, begin + width)
            squared = self._squared[:, some]
            part = np.multiply(squared, rate, out=self._part[:, : squared.shape[1]])
            part.sum(axis=0, out=self._together[some])
            np.exp(part, out=part).sum(axis=0, out=self._mean[some])
            np.multiply(part, squared, out=self._leaning[:, some])
        self._mean /= p
        np.exp(self._together, out=self._together)

    def _covariance(self, additive: float, joint: float, noise: float) -> Floats:
        """Of the runs, below the diagonal; a point and itself are at no distance."""
        n = len(self._targets)
        np.multiply(self._mean, additive**2, out=self._one)
        self._one += np.multiply(self._together, joint**2, out=self._other)
        self._matrix[self._places] = self._one
        self._matrix[:: n + 1] = additive**2 + joint**2 + noise**2 + JITTER
        return self._matrix.reshape(n, n, order="F")

    def _sensitivities(
        self, inverse: Floats, alpha: Floats, acting: float, with_others: float
    ) -> tuple[Floats, Floats]:
        """How the value answers to the two parts of each pair's kernel. Each pair stands for two places of the
        symmetric matrix."""
        one, other = self._one, self._other
        # No place is out of range; to say how such a one is handled saves a copy.
        np.take(alpha, self._rows, out=one, mode="clip")
        one *= np.take(alpha, self._others, out=other, mode="clip")
        np.take(inverse.ravel(order="K"), self._places, out=other, mode="clip")
        other -= one
        np.multiply(other, acting, out=one)
        other *= with_others
        other *= self._together
        return one, other


def left_out(
    kernel: Kernel, points: Floats, targets: Floats, groups: NDArray[np.int64] | None = None
) -> tuple[Floats, Floats]:
    """Errors of each run, predicted without its group, and their predicted standard deviations; shape (n,) each.

    Rasmussen and Williams 2006, Eq. 5.12, with blocks of the inverse in place of its diagonal.
    """
    covariance = kernel.among(points) + np.eye(len(points)) * (kernel.noise**2 + JITTER)
    inverse = np.linalg.inv(covariance)
    weights = inverse @ targets
    if groups is None or len(np.unique(groups)) == len(groups):
        of_one = 1.0 / np.diag(inverse)
        return of_one * weights, np.sqrt(of_one)
    errors, error_sd = np.empty(len(targets)), np.empty(len(targets))
    for group in np.unique(groups):
        own = np.flatnonzero(groups == group)
        block = np.linalg.inv(inverse[np.ix_(own, own)])
        errors[own], error_sd[own] = block @ weights[own], np.sqrt(np.diag(block))
    return errors, error_sd


def residual_levels(standardised: Floats) -> Floats:
    levels: Floats = np.quantile(standardised, (np.arange(RESIDUAL_LEVELS) + 0.5) / RESIDUAL_LEVELS)
    return levels


def logistic(score: Floats, y: Floats) -> Floats:
    """Platt's calibration of leave-one-out scores: (slope, offset), slope never negative, targets smoothed."""
    positive, negative = y.sum(), len(y) - y.sum()
    smoothed = np.where(y > 0.5, (positive + 1) / (positive + 2), 1 / (negative + 2))

    def loss(theta: Floats) -> tuple[float, Floats]:
        logit = theta[0] * score + theta[1]
        probability = 1 / (1 + np.exp(-logit))
        value = np.logaddexp(0, logit).sum() - (smoothed * logit).sum()
        difference = probability - smoothed
        return float(value), np.array([(difference * score).sum(), difference.sum()])

    best = minimize(loss, np.array([1.0, 0.0]), jac=True, method="L-BFGS-B", bounds=[(0, 20), (-10, 10)])
    calibration: Floats = best.x
    return calibration
