r"""Exact view factor between two spheres that see each other freely.

Derivation. Every line that meets both spheres is counted once by its direction and by where it
crosses the lens in which the two shadows overlap, so with the distance s between the shadow
centres

.. math:: F_{12} = \frac{1}{2\pi r_1^2}
          \int A_\mathrm{lens}(r_1, r_2, d\sin\theta)\sin\theta\,d\theta .

The lens shrinks with s by its chord. Integrating by parts, writing :math:`x=s^2` and removing the
part that cancels leaves a positive integrand,

.. math:: F_{12} = \frac{1}{4\pi r_1^2 d^2}\int_{(r_1-r_2)^2}^{(r_1+r_2)^2}
          \frac{\sqrt{((r_1+r_2)^2-x)\,(x-(r_1-r_2)^2)}}{1+\sqrt{1-x/d^2}}\,dx ,

and with :math:`x=(r_1+r_2)^2-4r_1r_2y^2`

.. math:: F_{12} = \frac{r_2^2}{\pi d^2}\int_0^1
          \frac{8y^2\sqrt{1-y^2}}{1+\sqrt{\varepsilon+\kappa y^2}}\,dy,\quad
          \varepsilon = 1-\frac{(r_1+r_2)^2}{d^2},\quad \kappa=\frac{4r_1r_2}{d^2}.

A Gauss-Jacobi rule for the end :math:`\sqrt{1-y}` with 32 nodes is within 1e-11 (relative) of the
integral for all gaps, touching included, and size ratios 0.01 to 100; far away the integral tends
to pi/4 and the factor to :math:`r_2^2/(4d^2)`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.core.errors import RangeError

Array = NDArray[np.float64]

NODES = 32
# Overlap of a pair that still counts as touching, relative to r_i + r_j: soft contact of DEM
# codes stays well below it, a duplicate or misplaced sphere does not.
TOUCHING = 0.05


def quadrature() -> tuple[Array, Array]:
    """Squared nodes y^2 and weights of the rule, shape (32,) each [-].

    The weights hold 8 y^2 sqrt(1 - y^2) / pi, so that ``F = (r_j / d)^2 sum(w / (1 + sqrt(eps +
    kappa y2)))``.
    """
    from scipy.special import roots_jacobi

    x, w = roots_jacobi(NODES, 0.5, 0.0)
    y = 0.5 * (x + 1.0)
    return y**2, w * 2.0**-1.5 * 8.0 * y**2 * np.sqrt(1.0 + y) / np.pi


_RULE: list[tuple[Array, Array]] = []


def pair_factor(over_distance: Array, ratio: Array) -> Array:
    """Exact factor from x = r_j / d and ratio = r_j / r_i [-], no checks; overlaps touch."""
    if not _RULE:
        _RULE.append(quadrature())
    other = over_distance / ratio  # r_i / d
    kappa = 4.0 * over_distance * other
    # max: pairs that overlap slightly count as touching, see docs/overlaps.md
    eps = np.maximum(1.0 - (over_distance + other) ** 2, 0.0)
    total = np.zeros(np.broadcast(eps, kappa).shape)
    for y2, weight in zip(*_RULE[0], strict=True):
        total += weight / (1.0 + np.sqrt(eps + kappa * y2))
    return over_distance**2 * total


def exact_view_factor(r_i: ArrayLike, r_j: ArrayLike, distance: ArrayLike) -> Array:
    r"""View factor from sphere i to sphere j with nothing in between.

    Parameters
    ----------
    r_i, r_j : array_like
        Radii, above zero [m]. Broadcast against each other and ``distance``.
    distance : array_like
        Distance of the centres [m], at least r_i + r_j. Down to 5 % below it (soft contact) the
        pair counts as touching.

    Returns
    -------
    factor : ndarray
        F_ij [-], between 0 and 0.5, relative error below 1e-11.

    Raises
    ------
    RangeError
        If a number is not finite, a radius is not above zero, or the spheres overlap by more
        than soft contact does.

    Notes
    -----
    Limits: r_j^2 / (4 d^2) far away; 0.0755868184216 for equal spheres in contact; r_i^2 F_ij =
    r_j^2 F_ji. Derived in this module's docstring; checked against the lens integral.

    Examples
    --------
    >>> print(f"{exact_view_factor(1.0, 1.0, 2.0):.13f}")
    0.0755868184216
    """
    a, b, d = (np.asarray(v, dtype=np.float64) for v in (r_i, r_j, distance))
    for name, value in (("r_i", a), ("r_j", b), ("distance", d)):
        bad = ~(np.isfinite(value) & (value > 0.0))
        if bad.any():
            raise RangeError(
                f"{name} = {value[bad].flat[0]:g} [m] must be finite and above 0; check the input."
            )
    gap = d - (a + b)
    deep = gap < -TOUCHING * (a + b)
    if deep.any():
        r1, r2, apart = (np.broadcast_to(v, deep.shape)[deep].flat[0] for v in (a, b, d))
        raise RangeError(
            f"distance = {apart:g} [m] is below r_i + r_j = {r1 + r2:g} [m] by more than "
            f"{TOUCHING:.0%}: the spheres overlap and have no free view factor; separate them."
        )
    d = np.where(gap < 0.0, a + b, d)
    return pair_factor(b / d, b / a)
