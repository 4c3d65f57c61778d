"""Quadratic response surface by least squares, with the error of its mean."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from greybed.calibration.surrogates.base import Sample, Surrogate

Array = NDArray[np.float64]


def quadratic_terms(x: Array, axes: tuple[int, ...] | None = None) -> tuple[Array, list[str]]:
    """Columns 1, x, x^2 and products of the centred axes, and their names (``0``, ``0:1``).

    Parameters
    ----------
    x : ndarray (n, d)
        Points of the unit cube [-].
    axes : tuple of int, optional
        Those that have terms; all by default.
    """
    axes = tuple(range(x.shape[1])) if axes is None else axes
    z = 2.0 * x - 1.0
    columns, names = [np.ones(len(x))], [""]
    for i in axes:
        columns.append(z[:, i])
        names.append(f"{i}")
    for a, i in enumerate(axes):
        for j in axes[a:]:
            columns.append(z[:, i] * z[:, j])
            names.append(f"{i}:{j}")
    return np.column_stack(columns), names


class Quadratic(Surrogate):
    """A quadratic surface; terms for which there are too few runs are left out, products first.

    Parameters
    ----------
    sample : Sample
        Runs.
    axes : tuple of int, optional
        Axes that the response may depend on.

    Notes
    -----
    Its error is that of a mean of the fitted surface with the residual variance of the fit, so
    what the surface cannot follow counts as error, too.
    """

    def __init__(self, sample: Sample, axes: tuple[int, ...] | None = None) -> None:
        self.sample, self._axes = sample, axes
        terms, names = quadratic_terms(sample.x, axes)
        room = max(1, len(sample.y) - 2)
        order = sorted(range(len(names)), key=lambda k: _rank(names[k]))
        self._kept = sorted(order[: min(room, len(order))])
        self._weight = np.sqrt(sample.counts)
        a = terms[:, self._kept] * self._weight[:, None]
        self._inverse = np.linalg.pinv(a.T @ a, rcond=1e-10)
        self._beta = self._inverse @ (a.T @ (sample.y * self._weight))
        residual = sample.y - terms[:, self._kept] @ self._beta
        rank = int(np.linalg.matrix_rank(a))
        self._freedom = max(1, len(sample.y) - rank)
        self._variance = float((sample.counts * residual**2).sum()) / self._freedom
        self.noise = float(np.sqrt(sample.scatter if sample.freedom else self._variance))
        self._terms = terms[:, self._kept]

    def predict(self, x: Array) -> tuple[Array, Array]:
        """See :meth:`Surrogate.predict`."""
        terms = quadratic_terms(x, self._axes)[0][:, self._kept]
        leverage = np.einsum("ij,jk,ik->i", terms, self._inverse, terms)
        sd = np.sqrt(np.maximum(self._variance * leverage, 1e-24))
        # What replicates do not explain is misfit of the surface, wherever one looks.
        misfit = max(self._variance - self.noise**2, 0.0) if self.sample.freedom else 0.0
        return terms @ self._beta, np.sqrt(sd**2 + misfit)

    def leave_out(self) -> tuple[Array, Array]:
        """See :meth:`Surrogate.leave_out`, by the leverages."""
        hat = np.einsum("ij,jk,ik->i", self._terms, self._inverse, self._terms)
        hat = np.minimum(hat * self.sample.counts, 1.0 - 1e-9)
        fitted = self._terms @ self._beta
        mean = self.sample.y - (self.sample.y - fitted) / (1.0 - hat)
        sd = np.sqrt(self._variance * hat / (1.0 - hat) / self.sample.counts)
        return mean, sd


def _rank(name: str) -> tuple[int, str]:
    if not name:
        return 0, name
    if ":" not in name:
        return 1, name
    i, j = name.split(":")
    return (2 if i == j else 3), name
