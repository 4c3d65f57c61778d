"""Rows of view factors of a bed, and their balance: sums of one and reciprocity."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags

from greybed.core.errors import InputError
from greybed.core.packing import Packing

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Rows:
    """View factors of a bed, one row per sphere.

    Attributes
    ----------
    factors : csr matrix, shape (n, n)
        Fraction of what sphere i sends out that arrives directly at sphere j [-].
    wall_factors : array, shape (n, n_walls)
        Fraction that arrives directly at each wall [-].
    escaped : array, shape (n,)
        Fraction that leaves through the opening [-].
    areas : array, shape (n,)
        Surface of each sphere [m2]; times its emissivity where ``emissivity`` is set.
    emissivity : array, shape (n,), or None
        Set for exchange factors, which hold reflections at these emissivities [-]: they say who
        absorbs, not who is hit, and walls and opening are then what absorbs there.

    Raises
    ------
    InputError
        If shapes disagree, a factor is negative or not finite, or an area is not above zero.
    """

    factors: csr_matrix
    wall_factors: Array
    escaped: Array
    areas: Array
    emissivity: Array | None = None

    def __post_init__(self) -> None:
        factors = csr_matrix(self.factors, dtype=np.float64)
        n = factors.shape[0]
        escaped = np.asarray(self.escaped, dtype=np.float64)
        areas = np.asarray(self.areas, dtype=np.float64)
        walls = np.asarray(self.wall_factors, dtype=np.float64)
        shapes = (factors.shape, walls.shape[:1], escaped.shape, areas.shape)
        if walls.ndim != 2 or shapes != ((n, n), (n,), (n,), (n,)):
            raise InputError(
                f"factors {factors.shape}, wall_factors {walls.shape}, escaped {escaped.shape} and "
                f"areas {areas.shape} disagree; give (n, n), (n, n_walls), (n,) and (n,)."
            )
        for name, array in (
            ("factors", factors.data),
            ("wall_factors", walls),
            ("escaped", escaped),
        ):
            if not (np.isfinite(array).all() and (array >= 0.0).all()):
                worst = array.flat[int((~(array >= 0.0)).argmax())]
                raise InputError(
                    f"{name} contain {worst:g} [-]; every view factor must be finite and at "
                    "least 0: trace again or check the closure."
                )
        if not (np.isfinite(areas).all() and (areas > 0.0).all()):
            raise InputError("areas must be finite and above 0 [m2]; use packing.areas.")
        for name, value in (
            ("factors", factors),
            ("wall_factors", walls),
            ("escaped", escaped),
            ("areas", areas),
        ):
            object.__setattr__(self, name, value)

    @classmethod
    def of(cls, result: Any, packing: Packing) -> Rows:
        """Take the rows of a traced result or of a closure's ``bed_factors``.

        Parameters
        ----------
        result : object
            Anything with ``factors``, ``wall_factors``, ``escaped`` and, optionally, ``areas``;
            with ``emission_areas`` and ``emissivity``, too, for exchange factors. A share
            ``environment`` beyond a distance limit goes to the spheres, see :func:`localised`.
        packing : Packing
            The bed that they belong to.

        Returns
        -------
        Rows
            The same numbers, checked.

        Raises
        ------
        InputError
            If the rows are not those of this packing.
        """
        rows = cls.taken(result, packing.areas)
        have = (len(rows.areas), rows.wall_factors.shape[1])
        if have != (len(packing), packing.n_walls):
            raise InputError(
                f"the view factors are for {have[0]} spheres and {have[1]} walls, but "
                f"{packing.source} has {len(packing)} and {packing.n_walls}; make them from "
                "this packing."
            )
        return rows

    @classmethod
    def taken(cls, result: Any, areas: Array | None = None) -> Rows:
        """Take rows as :meth:`of` does, with ``areas`` [m2] where the result has none.

        Exchange factors of black spheres are view factors.

        Raises
        ------
        InputError
            If there are no areas, or factors of several emissivities at once.
        """
        if isinstance(result, cls):
            return result
        if not hasattr(result, "factors"):
            raise InputError(
                f"{type(result).__name__} has no rows of factors; give one result, e.g. results[0] "
                "of several emissivities."
            )
        own = getattr(result, "areas", None)
        emissivity = None
        if getattr(result, "emission_areas", None) is not None and (result.emissivity < 1.0).any():
            own, emissivity = result.emission_areas, np.array(result.emissivity)
        own = areas if own is None else own
        if own is None:
            raise InputError("the factors come without areas; give Rows with areas [m2].")
        factors = result.factors
        beyond = getattr(result, "environment", None)
        if beyond is not None and (beyond > 0.0).any():
            factors = localised(factors, beyond)
        return cls(factors, result.wall_factors, result.escaped, own, emissivity)

    @cached_property
    def sums(self) -> Array:
        """Row sums over spheres, walls and opening, shape (n,); 1 where nothing is lost [-]."""
        return np.asarray(self.factors.sum(axis=1)).ravel() + self._outside

    @property
    def _outside(self) -> Array:
        return self.wall_factors.sum(axis=1) + self.escaped

    @cached_property
    def imbalance(self) -> float:
        """Largest violation of closure, or of reciprocity over the area [-]."""
        exchange = diags(self.areas) @ self.factors
        skew = abs(exchange - exchange.T).tocsr()
        reciprocity = skew.max() / self.areas.min() if skew.nnz else 0.0
        return float(max(abs(self.sums - 1.0).max(), reciprocity))


def localised(factors: Any, environment: Array) -> csr_matrix:
    """Factors with what lies beyond a distance limit given to the surroundings of each sphere.

    Parameters
    ----------
    factors : sparse array, shape (n, n)
        Sphere to sphere [-].
    environment : array, shape (n,)
        Share of each row that the limit cut off inside the bed [-].

    Returns
    -------
    csr matrix, shape (n, n)
        Rows scaled such that they hold that share too: what lies beyond has the mean emissive
        power of what the sphere sees, weighted by the factors. A bed at one temperature stays so.

    Raises
    ------
    InputError
        If a sphere has such a share and sees no other sphere.
    """
    seen = np.asarray(factors.sum(axis=1)).ravel()
    blind = (environment > 0.0) & (seen <= 0.0)
    if blind.any():
        raise InputError(
            f"sphere {int(blind.argmax())} sees no other sphere within max_distance, so its "
            "surroundings have no local mean; trace with a longer reach."
        )
    share = np.divide(environment, seen, out=np.zeros_like(seen), where=environment > 0.0)
    return csr_matrix(diags(1.0 + share) @ factors)


def balanced(rows: Rows, *, tolerance: float = 1e-14, max_iterations: int = 5000) -> Rows:
    r"""Rows that sum to one and are reciprocal, both to round-off.

    The exchange areas are made symmetric, :math:`S_{ij} = A_i A_j (F_{ij} + F_{ji})/(A_i + A_j)`,
    the best estimate from rows with equally many rays. Then every sphere gets one factor
    :math:`x_i`, such that :math:`x_i (\sum_j S_{ij} x_j + A_i F_{i,out}) = A_i`.

    Parameters
    ----------
    rows : Rows
        View factors with errors of sampling, fitting or truncation.
    tolerance : float
        Largest relative change per iteration at the end, above zero [-].
    max_iterations : int
        Number of iterations after which it gives up [-].

    Returns
    -------
    Rows
        Zeros stay zero, nothing becomes negative; walls and opening are scaled by ``x_i`` too.

    Raises
    ------
    InputError
        If no such factors exist, e.g. for a closed pair with unequal areas.

    Notes
    -----
    The factors minimise a convex function, so they are unique where they exist. Without balance a
    bed of one temperature would heat or cool by itself, and heat would be made or lost on the way
    from one sphere to another. Fixed point with a square root (symmetric matrix scaling): Knight,
    Ruiz & Ucar, SIAM J. Matrix Anal. Appl. 35 (2014) 931.
    """
    a = rows.areas
    f = rows.factors.tocoo()
    # Equal rays: each estimate of A_i F_ij has a variance proportional to A_i.
    weight = a[f.row] * a[f.col] / (a[f.row] + a[f.col])
    s = csr_matrix((weight * f.data, (f.row, f.col)), shape=f.shape)
    s = (s + s.T).tocsr()
    outside = a * rows._outside
    x = np.ones(len(a))
    change = math.inf
    for _ in range(max_iterations):
        received = s @ x + outside
        if (received <= 0.0).any():
            i = int((received <= 0.0).argmax())
            raise InputError(
                f"sphere {i} sees nothing at all (its row is empty); trace with more rays or a "
                "longer reach."
            )
        new = np.sqrt(x * a / received)
        change = float(abs(new / x - 1.0).max())
        x = new
        # Where no factors exist some run off to infinity.
        if change <= tolerance or x.max() > 1e100 or x.min() < 1e-100:
            break
    # At the round-off floor the change may hover just above the tolerance.
    if change > 1e-12:
        raise InputError(
            f"view factors cannot be balanced: rows still change by {change:.1e} [-] per iteration "
            f"after at most {max_iterations}, so no scaling closes them; trace with more rays or "
            "check that walls and opening are part of the rows."
        )
    factors = (diags(x / a) @ s @ diags(x)).tocsr()
    return Rows(factors, rows.wall_factors * x[:, None], rows.escaped * x, a, rows.emissivity)
