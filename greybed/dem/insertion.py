"""Insertion: where new particles find room."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.core.errors import InputError
from greybed.dem import _insert

Array = NDArray[np.float64]

# Tries for each sphere: random places fill about a third of a volume with so many.
ATTEMPTS = 400


@dataclass(frozen=True)
class Region:
    """A box, or the upright cylinder in it, that particles are put into.

    Attributes
    ----------
    lower, upper : (3,) floats
        Corners of the box [m].
    round : bool
        Only the cylinder about its vertical axis.
    """

    lower: tuple[float, float, float]
    upper: tuple[float, float, float]
    round: bool = False

    def __post_init__(self) -> None:
        if not all(a < b for a, b in zip(self.lower, self.upper, strict=True)):
            raise InputError(
                f"lower {self.lower} must be below upper {self.upper} along x, y and z [m]."
            )


def random_places(
    region: Region,
    radii: ArrayLike,
    seed: int | Sequence[int],
    *,
    taken: ArrayLike = (),
    taken_radii: ArrayLike = (),
    attempts: int = ATTEMPTS,
) -> Array:
    """Places in a region for spheres that touch neither each other nor what is there.

    Parameters
    ----------
    region : Region
        Spheres lie wholly inside it.
    radii : array_like, shape (n,)
        Radii [m].
    seed : int or sequence of ints
        Same seed, same places.
    taken, taken_radii : array_like, shapes (m, 3) and (m,)
        Spheres that are there already [m].
    attempts : int
        Random places tried for each sphere, on average [-].

    Returns
    -------
    ndarray, shape (k, 3)
        Places of the first k spheres, all n of them if there is room; large ones should come
        first [m].

    Raises
    ------
    InputError
        If a sphere is larger than the region.
    """
    r = np.asarray(radii, dtype=np.float64)
    low, high = np.array(region.lower), np.array(region.upper)
    room = float((high - low).min())
    if len(r) and 2.0 * r.max() > room:
        raise InputError(
            f"a particle of radius {r.max():g} [m] does not fit into a region {room:g} [m] wide; "
            "make it wider."
        )
    other = np.asarray(taken, dtype=np.float64).reshape(-1, 3)
    other_radii = np.asarray(taken_radii, dtype=np.float64)
    # Only those that can touch: a bed below must not fill the cells of the region's edge.
    if len(other):
        reach = other_radii + 0.0
        near = ((other > low - reach[:, None]) & (other < high + reach[:, None])).all(axis=1)
        other, other_radii = other[near], other_radii[near]
    numbers = np.random.default_rng(seed).random((max(attempts * len(r), 1), 3))
    placed = np.empty((len(r), 3))
    largest = max(float(r.max(initial=0.0)), float(other_radii.max(initial=0.0)), 1e-30)
    found = _insert.place_apart(
        numbers, r, low, high, region.round, np.ascontiguousarray(other), other_radii,
        2.0 * largest, placed,
    )  # fmt: skip
    return placed[:found]
