"""What would have been seen: the smallest amplitude of each effect that "none" excludes."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from greybed.residual.evidence import log_sum
from greybed.residual.fit import Fit, grams
from greybed.residual.look import Look
from greybed.residual.terms import Term

Array = NDArray[np.float64]

POWER = 0.9  # chance of being seen
DRAWS = 400


def detectable(seen: Look, null: Fit, critical: float) -> dict[str, Any]:
    """Smallest effects that these data would show nine times in ten.

    Parameters
    ----------
    seen : Look
        Rows and candidates.
    null : Fit
        Base model with its parameters: says what the noise is.
    critical : float
        Statistic above which something is called missing.

    Returns
    -------
    detectable : dict
        ``relative``: root mean square change of the response by the most visible effect at its
        smallest visible amplitude; ``effects``: amplitude and change of each.
    """
    found: dict[str, Any] = {}
    tau, sigma = null.grid_point
    for term in seen.terms:
        if term.effect is None:
            continue
        columns = np.column_stack([a.column for a in term.atoms])
        gram = grams(seen.grid, np.column_stack([columns, seen.nuisance]))[tau, sigma]
        m = columns.shape[1]
        inner = gram[m:, m:] + np.diag(seen.precision)
        norm = gram[:m, :m] - gram[:m, m:] @ np.linalg.solve(inner, gram[m:, :m])
        size = _smallest(term, norm, critical)
        if size is None:
            continue
        middle = columns[:, m // 2]
        found[term.name] = {
            "amplitude": size * abs(term.effect.typical),
            "relative": size * float(np.sqrt(np.mean(middle**2))),
            "theory": term.effect.theory,
        }
    smallest = min((item["relative"] for item in found.values()), default=float("nan"))
    return {"relative": smallest, "effects": found}


def _smallest(term: Term, norm: Array, critical: float) -> float | None:
    """Amplitude over typical at which the term alone lifts the statistic over the critical one.

    ``norm`` holds the atoms against each other, nuisance projected out; the projections of a
    residual with amplitude a are normal with mean a times a column of it and covariance ``norm``.
    """
    values, vectors = np.linalg.eigh(norm)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    noise = np.random.default_rng(0).standard_normal((DRAWS, len(norm))) @ root.T
    mean = np.array([a.mean for a in term.atoms])
    precision = np.array([a.sd for a in term.atoms]) ** -2.0
    weight = np.array([a.log_weight for a in term.atoms]) + term.log_prior
    q = np.diag(norm)

    def seen(size: float) -> float:
        c = size * norm[:, len(norm) // 2] + noise
        factor = 0.5 * (c - q * mean) ** 2 / (q + precision) + mean * c
        factor = factor - 0.5 * mean**2 * q - 0.5 * np.log1p(q / precision) + weight
        return float(np.mean(log_sum(factor, axis=1) > critical))

    sizes = np.geomspace(1e-3, 1e3, 121)
    for size in sizes:
        if seen(float(size)) >= POWER:
            return float(size)
    return None
