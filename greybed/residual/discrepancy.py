"""The competitor without a name: a Gaussian process over the residual (Kennedy & O'Hagan, 2001)."""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve
from sklearn.exceptions import ConvergenceWarning
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

from greybed.residual.problem import Problem

Array = NDArray[np.float64]


class Discrepancy:
    """A Gaussian process over all varying covariates, one length scale each.

    Parameters
    ----------
    problem : Problem
        Rows.
    residual : ndarray (n,)
        Transformed measurement less base prediction.
    """

    def __init__(self, problem: Problem, residual: Array) -> None:
        columns = []
        for values in problem.covariates().values():
            x = np.log(values) if (values > 0.0).all() else values
            columns.append((x - x.mean()) / max(float(x.std()), 1e-300))
        self._residual = residual
        self._covariance: Array | None = None
        if not columns:
            return
        x = np.column_stack(columns)
        spread = max(float(np.std(residual)), 1e-9)
        kernel = ConstantKernel(1.0, (1e-3, 1e4)) * RBF(
            np.full(x.shape[1], 2.0), (0.2, 50.0)
        ) + WhiteKernel(0.1, (1e-6, 10.0))
        regressor = GaussianProcessRegressor(kernel, random_state=0)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ConvergenceWarning)
            regressor.fit(x, residual / spread)
        self._covariance = spread**2 * regressor.kernel_(x)

    def predict(self, known: NDArray[np.bool_], wanted: NDArray[np.bool_]) -> Array:
        """Residual at the ``wanted`` rows from that at the ``known`` ones."""
        if self._covariance is None:
            return np.full(int(wanted.sum()), float(self._residual[known].mean()))
        mean = float(self._residual[known].mean())
        factor = cho_factor(self._covariance[np.ix_(known, known)])
        weights = cho_solve(factor, self._residual[known] - mean)
        return mean + self._covariance[np.ix_(wanted, known)] @ weights
