"""Gaussian process with a quadratic trend, one length for each axis, and explicit replicate noise.

Matern kernel of order 5/2 (Rasmussen & Williams, Gaussian Processes for Machine Learning, MIT
Press 2006, eq. 4.17) plus a linear kernel and its square (their section 4.2.2), which are Bayesian
trends of first and second order; lengths, amplitudes and noise maximise the posterior density under
wide log-normal priors. Replicates enter twice: the mean of k of them has noise variance s2/k, and
their pooled variance is evidence on s2 with a chi-squared density.

Hyperparameters that are fitted to n runs and then taken as known make errors look too small. Each
of the d + 3 that shape the mean is counted as a degree of freedom: variances are widened by
n / (n - d - 3), at most fourfold, as a residual variance is. benchmarks/calibration.py checks by
the coverage of regions that this is about right.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cho_solve, cholesky, solve_triangular
from scipy.optimize import minimize

from greybed.calibration.surrogates.base import Sample, Surrogate

Array = NDArray[np.float64]

SQRT5 = np.sqrt(5.0)
# Priors of the natural logarithms in standardised units: mean and sd.
_LENGTH = (0.2, 1.0)  # of a cube's edge
_AMPLITUDE = (-0.3, 1.2)
_LINEAR = (0.0, 1.5)
_SQUARE = (-0.5, 1.5)
_NOISE = (-3.0, 1.7)
_REST = (_AMPLITUDE, _LINEAR, _SQUARE, _NOISE)
_LENGTH_BOUNDS, _AMPLITUDE_BOUNDS = (-3.5, 4.0), (-5.0, 4.0)
_TREND_BOUNDS = (-6.0, 4.0)
_NOISE_BOUNDS = (-7.0, 1.5)
_WIDEST = 4.0
_FEW = 50
_CONSTANT = 10.0  # prior sd of the mean, in sds of the data


class GaussianProcess(Surrogate):
    """A Gaussian process over the unit cube.

    Parameters
    ----------
    sample : Sample
        Runs.
    start : ndarray (d + 4,), optional
        Hyperparameters to begin from, those of an earlier fit.
    tune : bool
        Whether to look for the best hyperparameters; otherwise ``start`` is taken as it is.

    Attributes
    ----------
    hyper : ndarray (d + 4,)
        Logarithms of lengths [-], of the amplitudes of the local, the linear and the quadratic
        part, and of the noise [sds of the data].
    noise : float
        Standard deviation of a single replicate, in the unit of the response.
    """

    def __init__(self, sample: Sample, start: Array | None = None, tune: bool = True) -> None:
        self.sample = sample
        n, d = sample.x.shape
        self._shift = float(sample.y.mean())
        spread = float(sample.y.std())
        self._scale = spread if spread > 1e-12 * max(1.0, abs(self._shift)) else 1.0
        self._y = (sample.y - self._shift) / self._scale
        self._scatter = sample.scatter / self._scale**2
        self._square = (sample.x[:, None, :] - sample.x) ** 2
        self._centred = sample.x - 0.5
        self._dot = self._centred @ self._centred.T
        plain = np.concatenate([np.full(d, _LENGTH[0]), [p[0] for p in _REST]])
        if sample.freedom and self._scatter > 0.0:
            plain[-1] = np.clip(0.5 * np.log(self._scatter), *_NOISE_BOUNDS)
        elif sample.freedom:
            plain[-1] = _NOISE_BOUNDS[0]
        if not tune and start is not None:
            self.hyper = start
        else:
            self.hyper = self._tune(plain, start, d)
        self._finish(n)

    # -- fit --------------------------------------------------------------------------------

    def _tune(self, plain: Array, start: Array | None, d: int) -> Array:
        bounds = [
            *[_LENGTH_BOUNDS] * d, _AMPLITUDE_BOUNDS, _TREND_BOUNDS, _TREND_BOUNDS, _NOISE_BOUNDS,
        ]  # fmt: skip
        short = plain.copy()
        short[:d] -= 1.0
        guesses = [plain, short] if start is None else [start]
        if start is not None and len(self._y) <= _FEW:
            guesses.append(short)  # an early fit may have taken all for noise
        best, least = plain, np.inf
        for guess in guesses:
            found = minimize(
                self._objective, guess, jac=True, method="L-BFGS-B", bounds=bounds,
                options={"maxiter": 60},
            )  # fmt: skip
            if found.fun < least:
                best, least = found.x, float(found.fun)
        return np.asarray(best)

    def _kernel(self, hyper: Array) -> tuple[Array, Array, Array, Array, Array]:
        """Matern part, its factor exp(-sqrt5 r), scaled distances r, and both trends."""
        d = self._square.shape[2]
        r = np.sqrt(self._square @ np.exp(-2.0 * hyper[:d]))
        decay = np.exp(2.0 * hyper[d] - SQRT5 * r)
        return (
            (1.0 + SQRT5 * r + 5.0 / 3.0 * r**2) * decay, decay, r,
            np.exp(2.0 * hyper[d + 1]) * self._dot, np.exp(2.0 * hyper[d + 2]) * self._dot**2,
        )  # fmt: skip

    def _objective(self, hyper: Array) -> tuple[float, Array]:
        """Negative log posterior density of the hyperparameters, and its gradient."""
        n, d = self.sample.x.shape
        matern, decay, r, linear, square = self._kernel(hyper)
        variance = np.exp(2.0 * hyper[d + 3])
        noise = variance / self.sample.counts
        k = matern + linear + square + _CONSTANT**2
        k[np.diag_indices(n)] += noise + 1e-10
        try:
            lower = cholesky(k, lower=True, check_finite=False)
        except LinAlgError:
            return 1e10, np.zeros_like(hyper)
        inverse = cho_solve((lower, True), np.eye(n), check_finite=False)
        alpha = inverse @ self._y
        value = 0.5 * float(self._y @ alpha) + float(np.log(np.diag(lower)).sum())
        weight = 0.5 * (inverse - np.outer(alpha, alpha))
        gradient = np.empty_like(hyper)
        # d k / d log l_i = 5/3 (1 + sqrt5 r) exp(-sqrt5 r) (x_i - x_i')^2 / l_i^2
        slope = weight * (5.0 / 3.0 * (1.0 + SQRT5 * r) * decay)
        gradient[:d] = np.tensordot(slope, self._square, 2) * np.exp(-2.0 * hyper[:d])
        gradient[d] = 2.0 * float((weight * matern).sum())
        gradient[d + 1] = 2.0 * float((weight * linear).sum())
        gradient[d + 2] = 2.0 * float((weight * square).sum())
        gradient[d + 3] = 2.0 * float((np.diag(weight) * noise).sum())
        if self.sample.freedom:
            ratio = self._scatter / variance
            value += 0.5 * self.sample.freedom * float(np.log(variance) + ratio)
            gradient[d + 3] += self.sample.freedom * (1.0 - ratio)
        means = np.array([*[_LENGTH[0]] * d, *(p[0] for p in _REST)])
        sds = np.array([*[_LENGTH[1]] * d, *(p[1] for p in _REST)])
        off = (hyper - means) / sds
        return value + 0.5 * float(off @ off), gradient + off / sds

    def _finish(self, n: int) -> None:
        matern, _, _, linear, square = self._kernel(self.hyper)
        k = matern + linear + square + _CONSTANT**2
        noise = np.exp(2.0 * self.hyper[-1]) / self.sample.counts
        k[np.diag_indices(n)] += noise + 1e-10
        self._lower = cholesky(k, lower=True)
        self._alpha = cho_solve((self._lower, True), self._y)
        self._noise_part = noise
        left = n - self.sample.x.shape[1] - 3
        self._widen = min(n / left, _WIDEST) if left > 0 else _WIDEST
        self.noise = float(np.exp(self.hyper[-1])) * self._scale

    # -- use --------------------------------------------------------------------------------

    def _cross(self, x: Array, others: Array) -> Array:
        d = x.shape[1]
        inverse = np.exp(-self.hyper[:d])
        a, b = x * inverse, others * inverse
        square = (a**2).sum(axis=1)[:, None] + (b**2).sum(axis=1) - 2.0 * a @ b.T
        r = np.sqrt(np.maximum(square, 0.0))
        matern = (1.0 + SQRT5 * r + 5.0 / 3.0 * r**2) * np.exp(2.0 * self.hyper[d] - SQRT5 * r)
        dot = (x - 0.5) @ (others - 0.5).T
        trend = np.exp(2.0 * self.hyper[d + 1]) * dot + np.exp(2.0 * self.hyper[d + 2]) * dot**2
        return np.asarray(matern + trend + _CONSTANT**2)

    def _own(self, x: Array) -> Array:
        d = x.shape[1]
        dot = ((x - 0.5) ** 2).sum(axis=1)
        trend = np.exp(2.0 * self.hyper[d + 1]) * dot + np.exp(2.0 * self.hyper[d + 2]) * dot**2
        return np.asarray(np.exp(2.0 * self.hyper[d]) + trend + _CONSTANT**2)

    def predict(self, x: Array) -> tuple[Array, Array]:
        """See :meth:`Surrogate.predict`."""
        k = self._cross(x, self.sample.x)
        half = solve_triangular(self._lower, k.T, lower=True, check_finite=False)
        variance = np.maximum(self._own(x) - (half**2).sum(axis=0), 1e-12)
        sd = self._scale * np.sqrt(self._widen * variance)
        return self._shift + self._scale * (k @ self._alpha), sd

    def covariance(self, x: Array, others: Array) -> Array:
        """Covariance of the mean responses at two sets of points, (n, m)."""
        a = solve_triangular(self._lower, self._cross(x, self.sample.x).T, lower=True)
        b = solve_triangular(self._lower, self._cross(others, self.sample.x).T, lower=True)
        return np.asarray((self._cross(x, others) - a.T @ b) * self._scale**2 * self._widen)

    def leave_out(self) -> tuple[Array, Array]:
        """See :meth:`Surrogate.leave_out`; hyperparameters stay (Rasmussen & Williams, 5.12)."""
        inverse = cho_solve((self._lower, True), np.eye(len(self._y)))
        diagonal = np.diag(inverse)
        mean = self._y - self._alpha / diagonal
        sd = np.sqrt(self._widen * np.maximum(1.0 / diagonal - self._noise_part, 1e-12))
        return self._shift + self._scale * mean, self._scale * sd

    def spread_of_replicates(self, x: Array) -> Array:
        """See :meth:`Surrogate.spread_of_replicates`: weights of the runs times their noise."""
        k = self._cross(x, self.sample.x)
        weights = cho_solve((self._lower, True), k.T)
        part = ((weights**2) * self._noise_part[:, None]).sum(axis=0)
        _, sd = self.predict(x)
        return np.asarray(np.clip(part * self._widen * self._scale**2 / sd**2, 0.0, 1.0))
