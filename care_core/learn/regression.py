"""Does a target depend on a variable given all the others? Least squares on normal scores and their magnitudes."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pandas as pd
from scipy.special import fdtrc

from care_core.learn.table import normal_scores
from care_core.numbers import Bools, Floats
from care_core.records import Record

ROWS_PER_COLUMN = 3
"""Runs that each fitted column must have; with fewer, only options that matter marginally are held."""


class Regressions:
    """Nested least-squares fits on one table. What two questions share (columns, inverses) is computed once.

    Every variable enters by its normal scores and their magnitude, so an optimum inside is seen; a missing metric (a
    mission that never flew) enters as 0 with a column of its own.

    Args:
        frame: a checked table; a target's own gaps leave the run out of its fit.
    """

    def __init__(self, frame: pd.DataFrame) -> None:
        self._frame = frame
        self._columns: dict[str, Floats] = {}
        self._features: dict[tuple[str, bytes], Floats] = {}
        self._fits: dict[tuple[tuple[str, ...], bytes], _Design] = {}

    def p_of_each(self, names: Sequence[str], target: str) -> Floats:
        """p-value of each variable adding nothing to a least-squares fit of the target on all the others.

        Of more variables than the runs can carry, the ones most correlated with the target are held, and the rest
        tested one by one beside them.

        Returns:
            Shape (len(names),).
        """
        return self._p_of_each(names, target, ~np.isnan(self._column(target)), names)

    def p_of(self, name: str, given: Sequence[str], target: str) -> float:
        """The test of `p_of_each` for one variable beside given ones, on the runs that have it."""
        runs = ~np.isnan(self._column(target)) & ~np.isnan(self._column(name))
        return float(self._p_of_each([name, *given], target, runs, [name])[0])

    def _p_of_each(self, names: Sequence[str], target: str, runs: Bools, asked: Sequence[str]) -> Floats:
        p = np.ones(len(asked))
        y = normal_scores(self._column(target)[runs])
        if len(y) < 2 * ROWS_PER_COLUMN or np.ptp(y) == 0:
            return p
        blocks = {name: self._block(name, runs) for name in names}
        design = self._design(_fitted_together(blocks, y), runs)
        b = design.inverse @ (design.x.T @ y)
        left = y - design.x @ b
        freedom = len(y) - design.rank
        noise = max(float((left**2).sum()) / freedom, 1e-12)
        for i, name in enumerate(asked):
            if name in design.own:
                p[i] = design.p_of(name, b, noise, freedom)
            else:
                beyond = blocks[name] - design.x @ (design.inverse @ (design.x.T @ blocks[name]))
                p[i] = _f_test(left, beyond, design.rank)
        return p

    def _column(self, name: str) -> Floats:
        if name not in self._columns:
            self._columns[name] = self._frame[name].to_numpy(dtype=float)
        return self._columns[name]

    def _block(self, name: str, runs: Bools) -> Floats:
        key = name, np.packbits(runs).tobytes()
        if key not in self._features:
            self._features[key] = features(self._column(name)[runs])
        return self._features[key]

    def _design(self, held: tuple[str, ...], runs: Bools) -> _Design:
        key = held, np.packbits(runs).tobytes()
        if key not in self._fits:
            self._fits[key] = _Design.of({name: self._block(name, runs) for name in held}, int(runs.sum()))
        return self._fits[key]


class _Design(Record, eq=False):
    """A design matrix `x` of shape (n, q) with the pseudo-inverse of x'x, its rank, and what only each block holds.

    Metrics of missions that never flew are missing together: columns repeat each other, and only what is a block's
    own is tested.
    """

    x: Floats
    inverse: Floats
    rank: int
    own: dict[str, tuple[slice, Floats, Floats]]
    """Per block: its columns, the directions that no other block repeats, and the inverse of their covariance."""

    @classmethod
    def of(cls, blocks: dict[str, Floats], n: int) -> _Design:
        x = np.column_stack([np.ones((n, 1)), *blocks.values()])
        inverse = np.linalg.pinv(x.T @ x, rcond=1e-10, hermitian=True)
        # Projects on the combinations of columns that cancel.
        repeated = np.eye(x.shape[1]) - inverse @ (x.T @ x)
        own, start = {}, 1
        for name, block in blocks.items():
            part = slice(start, start + block.shape[1])
            start = part.stop
            share, directions = np.linalg.eigh(repeated[part, part])
            kept = directions[:, share < 1e-6]
            own[name] = part, kept, np.linalg.inv(kept.T @ inverse[part, part] @ kept)
        return cls(x, inverse, x.shape[1] - round(float(np.trace(repeated))), own)

    def p_of(self, name: str, b: Floats, noise: float, freedom: int) -> float:
        part, own, precision = self.own[name]
        if not own.size:
            return 1.0
        effect = own.T @ b[part]
        return float(fdtrc(own.shape[1], freedom, float(effect @ precision @ effect) / own.shape[1] / noise))


def _fitted_together(blocks: dict[str, Floats], y: Floats) -> tuple[str, ...]:
    """The blocks that are fitted together: the most correlated ones, as many columns as the runs can carry."""
    order = sorted(blocks, key=lambda name: -float(np.abs(blocks[name].T @ y).max(initial=0.0)))
    held, used = set(), 1
    for name in order:
        if blocks[name].shape[1] and ROWS_PER_COLUMN * (used + blocks[name].shape[1]) <= len(y):
            held.add(name)
            used += blocks[name].shape[1]
    # In the order of the names, so that targets that hold the same ones share their design.
    return tuple(name for name in blocks if name in held)


def features(values: Floats) -> Floats:
    """Scores and their magnitude, and where the value is missing, as orthonormal columns; shape (n, 0 to 3).

    A yes-or-no variable has one column, since its magnitude repeats its score: a test counts what is really added.
    """
    scores = normal_scores(values)
    missing = np.isnan(scores)
    scores = np.nan_to_num(scores)
    columns = np.column_stack([scores, np.abs(scores), missing.astype(float)])
    columns = columns[:, np.ptp(columns, axis=0) > 0]
    return _span(columns - columns.mean(axis=0)) if columns.size else columns


def _span(columns: Floats) -> Floats:
    """Orthonormal columns with the same span."""
    left, values, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(left[:, values > 1e-8 * values.max()])


def _f_test(target: Floats, added: Floats, used: int) -> float:
    """F-test of added columns; both sides already without what `used` columns explain."""
    if not added.size or float(np.abs(added).max()) < 1e-9:
        return 1.0
    directions = _span(added)
    count, freedom = directions.shape[1], len(target) - used - directions.shape[1]
    explained = float(((directions.T @ target) ** 2).sum())
    within = float((target**2).sum()) - explained
    if freedom < 1 or within <= 1e-9:
        return 1.0
    return float(fdtrc(count, freedom, explained / count * freedom / within))
