"""Mechanisms: how each metric and objective answers to its causes. Learned offline, evaluated with numpy alone.

A mechanism is a Gaussian process (Rasmussen and Williams 2006, chapters 2 and 4) with one relevance per input.
Its kernel is the sum of an additive part (each option acts alone) and a joint part (options interact):

    k(x, x') = a^2 mean_j e_j + b^2 prod_j e_j,    e_j = exp(-(r_j (x_j - x'_j))^2 / 2)

so it learns from few missions, says how sure it is away from the data, and stores nothing but numbers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from care_core.causal.kernel import Factor, Kernel, UniqueValues
from care_core.causal.nominal import Nominal
from care_core.numbers import Bools, Floats, logistic, quantile
from care_core.records import Record

Transform = Literal["identity", "log", "log1p"]
LEAST: Mapping[Transform, float] = {"identity": -np.inf, "log": 0.0, "log1p": -1.0}
"""Every value that a transform can take lies above this."""
JITTER = 1e-6
TAIL = 0.01
"""Probabilities are kept this far from 0 and 1: no table of a few hundred runs supports more."""


def transformed(values: Floats, transform: Transform) -> Floats:
    """The scale on which a mechanism is additive in its noise."""
    if transform == "log":
        return np.log(values)
    return np.log1p(values) if transform == "log1p" else values


def restored(values: Floats, transform: Transform) -> Floats:
    """The inverse of `transformed`."""
    if transform == "log":
        return np.exp(values)
    return np.expm1(values) if transform == "log1p" else values


class Averaging(Record):
    """Noise that averages out over the like parts of a mission (its goals): `share` of the noise variance belongs to
    each part alone in missions of `usual` parts; `count` is the input that counts them. One part alone has more."""

    count: str
    usual: float
    share: float


class TrainingRuns(Record, eq=False, dict=True):
    """The u distinct training inputs of a mechanism. Runs that share theirs are one outcome, their mean, whose noise is
    so much less: the posterior is the same, and a third of a fleet's runs leave all that a stage reads as it is.

    Attributes:
        counts: runs of each, shape (u,). weights: of their outcomes, summed, shape (u,).
    """

    kernel: Kernel
    points: UniqueValues
    counts: NDArray[np.intp]
    weights: Floats

    @cached_property
    def factor(self) -> Factor:
        """Of the covariance of the outcomes."""
        covariance = self.kernel.among(self.points)
        covariance[np.diag_indices_from(covariance)] += (self.kernel.noise**2 + JITTER) / self.counts
        return Factor.of(covariance)


class Mechanism(Record, eq=False, dict=True):
    """One mechanism: a regression of the (transformed) target on its inputs.

    Binary targets are coded -1 and 1 and regressed the same way; `calibration` then turns the regression into
    probability. Everything is scaled: inputs to mean 0 and standard deviation 1 (log first where `log_inputs`), the
    target likewise.

    Attributes:
        inputs: names, shape (p,), in the order of the columns that `latent` expects.
        reads: places of the inputs that the kernel sees, shape (q,); scaling and relevance have one value for each.
        points: shape (n, q), scaled training inputs.
        targets: shape (n,), scaled training targets.
        weights: shape (n,), (K + noise)^-1 targets: the posterior mean is a kernel times these.
        calibration: binary: (slope, offset) of the logistic of the regression. Continuous: sorted standardised
            leave-one-out residuals, the distribution of this mechanism's own errors.
        prior: of a mechanism carried over from another platform: that platform's mechanism and the share of its
            prediction that is kept. The regression is then of what that leaves.
        nominal: what physics says of the target. The regression is then of the logarithm of the ratio to it.
        averaging: what of the noise depends on how many like parts a mission has.
    """

    inputs: tuple[str, ...]
    reads: NDArray[np.int64]
    log_inputs: Bools
    centre: Floats
    sd: Floats
    kernel: Kernel
    points: Floats
    targets: Floats
    weights: Floats
    mean: float
    scale: float
    transform: Transform
    binary: bool
    calibration: Floats
    prior: tuple[Mechanism, float] | None = None
    nominal: Nominal | None = None
    averaging: Averaging | None = None

    def scaled(self, x: Floats) -> Floats:
        """Inputs in their own units, shape (m, p), to the scale and the columns that the kernel sees, shape (m, q)."""
        x = x[:, self.reads]
        logs = np.log(np.where(self.log_inputs, np.maximum(x, 1e-12), 1.0))
        scaled: Floats = (np.where(self.log_inputs, logs, x) - self.centre) / self.sd
        return scaled

    @cached_property
    def training(self) -> TrainingRuns:
        """The training runs as the kernel sees them."""
        rows = [row.tobytes() for row in self.points]
        places = {row: i for i, row in enumerate(dict.fromkeys(rows))}
        place = np.array([places[row] for row in rows], dtype=np.intp)
        points = np.empty((len(places), self.points.shape[1]))
        points[place] = self.points
        weights = np.bincount(place, self.weights).astype(np.float64)
        return TrainingRuns(self.kernel, UniqueValues.of(points), np.bincount(place), weights)

    def posterior(self, x: Floats) -> Posterior:
        """The mechanism at places x, shape (m, p)."""
        return Posterior(self, x)

    def latent(self, x: Floats) -> Floats:
        """Posterior mean on the transformed scale. x: (m, p) -> (m,)."""
        return self.posterior(x).latent

    def latent_sd(self, x: Floats) -> Floats:
        """Posterior standard deviation of the noise-free value, shape (m,)."""
        return self.posterior(x).latent_sd

    def known(self, x: Floats) -> Floats:
        """What physics and the other platform's mechanism say, shape (m,); zero without either."""
        return self.posterior(x).known

    def active_inputs(self, x: Floats) -> list[bytes]:
        """Of each row of x (m, p) the values of the inputs that anything reads: rows with the same have one answer."""
        return [row.tobytes() for row in x[:, self._active]]

    @cached_property
    def _active(self) -> NDArray[np.int64]:
        names = {self.inputs[place] for place in self.reads}
        names.update(() if self.nominal is None else self.nominal.inputs)
        names.update(() if self.averaging is None else (self.averaging.count,))
        names.update(() if self.prior is None else self.prior[0].inputs)
        return np.array([place for place, name in enumerate(self.inputs) if name in names], dtype=np.int64)

    def columns(self, x: Floats, names: Sequence[str]) -> Floats:
        """Those of the inputs, of x (m, p)."""
        return x[:, [self.inputs.index(name) for name in names]]

    @property
    def prior_variance(self) -> float:
        """Of a noise-free value before any run, on the transformed scale."""
        own = self.scale**2 * self.kernel.variance
        return own if self.prior is None else own + self.prior[1] ** 2 * self.prior[0].prior_variance

    @property
    def noise_sd(self) -> float:
        """Standard deviation of a training run around the mechanism, on the transformed scale."""
        return self.scale * self.kernel.noise

    def noise_at(self, x: Floats) -> Floats:
        """The same for missions of any number of parts, shape (m,)."""
        if self.averaging is None:
            return np.full(len(x), self.noise_sd)
        parts = np.maximum(self.columns(x, (self.averaging.count,))[:, 0], 1.0)
        share = self.averaging.share
        return np.asarray(self.noise_sd * np.sqrt(1 - share + share * self.averaging.usual / parts))

    def probability(self, x: Floats) -> Floats:
        """Binary targets: probability of 1, shape (m,)."""
        return self.probability_of(self.latent(x))

    def probability_of(self, latent: Floats) -> Floats:
        """Binary targets: probability of 1 for values of the regression, of any shape."""
        slope, offset = self.calibration
        return np.clip(logistic(slope * latent + offset), TAIL, 1 - TAIL)

    def share_below(self, z: Floats) -> Floats:
        """Continuous targets: distribution function of the standardised error, kept off 0 and 1."""
        levels = (np.arange(len(self.calibration)) + 0.5) / len(self.calibration)
        return np.clip(np.interp(z, self.calibration, levels, left=0.0, right=1.0), TAIL, 1 - TAIL)

    def error_quantile(self, share: float) -> float:
        """Continuous targets: that quantile of the standardised error."""
        if share not in self._quantiles:
            self._quantiles[share] = quantile(self.calibration, share)
        return self._quantiles[share]

    @cached_property
    def _quantiles(self) -> dict[float, float]:
        return {}

    def residual_share(self, x: Floats, value: float) -> tuple[float, float]:
        """Continuous targets: the share of training runs whose error lies below that of `value` at one place, and what
        was expected there. x: (1, p). An error that no training run had is 0 or 1."""
        if value <= LEAST[self.transform]:
            return 0.0, float(self.expected(x)[0])
        there = self.posterior(x)
        sd = np.sqrt(there.latent_sd**2 + self.noise_at(x) ** 2)
        z = (transformed(np.array([value]), self.transform) - there.latent) / sd
        share = np.searchsorted(self.calibration, z)[0] / len(self.calibration)
        return float(share), float(restored(there.latent, self.transform)[0])

    def expected(self, x: Floats) -> Floats:
        """Expected value in the target's own unit; the probability of 1 for binary targets."""
        return self.probability(x) if self.binary else restored(self.latent(x), self.transform)


