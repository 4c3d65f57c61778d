"""Fit of the forest of filtered drag with scikit-learn: quotients of forces in its leaves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import RandomForestRegressor

from greybed.closures.drag.filtered import Gate
from greybed.closures.drag.filtered.closure import LOG_BOUND
from greybed.closures.drag.filtered.features import DragMarkerSet
from greybed.closures.predictors import Forest
from greybed.training.drag_rows import MOST_KEPT, DragRows, heard
from greybed.training.forest import flat_trees, leaves_of

Array = NDArray[np.float64]

TREES = 24
LEAVES = 250
LEAST_ROWS = 40
# A leaf counts this many mean rows of H = 1 as its own.
PRIOR_ROWS = 2.0
# A leaf's spread counts this many rows of all as its own.
SPREAD_ROWS = 30.0


def _quotients(rows: DragRows) -> tuple[Array, Array]:
    """H along and across of single rows, kept within reason, and what a row weighs (n, 2)."""
    across = rows.unfiltered[:, 1:]
    slow = np.square(across).sum(axis=1) + 1e-300
    along = rows.force[:, 0] / np.where(rows.unfiltered[:, 0] == 0.0, 1e-300, rows.unfiltered[:, 0])
    lateral = (rows.force[:, 1:] * across).sum(axis=1) / slow
    kept = np.clip(np.stack([along, lateral], axis=1), 0.0, MOST_KEPT)
    # Of the drift flux phi s (H - 1).
    phi = rows.markers["solid_fraction"][:, None]
    lateral2 = np.square(rows.slip[:, 1:]).sum(axis=1)
    return kept, phi**2 * np.stack([rows.slip[:, 0] ** 2, lateral2], axis=1)


def fit_drag_forest(rows: DragRows, chosen: DragMarkerSet, gate: Gate, *, seed: int) -> Forest:
    """Fit a forest; the spread stays at its start, see :func:`forest_with_spread`.

    Leaves hold ln H over the gate. H of a leaf is the quotient of the summed forces of its rows,
    which small slips cannot upset, and their gate is the mean that weighs them alike.

    Parameters
    ----------
    rows : DragRows
        To fit.
    chosen : DragMarkerSet
        Markers without a linear part.
    gate : Gate
        Of the closure.
    seed : int
        Of the forest.
    """
    features = chosen.features(rows.of(chosen))
    kept, weight = _quotients(rows)
    each = weight / weight.mean(axis=0)
    model = RandomForestRegressor(
        n_estimators=TREES, max_leaf_nodes=LEAVES, min_samples_leaf=LEAST_ROWS, max_samples=0.5,
        max_features=0.5, random_state=seed, n_jobs=1,
    )  # fmt: skip
    told = np.where(heard(features), features, 0.0)
    model.fit(told.astype(np.float32), kept, sample_weight=each.sum(axis=1))
    forest = flat_trees([tree.tree_ for tree in model.estimators_])
    opening = gate(rows.markers["solid_fraction"], rows.markers["filter_size"])
    value = np.zeros((len(forest.feature), 3))
    value[:, 2] = 0.5
    for leaf in leaves_of(forest, features):
        for k in range(2):
            w = each[:, k]

            def total(x: Array, leaf: NDArray[np.int64] = leaf) -> Array:
                return np.bincount(leaf, x, minlength=len(value)).astype(np.float64)

            counted = total(np.ones(len(leaf))) > 0.0
            prior = PRIOR_ROWS * w.mean()
            sums = total(w) + prior
            mean = (total(w * kept[:, k]) + prior) / sums
            open_ = np.maximum(total(w * opening) / np.maximum(total(w), 1e-300), 0.02)
            log = np.log(np.maximum(mean, np.exp(-LOG_BOUND))) / open_
            value[counted, k] = np.clip(log, -LOG_BOUND, LOG_BOUND)[counted]
    return Forest(forest.roots, forest.feature, forest.threshold, forest.left, value)


def forest_with_spread(
    forest: Forest, rows: DragRows, kept: Array, chosen: DragMarkerSet, gate: Gate
) -> Forest:
    """Put into every leaf the scatter of errors on cases that were held out.

    Parameters
    ----------
    kept : (n,) array
        H along gravity that fits without the row's case gave [-].
    """
    opening = gate(rows.markers["solid_fraction"], rows.markers["filter_size"])
    index = np.flatnonzero(rows.clean & (opening > 0.01))
    some = rows.take(index)
    mine = np.maximum(kept[index], np.exp(-LOG_BOUND))
    error2 = np.square((some.kept - mine) / (mine * opening[index]))
    error2 = np.minimum(error2, np.quantile(error2, 0.99))
    mean = float(error2.mean())
    spread = np.full(len(forest.feature), np.sqrt(mean))
    for leaf in leaves_of(forest, chosen.features(some.of(chosen))):
        count = np.bincount(leaf, minlength=len(spread))
        sums = np.bincount(leaf, error2, minlength=len(spread))
        local = (sums + SPREAD_ROWS * mean) / (count + SPREAD_ROWS)
        spread = np.where(count > 0, np.sqrt(local), spread)
    value = forest.value.copy()
    value[:, 2] = spread
    return Forest(forest.roots, forest.feature, forest.threshold, forest.left, value)
