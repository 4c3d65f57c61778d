"""Noise: random errors per row, errors shared by a group, faulty rows; on a grid of both sizes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SIGMA_STEP = 1.1  # ratio of neighbouring random errors: finer than 150 rows can tell apart
TAU_STEP = 1.4  # ratio of neighbouring group errors: finer than 30 groups can tell apart
STATED_SD = 0.10  # how well a stated random error is known, relative
NO_GROUP_ERROR = 0.4  # prior share of "no group error beyond the stated one"
SLOPE_LEVEL = 0.01  # of the test whether the random error varies


@dataclass(frozen=True)
class NoiseGrid:
    """Covariances sigma^2 W + A + tau^2 Z Z' for many sigma and tau, by eigenvectors.

    Attributes
    ----------
    weight : ndarray (n,)
        W: relative variance of each row.
    vectors : ndarray (T, n, n)
        Eigenvectors of W^-1/2 (A + tau^2 Z Z') W^-1/2 for each tau, as columns.
    values : ndarray (T, n)
        Eigenvalues.
    tau, sigma : ndarray (T,), (S,)
        The grids, in the transformed response.
    log_prior : ndarray (T, S)
        Logarithm of the prior weight of each point.
    log_det_weight : float
        Logarithm of det W.
    """

    weight: Array
    vectors: Array
    values: Array
    tau: Array
    sigma: Array
    log_prior: Array
    log_det_weight: float

    def rotate(self, columns: Array) -> Array:
        """Columns (n, m) in the eigenbasis of each tau, shape (T, n, m)."""
        scaled = columns / np.sqrt(self.weight)[:, None]
        return np.swapaxes(self.vectors, 1, 2) @ scaled

    def precision(self) -> Array:
        """1 / (sigma^2 + eigenvalue), shape (T, S, n)."""
        return 1.0 / (self.sigma[None, :, None] ** 2 + self.values[:, None, :])

    def log_det(self) -> Array:
        """Logarithm of the determinant of the covariance, shape (T, S)."""
        return self.log_det_weight - np.log(self.precision()).sum(axis=2)

    def near(self, sigma: float, factor: float) -> NoiseGrid:
        """The grid with sigma within a factor."""
        keep = np.abs(np.log(self.sigma / sigma)) <= np.log(factor)
        return NoiseGrid(
            self.weight,
            self.vectors,
            self.values,
            self.tau,
            self.sigma[keep],
            self.log_prior[:, keep],
            self.log_det_weight,
        )

    def covariance(self, tau: int, sigma: int) -> Array:
        """One covariance matrix, shape (n, n)."""
        root = np.sqrt(self.weight)
        inner = (self.vectors[tau] * (self.sigma[sigma] ** 2 + self.values[tau])) @ self.vectors[
            tau
        ].T
        return root[:, None] * inner * root[None, :]


def noise_grid(
    weight: Array,
    systematic: Array,
    group: NDArray[np.int64] | None,
    spread: float,
    stated: float | None,
    smallest: float,
) -> NoiseGrid:
    """Lay the grid.

    Parameters
    ----------
    weight : ndarray (n,)
        Relative variance of each row.
    systematic : ndarray (n, n)
        Covariance from stated systematic errors.
    group : ndarray (n,) of int, or None
        Rows of one group share an error of unknown size; None: there is no such error.
    spread : float
        Largest error to think of: the root mean square of the residual.
    stated : float or None
        Stated random error per row.
    smallest : float
        Smallest random error to think of.

    Returns
    -------
    grid : NoiseGrid
        Random errors are log-uniform between the bounds, or about the stated one.
    """
    size = len(weight)
    if stated is not None:
        sigma = stated * SIGMA_STEP ** np.arange(-4.0, 6.0)
        sigma_prior = -0.5 * (np.log(sigma / stated) / STATED_SD) ** 2
    else:
        steps = int(np.ceil(np.log(2.0 * max(spread / smallest, 1.0)) / np.log(SIGMA_STEP))) + 1
        sigma = smallest * SIGMA_STEP ** np.arange(float(steps))
        sigma_prior = np.zeros(steps)
    tau = np.zeros(1)
    tau_prior = np.zeros(1)
    root = np.sqrt(weight)
    if group is not None:
        low = 0.25 * max(smallest, 0.1 * stated if stated is not None else 0.0)
        steps = int(np.ceil(np.log(max(spread, 2.0 * low) / low) / np.log(TAU_STEP))) + 1
        positive = low * TAU_STEP ** np.arange(float(steps))
        tau = np.concatenate([[0.0], positive])
        tau_prior = np.concatenate(
            [[np.log(NO_GROUP_ERROR)], np.full(steps, np.log((1.0 - NO_GROUP_ERROR) / steps))]
        )
        same = (group[:, None] == group[None, :]) / np.outer(root, root)
    inner = systematic / np.outer(root, root)
    stack = [inner + t**2 * same for t in tau] if group is not None else [inner]
    values, vectors = np.linalg.eigh(np.array(stack))
    sigma_prior = sigma_prior - np.log(np.exp(sigma_prior - sigma_prior.max()).sum())
    return NoiseGrid(
        weight,
        vectors,
        np.maximum(values, 0.0),
        tau,
        sigma,
        tau_prior[:, None] + (sigma_prior - sigma_prior.max())[None, :],
        float(np.log(weight).sum()) * 1.0 if size else 0.0,
    )
