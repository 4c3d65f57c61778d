"""The conditions at which explanations differ most: what to measure next."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from greybed.residual.fit import Fit, amplitudes, offsets
from greybed.residual.problem import Problem
from greybed.residual.terms import power

Array = NDArray[np.float64]

TRIALS = 3000
REACH = 2.0  # conditions beyond those of the data, as a factor
FRACTIONS = {"void_fraction": (0.3, 0.95), "sphericity": (0.4, 1.0), "emissivity": (0.05, 1.0)}
ABSOLUTE = {"temperature": 1.3}  # cannot be doubled in most laboratories
KEPT = {"particle_density", "fluid_density", "viscosity"}  # what the material is


def experiment(problem: Problem, rivals: tuple[Fit, ...], seed: int) -> dict[str, Any] | None:
    """Search for the row of conditions that would tell two explanations apart.

    Parameters
    ----------
    problem : Problem
        Rows and model.
    rivals : tuple of Fit
        Sets of terms; the first two that differ in their predictions are compared.
    seed : int
        Of the trial conditions.

    Returns
    -------
    experiment : dict or None
        ``conditions`` (value, unit and range in the data of each), ``predictions`` of each rival
        with its standard deviation, and ``separation_sd``: their distance over the combined
        standard deviation; None where the rivals agree everywhere.
    """
    trials = _trials(problem, rivals, seed)
    outcomes = [_predictions(problem, made, trials) for made in rivals]
    distance = np.zeros(TRIALS)
    for i, (first, spread) in enumerate(outcomes):
        for second, other in outcomes[i + 1 :]:
            noise = rivals[0].sigma ** 2 + rivals[0].tau ** 2
            apart = np.abs(first - second) / np.sqrt(spread**2 + other**2 + noise)
            distance = np.maximum(distance, np.where(np.isfinite(apart), apart, 0.0))
    best = int(np.argmax(distance))
    if distance[best] <= 0.0:
        return None
    table = problem.study.table
    conditions = {}
    for name, column in trials.items():
        data = problem.columns[name]
        if name in (problem.study.response, problem.study.replicate) or np.ptp(column) == 0.0:
            continue
        conditions[name] = {
            "value": float(column[best]),
            "unit": table.units.get(name, ""),
            "in_data": [float(data.min()), float(data.max())],
        }
    log = problem.model.transform == "log"
    predictions = []
    for made, (value, spread) in zip(rivals, outcomes, strict=True):
        centre = float(np.exp(value[best])) if log else float(value[best])
        sd = float(spread[best]) * (abs(centre) if log else 1.0)
        predictions.append({"effects": list(made.names), "response": centre, "sd": sd})
    return {
        "conditions": conditions,
        "predictions": predictions,
        "unit": table.units.get(problem.study.response, ""),
        "separation_sd": float(distance[best]),
    }


def _trials(problem: Problem, rivals: tuple[Fit, ...], seed: int) -> dict[str, Array]:
    """Random conditions around those of the data: rows, with some columns moved."""
    generator = np.random.default_rng(seed)
    rows = generator.integers(0, len(problem), TRIALS)
    moved = set(problem.covariates())
    for made in rivals:
        for term in made.terms:
            moved |= set(term.effect.columns if term.effect else (term.name,))
    trials = {}
    for name, column in problem.columns.items():
        base = column[rows].copy()
        if name in moved - KEPT and name not in (problem.study.response, problem.study.replicate):
            low, high = float(column.min()), float(column.max())
            if low > 0.0:
                factor = ABSOLUTE.get(name, REACH)
                low, high = low / factor, high * factor
                if name in FRACTIONS:
                    low, high = max(low, FRACTIONS[name][0]), min(high, FRACTIONS[name][1])
                new = np.exp(generator.uniform(np.log(low), np.log(high), TRIALS))
                base = np.where(generator.random(TRIALS) < 0.5, new, base)
        trials[name] = base
    return trials


def _predictions(problem: Problem, made: Fit, trials: dict[str, Array]) -> tuple[Array, Array]:
    """Transformed predictions at the trials and their standard deviations."""

    def at(u: Array) -> Array:
        p = len(problem.names)
        total = problem.predict(u[:p], amplitudes(made.terms, u, p), trials)
        for term, k in zip(made.terms, offsets(made.terms, p), strict=True):
            if term.kind in ("inside", "outside"):
                basis = trials[term.name] / term.centre
                if term.linear:
                    total = total + u[k] * basis
                else:
                    total = total + u[k] * power(basis, float(u[k + 1]), term.basis)
        return total

    centre = at(made.u)
    slopes = np.empty((TRIALS, len(made.u)))
    for j in range(len(made.u)):
        moved = made.u.copy()
        step = 1e-4 * max(1.0, abs(moved[j]))
        moved[j] += step
        slopes[:, j] = (at(moved) - centre) / step
    variance = np.einsum("ij,jk,ik->i", slopes, made.covariance, slopes)
    return centre, np.sqrt(np.maximum(variance, 0.0))
