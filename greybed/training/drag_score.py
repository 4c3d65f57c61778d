"""Scores of filtered drag: of a closure, of published models, and of trivial guesses."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from greybed.closures.drag.filtered import BASELINES, KeptDrag
from greybed.closures.drag.filtered.force import faded_share
from greybed.training.drag_rows import MOST_KEPT, DragRows

Array = NDArray[np.float64]
Guess = Callable[[DragRows], Array]


def force_of(closure: KeptDrag, rows: DragRows) -> Array:
    """Filtered drag (n, 3) that a closure or published model gives, as rows have it [-]."""
    found = {n: rows.markers[n] for n in closure.marker_names}
    p = closure.predict(**found)
    kept = rows.unfiltered * np.stack([p.kept_along, p.kept_across, p.kept_across], axis=1)
    if p.share.any():
        work = (kept * rows.slip).sum(axis=1)
        share = faded_share(p.share, work, rows.pull, rows.slip, 1.0)[:, None]
        kept = (1.0 - share) * kept + share * rows.pull
    return kept


def two_constants(rows: DragRows) -> tuple[float, float]:
    """Least squares a and b of F = a F0 + b P in drift fluxes along gravity."""
    scale = rows.markers["solid_fraction"] / rows.lead
    left = np.stack([rows.unfiltered[:, 0] * scale, rows.pull[:, 0] * scale], axis=1)
    a, b = np.linalg.lstsq(left, rows.force[:, 0] * scale, rcond=None)[0]
    return float(a), float(b)


def guesses(train: DragRows) -> dict[str, Guess]:
    """What a closure has to beat, by name: published models and trivial ones.

    The two constants are fitted to ``train``.
    """
    a, b = two_constants(train)
    found: dict[str, Guess] = {
        name: lambda rows, model=model: force_of(model, rows)  # type: ignore[misc]
        for name, model in BASELINES.items()
        if name != "radl-sundaresan-unclamped"
    }
    found["gas balance"] = lambda rows: rows.pull
    found["two constants"] = lambda rows: a * rows.unfiltered + b * rows.pull
    return found


def r_squared(truth: Array, guess: Array) -> float:
    """Share of the variance that is explained [-]; NaN where nothing varies."""
    spread = float(np.square(truth - truth.mean(axis=0)).sum())
    if spread <= 1e-24 * max(1.0, float(np.square(truth).sum())):
        return float("nan")
    return 1.0 - float(np.square(truth - guess).sum()) / spread


def score_of(rows: DragRows, force: Array) -> dict[str, float]:
    """How close a force comes.

    Parameters
    ----------
    rows : DragRows
        What it is compared with.
    force : (n, 3) array
        As rows have it.

    Returns
    -------
    dict
        R² of the drift flux along gravity (``drift_r2``), of all of it (``drift_r2_vector``), of
        the force along gravity (``force_r2``), of H on clean rows (``kept_r2``; guesses kept
        between 0 and 3), rms error and bias of H there, rms error of the drift flux along gravity
        (``drift_rms``), the summed force along gravity over the true one, less 1 (``force_bias``),
        and counts.
    """
    truth, guess = rows.drift(rows.force), rows.drift(force)
    clean, whole = rows.clean, rows.force[:, 0].sum()
    kept = rows.kept[clean]
    mine = (force[:, 0] / np.where(clean, rows.unfiltered[:, 0], 1.0))[clean]
    # Guesses that know no bound get the one of the rows.
    mine = np.clip(mine, 0.0, MOST_KEPT)
    return {
        "drift_r2": r_squared(truth[:, 0], guess[:, 0]),
        "drift_r2_vector": r_squared(truth, guess),
        "force_r2": r_squared(rows.force[:, 0], force[:, 0]),
        "kept_r2": r_squared(kept, mine),
        "kept_rms": float(np.sqrt(np.mean((mine - kept) ** 2))),
        "kept_bias": float(np.mean(mine - kept)),
        "drift_rms": float(np.sqrt(np.mean((guess[:, 0] - truth[:, 0]) ** 2))),
        "force_bias": float(force[:, 0].sum() / whole - 1.0) if whole else float("nan"),
        "rows": len(rows),
        "clean_rows": int(clean.sum()),
    }


def score_table(rows: DragRows, forces: Mapping[str, Array]) -> list[dict[str, Any]]:
    """Scores of several forces for the same rows, by name."""
    return [{"name": name, **score_of(rows, force)} for name, force in forces.items()]
