"""The door of the room: a study in, the answer out, all finished runs kept."""

from __future__ import annotations

import os
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from greybed.calibration.acquisition import quick_posterior
from greybed.calibration.answer import Answer, answer
from greybed.calibration.designs import latin_hypercube
from greybed.calibration.runs import Campaign
from greybed.calibration.search import Search
from greybed.calibration.store import Store
from greybed.calibration.strategies import BY_NAME
from greybed.calibration.study import Study
from greybed.core.progress import progress

Array = NDArray[np.float64]

STORE = "runs.sqlite"


def calibrate(
    study: Study, folder: str | os.PathLike[str] | None = None, *, show: bool = False
) -> Answer:
    """Find the parameters of a study, and how far its data determine them.

    Parameters
    ----------
    study : Study
        Parameters [SI], experiments, measured data, options.
    folder : path, optional
        Where ``runs.sqlite`` keeps finished runs: the same study in the same folder goes on from
        them. Without it they are kept in memory.
    show : bool
        Whether to draw a progress bar.

    Returns
    -------
    Answer
        Posterior, best set, verdicts, errors, sensitivities, advice.

    Raises
    ------
    InputError
        If a strategy cannot work with the study, or nearly all runs fail.

    Notes
    -----
    The answer depends on the study and its seed, not on the number of workers, nor on how often it
    was stopped.
    """
    begin, o = time.perf_counter(), study.options
    store = Store(":memory:" if folder is None else Path(folder) / STORE)
    others = study.with_role("candidate", "process", "validation")
    per = o.others or 3 * len(study.space) + 4
    total = o.runs + per * len(others)
    campaign = Campaign(
        study.experiments, store, seed=o.seed, attempts=o.attempts, workers=o.workers,
        scheduler=o.scheduler,
    )  # fmt: skip
    try:
        # Small matrices: more threads only wait for each other, and change last digits.
        with (
            threadpool_limits(1),
            progress(total, "runs", show=show) as advance,
            campaign,
        ):
            campaign.tell = advance
            search = Search(study, campaign)
            BY_NAME[o.strategy](search)
            _others(search, others, per)
            return answer(search, begin)
    finally:
        store.close()


def _others(search: Search, names: tuple[str, ...], per: int) -> None:
    """Runs of the experiments that are not fitted to: over the prior, and where the answer is."""
    if not names:
        return
    study, o = search.study, search.study.options
    model = search.fit()
    near = quick_posterior(model, o.seed)
    half = max(per // 2, 1)
    spread = study.space.from_prior(latin_hypercube(per - half, len(study.space), o.seed + 1))
    points = np.concatenate([spread, _far_apart(near, half)])
    search.campaign.make([search.job(name, u) for name in names for u in points])


def _far_apart(points: Array, count: int) -> Array:
    """So many of the points, each as far as possible from those before."""
    chosen = [0]
    nearest = np.full(len(points), np.inf)
    while len(chosen) < min(count, len(points)):
        nearest = np.minimum(nearest, ((points - points[chosen[-1]]) ** 2).sum(axis=1))
        chosen.append(int(nearest.argmax()))
    return points[chosen]
