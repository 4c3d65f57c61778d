r"""Sides of spheres: which part of a sphere sees which neighbour, from where the neighbours stand.

A sphere's radiation leaves evenly, but what it reflects leaves from the side that was lit. So each
sphere is cut into sides p of equal area, and the factor from a side to a neighbour k follows the
profile of a free pair,

.. math:: f_{jk}(p) = x_k y_p\,h(\gamma_{pk}, d_{jk}),\qquad
          \sum_k f_{jk}(p) = 1,\qquad \frac1P\sum_p f_{jk}(p) = F_{jk},

with h the factor from an element of a sphere to another sphere, and x, y by alternate scaling
(Sinkhorn), so that both sums hold. From side p of j to side q of k goes f_jk(p) f_kj(q) / (P F_kj):
sides add nothing to the view factors, and take nothing from them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags

from greybed.core.packing import Packing
from greybed.core.rows import Rows
from greybed.core.walls import Plane

Array = NDArray[np.float64]

# Light that comes round a corner: no profile is zero anywhere.
_LEAST = 1e-6
_TOLERANCE, _ROUNDS = 1e-13, 2000


def directions(sides: int) -> Array:
    """Unit vectors through the middles of the sides, shape (sides, 3), evenly spread [-]."""
    k = np.arange(sides) + 0.5
    z, turn = 1.0 - 2.0 * k / sides, np.pi * (1.0 + np.sqrt(5.0)) * k
    across = np.sqrt(1.0 - z * z)
    return np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1)


def element_to_sphere(cosine: Array, r_j: float, r_k: Array, distance: Array) -> Array:
    """Factor from an element of sphere j to sphere k that it sees freely, in part or not [-].

    Parameters
    ----------
    cosine : array
        Of the angle at the centre of j between the element and k [-].
    r_j, r_k, distance : float, arrays
        Radii and distance of the centres, at least their sum [m].

    Notes
    -----
    With H the distance over r_k and omega the angle from the normal: cos(omega) / H^2 above the
    horizon, and the form for a sphere that the horizon cuts otherwise (Howell, A Catalog of
    Radiation Heat Transfer Configuration Factors, element to sphere).
    """
    length = np.sqrt(distance**2 + r_j**2 - 2.0 * distance * r_j * cosine)
    slope = np.clip((distance * cosine - r_j) / length, -1.0, 1.0)
    size = np.minimum(r_k / length, 1.0)
    across = np.sqrt(np.maximum(1.0 - slope**2, 1e-30))
    rest = np.sqrt(1.0 - size**2)
    y = np.clip(-rest * slope / (size * across), -1.0, 1.0)
    half = across * np.sqrt(1.0 - y**2)
    cut = size**2 * (slope * np.arccos(y) - rest / size * half)
    cut = (cut + np.arctan2(half * size, rest)) / np.pi
    whole = size**2 * slope
    return np.where(slope >= size, whole, np.where(slope > -size, np.maximum(cut, 0.0), 0.0))


def by_sides(packing: Packing, view: Rows, sides: int) -> tuple[csr_matrix, NDArray, Array]:
    """What each side of each sphere sees.

    Parameters
    ----------
    packing : Packing
        Where the spheres stand; of periodic images the nearest counts.
    view : Rows
        Balanced view factors.
    sides : int
        Sides of each sphere [-].

    Returns
    -------
    pairs : csr matrix, shape (m, n * sides)
        One row per entry (j, k) of the view factors: exchange areas of the sides of j with k,
        over the square root of the pair's exchange area [m].
    back : int array, shape (m,)
        Where the entry (k, j) is.
    outer : array, shape (n * sides, n_walls + 1)
        Exchange areas with walls and, last, the opening [m2].
    """
    n = len(packing)
    # Symmetric to the last digit, so that every entry has its counterpart.
    both = diags(view.areas) @ view.factors
    f = csr_matrix(diags(0.5 / view.areas) @ (both + both.T))
    f.sort_indices()
    f.eliminate_zeros()
    place = csr_matrix((np.arange(1.0, f.nnz + 1.0), f.indices, f.indptr), f.shape)
    turned = place.T.tocsr()
    turned.sort_indices()
    back = turned.data.astype(np.int64) - 1
    normal = directions(sides)
    ahead = np.column_stack([_toward(packing, normal), np.ones(sides)])
    share = np.empty((f.nnz, sides))
    outer = np.zeros((n * sides, ahead.shape[1]))
    for j in range(n):
        own = slice(f.indptr[j], f.indptr[j + 1])
        profile = np.column_stack([_profiles(packing, j, f.indices[own], normal), ahead])
        total = np.concatenate([f.data[own], view.wall_factors[j], view.escaped[j : j + 1]])
        seen = total > 0.0
        scaled = np.zeros_like(profile)
        scaled[:, seen] = _scaled(profile[:, seen], total[seen])
        inner = len(f.data[own])
        share[own] = scaled[:, :inner].T
        outer[j * sides : (j + 1) * sides] = scaled[:, inner:] * (view.areas[j] / sides)
    owner = np.repeat(np.arange(n), np.diff(f.indptr))
    # A_j F_jk is symmetric to round-off; one root for both directions makes it exactly so.
    exchange = view.areas[owner] * f.data
    root = np.sqrt(0.5 * (exchange + exchange[back]))
    share *= (view.areas[owner] / sides / root)[:, None]
    columns = (owner[:, None] * sides + np.arange(sides)).ravel()
    starts = np.arange(f.nnz + 1) * sides
    return csr_matrix((share.ravel(), columns, starts), (f.nnz, n * sides)), back, outer


def _toward(packing: Packing, normal: Array) -> Array:
    """Profile of each wall, shape (sides, n_walls): planes have a direction, others none."""
    columns = [
        0.5 * (1.0 - normal @ np.array(wall.normal)) + _LEAST
        if isinstance(wall, Plane)
        else np.ones(len(normal))
        for wall in packing.walls
    ]
    return np.array(columns).reshape(len(columns), len(normal)).T


def _profiles(packing: Packing, j: int, others: NDArray, normal: Array) -> Array:
    away = packing.centres[others] - packing.centres[j]
    for axis in np.flatnonzero(packing.periodic):
        away[:, axis] -= packing.edges[axis] * np.round(away[:, axis] / packing.edges[axis])
    apart = np.sqrt((away**2).sum(axis=1))
    image = apart == 0.0  # of the sphere itself, on all sides
    cosine = normal @ (away / np.where(image, 1.0, apart)[:, None]).T
    r_j, r_k = float(packing.radii[j]), packing.radii[others]
    lit = element_to_sphere(cosine, r_j, r_k, np.maximum(apart, r_j + r_k)) + _LEAST
    return np.where(image, 1.0, lit)


def _scaled(profile: Array, total: Array) -> Array:
    """Rows that sum to one and columns with the means ``total``, of the profiles (sides, m)."""
    sides = len(profile)
    x = np.ones(len(total))
    for _ in range(_ROUNDS):
        y = 1.0 / (profile @ x)
        new = sides * total / (profile.T @ y)
        change = np.abs(new / x - 1.0).max()
        x = new
        if change <= _TOLERANCE:
            break
    return profile * x / (profile @ x)[:, None]
