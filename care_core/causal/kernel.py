"""Covariances of a Gaussian process: its kernel between points, and their factor.

    k(x, x') = a^2 mean_j e_j + b^2 prod_j e_j,    e_j = exp(-(r_j (x_j - x'_j))^2 / 2)

It is the sum of an additive part (each option acts alone) and a joint part (options interact).
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from care_core.numbers import Floats
from care_core.records import Record

BLOCK = 300_000
"""Largest number of floats in one block of pairwise distances, which then stays in the processor's cache: changes no
number."""
SLICE = 64


class UniqueValues(Record, eq=False):
    """Points by the values that each of their columns takes: most runs leave most options as they are, so n runs have
    far fewer values of an option than n, and the kernel's exponentials are of these alone.

    Attributes:
        values: of one column after the other, each ascending and once, shape (u,). column: which column each is of.
        place: where in `values` each point's value stands, by column, shape (p, n).
    """

    values: Floats
    column: NDArray[np.intp]
    place: NDArray[np.intp]

    @classmethod
    def of(cls, points: Floats) -> UniqueValues:
        """Of points of shape (n, p)."""
        columns = points.T
        order = columns.argsort(axis=1)
        ascending = np.take_along_axis(columns, order, axis=1)
        is_new = np.ones(columns.shape, dtype=bool)
        np.not_equal(ascending[:, 1:], ascending[:, :-1], out=is_new[:, 1:])
        place = np.empty(columns.shape, dtype=np.intp)
        np.put_along_axis(place, order, (is_new.cumsum() - 1).reshape(columns.shape), axis=1)
        return cls(ascending[is_new], is_new.nonzero()[0], place)


def _unique(points: Floats | UniqueValues) -> UniqueValues:
    return points if isinstance(points, UniqueValues) else UniqueValues.of(points)


def _alike(a: Floats, b: Floats) -> Floats:
    """e_j of scaled values, of the shape that both have together."""
    exponents = a - b
    np.multiply(exponents, exponents, out=exponents)
    np.negative(exponents, out=exponents)
    return np.asarray(np.exp(exponents, out=exponents))


def _between(values: Floats, place: NDArray[np.intp]) -> Callable[[slice, slice], Floats]:
    """e_j of two slices of n points, which stand at these places among the values: looked up where the values are so
    few that they have no more pairs than half of the points' own, which are asked for."""
    if 2 * len(values) > len(place):
        column = values[place]
        return lambda these, those: _alike(column[these, None], column[those])
    pairs = _alike(values[:, None], values)
    return lambda these, those: pairs[:, place[those]].take(place[these], axis=0)


class Kernel(Record, eq=False):
    """The covariance above on scaled inputs. `relevance`: shape (p,); amplitudes, `noise`: standard deviations."""

    relevance: Floats
    additive: float
    joint: float
    noise: float
    idle: int = 0
    """Inputs that were found to explain nothing and left out: each adds an e_j of 1."""

    def __call__(self, a: Floats, b: Floats | UniqueValues) -> Floats:
        """Covariance of the noise-free values. a: (m, p), b: (n, p) -> (m, n)."""
        points = _unique(b)
        rows = max(1, BLOCK // max(1, points.place.size))
        covariance = np.empty((len(a), points.place.shape[1]))
        for i in range(0, len(a), rows):
            covariance[i : i + rows] = self._block(a[i : i + rows], points).T
        return covariance

    def among(self, points: Floats | UniqueValues) -> Floats:
        """Covariance of n points with each other, shape (n, n): half the work of calling it, and the same numbers."""
        points = _unique(points)
        n = points.place.shape[1]
        scaled = points.values * self._scale[points.column]
        bounds = np.searchsorted(points.column, np.arange(len(points.place) + 1)).tolist()
        between = [
            _between(scaled[first:last], place - first)
            for (first, last), place in zip(pairwise(bounds), points.place, strict=True)
        ]
        covariance = np.empty((n, n))
        for i in range(0, n, SLICE):
            rows = slice(i, i + SLICE)
            shape = covariance[i:, rows].shape
            joint, each = np.ones(shape), np.full(shape, float(self.idle))
            for alike in between:
                e = alike(slice(i, None), rows)
                each += e
                joint *= e
            covariance[i:, rows] = self._sum(joint, each)
            covariance[rows, i:] = covariance[i:, rows].T
        return covariance

    def _block(self, a: Floats, points: UniqueValues) -> Floats:
        """Of n points with m others, a: (m, p) -> (n, m)."""
        scale = self._scale[points.column][:, None]
        alike = _alike(a.T[points.column] * scale, points.values[:, None] * scale)
        shape = points.place.shape[1], len(a)
        joint, each, e = np.ones(shape), np.full(shape, float(self.idle)), np.empty(shape)
        for place in points.place:
            alike.take(place, axis=0, out=e, mode="clip")  # none is out of range: to say what then saves a copy
            each += e
            joint *= e
        return self._sum(joint, each)

    @property
    def _scale(self) -> Floats:
        return np.asarray(self.relevance * np.sqrt(0.5))

    def _sum(self, joint: Floats, each: Floats) -> Floats:
        """The covariance of the product of all e_j and their sum, in the place of the first."""
        joint *= self.joint**2
        each *= self.additive**2 / max(1, len(self.relevance) + self.idle)
        joint += each
        return joint

    @property
    def variance(self) -> float:
        """Prior variance of a noise-free value."""
        return self.additive**2 + self.joint**2


class Factor(Record, eq=False):
    """The Cholesky factor of a covariance, to be asked for L^-1 b: what is explained is the square of that.

    numpy solves no triangular system, so the inverses of its blocks on the diagonal are kept beside it.
    """

    lower: Floats
    diagonal: tuple[Floats, ...]

    @classmethod
    def of(cls, covariance: Floats) -> Factor:
        """Of a positive definite matrix, shape (n, n)."""
        lower: Floats = np.linalg.cholesky(covariance).astype(np.float64, copy=False)
        starts = range(0, len(lower), SLICE)
        return cls(lower, tuple(np.asarray(np.linalg.inv(lower[i : i + SLICE, i : i + SLICE])) for i in starts))

    def whitened(self, rows: Floats) -> Floats:
        """L^-1 of each row. rows: (m, n) -> (m, n)."""
        solved = np.empty_like(rows)
        for i, inverse in zip(range(0, len(self.lower), SLICE), self.diagonal, strict=True):
            block = slice(i, i + SLICE)
            solved[:, block] = (rows[:, block] - solved[:, :i] @ self.lower[block, :i].T) @ inverse.T
        return solved
