"""Intervals of amplitudes that include the choice of the set."""

from __future__ import annotations

import numpy as np
from scipy import stats

from greybed.residual.fit import Fit, fit, offsets
from greybed.residual.look import Look
from greybed.residual.search import Search, log_odds
from greybed.residual.terms import Term

WORTH = 4.0  # log odds below the best at which a set still counts
MOST = 6


def over_sets(seen: Look, final: Fit, found: Search, term: Term) -> tuple[float, float]:
    """95 % interval of an amplitude over its typical one.

    Parameters
    ----------
    seen, final, found
        Rows, the set that is reported (with intervals), and all sets that were fitted.
    term : Term
        An effect in ``final``.

    Returns
    -------
    low, high : float
        Quantiles of the mixture over the sets that hold the effect, weighted by their odds; in
        each the amplitude's own prior is left out, so that the interval is the data's.
    """
    p = len(seen.problem.names)
    near = [f for f in found.fits if term in f.terms and np.isfinite(f.log_evidence)]
    top = max((log_odds(f) for f in near), default=0.0)
    centres, widths, weights = [], [], []
    for made in [f for f in near if top - log_odds(f) < WORTH][:MOST]:
        again = final
        if made.names != final.names:
            again = fit(seen.problem, seen.grid, made.terms, made.u, intervals=True)
        k = offsets(again.terms, p)[again.terms.index(term)]
        centre, low, high = again.flat[k]
        if np.isfinite(high - low):
            centres.append(centre)
            widths.append((high - low) / (2.0 * stats.norm.isf(0.025)))
            weights.append(np.exp(log_odds(made) - top))
    k = offsets(final.terms, p)[final.terms.index(term)]
    if len(centres) < 2:
        return float(final.flat[k][1]), float(final.flat[k][2])
    share = np.array(weights) / np.sum(weights)
    c, w = np.array(centres), np.array(widths)
    x = np.linspace(float((c - 6.0 * w).min()), float((c + 6.0 * w).max()), 4001)
    total = (share[:, None] * stats.norm.cdf(x, c[:, None], w[:, None])).sum(axis=0)
    return float(np.interp(0.025, total, x)), float(np.interp(0.975, total, x))
