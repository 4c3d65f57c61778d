"""What a trace with reflections gives back: rows of exchange factors, shares of given rays."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from greybed.raytrace import _paths
from greybed.raytrace.follow import Followed

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ImagePairs:
    """Exchange factors with the periodic images of a target kept apart, shape (m,) each.

    Attributes
    ----------
    emitter, target : int arrays, shape (m,)
        Spheres; sorted by emitter.
    image : int array, shape (m, 3)
        Boxes by which the target is shifted, as seen from the emitter.
    factor, stderr : arrays, shape (m,)
        D_ij and its standard error [-].
    """

    emitter: NDArray[np.int64]
    target: NDArray[np.int64]
    image: NDArray[np.int64]
    factor: Array
    stderr: Array


@dataclass(frozen=True, eq=False)
class PatchExchange:
    """Exchange factors of the walls at one emissivity: what a wall emits, by who absorbs it.

    Attributes
    ----------
    factors, stderr : csr_array, shape (n_walls, n)
        Wall to sphere and standard error [-]; rows of walls without end are empty.
    wall_factors, wall_stderr : ndarray, shape (n_walls, n_walls)
        Wall to wall [-]; NaN in rows of walls without end.
    escaped, escaped_stderr : ndarray, shape (n_walls,)
        Share that leaves for good [-].
    emissivity : ndarray, shape (n_walls,)
        Of the walls [-].
    areas, buried : ndarray, shape (n_walls,)
        Surface on the bed's side, less what lies inside spheres [m2], infinite without end, and
        the share inside spheres [-]. ``A_w e_w D_wi = A_i e_i D_iw`` holds within the errors.
    rays : int
        Rays started from each wall [-].
    """

    factors: sparse.csr_array
    stderr: sparse.csr_array
    wall_factors: Array
    wall_stderr: Array
    escaped: Array
    escaped_stderr: Array
    emissivity: Array
    areas: Array
    buried: Array
    rays: int

    @property
    def exchange(self) -> Array:
        """Exchange areas between walls, A e D, (n_walls, n_walls) [m2], the mean of both ways.

        Where one of two walls has no end, what the other one sends; zero where both have none.
        """
        sent = self.areas[:, None] * self.emissivity[:, None] * self.wall_factors
        known = np.isfinite(sent)
        sent = np.where(known, sent, 0.0)
        ways = known.astype(np.float64)
        return (sent + sent.T) / np.maximum(ways + ways.T, 1.0)


@dataclass(frozen=True, eq=False)
class ExchangeRows:
    """Exchange factors D_ij at one emissivity: the share of what i emits that j finally absorbs.

    Attributes
    ----------
    factors, stderr : csr_array, shape (n, n)
        Sphere to sphere and standard error [-], periodic images summed; the diagonal is what
        comes back. Row i, all ``wall_factors[i]`` and ``escaped[i]`` add up to one.
    wall_factors, wall_stderr : ndarray, shape (n, n_walls)
        Absorbed by each wall [-].
    escaped, escaped_stderr : ndarray, shape (n,)
        Share that leaves for good [-]; with what paths cut short still carried.
    emissivity : ndarray, shape (n,)
        Of the spheres [-].
    wall_emissivity : ndarray, shape (n_walls,)
        Of the walls [-].
    areas, buried : ndarray, shape (n,)
        Exposed surface [m2] and the fraction inside other spheres or walls [-].
    spread, spread_stderr : ndarray, shape (n, 4)
        sum_j D_ij (x_ij^2, y_ij^2, z_ij^2, d_ij^2) over spheres and images [m2].
    pairs : ImagePairs or None
        Where images were asked for.
    patches : PatchExchange or None
        Rows of the walls, where ``wall_rays`` were asked for.
    cut : float
        Share of the paths that were cut short [-].
    rays, seed : int
        Rays per sphere [-] and the seed.
    seconds : float
        Wall time of the trace, all emissivities together [s].
    """

    factors: sparse.csr_array
    stderr: sparse.csr_array
    wall_factors: Array
    wall_stderr: Array
    escaped: Array
    escaped_stderr: Array
    emissivity: Array
    wall_emissivity: Array
    areas: Array
    buried: Array
    spread: Array
    spread_stderr: Array
    pairs: ImagePairs | None
    patches: PatchExchange | None
    cut: float
    rays: int
    seed: int
    seconds: float

    @property
    def emission_areas(self) -> Array:
        """Areas times emissivity, (n,) [m2]: ``E_i D_ij = E_j D_ji`` holds within the errors."""
        return self.areas * self.emissivity

    @property
    def wall_exchange(self) -> Array | None:
        """Exchange areas between the walls, (n_walls, n_walls) [m2]; None without ``patches``."""
        return None if self.patches is None else self.patches.exchange


@dataclass(frozen=True, eq=False)
class ExchangeFactors:
    """Exchange factors of one trace, one :class:`ExchangeRows` per emissivity asked for.

    Attributes
    ----------
    results : tuple of ExchangeRows
        In the order of the emissivities; also by index, length and iteration.
    """

    results: tuple[ExchangeRows, ...]

    def __getitem__(self, k: int) -> ExchangeRows:
        return self.results[k]

    def __len__(self) -> int:
        return len(self.results)

    def __iter__(self) -> Iterator[ExchangeRows]:
        return iter(self.results)


@dataclass(frozen=True, eq=False)
class RayShares:
    """Where the energy of given rays is absorbed in the end, at one emissivity.

    Attributes
    ----------
    factors, stderr : ndarray, shape (n,)
        Shares of the spheres and standard errors [-].
    wall_factors, wall_stderr : ndarray, shape (n_walls,)
        Shares of the walls [-].
    escaped, escaped_stderr : float
        Share that leaves for good [-].
    """

    factors: Array
    stderr: Array
    wall_factors: Array
    wall_stderr: Array
    escaped: float
    escaped_stderr: float


def error_of(total: Array, square: Array, unit: ArrayLike, rays: int) -> Array:
    """Standard error of a mean over rays, after two more hits worth ``unit`` and two misses."""
    u = np.asarray(unit, dtype=np.float64)
    mean = (total + 2.0 * u) / (rays + 4.0)
    spread = (square + 2.0 * u * u) / (rays + 4.0) - mean * mean
    return np.sqrt(np.maximum(spread, 0.0) / (rays + 4.0))


def outside_of(done: Followed, k: int, n: int, emissivity: Array) -> tuple[Array, Array]:
    """Totals and squares of walls and, last, escape, each (n, n_walls + 1)."""
    n_walls = len(emissivity)
    total, square = np.zeros((n, n_walls + 1)), np.zeros((n, n_walls + 1))
    out = done.key < 0
    column = np.where(done.key[out] == _paths.ESCAPED, n_walls, -1 - done.key[out])
    total[done.emitter[out], column] = done.total[out, k]
    square[done.emitter[out], column] = done.square[out, k]
    return total, square


def shares_of(done: Followed, k: int, emissivity: Array, walls: Array) -> RayShares:
    """Where the energy of the rays went, at emissivities number ``k``."""
    n, rays = len(emissivity), done.rays
    total, square = np.zeros(n), np.zeros(n)
    hit = done.key >= 0
    total[done.key[hit]], square[done.key[hit]] = done.total[hit, k], done.square[hit, k]
    outer, outer_square = (v[0] for v in outside_of(done, k, 1, walls))
    outer_error = error_of(outer, outer_square, np.append(walls, 1.0), rays)
    return RayShares(
        factors=total / rays,
        stderr=error_of(total, square, emissivity, rays),
        wall_factors=outer[:-1] / rays,
        wall_stderr=outer_error[:-1],
        escaped=float(outer[-1]) / rays,
        escaped_stderr=float(outer_error[-1]),
    )
