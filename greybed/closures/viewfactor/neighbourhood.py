"""Neighbourhood: for chosen spheres, every other sphere (and periodic image) within reach."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from greybed.core import Packing

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Neighbourhood:
    """Neighbours by emitter, each emitter's by growing distance.

    Besides the spheres in reach it holds those a little further out that can still stand between
    an emitter and one of them; ``within`` tells the two apart.

    Attributes
    ----------
    emitters : (e,) int
        The spheres asked for.
    start : (e + 1,) int
        Neighbours of emitter k stand at ``start[k]:start[k + 1]``.
    sphere : (m,) int
        The neighbour's number.
    image : (m, 3) int
        Its periodic image, in boxes.
    vector : (m, 3) float
        From the emitter's centre to the neighbour's [m].
    distance : (m,) float
        Length of ``vector`` [m].
    within : (m,) bool
        Whether the neighbour itself lies in reach.
    """

    emitters: Index
    start: Index
    sphere: Index
    image: Index
    vector: Array
    distance: Array
    within: NDArray[np.bool_]

    @property
    def owner(self) -> Index:
        """Emitter (sphere number) of every neighbour, shape (m,)."""
        return np.repeat(self.emitters, np.diff(self.start))


def neighbourhood(packing: Packing, reach: float, emitters: Index | None = None) -> Neighbourhood:
    """Find all spheres and images whose centres lie within ``reach`` [m] of each emitter."""
    from scipy.spatial import cKDTree

    pairs_reach, reach = reach, reach + 2.0 * float(packing.radii.max())

    who = np.arange(len(packing)) if emitters is None else np.asarray(emitters, dtype=np.int64)
    low, high = packing.bounds
    edges = high - low
    turns = [int(np.ceil(reach / edges[k])) if packing.periodic[k] else 0 for k in range(3)]
    centres, sphere, image = [], [], []
    for shift in product(*(range(-t, t + 1) for t in turns)):
        moved = packing.centres + np.array(shift) * edges
        # Only images within reach of the box can be anybody's neighbour.
        near = ((moved > low - reach) & (moved < high + reach)) | ~np.array(packing.periodic)
        chosen = np.flatnonzero(near.all(axis=1))
        centres.append(moved[chosen])
        sphere.append(chosen)
        image.append(np.broadcast_to(shift, (len(chosen), 3)))
    c, s, im = np.concatenate(centres), np.concatenate(sphere), np.concatenate(image)
    lists = cKDTree(c).query_ball_point(packing.centres[who], reach, return_sorted=False)
    sizes = np.array([len(entry) for entry in lists])
    index = np.concatenate([np.asarray(entry, dtype=np.int64) for entry in lists])
    owner = np.repeat(np.arange(len(who)), sizes)
    vector = c[index] - packing.centres[who][owner]
    distance = np.sqrt((vector**2).sum(axis=1))
    own = (s[index] == who[owner]) & ~im[index].any(axis=1)
    index, owner, vector, distance = index[~own], owner[~own], vector[~own], distance[~own]
    order = np.lexsort((distance, owner))
    index, owner = index[order], owner[order]
    return Neighbourhood(
        who,
        np.searchsorted(owner, np.arange(len(who) + 1)),
        s[index],
        im[index],
        vector[order],
        distance[order],
        distance[order] <= pairs_reach,
    )
