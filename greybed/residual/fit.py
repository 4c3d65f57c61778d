"""Nonlinear fit of a set of terms: parameters, amplitudes, exponents, noise, and its evidence."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from greybed.residual.evidence import log_sum
from greybed.residual.noise import NoiseGrid
from greybed.residual.problem import Problem
from greybed.residual.terms import LABEL_SD, OFF_SPREAD, OFF_THEORY, POWER_SD, Term, power

Array = NDArray[np.float64]

ITERATIONS = 25
LARGEST_EXPONENT = 4.0
LOG_2PI = float(np.log(2.0 * np.pi))


@dataclass(frozen=True)
class Fit:
    """A set of terms fitted to the rows.

    Attributes
    ----------
    terms : tuple of Term
        The set; empty for the base model with its parameters.
    u : ndarray (p + k,)
        Parameters t, then for each term its amplitude over typical (and exponent).
    fitted : ndarray (n,)
        Transformed prediction.
    log_evidence : float
        Integrated over coefficients and noise, with the prior of each term.
    log_likelihood : float
        Of the residual at the best point, without priors.
    sigma, tau : float
        Random and group error at the best point.
    covariance : ndarray (p + k, p + k)
        Of u, from data and priors, at the best noise.
    flat : ndarray (p + k, 3)
        Estimate and 95 % interval of each entry without its own prior, noise integrated.
    grid_point : tuple of int
        Index of tau and sigma.
    converged : bool
        Whether the last step was small.
    """

    terms: tuple[Term, ...]
    u: Array
    fitted: Array
    log_evidence: float
    log_likelihood: float
    sigma: float
    tau: float
    covariance: Array
    flat: Array
    grid_point: tuple[int, int]
    converged: bool

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the terms."""
        return tuple(term.name for term in self.terms)


def amplitudes(terms: tuple[Term, ...], u: Array, p: int) -> dict[str, float]:
    """Amplitudes of the effects in the units of their laws."""
    found = {}
    for term, k in zip(terms, offsets(terms, p), strict=True):
        if term.effect is not None:
            found[term.effect.name] = float(u[k]) * term.effect.typical
    return found


def offsets(terms: tuple[Term, ...], p: int) -> list[int]:
    """Where each term's amplitude stands in u."""
    places = []
    for term in terms:
        places.append(p)
        p += term.size
    return places


def extra(terms: tuple[Term, ...], u: Array, p: int, problem: Problem) -> Array:
    """What labels and powers add to the transformed prediction, shape (n,)."""
    total = np.zeros(len(problem))
    for term, k in zip(terms, offsets(terms, p), strict=True):
        if term.kind == "effect":
            continue
        basis = term.on(problem)
        if term.kind == "label" or term.linear:
            total += u[k] * basis
        else:
            total += u[k] * power(basis, float(u[k + 1]), term.basis)
    return total


def predict(problem: Problem, terms: tuple[Term, ...], u: Array) -> Array:
    """Transformed prediction with the terms, shape (n,); the rows need not be those of a fit."""
    p = len(problem.names)
    base = problem.predict(u[:p], amplitudes(terms, u, p))
    return base + extra(terms, u, p, problem)


def _slopes(problem: Problem, terms: tuple[Term, ...], u: Array, centre: Array) -> Array:
    p = len(problem.names)
    slopes = np.empty((len(problem), len(u)))
    for j in range(len(u)):
        step = 1e-5 * max(1.0, abs(u[j])) if j >= p else 1e-4
        moved = u.copy()
        moved[j] += step
        slopes[:, j] = (predict(problem, terms, moved) - centre) / step
    return slopes


def at_end(made: Fit, p: int) -> str | None:
    """Name of an effect whose amplitude stands at the end of what physics allows."""
    low, high = _bounds(made.terms, p, len(made.u))
    for term, k in zip(made.terms, offsets(made.terms, p), strict=True):
        if term.effect is not None and not low[k] * 1.001 < made.u[k] < high[k] * 0.999:
            return term.name
    return None


@dataclass(frozen=True)
class _Prior:
    """Local Gaussian shape of the prior at u: precision, pull and log density."""

    precision: Array
    pull: Array
    log_density: float
    log_pulling: float  # the part of the density that pulls: what a fit weighs against the data


def _log_normal(x: Array | float, sd: Array | float) -> Array:
    """Log density of a normal variable about 0; scipy's checks take ten times as long here."""
    return -0.5 * (np.divide(x, sd) ** 2 + LOG_2PI) - np.log(sd)


