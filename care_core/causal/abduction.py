"""What a run's own outcome says about the next one: one correlation for centre and standard deviation.

Around its mechanism f every run has noise. Two runs of configurations x and x' have values whose errors go together for
two reasons: what is not known of f at x is partly what is not known at x' (the posterior covariance of f), and what the
first run met the second meets again (rho, the share of the noise variance that carries over). So with noise variance s2

    cov(y', y) = cov(f(x'), f(x)) + rho s2,    var(y) = var f(x) + s2

and the next outcome is the conditional of a joint Gaussian (Rasmussen and Williams 2006, Eq. A.6), for yes-or-no
outcomes of a probit: a run passes where a standard normal stays below the quantile of its predicted probability.
Several runs of one configuration are conditioned on together; a second failure is evidence against chance.

A run that ends before it has an outcome still has metrics on the way to it. Where the graph names them, their errors
are part of the outcome's, and each goes on to x' as its own mechanism lets it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from care_core.causal.mechanisms import Posterior
from care_core.numbers import Floats
from care_core.records import Record, replace

_Z = np.linspace(-6.0, 6.0, 2401)
_CDF = np.array([0.5 * (1.0 + math.erf(z / math.sqrt(2.0))) for z in _Z.tolist()])
_NODES = np.linspace(-5.0, 5.0, 101)
"""Values of what the runs of one configuration share."""
_DENSITY = np.exp(-(_NODES**2) / 2) / np.exp(-(_NODES**2) / 2).sum()

FARTHEST = 3.0
"""Standard deviations beyond which a metric's error counts no more: what is farther came from outside the model."""


class ErrorCovariance(Record, eq=False):
    """How the errors of outcomes at m configurations go together with those at this run's, for one mechanism.

    Attributes:
        variance: of an outcome around the prediction at each configuration, shape (m,), on the transformed scale.
        covariance: with an outcome here, shape (m,).
        here: variance of an outcome here. repeated: covariance of two outcomes here.
    """

    variance: Floats
    covariance: Floats
    here: float
    repeated: float
    noise: Floats | float = 0.0
    """What all the noise would add to the covariance if it carried over, shape (m,); `own_noise`: to `repeated`."""
    own_noise: float = 0.0

    def sharing(self, carry_over: float) -> ErrorCovariance:
        """The same where this share of the noise carries over besides."""
        return replace(
            self,
            covariance=self.covariance + carry_over * self.noise,
            repeated=self.repeated + carry_over * self.own_noise,
        )


def error_covariance(there: Posterior, here: Posterior, carry_over: float) -> ErrorCovariance:
    """How outcomes at m places go together with those here, at one place.

    Args:
        carry_over: share of the noise variance, 0 to 1.
    """
    mechanism = there.mechanism
    noise, own = mechanism.noise_at(there.x) ** 2, float(mechanism.noise_at(here.x)[0]) ** 2
    unsure = float(here.variance[0])
    free = ErrorCovariance(
        there.variance + noise, there.covariance(here), unsure + own, unsure, np.sqrt(noise * own), own
    )
    return free.sharing(carry_over)


def next_value(errors: ErrorCovariance, latent: Floats, expected: float, seen: Floats) -> tuple[Floats, Floats]:
    """Centre and standard deviation of the next outcome, both of shape (m,), on the transformed scale.

    Args:
        latent: predictions at the m configurations. expected: prediction here. seen: outcomes here, shape (k,), k > 0.
    """
    mean_variance = (errors.here + (len(seen) - 1) * errors.repeated) / len(seen)
    centre = latent + errors.covariance / mean_variance * (float(seen.mean()) - expected)
    return centre, np.sqrt(np.maximum(errors.variance - errors.covariance**2 / mean_variance, 1e-12))


def by_mediators(
    covariances: Sequence[ErrorCovariance], errors: Floats, weights: Floats, among: Floats
) -> tuple[Floats, Floats]:
    """What metrics say of an outcome that k runs do not have: centre and variance of its error at m configurations, as
    shares of its standard deviation and of its variance; shape (m,) each.

    Args:
        covariances: of each of q metrics. errors: of them in the runs, shape (k, q). weights: of a metric's error in
            the outcome's, shape (q,). among: correlations of the metrics' errors, shape (q, q).
    """
    runs = len(errors)
    seen = np.array([(one.here + (runs - 1) * one.repeated) / runs for one in covariances])
    spread = np.sqrt([one.variance for one in covariances])
    carried = weights[:, None] * np.array([one.covariance for one in covariances]) / spread
    centre: Floats = (errors.mean(axis=0) / seen) @ carried
    share = carried / np.sqrt(seen)[:, None]
    return centre, 1.0 - np.einsum("im,ij,jm->m", share, among, share)


def next_passes(errors: ErrorCovariance, chance: Floats, here: float, passed: Sequence[bool]) -> Floats:
    """Probability that the next run passes, shape (m,).

    What runs of this configuration share is integrated out, weighed by how well it explains which of them passed.

    Args:
        chance: predicted probability at the m configurations. here: predicted probability here. passed: per run.
    """
    shared = errors.repeated / errors.here
    to_shared = errors.covariance / np.sqrt(errors.variance * errors.here) / np.sqrt(shared)
    alike = _cdf((_quantile(np.array(here)) - np.sqrt(shared) * _NODES) / np.sqrt(max(1.0 - shared, 1e-9)))
    weight = _DENSITY * np.prod([alike if ok else 1.0 - alike for ok in passed], axis=0)
    if weight.sum() <= 0:
        return chance
    left = np.sqrt(np.maximum(1.0 - to_shared**2, 1e-9))[:, None]
    passes = _cdf((_quantile(chance)[:, None] - to_shared[:, None] * _NODES) / left)
    probability: Floats = passes @ weight / weight.sum()
    return probability


def _cdf(z: Floats) -> Floats:
    return np.asarray(np.interp(z, _Z, _CDF))


def _quantile(p: Floats) -> Floats:
    return np.asarray(np.interp(p, _CDF, _Z))
