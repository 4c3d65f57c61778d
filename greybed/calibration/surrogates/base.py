"""What a surrogate is, and the runs that it is fitted to."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Sample:
    """Runs of one response, replicates put together.

    Attributes
    ----------
    x : ndarray (n, d)
        Different points of the unit cube.
    y : ndarray (n,)
        Mean response at each.
    counts : ndarray (n,)
        Replicates at each [-].
    scatter : float
        Variance of single replicates, pooled over the points that have several; 0 if unknown.
    freedom : int
        Degrees of freedom of ``scatter``: replicates beyond the first at all points [-].
    """

    x: Array
    y: Array
    counts: Array
    scatter: float = 0.0
    freedom: int = 0

    @classmethod
    def of(cls, x: Array, y: Array) -> Sample:
        """Put the replicates of ``y`` (m,) at equal rows of ``x`` (m, d) together."""
        points, place = np.unique(np.round(x, 10), axis=0, return_inverse=True)
        place = place.ravel()
        # In the order in which they were run, so that more runs append.
        first = np.full(len(points), len(x))
        np.minimum.at(first, place, np.arange(len(x)))
        order = np.argsort(first)
        rank = np.empty_like(order)
        rank[order] = np.arange(len(order))
        place = rank[place]
        counts = np.bincount(place).astype(float)
        mean = np.bincount(place, y) / counts
        within = float(((y - mean[place]) ** 2).sum())
        freedom = int(len(y) - len(points))
        scatter = within / freedom if freedom else 0.0
        return cls(x[first[order]], mean, counts, scatter, freedom)

    def without(self, rows: NDArray[np.bool_]) -> Sample:
        """The sample without the points of a mask."""
        keep = ~rows
        return Sample(self.x[keep], self.y[keep], self.counts[keep], self.scatter, self.freedom)


class Surrogate(ABC):
    """A function of the unit cube with its error, fitted to a :class:`Sample`.

    Attributes
    ----------
    noise : float
        Standard deviation of a single replicate, as fitted.
    """

    noise: float

    @abstractmethod
    def predict(self, x: Array) -> tuple[Array, Array]:
        """Mean response at points (n, d) and the standard deviation of this mean, each (n,)."""

    @abstractmethod
    def leave_out(self) -> tuple[Array, Array]:
        """Mean and sd of the response at each fitted point from the other points, each (n,)."""

    def spread_of_replicates(self, x: Array) -> Array:
        """Share of the variance of :meth:`predict` that finite replicates cause, (n,) [0 to 1]."""
        return np.zeros(len(x))
