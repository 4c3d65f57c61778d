"""Chance that a run comes to its end, from those that did and those that failed.

A logistic Gaussian process by Laplace's approximation (Rasmussen & Williams, Gaussian Processes for
Machine Learning, MIT Press 2006, algorithms 3.1 and 3.2) with a fixed length, so that a handful of
failures neither forbid the whole range nor are forgotten.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_solve, cholesky, solve_triangular
from scipy.special import expit

Array = NDArray[np.float64]

_LENGTH = 0.35  # of an edge of the cube, times the root of the number of axes
_AMPLITUDE = 2.0  # of the local part of the log odds
_CONSTANT = 2.0  # of their mean
_STEPS = 30


class Feasibility:
    """Chance of success over the unit cube.

    Parameters
    ----------
    x : ndarray (n, d)
        Points of all runs [-].
    good : ndarray (n,), bool
        Whether each came to its end.
    """

    def __init__(self, x: Array, good: NDArray[np.bool_]) -> None:
        self._all = bool(good.all())
        if self._all:
            return
        self._x = x
        t = good.astype(float)
        k = self._kernel(x, x)
        f = np.zeros(len(x))
        for _ in range(_STEPS):
            p = expit(f)
            w = np.sqrt(p * (1.0 - p)) + 1e-9
            lower = cholesky(np.eye(len(x)) + w[:, None] * k * w, lower=True)
            b = w**2 * f + (t - p)
            a = b - w * cho_solve((lower, True), w * (k @ b))
            new = k @ a
            done = np.abs(new - f).max() < 1e-9
            f = new
            if done:
                break
        p = expit(f)
        self._w = np.sqrt(p * (1.0 - p)) + 1e-9
        self._lower = cholesky(np.eye(len(x)) + self._w[:, None] * k * self._w, lower=True)
        self._slope = t - p

    def _kernel(self, a: Array, b: Array) -> Array:
        square = ((a[:, None, :] - b) ** 2).sum(axis=2)
        length = _LENGTH * np.sqrt(a.shape[1])
        return np.asarray(_AMPLITUDE**2 * np.exp(-0.5 * square / length**2) + _CONSTANT**2)

    def chance(self, x: Array) -> Array:
        """Chance that a run at each point comes to its end, (n,) [-]."""
        if self._all:
            return np.ones(len(x))
        k = self._kernel(x, self._x)
        mean = k @ self._slope
        half = solve_triangular(self._lower, self._w[:, None] * k.T, lower=True)
        variance = np.maximum(_AMPLITUDE**2 + _CONSTANT**2 - (half**2).sum(axis=0), 0.0)
        # The mean of a sigmoid over a normal variable (MacKay, Neural Comput. 4 (1992) 720).
        return np.asarray(expit(mean / np.sqrt(1.0 + np.pi / 8.0 * variance)))
