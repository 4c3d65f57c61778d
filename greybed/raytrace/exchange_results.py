"""What a trace with reflections gives back: rows of exchange factors, shares of given rays."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

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
    cut: float
    rays: int
    seed: int
    seconds: float

    @property
    def emission_areas(self) -> Array:
        """Areas times emissivity, (n,) [m2]: ``E_i D_ij = E_j D_ji`` holds within the errors."""
        return self.areas * self.emissivity


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