def _prior(problem: Problem, terms: tuple[Term, ...], u: Array, flat: int | None = None) -> _Prior:
    p = len(problem.names)
    precision = np.zeros(len(u))
    pull = np.zeros(len(u))
    density = even = 0.0
    precision[:p] = problem.prior_sd**-2.0
    pull[:p] = -u[:p] * precision[:p]
    density += float(np.sum(_log_normal(u[:p], problem.prior_sd)))
    for term, k in zip(terms, offsets(terms, p), strict=True):
        if term.kind == "effect":
            assert term.effect is not None
            if term.effect.theory is not None:
                sds = np.array([term.spread, OFF_SPREAD])
                logs = np.log([1.0 - OFF_THEORY, OFF_THEORY])
                logs = logs + _log_normal(u[k] - 1.0, sds)
                total = float(np.logaddexp(*logs))
                share = np.exp(logs - total)
                precision[k] = float(share @ sds**-2.0)
                pull[k] = (1.0 - u[k]) * precision[k]
                density += total
            else:
                low, high = term.effect.sizes
                size = max(abs(float(u[k])), 1e-12)
                # even in the logarithm of the amplitude, so it pulls nowhere
                even -= float(np.log(size * np.log(high / low)))
                # data that say nothing must leave the evidence as it was: a normal curve with the
                # same peak as the even density has the same area
                precision[k] = 2.0 * np.pi / (size * np.log(high / low)) ** 2
        else:
            sd = LABEL_SD if term.kind == "label" else POWER_SD
            precision[k] = sd**-2.0
            pull[k] = -u[k] * precision[k]
            density += float(_log_normal(u[k], sd))
            if term.size == 2:
                precision[k + 1] = 2.0 * np.pi / (2.0 * LARGEST_EXPONENT) ** 2
                even -= float(np.log(2.0 * LARGEST_EXPONENT))
    if flat is not None:
        precision[flat] = 1e-12
        pull[flat] = 0.0
    return _Prior(precision, pull, density + even, density)


def prior_precision(problem: Problem, made: Fit) -> Array:
    """Prior precision of each entry of u, shape (p + k,)."""
    return _prior(problem, made.terms, made.u).precision


def _bounds(terms: tuple[Term, ...], p: int, size: int) -> tuple[Array, Array]:
    low = np.full(size, -np.inf)
    high = np.full(size, np.inf)
    for term, k in zip(terms, offsets(terms, p), strict=True):
        if term.effect is not None:
            scale = abs(term.effect.typical)
            low[k], high[k] = (size / scale for size in term.effect.sizes)
        elif term.size == 2:
            low[k + 1], high[k + 1] = -LARGEST_EXPONENT, LARGEST_EXPONENT
    return low, high


def grams(grid: NoiseGrid, matrix: Array) -> Array:
    """Products of the columns under every noise of the grid, shape (T, S, m, m)."""
    rotated = grid.rotate(matrix)
    m = matrix.shape[1]
    weight = grid.precision()
    products = rotated[:, :, :, None] * rotated[:, :, None, :]
    flat = products.reshape(*products.shape[:2], m * m)
    return (weight @ flat).reshape(*weight.shape[:2], m, m)


def fit(
    problem: Problem,
    grid: NoiseGrid,
    terms: tuple[Term, ...],
    start: Array,
    flat: int | None = None,
    intervals: bool = False,
) -> Fit:
    """Fit a set of terms by Gauss-Newton steps, with the noise chosen anew at each step.

    Parameters
    ----------
    problem : Problem
        Rows and model.
    grid : NoiseGrid
        Of the same rows.
    terms : tuple of Term
        The set.
    start : ndarray (p + k,)
        Where to begin.
    flat : int or None
        Entry of u whose prior is left out, for an interval that is the data's alone.
    intervals : bool
        Whether to work out ``flat``.

    Returns
    -------
    fit : Fit
        ``log_evidence`` by Laplace's formula at every point of the noise grid, summed.
    """
    p = len(problem.names)
    low, high = _bounds(terms, p, len(start))
    u = np.clip(start, low, high)
    constant = grid.log_prior - 0.5 * grid.log_det()
    converged = False
    centre = predict(problem, terms, u)
    for _ in range(ITERATIONS):
        slopes = _slopes(problem, terms, u, centre)
        if not np.isfinite(slopes).all() or not np.isfinite(centre).all():
            break
        gram = grams(grid, np.column_stack([problem.z - centre, slopes]))
        prior = _prior(problem, terms, u, flat)
        inner = gram[..., 1:, 1:] + np.diag(prior.precision)
        right = gram[..., 1:, 0] + prior.pull
        steps = np.linalg.solve(inner, right[..., None])[..., 0]
        gain = 0.5 * np.einsum("tsk,tsk->ts", right, steps)
        score = constant - 0.5 * gram[..., 0, 0] + gain
        if len(u):
            score = score - 0.5 * np.linalg.slogdet(inner)[1]
        best = np.unravel_index(int(np.argmax(score)), score.shape)
        point = (int(best[0]), int(best[1]))
        if not len(u):
            converged = True
            break
        step = np.clip(u + steps[point], low, high) - u
        precision = inner[point]
        if _small(step, precision):
            converged = True
            break
        u, centre, moved = _advance(problem, grid, terms, u, centre, step, point, flat)
        if not moved:
            converged = True
            break
    else:
        gram = grams(
            grid, np.column_stack([problem.z - centre, _slopes(problem, terms, u, centre)])
        )
    return _finish(problem, grid, terms, u, centre, converged, flat, intervals)


