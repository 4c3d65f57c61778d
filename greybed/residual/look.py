"""One look at the rows: linearised terms, faulty rows, noise, and whether anything is missing."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from greybed.residual.evidence import Scan, log_sum, null_statistics, scan
from greybed.residual.noise import NoiseGrid, noise_grid
from greybed.residual.problem import Problem
from greybed.residual.screen import MOST_OUTLIERS, Screened, screen
from greybed.residual.terms import Term, blurred, terms

Array = NDArray[np.float64]

LEAST_VISIBLE = 0.10  # share of an effect that must remain after recalibration
SAMPLES = 999  # bootstraps at alpha 0.01; more where alpha is smaller
HINGES = 4  # most deviating rows to look at the finding without
EXCESS = 1.5  # scatter over the stated one that cannot be passed over
EXCESS_LEVEL = 1e-4
FEWEST_EXCEEDING = 10  # samples expected beyond the critical value


@dataclass(frozen=True)
class Look:
    """Rows, candidates and noise, ready for a search.

    Attributes
    ----------
    problem : Problem
        Without the faulty rows.
    t : ndarray (p,)
        Parameters at which everything is linearised.
    terms : list of Term
        Candidates that are identifiable.
    hidden : dict of str to str
        Effects that recalibration would absorb, or that these rows cannot show, with the reason.
    screened : Screened
        Of all rows.
    grid, scan
        Noise and evidence.
    nuisance, precision : ndarray (n, p), (p,)
        Directions of the parameters, and their prior precision.
    statistic : float
        Log evidence that anything at all is missing.
    excess : float or None
        Random scatter over the stated one, where it is certainly more than stated.
    """

    problem: Problem
    t: Array
    terms: list[Term]
    hidden: dict[str, str]
    screened: Screened
    grid: NoiseGrid
    scan: Scan
    nuisance: Array
    precision: Array
    statistic: float
    excess: float | None = None


def recalibrated(problem: Problem, prior_sd: Array, steps: int = 30) -> Array:
    """Parameters fitted without any effect: robust Gauss-Newton, shape (p,)."""
    t = np.zeros(len(problem.names))
    if not len(t):
        return t
    for _ in range(steps):
        residual = problem.z - problem.predict(t, {})
        slopes = problem.slopes(t, {})
        if not np.isfinite(residual).all() or not np.isfinite(slopes).all():
            break
        scale = max(1.4826 * float(np.median(np.abs(residual - np.median(residual)))), 1e-9)
        weight = np.minimum(1.0, 2.0 * scale / np.maximum(np.abs(residual), 1e-300)) / scale**2
        inner = slopes.T @ (slopes * weight[:, None]) + np.diag(prior_sd**-2.0)
        step = np.linalg.solve(inner, slopes.T @ (weight * residual) - t / prior_sd**2)
        step = np.clip(step, -1.0, 1.0)
        t = t + step
        if np.max(np.abs(step)) < 1e-7:
            break
    return t


def look(problem: Problem, reuse: Screened | None = None) -> Look:
    """Linearise, screen, and weigh every single term.

    Parameters
    ----------
    problem : Problem
        Rows and model.
    reuse : Screened or None
        An earlier screening of exactly these rows, for a hold-out.

    Returns
    -------
    look : Look
        Ready for :func:`existence` and a search.
    """
    free = problem.prior_sd > 1.0
    t = np.zeros(len(problem.names))
    if free.any():
        # measured parameters stay where they were measured
        t = np.where(free, recalibrated(problem, np.where(free, problem.prior_sd, 1e-6)), 0.0)
    candidates, hidden = terms(problem, t)
    residual = problem.z - problem.predict(t, {})
    slopes = problem.slopes(t, {})
    # a free parameter may go anywhere from here, a measured one knows where it was measured
    precision = problem.prior_sd**-2.0
    systematic = problem.systematic(t)
    group = problem.group if problem.grouped else None
    stated = problem.study.noise.relative
    screened = reuse or screen(
        residual, slopes, precision, systematic, group, candidates, _courses(problem, t), stated
    )
    candidates, unseen = _identifiable(candidates, slopes, precision, systematic, screened)
    hidden.update(unseen)
    keep = ~screened.outlier
    problem = problem.take(keep)
    candidates = [_cut(term, keep) for term in candidates]
    residual, slopes = residual[keep], slopes[keep]
    weight = screened.weight[keep]
    excess = _excess(screened.sigma, stated, int(keep.sum()))
    grid = noise_grid(
        weight,
        systematic[np.ix_(keep, keep)],
        None if group is None else group[keep],
        spread=1.5 * max(float(np.sqrt(np.mean(residual**2))), 1e-9),
        stated=None if excess else stated,
        smallest=max(0.4 * screened.sigma, 1e-9),
    )
    scanned = scan(grid, residual, slopes, precision, candidates)
    statistic = float(log_sum(scanned.singles(), axis=0))
    return Look(
        problem,
        t,
        candidates,
        hidden,
        screened,
        grid,
        scanned,
        slopes,
        precision,
        statistic,
        excess,
    )


def _excess(sigma: float, stated: float | None, rows: int) -> float | None:
    """Scatter over the stated one where chance cannot make it."""
    if stated is None:
        return None
    ratio = sigma / stated
    freedom = max(rows // 2, 3)  # a flexible model takes up to half of what the rows know
    certain = freedom * ratio**2 > stats.chi2.isf(EXCESS_LEVEL, freedom)
    return ratio if certain and ratio > EXCESS else None


def _courses(problem: Problem, t: Array) -> dict[str, Array]:
    """What the random error may follow."""
    return {**problem.covariates(), "the predicted response": problem.predict(t, {})}


def _cut(term: Term, keep: NDArray[np.bool_]) -> Term:
    atoms = tuple(replace(atom, column=atom.column[keep]) for atom in term.atoms)
    return replace(term, atoms=atoms, basis=None if term.basis is None else term.basis[keep])


def _identifiable(
    candidates: list[Term],
    slopes: Array,
    precision: Array,
    systematic: Array,
    screened: Screened,
) -> tuple[list[Term], dict[str, str]]:
    """Effects that leave a trace when the parameters are recalibrated."""
    noise = systematic + np.diag(screened.sigma**2 * screened.weight)
    absorbed = noise + (slopes / precision) @ slopes.T
    kept, hidden = [], {}
    for term in candidates:
        column = term.atoms[0].column
        before = float(column @ np.linalg.solve(noise, column))
        after = float(column @ np.linalg.solve(absorbed, column))
        if term.kind == "effect" and after < LEAST_VISIBLE**2 * before:
            hidden[term.name] = (
                f"recalibrating the parameters absorbs all but {np.sqrt(after / before):.0%} of it"
            )
        else:
            kept.append(blurred(term, min(1.0, np.sqrt(after / max(before, 1e-300)))))
    return kept, hidden


def without_hinge(whole: Problem, seen: Look, critical: float) -> Look:
    """Look again without rows on which the whole finding hangs, one at a time.

    Parameters
    ----------
    whole : Problem
        All rows.
    seen : Look
        Of ``whole``, with a statistic above ``critical``.
    critical : float
        Statistic above which something is missing.

    Returns
    -------
    look : Look
        ``seen`` itself, unless leaving out one of its most deviating rows takes the statistic
        below the critical one: then that row is an outlier, since an effect shows in many.
    """
    most = max(1, int(MOST_OUTLIERS * len(whole)))
    while seen.terms and seen.statistic >= critical:
        outlier = seen.screened.outlier
        if outlier.sum() >= most:
            break
        residual = whole.z - whole.predict(seen.t, {})
        off = np.where(outlier, 0.0, np.abs(residual - np.median(residual[~outlier])))
        off = off / np.sqrt(seen.screened.weight)
        for row in np.argsort(-off)[:HINGES]:
            trial = outlier.copy()
            trial[row] = True
            again = look(whole, replace(seen.screened, outlier=trial))
            if again.statistic < critical:
                seen = again
                break
        else:
            break
    return seen


def existence(seen: Look, alpha: float, seed: int) -> tuple[float, float]:
    """Chance that a complete model shows as much structure, and the critical statistic.

    Parameters
    ----------
    seen : Look
        The rows and candidates.
    alpha : float
        Family-wise level over all terms.
    seed : int
        Of the parametric bootstrap.

    Returns
    -------
    p_value, critical : float
        Smallest possible p is 1 / (samples + 1).
    """
    samples = max(SAMPLES, int(np.ceil(FEWEST_EXCEEDING / alpha)) - 1)
    columns = np.column_stack([a.column for term in seen.terms for a in term.atoms])
    null = null_statistics(
        seen.scan,
        seen.grid,
        seen.nuisance,
        seen.precision,
        columns,
        samples,
        np.random.default_rng(seed),
    )
    p_value = (1 + int((null >= seen.statistic).sum())) / (samples + 1)
    rank = int(np.floor(alpha * (samples + 1)))
    return p_value, float(np.sort(null)[::-1][max(rank - 1, 0)])
