"""Covariances of a Gaussian process: its kernel between points, and their factor.

    k(x, x') = a^2 mean_j e_j + b^2 prod_j e_j,    e_j = exp(-(r_j (x_j - x'_j))^2 / 2)

It is the sum of an additive part (each option acts alone) and a joint part (options interact).
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from care_core.frozen import dataclass

FloatArray = NDArray[np.float64]
BLOCK = 300_000
"""Largest number of floats in one block of pairwise distances, which then stays in the processor's cache: changes no
number."""
SLICE = 64


@dataclass(frozen=True, slots=True, eq=False)
class Levels:
    """Points by the values that each of their columns takes: most runs leave most options as they are, so n runs have
    far fewer values of an option than n, and the kernel's exponentials are of these alone.

    Attributes:
        values: of one column after the other, each ascending and once, shape (u,). column: which column each is of.
        place: where in `values` each point's value stands, by column, shape (p, n).
    """

    values: FloatArray
    column: NDArray[np.intp]
    place: NDArray[np.intp]

    @classmethod
    def of(cls, points: FloatArray) -> Levels:
        """Of points of shape (n, p)."""
        columns = points.T
        order = columns.argsort(axis=1)
        ascending = np.take_along_axis(columns, order, axis=1)
        is_new = np.ones(columns.shape, dtype=bool)
        np.not_equal(ascending[:, 1:], ascending[:, :-1], out=is_new[:, 1:])
        place = np.empty(columns.shape, dtype=np.intp)
        np.put_along_axis(place, order, (is_new.cumsum() - 1).reshape(columns.shape), axis=1)
        return cls(ascending[is_new], is_new.nonzero()[0], place)


def _levels(points: FloatArray | Levels) -> Levels:
    return points if isinstance(points, Levels) else Levels.of(points)


@dataclass(frozen=True, eq=False)
class Kernel:
    """The covariance above on scaled inputs. `relevance`: shape (p,); amplitudes, `noise`: standard deviations."""

    relevance: FloatArray
    additive: float
    joint: float
    noise: float
    idle: int = 0
    """Inputs that were found to explain nothing and left out: each adds an e_j of 1."""

    def __call__(self, a: FloatArray, b: FloatArray | Levels) -> FloatArray:
        """Covariance of the noise-free values. a: (m, p), b: (n, p) -> (m, n)."""
        levels = _levels(b)
        rows = max(1, BLOCK // max(1, levels.place.size))
        covariance = np.empty((len(a), levels.place.shape[1]))
        for i in range(0, len(a), rows):
            block = a[i : i + rows]
            alike = self._alike(levels.values, levels.column, block.T[levels.column])
            covariance[i : i + rows] = self._covariance(alike, levels.place).T
        return covariance

    def among(self, points: FloatArray | Levels) -> FloatArray:
        """Covariance of n points with each other, shape (n, n): half the work of calling it, and the same numbers."""
        levels = _levels(points)
        p, n = levels.place.shape
        starts = np.searchsorted(levels.column, np.arange(p + 1))
        columns = [slice(i, j) for i, j in pairwise(starts.tolist())]
        tables = [self._table(levels.values[own], levels.column[own]) for own in columns]
        covariance = np.empty((n, n))
        for i in range(0, n, SLICE):
            rows = slice(i, i + SLICE)
            places = levels.place[:, rows] - starts[:-1, None]
            alike = np.empty((len(levels.values), places.shape[1]))
            for own, table, place in zip(columns, tables, places, strict=True):
                table.take(place, axis=1, out=alike[own], mode="clip")
            covariance[i:, rows] = self._covariance(alike, levels.place[:, i:])
            covariance[rows, i:] = covariance[i:, rows].T
        return covariance

    def _table(self, values: FloatArray, column: NDArray[np.intp]) -> FloatArray:
        """e_j of the u values of one column with each other, shape (u, u)."""
        return self._alike(values, column, np.broadcast_to(values, (len(values), len(values))))

    def _alike(self, values: FloatArray, column: NDArray[np.intp], others: FloatArray) -> FloatArray:
        """e_j of u values, each of one column, with the same column of m points: shape (u,), (u, m) -> (u, m)."""
        scale = (self.relevance * np.sqrt(0.5))[column]
        exponents = others * scale[:, None]
        exponents -= (values * scale)[:, None]
        np.multiply(exponents, exponents, out=exponents)
        np.negative(exponents, out=exponents)
        alike: FloatArray = np.exp(exponents, out=exponents)
        return alike

    def _covariance(self, alike: FloatArray, place: NDArray[np.intp]) -> FloatArray:
        """Of n points with m others. alike: (u, m), place: (p, n) -> (n, m)."""
        p, shape = len(place), (place.shape[1], alike.shape[1])
        joint, each, e = np.ones(shape), np.full(shape, float(self.idle)), np.empty(shape)
        for column in place:
            alike.take(column, axis=0, out=e, mode="clip")
            each += e
            joint *= e
        joint *= self.joint**2
        each *= self.additive**2 / max(1, p + self.idle)
        joint += each
        return joint

    @property
    def variance(self) -> float:
        """Prior variance of a noise-free value."""
        return self.additive**2 + self.joint**2


@dataclass(frozen=True, slots=True, eq=False)
class Factor:
    """The Cholesky factor of a covariance, to be asked for L^-1 b: what is explained is the square of that.

    numpy solves no triangular system, so the inverses of its blocks on the diagonal are kept beside it.
    """

    lower: FloatArray
    diagonal: tuple[FloatArray, ...]

    @classmethod
    def of(cls, covariance: FloatArray) -> Factor:
        """Of a positive definite matrix, shape (n, n)."""
        lower: FloatArray = np.linalg.cholesky(covariance).astype(np.float64, copy=False)
        starts = range(0, len(lower), SLICE)
        return cls(lower, tuple(np.asarray(np.linalg.inv(lower[i : i + SLICE, i : i + SLICE])) for i in starts))

    def whitened(self, rows: FloatArray) -> FloatArray:
        """L^-1 of each row. rows: (m, n) -> (m, n)."""
        solved = np.empty_like(rows)
        for i, inverse in zip(range(0, len(self.lower), SLICE), self.diagonal, strict=True):
            block = slice(i, i + SLICE)
            solved[:, block] = (rows[:, block] - solved[:, :i] @ self.lower[block, :i].T) @ inverse.T
        return solved
