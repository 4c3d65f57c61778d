"""Designs in the unit cube: Latin hypercube, Sobol, factorials, central composite."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import pdist
from scipy.stats import qmc

from greybed.core.errors import InputError

Array = NDArray[np.float64]

DESIGNS = ("lhs", "sobol", "factorial")
# Latin hypercubes that are tried, where there are so few points that it is quick.
_TRIES, _MANY = 60, 500
# Generators of two-level fractions of highest resolution: factors -> words, after Box, Hunter &
# Hunter, Statistics for Experimenters (1978), table 12.15; with the resolution that they reach.
GENERATORS: dict[int, tuple[tuple[str, ...], int]] = {
    3: ((), 9),
    4: (("abc",), 4),
    5: (("abcd",), 5),
    6: (("abc", "bcd"), 4),
    7: (("abc", "bcd", "acd"), 4),
    8: (("bcd", "acd", "abc", "abd"), 4),
    9: (("abcd", "acde", "bcde", "abde"), 4),
}


def latin_hypercube(n: int, dimensions: int, seed: int) -> Array:
    """Points of which one lies in each n-th of every axis, shape (n, d).

    Of many such designs the one is taken whose nearest points are farthest apart (Johnson, Moore &
    Ylvisaker, J. Stat. Plan. Inference 26 (1990) 131).

    Parameters
    ----------
    n, dimensions : int
        Points and axes [-].
    seed : int
        Of the random numbers.
    """
    rng = np.random.default_rng([seed, 21])
    best, farthest = np.empty((0, dimensions)), -1.0
    for _ in range(_TRIES if n <= _MANY else 1):
        points = (rng.permuted(np.tile(np.arange(n), (dimensions, 1)), axis=1).T + 0.5) / n
        nearest = float(pdist(points).min()) if n > 1 else 0.0
        if nearest > farthest:
            best, farthest = points, nearest
    # Anywhere in the cells, but not so far that neighbours meet.
    return np.asarray(best + (rng.random(best.shape) - 0.5) * 0.5 / n)


def sobol(n: int, dimensions: int, seed: int) -> Array:
    """The first n points of a scrambled Sobol sequence, shape (n, d)."""
    sampler = qmc.Sobol(dimensions, rng=np.random.default_rng([seed, 22]))
    power = max(1, int(np.ceil(np.log2(max(n, 2)))))
    return np.asarray(sampler.random_base2(power)[:n])


def full_factorial(levels: int, dimensions: int, *, edge: float = 0.0) -> Array:
    """All combinations of evenly spaced levels, shape (levels**d, d).

    Parameters
    ----------
    levels, dimensions : int
        Levels of each axis, axes [-].
    edge : float
        Distance of the outer levels from the faces of the cube [-].
    """
    ticks = np.linspace(edge, 1.0 - edge, levels)
    return np.array(list(itertools.product(ticks, repeat=dimensions)))


def fractional_factorial(dimensions: int, *, edge: float = 0.1) -> tuple[Array, int]:
    """Two-level fraction in which main effects are clear of those of pairs where possible.

    Parameters
    ----------
    dimensions : int
        Factors, 1 to 9 [-].
    edge : float
        Distance of the levels from the faces of the cube [-].

    Returns
    -------
    points : ndarray (n, d)
        Between 8 and 32 of them; 2**d below four factors.
    resolution : int
        4: pairs are mixed with each other; 5: they are clear, too; 9: all combinations.

    Raises
    ------
    InputError
        For more than nine factors.
    """
    if dimensions > max(GENERATORS):
        raise InputError(
            f"{dimensions} free parameters are too many to screen at once; fix some, or use at "
            f"most {max(GENERATORS)}."
        )
    if dimensions < 4:
        signs = np.array(list(itertools.product((-1.0, 1.0), repeat=dimensions)))
        return 0.5 + (0.5 - edge) * signs, 9
    words, resolution = GENERATORS[dimensions]
    base = dimensions - len(words)
    signs = np.array(list(itertools.product((-1.0, 1.0), repeat=base)))
    made = [signs[:, ["abcdefgh".index(c) for c in word]].prod(axis=1) for word in words]
    return 0.5 + (0.5 - edge) * np.column_stack([signs, *made]), resolution


def central_composite(dimensions: int, *, centres: int = 3, edge: float = 0.0) -> Array:
    """Corners (a fraction of them from five axes on), faces and repeated centres.

    Parameters
    ----------
    dimensions : int
        Axes, 1 to 9 [-].
    centres : int
        Runs at the centre, from which the scatter is found [-].
    edge : float
        Distance of the star's points from the faces of the cube [-].

    Returns
    -------
    ndarray (n, d)
        The star stands on the faces, the corners at sqrt(1/2) of its distance where d is 2, as
        on a circle, and nearer to its own rotatable distance d = 2**(k/4) for more.
    """
    if dimensions < 5:
        signs = np.array(list(itertools.product((-1.0, 1.0), repeat=dimensions)))
    else:
        signs = np.sign(fractional_factorial(dimensions)[0] - 0.5)
    star = np.concatenate([np.eye(dimensions), -np.eye(dimensions)])
    reach = float(len(signs)) ** 0.25  # rotatable: Box & Hunter, Ann. Math. Stat. 28 (1957) 195
    half = 0.5 - edge
    points = np.concatenate([signs / reach, star, np.zeros((centres, dimensions))])
    return np.asarray(0.5 + half * points)


def first_design(kind: str, n: int, dimensions: int, seed: int) -> Array:
    """A design by name: ``lhs``, ``sobol``, or the ``factorial`` of about n points.

    Raises
    ------
    InputError
        For another name.
    """
    if kind == "lhs":
        return latin_hypercube(n, dimensions, seed)
    if kind == "sobol":
        return sobol(n, dimensions, seed)
    if kind == "factorial":
        levels = max(2, int(np.floor(n ** (1.0 / dimensions) + 1e-9)))
        return full_factorial(levels, dimensions, edge=0.5 / levels)
    raise InputError(f"design = {kind!r} must be one of {', '.join(map(repr, DESIGNS))}.")
