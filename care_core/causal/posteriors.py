"""Posteriors of mechanisms, each worked out once: the queries of one diagnosis ask about the same few configurations
again and again."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property

import numpy as np

from care_core.causal.mechanisms import Mechanism, Posterior
from care_core.numbers import Floats

MOST = 256
"""Configurations of one mechanism that are kept: each takes two numbers a training run."""

_Row = tuple[Posterior, int]
"""One row of a posterior of several."""


class PosteriorCache:
    """Posteriors by their mechanism and its active inputs."""

    def __init__(self) -> None:
        self._rows: dict[Mechanism, dict[bytes, _Row]] = {}

    def at(self, mechanism: Mechanism, x: Floats) -> Posterior:
        """The posterior at inputs x, shape (m, p); only the rows that are new are worked out."""
        cached = self._rows.setdefault(mechanism, {})
        inputs = mechanism.active_inputs(x)
        new = {row: i for i, row in enumerate(inputs) if row not in cached}
        posterior = mechanism.posterior(x[list(new.values())])
        added = {row: (posterior, i) for i, row in enumerate(new)}
        if len(cached) + len(new) <= MOST:
            cached.update(added)
        if len(new) == len(inputs):
            return posterior
        return _CachedPosterior(mechanism, x, [cached[row] if row in cached else added[row] for row in inputs])


class _CachedPosterior(Posterior, eq=False, dict=True):
    """A posterior whose rows were worked out at different times."""

    rows: Sequence[_Row]

    @cached_property
    def latent(self) -> Floats:
        return _stacked(posterior.latent[i] for posterior, i in self.rows)

    @cached_property
    def variance(self) -> Floats:
        return _stacked(posterior.variance[i] for posterior, i in self.rows)

    @cached_property
    def half(self) -> Floats:
        return _stacked(posterior.half[i] for posterior, i in self.rows)


def _stacked(rows: Iterable[Floats]) -> Floats:
    return np.array(list(rows))
