"""Free rays: what the eye or any other source meets first in a packing."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.core import InputError, Packing
from greybed.raytrace import _kernels
from greybed.raytrace.scene import Scene


def first_hits(
    packing: Packing, origins: ArrayLike, directions: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Nearest sphere or wall along free rays.

    Parameters
    ----------
    packing : Packing
        Spheres and walls.
    origins : array_like, shape (m, 3)
        Where the rays start, outside the spheres [m].
    directions : array_like, shape (m, 3)
        Directions of any length above zero [-].

    Returns
    -------
    distance : ndarray, shape (m,)
        Distance to the hit, infinite where there is none [m].
    hit : ndarray of int, shape (m,)
        Sphere, or -1 - k for wall k, or -1 - n_walls for nothing.
    """
    o = np.ascontiguousarray(origins, dtype=np.float64)
    d = np.array(directions, dtype=np.float64)
    if o.shape != d.shape or o.ndim != 2 or o.shape[1] != 3:
        raise InputError(f"origins {o.shape} and directions {d.shape} must both be (m, 3).")
    length = np.sqrt((d**2).sum(axis=1, keepdims=True))
    if not (np.isfinite(o).all() and np.isfinite(d).all() and (length > 0.0).all()):
        raise InputError("origins and directions must be finite, directions longer than zero.")
    scene = Scene.of(packing).tables
    distance, owner = np.empty(len(o)), np.empty(len(o), np.int64)
    _kernels.first_hits(o, d / length, scene.grid, scene.walls, distance, owner)
    return distance, owner
