"""What mechanisms say at places, each asked once: the worlds of one diagnosis ask of the same few again and again."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property

import numpy as np

from care_core.causal.kernel import FloatArray
from care_core.causal.mechanisms import At, Mechanism

MOST = 256
"""Places of one mechanism that are held: each takes two numbers a training run."""

_One = tuple[At, int]
"""A place among those that were asked together."""


class Places:
    """The places that were asked of, by their mechanism."""

    def __init__(self) -> None:
        self._held: dict[Mechanism, dict[bytes, _One]] = {}

    def at(self, mechanism: Mechanism, x: FloatArray) -> At:
        """The mechanism at places x, shape (m, p); what was worked out of them before is not worked out again."""
        held = self._held.setdefault(mechanism, {})
        rows = mechanism.felt(x)
        new = {row: i for i, row in enumerate(rows) if row not in held}
        asked = mechanism.at(x[list(new.values())])
        found = {row: (asked, i) for i, row in enumerate(new)}
        if len(held) + len(new) <= MOST:
            held.update(found)
        if len(new) == len(rows):
            return asked
        return _Gathered(mechanism, x, [held[row] if row in held else found[row] for row in rows])


class _Gathered(At, eq=False, dict=True):
    """Places that were asked of at different times."""

    parts: Sequence[_One]

    @cached_property
    def latent(self) -> FloatArray:
        return _gathered((asked.latent[i] for asked, i in self.parts))

    @cached_property
    def variance(self) -> FloatArray:
        return _gathered((asked.variance[i] for asked, i in self.parts))

    @cached_property
    def half(self) -> FloatArray:
        return _gathered((asked.half[i] for asked, i in self.parts))


def _gathered(parts: Iterable[FloatArray]) -> FloatArray:
    return np.array(list(parts))