class Posterior(Record, eq=False, dict=True):
    """A mechanism at m places x, shape (m, p). The kernel, which is what costs, is asked once for all that is asked of
    them, and nothing before it is needed."""

    mechanism: Mechanism
    x: Floats

    @cached_property
    def latent(self) -> Floats:
        """Posterior mean on the transformed scale, shape (m,)."""
        m = self.mechanism
        mean: Floats = m.mean + m.scale * (self._cross @ m.training.weights)
        return mean + self.known

    @cached_property
    def latent_sd(self) -> Floats:
        """Posterior standard deviation of the noise-free value, shape (m,)."""
        return np.sqrt(self.variance)

    @cached_property
    def variance(self) -> Floats:
        """Its square, shape (m,)."""
        m = self.mechanism
        own: Floats = m.scale**2 * np.maximum(m.kernel.variance - (self.half**2).sum(axis=1), 1e-12)
        return own if self._prior is None else own + self._prior[1] ** 2 * self._prior[0].variance

    @property
    def epistemic_ratio(self) -> Floats:
        """How little the training data say there: posterior over prior variance, 0 (known) to 1 (nothing known).

        Shape (m,)."""
        return np.clip(self.variance / max(self.mechanism.prior_variance, 1e-12), 0.0, 1.0)

    @cached_property
    def known(self) -> Floats:
        """What physics and the other platform's mechanism say, shape (m,); zero without either."""
        latent, physics = np.zeros(len(self.x)), self.mechanism.nominal
        if physics is not None:
            latent += np.log(physics.of(self.mechanism.columns(self.x, physics.inputs)))
        if self._prior is not None:
            latent += self._prior[1] * self._prior[0].latent
        return latent

    def change_sd(self, here: Posterior) -> Floats:
        """Posterior standard deviation of f(x) - f(here), shape (m,); `here` is one place.

        What is not known at both places cancels, so a small change is known better than either value.
        """
        m = self.mechanism
        prior = 2 * (m.kernel.variance - m.kernel(self._z, here._z)[:, 0])
        explained = ((self.half - here.half) ** 2).sum(axis=1)
        sd: Floats = m.scale * np.sqrt(np.maximum(prior - explained, 1e-12))
        if self._prior is None or here._prior is None:
            return sd
        return np.hypot(sd, self._prior[1] * self._prior[0].change_sd(here._prior[0]))

    def covariance(self, here: Posterior) -> Floats:
        """Posterior covariance of the noise-free values with that of one place, shape (m,).

        What is not known of the mechanism at one place is partly what is not known at the other.
        """
        m = self.mechanism
        between = m.kernel(self._z, here._z)[:, 0]
        own: Floats = m.scale**2 * (between - self.half @ here.half[0])
        if self._prior is None or here._prior is None:
            return own
        return own + self._prior[1] ** 2 * self._prior[0].covariance(here._prior[0])

    @cached_property
    def _z(self) -> Floats:
        return self.mechanism.scaled(self.x)

    @cached_property
    def _cross(self) -> Floats:
        """Covariances with the training runs, shape (m, u)."""
        return self.mechanism.kernel(self._z, self.mechanism.training.points)

    @cached_property
    def half(self) -> Floats:
        """The same, whitened: products of its rows are covariances that the training runs explain."""
        return self.mechanism.training.factor.whitened(self._cross)

    @cached_property
    def _prior(self) -> tuple[Posterior, float] | None:
        """The other platform's mechanism there, and the share of it that is kept."""
        if self.mechanism.prior is None:
            return None
        source, share = self.mechanism.prior
        return source.posterior(self.mechanism.columns(self.x, source.inputs)), share


def solve(kernel: Kernel, points: Floats, targets: Floats) -> Floats:
    """Weights of the posterior mean, shape (n,), for scaled points (n, p) and targets (n,)."""
    covariance = kernel.among(points) + np.eye(len(points)) * (kernel.noise**2 + JITTER)
    return np.asarray(np.linalg.solve(covariance, targets))


def columns(rows: Sequence[Mapping[str, float]], names: Sequence[str]) -> Floats:
    """Configurations as a matrix, shape (len(rows), len(names))."""
    return np.array([[row[name] for name in names] for row in rows], dtype=float).reshape(len(rows), len(names))
