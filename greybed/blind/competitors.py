"""What others would do with the same residual and the same library of candidates."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from greybed.residual import read_study
from greybed.residual.look import recalibrated
from greybed.residual.problem import Problem, state

Array = NDArray[np.float64]

MOST_TERMS = 3
THRESHOLDS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5)
FOLDS = 5
ABSORBED = 1e-6  # share of a signature that must be left after projection


def library(folder: Path) -> tuple[list[str], Array, Array]:
    """Names, signatures (n, k) at the typical amplitude, and residual (n,) of a set.

    Free parameters are calibrated first and their direction is projected out, which helps every
    competitor.
    """
    from greybed.residual.models import build

    study = read_study(folder / "study.toml")
    values = {name: item.value for name, item in study.parameters.items()}
    problem: Problem = state(study, build(study.model, study.table, values))
    t = np.zeros(len(problem.names))
    free = problem.prior_sd > 1.0
    if free.any():
        t = recalibrated(problem, problem.prior_sd)
    base = problem.predict(t, {})
    residual = problem.z - base
    names, columns = [], []
    for effect in problem.model.effects.values():
        change = problem.predict(t, {effect.name: effect.typical}) - base
        if np.isfinite(change).all() and np.abs(change).max() > 1e-9:
            names.append(effect.name)
            columns.append(change)
    matrix = np.column_stack(columns) if columns else np.zeros((len(residual), 0))
    if free.any():
        slopes = problem.slopes(t, {})[:, free]
        basis = np.linalg.qr(slopes)[0]
        size = np.linalg.norm(matrix, axis=0)
        matrix = matrix - basis @ (basis.T @ matrix)
        residual = residual - basis @ (basis.T @ residual)
        # what calibration stands in for leaves rounding only, which no regression may scale up
        kept = np.linalg.norm(matrix, axis=0) > ABSORBED * size
        names = [name for name, keep in zip(names, kept, strict=True) if keep]
        matrix = matrix[:, kept]
    return names, matrix, residual


def best_subset(names: list[str], matrix: Array, residual: Array) -> list[str]:
    """The subset of up to three candidates with the lowest Bayesian information criterion."""
    n = len(residual)
    best = n * np.log(np.mean(residual**2))
    chosen: tuple[int, ...] = ()
    for size in range(1, min(MOST_TERMS, len(names)) + 1):
        for group in combinations(range(len(names)), size):
            x = matrix[:, group]
            rest = residual - x @ np.linalg.lstsq(x, residual, rcond=None)[0]
            score = n * np.log(np.mean(rest**2)) + size * np.log(n)
            if score < best:
                best, chosen = score, group
    return [names[i] for i in chosen]


def _stlsq(threshold: float, matrix: Array, residual: Array) -> Array:
    from pysindy import STLSQ

    optimizer = STLSQ(threshold=threshold, alpha=1e-6, normalize_columns=False)
    return np.asarray(optimizer.fit(matrix, residual[:, None]).coef_).ravel()


def stlsq(names: list[str], matrix: Array, residual: Array, tuned: bool) -> list[str]:
    """PySINDy's sequentially thresholded least squares on columns scaled to the residual.

    Parameters
    ----------
    tuned : bool
        Threshold by cross-validation instead of the default 0.1.
    """
    import warnings

    if not names:
        return []
    size = np.sqrt(np.mean(matrix**2, axis=0))
    scaled, y = matrix / size, residual / max(float(np.std(residual)), 1e-300)
    threshold = 0.1
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        if tuned:
            fold = np.arange(len(y)) % FOLDS
            losses = []
            for candidate in THRESHOLDS:
                loss = 0.0
                for k in range(FOLDS):
                    weights = _stlsq(candidate, scaled[fold != k], y[fold != k])
                    loss += float(np.sum((y[fold == k] - scaled[fold == k] @ weights) ** 2))
                losses.append(loss)
            threshold = THRESHOLDS[int(np.argmin(losses))]
        weights = _stlsq(threshold, scaled, y)
    order = np.argsort(-np.abs(weights))
    return [names[i] for i in order if weights[i] != 0.0]


def compete(folder: Path) -> dict[str, Any]:
    """Answers of all competitors to one set; STLSQ only where PySINDy is installed."""
    names, matrix, residual = library(folder)
    answers: dict[str, Any] = {"best-subset BIC": best_subset(names, matrix, residual)}
    try:
        import pysindy  # noqa: F401
    except ImportError:
        return answers
    answers["STLSQ, default"] = stlsq(names, matrix, residual, tuned=False)
    answers["STLSQ, cross-validated"] = stlsq(names, matrix, residual, tuned=True)
    return answers
