"""What would have been seen: the smallest amplitude of each effect that "none" excludes."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import stats

from greybed.residual.fit import Fit, grams
from greybed.residual.look import Look

POWER = 0.9  # chance of being seen


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
        atom = term.atoms[0]
        gram = grams(seen.grid, np.column_stack([atom.column, seen.nuisance]))[tau, sigma]
        inner = gram[1:, 1:] + np.diag(seen.precision)
        norm = float(gram[0, 0] - gram[0, 1:] @ np.linalg.solve(inner, gram[1:, 0]))
        if norm <= 0.0:
            continue
        sd = 1.0 / np.sqrt(norm)
        # a term alone must carry the whole statistic, its prior share included
        needed = critical - term.log_prior + 0.5 * np.log1p(norm / max(atom.sd**-2.0, 1e-12))
        size = sd * (np.sqrt(2.0 * max(needed, 0.0)) + float(stats.norm.isf(1.0 - POWER)))
        relative = size * float(np.sqrt(np.mean(atom.column**2)))
        found[term.name] = {
            "amplitude": size * abs(term.effect.typical),
            "relative": relative,
            "theory": term.effect.theory,
        }
    smallest = min((item["relative"] for item in found.values()), default=float("nan"))
    return {"relative": smallest, "effects": found}
