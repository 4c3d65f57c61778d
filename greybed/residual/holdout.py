"""Errors on rows that helped with nothing: every fold repeats screening, search and choice."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from greybed.residual.choice import choose
from greybed.residual.diagnosis import Errors, Score
from greybed.residual.discrepancy import Discrepancy
from greybed.residual.fit import predict
from greybed.residual.look import Look, look, recalibrated, without_hinge
from greybed.residual.problem import FREE_SD, Problem
from greybed.residual.search import NARROW, search

Array = NDArray[np.float64]

MOST_FOLDS = 20
ROW_FOLDS = 10  # where there are no groups
FEWEST_GROUPS = 3  # fewer cannot be left out one at a time
RESAMPLES = 1000


@dataclass(frozen=True)
class HeldOut:
    """Predictions of rows by models that never saw them, each (n,), in the transformed response."""

    base: Array
    recalibrated: Array
    with_effect: Array
    discrepancy: Array
    fold: NDArray[np.int64]
    text: str


def _folds(problem: Problem, seed: int) -> tuple[NDArray[np.int64], str]:
    study = problem.study
    n = len(problem)
    groups, own = np.unique(problem.group, return_inverse=True)
    if study.options.holdout == "group" and problem.grouped and len(groups) >= FEWEST_GROUPS:
        name = " and ".join(study.group)
        if len(groups) <= MOST_FOLDS:
            return own, f"leave one group out ({len(groups)} groups by {name})"
        order = np.random.default_rng(seed).permutation(len(groups)) % MOST_FOLDS
        return order[own], f"leave a twentieth of {len(groups)} groups by {name} out"
    count = min(ROW_FOLDS, n)
    order = np.random.default_rng(seed).permutation(n) % count
    return order, f"leave a {'tenth' if count == ROW_FOLDS else 'part'} of the rows out"


def hold_out(seen: Look, critical: float) -> HeldOut:
    """Predict each fold from the others.

    Parameters
    ----------
    seen : Look
        Of all rows: its clean rows are folded; nothing else of it is used, but for the
        hyperparameters of the Gaussian process, which favours that competitor.
    critical : float
        Statistic above which something is missing.

    Returns
    -------
    held : HeldOut
        With the fold of each row.
    """
    problem = seen.problem
    fold, text = _folds(problem, problem.study.options.seed)
    n = len(problem)
    out = {name: np.full(n, np.nan) for name in ("base", "recalibrated", "effect", "gp")}
    nothing = np.zeros(len(problem.names))
    discrepancy = Discrepancy(problem, problem.z - problem.predict(nothing, {}))

    def one(k: int) -> None:
        test = fold == k
        train, rest = problem.take(~test), problem.take(test)
        out["base"][test] = rest.predict(nothing, {})
        free = np.full(len(nothing), FREE_SD) / np.maximum(problem.scale, 1e-9)
        free = np.where(problem.prior_sd > 1.0, problem.prior_sd, free)
        out["recalibrated"][test] = rest.predict(recalibrated(train, free), {})
        out["gp"][test] = out["base"][test] + discrepancy.predict(~test, test)
        part = look(train)
        if part.terms:
            part = without_hinge(train, part, critical)
        if part.terms and part.statistic >= critical:
            found = search(part.problem, part.grid, part.scan, part.terms, part.t, NARROW)
            best = choose(part.problem, found).chosen
            out["effect"][test] = predict(rest, best.terms, best.u)
        else:  # nothing is missing: the base as it is, with its free parameters calibrated
            out["effect"][test] = rest.predict(part.t, {})

    # the matrices are small: more threads for each cost more than they gain
    with threadpool_limits(1):
        for k in np.unique(fold):
            one(k)
    return HeldOut(out["base"], out["recalibrated"], out["effect"], out["gp"], fold, text)


def errors(problem: Problem, held: HeldOut, seed: int) -> Errors:
    """Root mean square errors with intervals from resampled folds."""
    generator = np.random.default_rng(seed + 1)
    units = problem.group if problem.grouped else np.arange(len(problem))
    _, own = np.unique(units, return_inverse=True)
    count = own.max() + 1
    rows = np.bincount(own)
    squares = {}
    for name in ("base", "recalibrated", "with_effect", "discrepancy"):
        off = problem.z - getattr(held, name)
        off = np.where(np.isfinite(off), off, np.nanmax(np.abs(off)) if off.size else 0.0)
        squares[name] = np.bincount(own, off**2)
    picks = generator.integers(0, count, (RESAMPLES, count))
    weights = rows[picks].sum(axis=1)
    scores, samples = {}, {}
    for name, square in squares.items():
        samples[name] = np.sqrt(square[picks].sum(axis=1) / weights)
        value = float(np.sqrt(square.sum() / rows.sum()))
        scores[name] = Score(value=value, ci95=_ends(samples[name]))
    base = max(scores["base"].value, 1e-300)
    ratio = samples["with_effect"] / np.maximum(samples["base"], 1e-300)
    response = problem.study.response
    log = problem.model.transform == "log"
    return Errors(
        metric=f"rmse of {'log ' if log else ''}{response}",
        holdout=held.text,
        base=scores["base"],
        recalibrated=scores["recalibrated"],
        with_effect=scores["with_effect"],
        gp_discrepancy=scores["discrepancy"],
        ratio=Score(value=scores["with_effect"].value / base, ci95=_ends(ratio)),
    )


def _ends(samples: Array) -> tuple[float, float]:
    low, high = np.quantile(samples, [0.025, 0.975])
    return float(low), float(high)
