"""Evidence of sets of terms: Gaussian algebra on a noise grid, vectorised over sets and samples.

Words here: an *atom* is one column that a term may add, with a Gaussian prior of its amplitude; a
term of an unknown exponent has several. A *point* of the noise grid is one group error (tau, T of
them) with one random error (sigma, S of them); points are counted as ``h = tau_index * S +
sigma_index``. *Nuisance* columns are always there, such as those of free parameters.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from greybed.residual.noise import NoiseGrid
from greybed.residual.terms import Term

Array = NDArray[np.float64]

COARSE = (3, 4)  # a search over sets looks at every third group error, every fourth random one
NEAR = 2.2  # bootstrap samples lie within this factor of the data's random error


def log_sum(values: Array, axis: int | tuple[int, ...]) -> Array:
    """Logarithm of a sum of exponentials along ``axis``."""
    top = np.max(values, axis=axis, keepdims=True)
    total = np.log(np.sum(np.exp(values - top), axis=axis, keepdims=True)) + top
    return np.squeeze(total, axis=axis)


@dataclass(frozen=True)
class Scan:
    """Projections of residual and atoms, nuisance columns taken out, on the noise grid.

    Attributes
    ----------
    grid : NoiseGrid
        T group errors by S random errors; H = T S points.
    log_null : ndarray (H,)
        Log density of the residual without any term, times the prior of the point.
    dot, norm : ndarray (H, m)
        Weighted products of each atom with the residual, and with itself.
    coarse : ndarray (C,), int
        Points of the grid that stand for all in a search over sets.
    gram : ndarray (C, m, m)
        Weighted products of all atoms with each other there.
    mean, precision, log_weight : ndarray (m,)
        Priors of the atoms, with the prior of their term.
    term : ndarray (m,), int
        Which term an atom belongs to.
    """

    grid: NoiseGrid
    log_null: Array
    dot: Array
    norm: Array
    coarse: NDArray[np.int64]
    gram: Array
    mean: Array
    precision: Array
    log_weight: Array
    term: NDArray[np.int64]

    def singles(self) -> Array:
        """Log evidence of each atom with its prior, against 1 for the null, shape (m,)."""
        factor = self.factors(self.dot, self.norm)
        joint = log_sum(self.log_null[:, None] + factor, axis=0)
        return joint + self.log_weight - log_sum(self.log_null, axis=0)

    def factors(self, dot: Array, norm: Array) -> Array:
        """Log Bayes factor of single atoms for given products, (..., m)."""
        mean, precision = self.mean, self.precision
        b = dot - norm * mean
        return (
            0.5 * b**2 / (norm + precision)
            + mean * dot
            - 0.5 * mean**2 * norm
            - 0.5 * np.log1p(norm / precision)
        )


def scan(
    grid: NoiseGrid,
    residual: Array,
    nuisance: Array,
    precision: Array,
    terms: list[Term],
) -> Scan:
    """Project everything at every point of the grid.

    Parameters
    ----------
    grid : NoiseGrid
        Of n rows.
    residual : ndarray (n,)
        Transformed measurement less prediction.
    nuisance, precision : ndarray (n, p), (p,)
        Columns whose coefficients are not in question, such as those of the parameters, and the
        precision of their Gaussian prior about 0.
    terms : list of Term
        Candidates.
    """
    atoms = [(a, i) for i, term in enumerate(terms) for a in term.atoms]
    p = nuisance.shape[1]
    columns = np.column_stack([residual, *(a.column for a, _ in atoms)])
    rotated = grid.rotate(columns)  # (T, n, 1 + m)
    side = grid.rotate(nuisance)  # (T, n, p)
    weight = grid.precision()  # (T, S, n)
    t, s, n = weight.shape
    # Column 0 is the residual itself, in dot, norm and gram alike; it is taken off at the end.
    dot = weight @ (rotated * rotated[:, :, :1])  # (T, S, 1 + m)
    norm = weight @ rotated**2
    log_null = (grid.log_prior - 0.5 * grid.log_det()).ravel()
    dot, norm = dot.reshape(t * s, -1), norm.reshape(t * s, -1)
    coarse = _coarse(t, s)
    coarse_weight = weight.reshape(t * s, n)[coarse]
    coarse_tau = coarse // s
    gram = np.stack(
        [
            rotated[k].T @ (rotated[k] * w[:, None])
            for k, w in zip(coarse_tau, coarse_weight, strict=True)
        ]
    )
    if p:
        products = side[:, :, :, None] * side[:, :, None, :]
        inner = (weight @ products.reshape(t, n, p * p)).reshape(t * s, p, p) + np.diag(precision)
        cross = np.stack([weight @ (rotated * side[:, :, j : j + 1]) for j in range(p)], axis=2)
        cross = cross.reshape(t * s, p, -1)
        solved = np.linalg.solve(inner, cross)
        dot = dot - np.einsum("hp,hpm->hm", cross[:, :, 0], solved)
        norm = norm - np.einsum("hpm,hpm->hm", cross, solved)
        gram = gram - np.swapaxes(cross[coarse], 1, 2) @ solved[coarse]
        log_null = log_null - 0.5 * np.linalg.slogdet(inner)[1] + 0.5 * np.log(precision).sum()
    return Scan(
        grid,
        log_null - 0.5 * norm[:, 0],
        dot[:, 1:],
        norm[:, 1:],
        coarse,
        gram[:, 1:, 1:],
        np.array([a.mean for a, _ in atoms]),
        np.array([a.sd for a, _ in atoms]) ** -2.0,
        np.array([a.log_weight + terms[i].log_prior for a, i in atoms]),
        np.array([i for _, i in atoms], dtype=np.int64),
    )


def _coarse(t: int, s: int) -> NDArray[np.int64]:
    """Every few points of a grid of t by s."""
    pick = np.zeros((t, s), dtype=bool)
    pick[:: COARSE[0], :: COARSE[1]] = True
    return np.flatnonzero(pick.ravel())


def null_statistics(
    whole: Scan,
    grid: NoiseGrid,
    nuisance: Array,
    nuisance_precision: Array,
    columns: Array,
    samples: int,
    generator: np.random.Generator,
) -> Array:
    """Sum of the evidence of all single terms, for residuals drawn without any of them.

    Parameters
    ----------
    whole : Scan
        Of the data: says at which noise the data lie without a term.
    grid : NoiseGrid
        Of the same rows.
    nuisance, nuisance_precision
        As in :func:`scan`; coefficients are drawn from their prior, since a measured parameter
        is measured anew in every repetition of the experiment.
    columns : ndarray (n, m)
        Atoms.
    samples : int
        Residuals to draw.
    generator : Generator
        Random numbers.

    Returns
    -------
    statistics : ndarray (samples,)
        To compare with the same sum of the data; each sample is given the noise drawn from what
        the data allow for it.
    """
    n = len(nuisance)
    share = np.exp(whole.log_null - whole.log_null.max())
    points = generator.choice(len(share), size=samples, p=share / share.sum())
    tau, sigma = np.divmod(points, len(grid.sigma))
    white = generator.standard_normal((samples, n))
    rotated = white * np.sqrt(grid.sigma[sigma][:, None] ** 2 + grid.values[tau])
    draws = np.einsum("bij,bj->bi", grid.vectors[tau], rotated) * np.sqrt(grid.weight)
    if nuisance.shape[1]:
        coefficient = generator.standard_normal((samples, nuisance.shape[1]))
        draws += (coefficient / np.sqrt(nuisance_precision)) @ nuisance.T
    near = grid.near(float(np.exp(np.mean(np.log(grid.sigma[sigma])))), NEAR)
    return _statistics(whole, near, draws, nuisance, nuisance_precision, columns)


def _statistics(
    whole: Scan,
    grid: NoiseGrid,
    draws: Array,
    nuisance: Array,
    precision: Array,
    columns: Array,
) -> Array:
    """The statistic of each draw (B, n), by the same sums as :meth:`Scan.singles`."""
    p = nuisance.shape[1]
    rotated = grid.rotate(np.column_stack([nuisance, columns]))
    rotated_draws = grid.rotate(draws.T)  # (T, n, B)
    weight = grid.precision()
    constant = grid.log_prior - 0.5 * grid.log_det()
    none = np.full(len(draws), -np.inf)
    some = np.full(len(draws), -np.inf)
    for k in range(weight.shape[0]):
        for s in range(weight.shape[1]):
            weighted = rotated_draws[k] * weight[k, s][:, None]
            square = np.einsum("nb,nb->b", rotated_draws[k], weighted)
            cross = rotated[k].T @ weighted  # (p + m, B)
            norm = weight[k, s] @ rotated[k][:, p:] ** 2
            base, dot = constant[k, s], cross[p:]
            if p:
                scaled = rotated[k][:, :p] * weight[k, s][:, None]
                inner = rotated[k][:, :p].T @ scaled + np.diag(precision)
                mixed = rotated[k][:, p:].T @ scaled
                solved = np.linalg.solve(inner, cross[:p])
                square = square - np.einsum("pb,pb->b", cross[:p], solved)
                dot = dot - mixed @ solved
                norm = norm - np.einsum("mp,mp->m", mixed, np.linalg.solve(inner, mixed.T).T)
                base = base - 0.5 * np.linalg.slogdet(inner)[1]
            null = base - 0.5 * square
            factor = whole.factors(dot.T, norm) + whole.log_weight
            none = np.logaddexp(none, null)
            some = np.logaddexp(some, null + log_sum(factor, axis=1))
    return some - none
