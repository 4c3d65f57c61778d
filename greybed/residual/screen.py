"""Before any search: rows that no explanation can reach, and random errors that are not uniform."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from greybed.residual.noise import SLOPE_LEVEL
from greybed.residual.terms import Term

Array = NDArray[np.float64]

OUTLIER_LEVEL = 0.10  # chance that a clean table loses a row
PRESENT = 0.1  # share of its prior second moment that each term is given at once
MOST_OUTLIERS = 0.10  # share of rows; beyond it the noise is what it is
GROUP_SHARES = (0.0, 0.3, 0.6, 1.0, 1.7, 3.0, 6.0)  # group error over random error to try
LOG_CHI2_VARIANCE = np.pi**2 / 2.0  # of the logarithm of a squared normal number
LOG_CHI2_MEAN = -1.2703628  # its mean: -gamma - ln 2
MOST_SLOPE = 2.2  # largest change of the log variance from the middle either way


@dataclass(frozen=True)
class Screened:
    """What the first look found.

    Attributes
    ----------
    outlier : ndarray (n,), bool
        Rows that are off whatever explains the others.
    weight : ndarray (n,)
        Relative variance of each row, geometric mean 1.
    sigma : float
        Random error left over by a model with all terms in it.
    varies_with : str or None
        Covariate that the random error follows.
    """

    outlier: NDArray[np.bool_]
    weight: Array
    sigma: float
    varies_with: str | None


def _flexible(nuisance: Array, precision: Array, systematic: Array, terms: list[Term]) -> Array:
    """Prior covariance of a residual in which every term may be present."""
    covariance = systematic + (nuisance / precision) @ nuisance.T
    for term in terms:
        for atom in term.atoms:
            moment = PRESENT * (atom.mean**2 + atom.sd**2) / len(term.atoms)
            covariance = covariance + moment * np.outer(atom.column, atom.column)
    return covariance


class _Smoother:
    """The flexible model fitted to some of the rows: random error by maximum likelihood."""

    def __init__(
        self, structure: Array, same: Array | None, residual: Array, sigmas: Array
    ) -> None:
        self.structure, self.same, self.residual = structure, same, residual
        self.sigmas: Array = sigmas

    def fit(self, keep: NDArray[np.bool_]) -> tuple[float, float]:
        """Random error and group share with the highest likelihood."""
        rows = np.flatnonzero(keep)
        base = self.structure[np.ix_(rows, rows)]
        r = self.residual[rows]
        best: tuple[float, float, float] = (-np.inf, float(self.sigmas[-1]), 0.0)
        values, vectors = np.linalg.eigh(base)
        if self.same is None:
            y = vectors.T @ r
            for sigma in self.sigmas:
                total = np.maximum(values, 0.0) + sigma**2
                like = -0.5 * float(np.sum(y**2 / total + np.log(total)))
                best = max(best, (like, float(sigma), 0.0))
            return best[1], best[2]
        same = self.same[np.ix_(rows, rows)]
        for sigma in self.sigmas[:: 2 if len(self.sigmas) > 8 else 1]:
            for share in GROUP_SHARES:
                covariance = base + (share * sigma) ** 2 * same
                covariance[np.diag_indices(len(rows))] += sigma**2
                factor = np.linalg.cholesky(covariance)
                white = np.linalg.solve(factor, r)
                like = -0.5 * float(white @ white) - float(np.log(np.diag(factor)).sum())
                best = max(best, (like, float(sigma), share))
        return best[1], best[2]

    def without(self, keep: NDArray[np.bool_], sigma: float, share: float) -> tuple[Array, Array]:
        """Deviation of every kept row from what the others predict, and its sd."""
        rows = np.flatnonzero(keep)
        covariance = self.structure[np.ix_(rows, rows)].copy()
        if self.same is not None:
            covariance += (share * sigma) ** 2 * self.same[np.ix_(rows, rows)]
        covariance[np.diag_indices(len(rows))] += sigma**2
        inverse = np.linalg.inv(covariance)
        diagonal = np.diag(inverse)
        return (inverse @ self.residual[rows]) / diagonal, 1.0 / np.sqrt(diagonal)


def screen(
    residual: Array,
    nuisance: Array,
    precision: Array,
    systematic: Array,
    group: NDArray[np.int64] | None,
    terms: list[Term],
    covariates: dict[str, Array],
    stated: float | None,
) -> Screened:
    """Find faulty rows and the course of the random error.

    Parameters
    ----------
    residual : ndarray (n,)
        Transformed measurement less prediction.
    nuisance, precision : ndarray (n, p), (p,)
        Directions of the parameters and their prior precision.
    systematic : ndarray (n, n)
        Covariance from stated systematic errors.
    group : ndarray (n,) of int, or None
        Rows that share an error.
    terms : list of Term
        Everything that may explain structure.
    covariates : dict of ndarray (n,)
        What the random error may follow.
    stated : float or None
        Stated random error.

    Returns
    -------
    screened : Screened
        One row at a time is compared with what all others predict, its own influence on the
        random error removed (externally studentised residuals, Bonferroni bound).
    """
    structure = _flexible(nuisance, precision, systematic, terms)
    same = None if group is None else (group[:, None] == group[None, :]).astype(np.float64)
    wide = max(float(np.std(residual)), 1e-12) * 1.25 ** np.arange(-24.0, 2.0)
    freedom = max(4.0, 0.6 * len(residual) - nuisance.shape[1] - 2.0)
    found = None
    if stated is not None:
        near = stated * 1.1 ** np.arange(-3.0, 3.0)
        found = _screened(_Smoother(structure, same, residual, near), np.inf)
    if found is None:  # not stated, or so many rows are off that the statement must be wrong
        found = _screened(_Smoother(structure, same, residual, wide), freedom)
    assert found is not None
    keep, standard, sigma = found
    if stated is not None:
        sigma = _Smoother(structure, same, residual, wide).fit(keep)[0]
    weight, name = _course(standard, keep, covariates)
    return Screened(~keep, weight, sigma, name)


def _screened(smoother: _Smoother, freedom: float) -> tuple[NDArray[np.bool_], Array, float] | None:
    """Rows to keep, their standardised deviations, and the random error.

    None where the random error is taken as known (infinite ``freedom``) and too many rows are off.
    """
    n = len(smoother.residual)
    most = max(1, int(MOST_OUTLIERS * n))
    bound = float(stats.t.isf(0.5 * OUTLIER_LEVEL / n, freedom))
    keep = np.ones(n, dtype=bool)
    sigma, share = smoother.fit(keep)
    while True:
        deviation, sd = smoother.without(keep, sigma, share)
        own = int(np.argmax(np.abs(deviation) / sd))
        trial = keep.copy()
        trial[np.flatnonzero(keep)[own]] = False
        new_sigma, new_share = smoother.fit(trial)
        deviation, sd = smoother.without(keep, new_sigma, new_share)
        if abs(deviation[own]) / sd[own] < bound:
            break
        if (~trial).sum() > most:
            if np.isinf(freedom):
                return None
            break
        keep, sigma, share = trial, new_sigma, new_share
    deviation, sd = smoother.without(keep, sigma, share)
    return keep, deviation / sd, sigma


def _course(
    standard: Array, keep: NDArray[np.bool_], covariates: dict[str, Array]
) -> tuple[Array, str | None]:
    """Relative variances by a score test of the log squares against each covariate."""
    n = len(keep)
    logs = np.log(np.maximum(standard**2, 1e-12)) - LOG_CHI2_MEAN
    logs = np.maximum(logs, -6.0)  # a hit on the line by chance says nothing
    best, chosen, slope_of = 0.0, None, 0.0
    for name, values in covariates.items():
        x = np.log(values) if (values > 0.0).all() else values
        centred = x[keep] - x[keep].mean()
        norm = float(centred @ centred)
        if norm <= 0.0:
            continue
        slope = float(centred @ logs) / norm
        score = abs(slope) * np.sqrt(norm / LOG_CHI2_VARIANCE)
        if score > best:
            best, chosen, slope_of = float(score), name, slope
    if chosen is None or best < stats.norm.isf(0.5 * SLOPE_LEVEL / len(covariates)):
        return np.ones(n), None
    x = covariates[chosen]
    x = np.log(x) if (x > 0.0).all() else x
    course = np.clip(slope_of * (x - x[keep].mean()), -MOST_SLOPE, MOST_SLOPE)
    return np.exp(course - course.mean()), chosen
