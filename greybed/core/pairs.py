"""Pairs of spheres that may touch, found class by class of size so that wide ones stay cheap."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def close_pairs(positions: Array, radii: Array, period: Array, gap: float) -> NDArray[np.int64]:
    """Candidate pairs i < j with surfaces closer than ``gap``, sorted; a few lie further apart.

    Parameters
    ----------
    positions : (n, 3) array
        Centres relative to the lower corner of the box [m].
    radii : (n,) array
        Radii [m].
    period : (3,) array
        Edge of the box where it repeats, 0 where it does not [m].
    gap : float
        Largest distance of the surfaces [m].

    Returns
    -------
    (m, 2) int array
    """
    from scipy.spatial import cKDTree

    boxsize = None
    if (period > 0.0).any():
        boxsize = period
        # The tree wants coordinates in [0, period), rounding included.
        wraps = period > 0.0
        inside = np.mod(positions, np.where(wraps, period, 1.0))
        inside = np.where(inside >= period, 0.0, inside)
        positions = np.where(wraps, inside, positions)
    # One search radius for all sizes would list everything inside the reach of the largest
    # sphere; classes a factor of two wide list little more than what touches.
    level = np.floor(np.log2(radii / radii.min())).astype(int)
    members = [np.flatnonzero(level == k) for k in np.unique(level)]
    trees = [cKDTree(positions[m], boxsize=boxsize) for m in members]
    found = []
    for a, (tree, m) in enumerate(zip(trees, members, strict=True)):
        reach = float(radii[m].max())
        same = tree.query_pairs(2.0 * reach + gap, output_type="ndarray")
        found.append(m[same])
        for smaller, k in zip(trees[:a], members[:a], strict=True):
            near = tree.sparse_distance_matrix(
                smaller, reach + float(radii[k].max()) + gap, output_type="coo_matrix"
            )
            found.append(np.stack([m[near.row], k[near.col]], axis=1))
    pairs = np.concatenate(found).astype(np.int64).reshape(-1, 2)
    pairs.sort(axis=1)
    return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]
