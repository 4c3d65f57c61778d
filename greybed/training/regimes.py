"""Errors of a closure by regime: solid fraction, size of the factor, size ratio, packings."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from greybed.closures.viewfactor import ViewFactorClosure
from greybed.datasets.viewfactor import ViewFactorData

Array = NDArray[np.float64]

FRACTIONS = (0.0, 0.2, 0.35, 0.5, 1.0)
FACTORS = (1e-4, 1e-3, 1e-2, 1.0)
RATIOS = (0.0, 0.5, 0.999, 1.001, 2.0, np.inf)
BLOCKED = (0.0, 1e-9, 0.3, 0.7, 0.95, 1.01)
DISTANCES = (0.0, 2.0, 4.0, 8.0, np.inf)
EMISSIVITIES = (0.0, 0.3, 0.5, 0.7, 0.9, 1.01)
# A regime of fewer rows says little.
LEAST_ROWS = 50


def own_error(error: Array, stderr: Array, weight: Array) -> float:
    """Root mean square error that is the closure's own: the trace's variance taken out [-]."""
    left = np.average(error**2, weights=weight) - np.average(stderr**2, weights=weight)
    return float(np.sqrt(max(left, 0.0)))


def regimes(
    closure: ViewFactorClosure, data: ViewFactorData, split: str = "test"
) -> list[dict[str, Any]]:
    """Errors on held-out packings by regime.

    Parameters
    ----------
    closure : ViewFactorClosure
        Closure to score.
    data : ViewFactorData
        Rows for its markers.
    split : str
        Which packings.

    Returns
    -------
    list of dict
        ``by``, ``low``, ``high`` (or ``name`` for kinds of packings), ``rows``, ``rmse`` and
        ``bias`` [-] with the trace's noise taken out of the former, ``relative`` (rmse over the
        mean factor) and ``coverage95``. Rows with factors below 1e-4 are left out.
    """
    rows = data.in_split(split) & (data.columns["factor"] > FACTORS[0])
    c = {name: column[rows] for name, column in data.columns.items()}
    kinds = np.array([str(p.get("kind", "random")) for p in data.packings])[data.packing[rows]]
    p = closure.predict(**{name: c[name] for name in closure.marker_names})
    error, sigma = p.view_factor - c["factor"], np.hypot(p.stderr, c["stderr"])
    found: list[dict[str, Any]] = []

    def note(chosen: NDArray[np.bool_], **what: Any) -> None:
        if chosen.sum() < LEAST_ROWS:
            return
        w = c["weight"][chosen]
        rmse = own_error(error[chosen], c["stderr"][chosen], w)
        found.append(
            {
                **what,
                "rows": int(chosen.sum()),
                "rmse": rmse,
                "bias": float(np.average(error[chosen], weights=w)),
                "relative": rmse / float(np.average(c["factor"][chosen], weights=w)),
                "coverage95": float(np.average((np.abs(error) <= 1.96 * sigma)[chosen], weights=w)),
            }
        )

    for by, edges in (
        ("factor", FACTORS),
        ("solid_fraction", FRACTIONS),
        ("radius_ratio", RATIOS),
        ("blocked_fraction", BLOCKED),
        ("distance_over_radius", DISTANCES),
        ("emissivity", EMISSIVITIES),
    ):
        # The factor is told apart by the prediction: bins of a noisy truth would be biased.
        value = p.view_factor if by == "factor" else c.get(by)
        if value is None:
            continue
        for low, high in pairwise(edges):
            note((value >= low) & (value < high), by=by, low=float(low), high=float(high))
    for kind in dict.fromkeys(kinds):
        note(kinds == kind, by="kind", name=str(kind))
    return found
