"""A dependence without a name: its covariate, exponent and window, by profile likelihood."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from greybed.closures.term import GreyBoxTerm
from greybed.residual.diagnosis import Dependence
from greybed.residual.fit import Fit, extra, offsets, predict, prior_precision
from greybed.residual.noise import NoiseGrid
from greybed.residual.problem import Problem
from greybed.residual.terms import POWER_SD, Term

Array = NDArray[np.float64]

EXPONENTS = np.arange(-4.0, 4.0 + 1e-9, 0.05)
SIZES = np.geomspace(0.003, 100.0, 60)  # largest relative change to try
MOST_TAKEN = 0.95
LEAST_PRECISION = 0.05  # of what else is fitted, so that no digits are lost
BARE = 3.0  # log likelihood by which an unusual form must beat a usual one
# Form, and whether it is usual: something added to the response or to a resistance. A share taken
# away turns negative somewhere, and a bare power tends to no limit.
FORMS = {
    False: (
        ("times", True),
        ("over", True),
        ("times less", False),
        ("over less", False),
        ("power", False),
    ),
    True: (("added", True),),
}
DROP = 1.92  # of the log likelihood at the ends of a 95 % interval


def dependence(
    problem: Problem, grid: NoiseGrid, made: Fit, term: Term
) -> tuple[Dependence, GreyBoxTerm | None]:
    """Exponent of an unnamed term that ``made`` holds.

    Parameters
    ----------
    problem, grid
        The rows and their noise.
    made : Fit
        With the term in it.
    term : Term
        Of kind ``inside`` or ``outside``.

    Returns
    -------
    dependence : Dependence
        Of the best form: response times 1 + a z^n, response over 1 + a z^n (an added
        resistance), or unusual ones where they fit clearly better.
    closure : GreyBoxTerm or None
        The better of the two usual forms, to run and to export; None where there is no power.
    """
    p = len(problem.names)
    k = offsets(made.terms, p)[made.terms.index(term)]
    values = problem.columns[term.name]
    own = np.concatenate([np.zeros(p), made.u[k : k + term.size]])
    alone = extra((term,), own, p, problem)
    visible = np.abs(alone) > made.sigma
    window = values[visible] if visible.any() else values
    ends = (float(window.min()), float(window.max()))
    assert term.basis is not None
    if term.linear:
        unsure = (float("nan"), float("nan"))
        return Dependence(covariate=term.name, exponent=1.0, ci95=unsure, window=ends), None
    residual = problem.z - (made.fitted - alone)
    white = _whitener(problem, grid, made, k, term.size)
    best: tuple[float, float, tuple[float, float]] | None = None
    usual: tuple[float, GreyBoxTerm] | None = None
    linear = problem.model.transform != "log"
    for form, natural in FORMS[linear]:
        profile, sizes = _profile(white, residual, np.log(term.basis), form)
        if not natural:
            profile = profile - BARE
        top = int(np.argmax(profile))
        n = float(EXPONENTS[top])
        if form in ("times", "over") and n != 0.0 and (usual is None or profile[top] > usual[0]):
            # sizes are those at the largest value of basis^n
            extreme = values.max() if n > 0.0 else values.min()
            usual = (
                float(profile[top]),
                GreyBoxTerm(
                    name=f"{term.name}_term",
                    covariate=term.name,
                    unit=problem.study.table.units.get(term.name, ""),
                    response=problem.study.response,
                    reference=float(extreme),
                    amplitude=float(sizes[top]),
                    exponent=n,
                    side=1 if form == "times" else -1,
                    window=(float(values.min()), float(values.max())),
                    card={"model": problem.model.name, "rows": len(problem)},
                ),
            )
        if best is None or profile[top] > best[0]:
            near = EXPONENTS[profile > profile[top] - DROP]
            best = (float(profile[top]), _peak(profile, top), (float(near[0]), float(near[-1])))
    assert best is not None
    found = Dependence(covariate=term.name, exponent=best[1], ci95=best[2], window=ends)
    return found, None if usual is None else usual[1]


def _whitener(problem: Problem, grid: NoiseGrid, made: Fit, k: int, size: int) -> Array:
    """Inverse Cholesky factor of the noise and of everything else that is fitted."""
    others = np.array([j for j in range(len(made.u)) if not k <= j < k + size], dtype=int)
    covariance = grid.covariance(*made.grid_point)
    slopes = []
    centre = predict(problem, made.terms, made.u)
    for j in others:
        moved = made.u.copy()
        step = 1e-4 * max(1.0, abs(moved[j]))
        moved[j] += step
        slopes.append((predict(problem, made.terms, moved) - centre) / step)
    if slopes:
        matrix = np.column_stack(slopes)
        # the others may move as far as they might before the data
        precision = np.maximum(prior_precision(problem, made)[others], LEAST_PRECISION)
        covariance = covariance + (matrix / precision) @ matrix.T
    return np.linalg.inv(np.linalg.cholesky(covariance))


def _profile(white: Array, residual: Array, log_z: Array, form: str) -> tuple[Array, Array]:
    """Log likelihood of each exponent, amplitude (and constant) at their best; amplitudes."""
    profile = np.full(len(EXPONENTS), -np.inf)
    chosen = np.zeros(len(EXPONENTS))
    y = white @ residual
    one = white @ np.ones(len(residual))
    for i, n in enumerate(EXPONENTS):
        z = np.exp(n * log_z)
        z = z / z.max()
        if form == "power":
            off = y - white @ (n * log_z)
            constant = float(one @ off) / (float(one @ one) + POWER_SD**-2.0)
            off = off - constant * one
            profile[i] = -0.5 * float(off @ off) - 0.5 * (constant / POWER_SD) ** 2
            continue
        if form == "added":
            x = white @ z
            off = y - x * (float(x @ y) / float(x @ x))
            profile[i] = -0.5 * float(off @ off)
            continue
        less = form.endswith("less")
        sizes = -SIZES[SIZES < MOST_TAKEN] if less else SIZES
        for _ in range(3):
            curves = np.log1p(np.outer(z, sizes))
            off = y[:, None] - white @ (curves if form.startswith("times") else -curves)
            cost = 0.5 * np.einsum("ij,ij->j", off, off)
            b = int(np.argmin(cost))
            if -float(cost[b]) > profile[i]:
                profile[i], chosen[i] = -float(cost[b]), sizes[b]
            sizes = sizes[b] * np.linspace(0.8, 1.25, 15)
            sizes = sizes[sizes > -0.999]  # nothing may turn negative
    return profile, chosen


def _peak(profile: Array, top: int) -> float:
    """Exponent at the top of the parabola through the best three."""
    if not 0 < top < len(profile) - 1:
        return float(EXPONENTS[top])
    a, b, c = profile[top - 1 : top + 2]
    curve = a - 2.0 * b + c
    shift = 0.5 * (a - c) / curve if curve < 0.0 else 0.0
    return float(EXPONENTS[top] + np.clip(shift, -0.5, 0.5) * (EXPONENTS[1] - EXPONENTS[0]))
