"""Fit of the two-headed forest with scikit-learn; leaves hold shares in (0, 1) and their spread."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from sklearn.ensemble import RandomForestRegressor

from greybed.closures.predictors import Forest
from greybed.training.rows import Rows

TREES = 40
LEAVES = 800
LEAST_ROWS = 25
# Leaf values stay off 0 and 1, so that V stays above 0 whatever the gate.
LEAF_RANGE = (1e-6, 1.0 - 1e-6)
# A leaf's spread counts this many rows of the whole calibration set as its own.
PRIOR_ROWS = 20.0


def fit_forest(train: Rows, calibrate: Rows, *, seed: int) -> Forest:
    """Fit a forest to rows.

    The target is v = 1 - (1 - F / F_exact) / gate, linear in the traced factor, so that the mean
    of a leaf is not biased by the noise of the trace; rows weigh by what they say about F.

    Parameters
    ----------
    train, calibrate : Rows
        Rows of different packings: the spread is taken where the value was not fitted.
    seed : int
        Seed of the forest.

    Returns
    -------
    Forest
    """
    model = RandomForestRegressor(
        n_estimators=TREES, max_leaf_nodes=LEAVES, min_samples_leaf=LEAST_ROWS, max_samples=0.5,
        max_features=2, random_state=seed, n_jobs=-1,
    )  # fmt: skip
    model.fit(train.features.astype(np.float32), _target(train), sample_weight=_weight(train))
    forest = flat_trees([tree.tree_ for tree in model.estimators_])
    return _with_spread(forest, calibrate)


def _target(rows: Rows) -> NDArray[np.float64]:
    return 1.0 - (1.0 - rows.factor / rows.exact) / rows.gate


def _weight(rows: Rows) -> NDArray[np.float64]:
    weight = rows.weight * (rows.exact * rows.gate / rows.noise) ** 2
    return weight / weight.mean()


def flat_trees(trees: list) -> Forest:
    """Renumber the nodes of all trees so that siblings stand side by side."""
    roots: list[int] = []
    feature: list[int] = []
    threshold: list[float] = []
    left: list[int] = []
    value: list[float] = []
    for tree in trees:
        base = len(feature)
        roots.append(base)
        queue, places = [0], [base]
        feature.append(-1)
        threshold.append(0.0)
        left.append(0)
        value.append(0.0)
        while queue:
            node, place = queue.pop(), places.pop()
            if tree.children_left[node] < 0:
                value[place] = float(np.clip(tree.value[node, 0, 0], *LEAF_RANGE))
                continue
            pair = len(feature)
            feature[place] = int(tree.feature[node])
            threshold[place] = float(_below(tree.threshold[node]))
            left[place] = pair
            for child in (tree.children_left[node], tree.children_right[node]):
                queue.append(int(child))
                places.append(len(feature))
                feature.append(-1)
                threshold.append(0.0)
                left.append(0)
                value.append(0.0)
    return Forest(
        np.array(roots, np.int32),
        np.array(feature, np.int32),
        np.array(threshold, np.float32),
        np.array(left, np.int32),
        np.stack([value, np.full(len(value), 0.1)], axis=1),
    )


def _below(threshold: float) -> np.float32:
    """Largest single-precision number not above a threshold: it splits the features alike."""
    single = np.float32(threshold)
    return np.nextafter(single, np.float32(-np.inf)) if single > threshold else single


def leaves_of(forest: Forest, features: NDArray[np.float64]) -> NDArray[np.int64]:
    """Leaf of every row in every tree, shape (n_trees, m)."""
    single = features.astype(np.float32)
    node = np.repeat(forest.roots.astype(np.int64)[:, None], len(single), axis=1)
    rows = np.arange(len(single))
    while True:
        f = forest.feature[node]
        inner = f >= 0
        if not inner.any():
            return node
        right = single[rows[None, :], np.maximum(f, 0)] > forest.threshold[node]
        node = np.where(inner, forest.left[node] + right, node)


def _with_spread(forest: Forest, rows: Rows) -> Forest:
    """Put into every leaf the scatter of the forest's own error beyond the trace's noise."""
    predicted = forest(rows.features)[:, 0]
    weight = _weight(rows)
    noise = rows.stderr / (rows.exact * rows.gate)
    excess = (_target(rows) - predicted) ** 2 - noise**2
    mean = float((weight * excess).sum() / weight.sum())
    spread = np.full(len(forest.feature), np.sqrt(max(mean, 0.0)))
    for leaf in leaves_of(forest, rows.features):
        total = np.bincount(leaf, weight, minlength=len(spread))
        sums = np.bincount(leaf, weight * excess, minlength=len(spread))
        # Shrunk towards the mean of all rows, because a leaf may hold few of other packings.
        local = (sums + PRIOR_ROWS * mean) / (total + PRIOR_ROWS)
        spread = np.where(total > 0.0, np.sqrt(np.maximum(local, 0.01 * max(mean, 0.0))), spread)
    value = np.stack([forest.value[:, 0], np.minimum(spread, 0.5)], axis=1)
    return Forest(forest.roots, forest.feature, forest.threshold, forest.left, value)
