"""Score card of a view-factor closure on held-out packings, with intervals over packings."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from greybed.closures.viewfactor import ViewFactorClosure
from greybed.datasets.viewfactor import ViewFactorData
from greybed.training.regimes import own_error

Array = NDArray[np.float64]

# Factors below this are a handful of rays in a trace: their scatter says nothing on a closure.
LEAST = 1e-4


def r_squared(truth: Array, predicted: Array, weight: Array) -> float:
    """Share of the weighted variance that is explained [-]; NaN where nothing varies."""
    return 1.0 - _over_variance(np.square(truth - predicted), truth, weight)


def _over_variance(square: Array, truth: Array, weight: Array) -> float:
    """Weighted mean of squares over the variance of the truth [-]; NaN where it has none."""
    mean = np.average(truth, weights=weight)
    variance = float(np.average(np.square(truth - mean), weights=weight))
    # Equal numbers differ from their mean by round-off, on some processors.
    if variance <= (1e-12 * float(mean)) ** 2:
        return float("nan")
    return float(np.average(square, weights=weight)) / variance


def score(
    closure: ViewFactorClosure, data: ViewFactorData, split: str = "test", *, seed: int = 0
) -> dict[str, Any]:
    """Compare a closure with traced factors of whole packings.

    Parameters
    ----------
    closure : ViewFactorClosure
        Closure to score.
    data : ViewFactorData
        Data set.
    split : str
        Which packings.
    seed : int
        Seed of the bootstrap over packings.

    Returns
    -------
    dict
        ``r2`` (pairs with F > 1e-4) with ``r2_ci95`` over packings, ``r2_noise`` (what a perfect
        closure would reach), ``rmse``, ``rmse_own`` (the trace's ``noise`` taken out), ``mae``,
        ``bias``, ``mape_above_1e-2``,
        ``mape_above_1e-3``, ``negative``, ``above_exact``, ``unobstructed_error`` (against the
        exact factor), ``coverage95`` (closure's and trace's errors together),
        ``extrapolated``, and counts.
    """
    rows = data.in_split(split)
    c = {name: column[rows] for name, column in data.columns.items()}
    packing = data.packing[rows]
    m = {name: c[name] for name in closure.marker_names}
    p = closure.predict(**m)
    predicted, truth, exact = p.view_factor, c["factor"], c["exact"]
    big = truth > LEAST
    free = closure.markers.gate(m) == 0.0
    error = predicted - truth
    sigma = np.hypot(p.stderr, c["stderr"])
    w = c["weight"]
    result: dict[str, Any] = {
        "rows": int(rows.sum()),
        "pairs": int(big.sum()),
        "packings": len(np.unique(packing)),
        "r2": r_squared(truth[big], predicted[big], w[big]),
        "r2_noise": 1.0 - _over_variance(np.square(c["stderr"][big]), truth[big], w[big]),
        "rmse": float(np.sqrt(np.average(error[big] ** 2, weights=w[big]))),
        "rmse_own": own_error(error[big], c["stderr"][big], w[big]),
        "noise": float(np.sqrt(np.average(c["stderr"][big] ** 2, weights=w[big]))),
        "mae": float(np.average(np.abs(error[big]), weights=w[big])),
        "bias": float(np.average(error[big], weights=w[big])),
        "negative": int((predicted < 0.0).sum()),
        "above_exact": int((predicted > exact).sum()),
        "unobstructed_error": float(np.abs(predicted - exact)[free].max(initial=0.0)),
        "unobstructed_pairs": int(free.sum()),
        "coverage95": float(np.average((np.abs(error) <= 1.96 * sigma)[big], weights=w[big])),
        "extrapolated": float(np.average(p.extrapolates, weights=w)),
    }
    for least in (1e-2, 1e-3):
        chosen = truth > least
        relative = np.abs(error[chosen]) / truth[chosen]
        # A dilute or coarsely traced split may hold no pair that large.
        result[f"mape_above_{least:.0e}".replace("e-0", "e-")] = (
            float(np.average(relative, weights=w[chosen])) if chosen.any() else float("nan")
        )
    rng = np.random.default_rng(seed)
    names = np.unique(packing)
    draws = []
    for _ in range(200):
        times = np.bincount(rng.choice(len(names), len(names)), minlength=len(names))
        share = w * times[np.searchsorted(names, packing)]
        chosen = big & (share > 0.0)
        draws.append(r_squared(truth[chosen], predicted[chosen], share[chosen]))
    result["r2_ci95"] = [float(q) for q in np.quantile(draws, [0.025, 0.975])]
    return result
