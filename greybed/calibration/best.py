"""The best parameter set: the mode of the posterior, and the cheapest one that is as good."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from greybed.calibration.acquisition import quick_posterior
from greybed.calibration.metamodel import Metamodel

Array = NDArray[np.float64]

_STARTS = 5
# A set is as good as the best one where its chi-squared is larger by less than this.
AS_GOOD = 1.0


def best_point(model: Metamodel, seed: int, samples: Array | None = None) -> Array:
    """The mode of the posterior, from the best samples by Nelder and Mead's simplex, (d,).

    Parameters
    ----------
    model : Metamodel
        Surrogates.
    seed : int
        Of the samples.
    samples : ndarray (n, d), optional
        Those of the posterior; rough ones are drawn without them.
    """
    if samples is None:
        samples = quick_posterior(model, seed)
    weight = model.study.options.cost_weight

    def height(u: Array) -> Array:
        value = model.log_posterior(u)
        return value - weight * model.log_cost(u) if weight > 0.0 else value

    values = height(samples)
    order = np.argsort(-values, kind="stable")
    starts = [samples[order[0]]]
    for k in order[1:]:
        if len(starts) == _STARTS:
            break
        if min(float(np.abs(samples[k] - s).max()) for s in starts) > 0.05:
            starts.append(samples[k])
    best, top = samples[order[0]], float(values[order[0]])
    for start in starts:
        found = minimize(
            lambda u: -float(height(u[None])[0]), start, method="Nelder-Mead",
            options={"maxfev": 120 * len(start), "xatol": 1e-4, "fatol": 1e-4},
        )  # fmt: skip
        if -found.fun > top:
            best, top = np.asarray(found.x), -float(found.fun)
    return np.array(np.clip(best, 0.0, 1.0))


def cheapest_as_good(model: Metamodel, best: Array, samples: Array) -> tuple[Array, float] | None:
    """The sample of least work whose misfit is as good as the best one's, and its share of work.

    After DEcalioc (2018), which prefers sets that allow a longer time step.

    Returns
    -------
    point : ndarray (d,)
        In the unit cube.
    share : float
        Its work over that of the best set [-].
    """
    cost = model.log_cost(np.concatenate([best[None], samples]))
    if np.ptp(cost) < 1e-3:
        return None
    good = model.chi2(samples) <= float(model.chi2(best[None])[0]) + AS_GOOD
    if not good.any():
        return None
    place = int(np.argmin(np.where(good, cost[1:], np.inf)))
    share = float(np.exp(cost[1 + place] - cost[0]))
    return (samples[place], share) if share < 1.0 else None