def _small(step: Array, precision: Array) -> bool:
    return float(step @ precision @ step) < 1e-6


def _cost(
    problem: Problem,
    grid: NoiseGrid,
    terms: tuple[Term, ...],
    u: Array,
    centre: Array,
    point: tuple[int, int],
    flat: int | None,
) -> float:
    e = grid.vectors[point[0]].T @ ((problem.z - centre) / np.sqrt(grid.weight))
    total = grid.sigma[point[1]] ** 2 + grid.values[point[0]]
    prior = _prior(problem, terms, u, flat).log_pulling if flat is None else 0.0
    cost = 0.5 * float(np.sum(e**2 / total)) - prior
    return cost if np.isfinite(cost) else np.inf


def _advance(
    problem: Problem,
    grid: NoiseGrid,
    terms: tuple[Term, ...],
    u: Array,
    centre: Array,
    step: Array,
    point: tuple[int, int],
    flat: int | None,
) -> tuple[Array, Array, bool]:
    """A step that lowers the cost, halved until it does."""
    before = _cost(problem, grid, terms, u, centre, point, flat)
    for _ in range(8):
        trial = u + step
        predicted = predict(problem, terms, trial)
        after = _cost(problem, grid, terms, trial, predicted, point, flat)
        if after <= before + 1e-9:
            return trial, predicted, True
        step = 0.5 * step
    return u, centre, False


def _finish(
    problem: Problem,
    grid: NoiseGrid,
    terms: tuple[Term, ...],
    u: Array,
    centre: Array,
    converged: bool,
    flat: int | None,
    intervals: bool,
) -> Fit:
    size = len(u)
    if not np.isfinite(centre).all():
        nothing = np.full((size, 3), np.nan)
        return Fit(
            terms, u, centre, -np.inf, -np.inf, 0.0, 0.0, np.eye(size), nothing, (0, 0), False
        )
    slopes = _slopes(problem, terms, u, centre)
    gram = grams(grid, np.column_stack([problem.z - centre, slopes]))
    prior = _prior(problem, terms, u, flat)
    inner = gram[..., 1:, 1:] + np.diag(prior.precision)
    right = gram[..., 1:, 0] + prior.pull
    score = grid.log_prior - 0.5 * grid.log_det() - 0.5 * gram[..., 0, 0] + prior.log_density
    if size:
        steps = np.linalg.solve(inner, right[..., None])[..., 0]
        score = score + 0.5 * np.einsum("tsk,tsk->ts", right, steps)
        score = score - 0.5 * np.linalg.slogdet(inner)[1] + 0.5 * size * LOG_2PI
    evidence = float(log_sum(score.reshape(1, -1), axis=1)[0])
    evidence += sum(term.log_prior for term in terms)
    point = np.unravel_index(int(np.argmax(score)), score.shape)
    chance = np.exp(score - score.max())
    likelihood = -0.5 * (grid.log_det() + gram[..., 0, 0])[point]
    ends = np.full((size, 3), np.nan)
    if intervals:
        ends = _intervals(u, gram, prior, chance / chance.sum())
    return Fit(
        terms,
        u,
        centre,
        evidence,
        float(likelihood),
        float(grid.sigma[point[1]]),
        float(grid.tau[point[0]]),
        np.linalg.inv(inner[point]) if size else np.zeros((0, 0)),
        ends,
        (int(point[0]), int(point[1])),
        converged,
    )


def _intervals(u: Array, gram: Array, prior: _Prior, chance: Array) -> Array:
    """Estimate and 95 % interval of each entry without its own prior."""
    size = len(u)
    out = np.full((size, 3), np.nan)
    heavy = chance > 1e-4 * chance.max()
    weight = chance[heavy] / chance[heavy].sum()
    picked = gram[heavy]
    for k in range(size):
        precision = prior.precision.copy()
        pull = prior.pull.copy()
        precision[k], pull[k] = 1e-12, 0.0
        inner = picked[:, 1:, 1:] + np.diag(precision)
        try:
            covariance = np.linalg.inv(inner)
        except np.linalg.LinAlgError:
            continue
        step = np.einsum("hk,hk->h", covariance[:, k], picked[:, 1:, 0] + pull)
        mean = u[k] + step
        sd = np.sqrt(np.maximum(covariance[:, k, k], 0.0))
        centre, width = float(weight @ mean), float(weight @ sd)
        if not np.isfinite(width) or width <= 0.0:
            continue
        x = centre + width * np.linspace(-12.0, 12.0, 1601)
        total = (weight[:, None] * stats.norm.cdf(x, mean[:, None], sd[:, None])).sum(axis=0)
        out[k] = centre, np.interp(0.025, total, x), np.interp(0.975, total, x)
    return out
