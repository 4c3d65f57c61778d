"""Radiation of a whole bed as a conductivity: the radiative exchange factor of periodic beds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.core import InputError, Packing
from greybed.raytrace.exchange_results import ExchangeRows

Array = NDArray[np.float64]

STEFAN_BOLTZMANN = 5.670374419e-8  # [W/m2/K4], CODATA 2018, exact in the SI


@dataclass(frozen=True, eq=False)
class RadiativeExchangeFactor:
    """F_E = k_rad / (4 sigma T^3 d) of a periodic bed, with standard errors.

    Attributes
    ----------
    factor, stderr : float
        Mean over the three directions [-].
    axes, axes_stderr : array, shape (3,)
        Along x, y and z [-].
    diameter : float
        Sauter mean d_32, to which the factor refers [m].
    """

    factor: float
    stderr: float
    axes: Array
    axes_stderr: Array
    diameter: float

    def conductivity(self, temperature: ArrayLike) -> tuple[Array, Array]:
        """Effective radiative conductivity 4 sigma T^3 d_32 F_E and its error [W/m/K].

        Parameters
        ----------
        temperature : array_like
            Of the bed, above zero [K].
        """
        t = np.asarray(temperature, dtype=np.float64)
        if not (np.isfinite(t).all() and (t > 0.0).all()):
            raise InputError("temperature must be finite and above 0 [K]; give kelvin.")
        unit = 4.0 * STEFAN_BOLTZMANN * t**3 * self.diameter
        return unit * self.factor, unit * self.stderr


def radiative_exchange_factor(packing: Packing, result: ExchangeRows) -> RadiativeExchangeFactor:
    r"""Radiative exchange factor F_E of a bed that repeats in all directions.

    Parameters
    ----------
    packing : Packing
        The bed, periodic along x, y and z.
    result : ExchangeRows
        Exchange factors of this bed at one emissivity; emissivity 1 gives the view factors'.
        From some emitters only: they stand for all.

    Returns
    -------
    RadiativeExchangeFactor

    Raises
    ------
    InputError
        For a bed that is not periodic in all directions, overlaps behind buried surfaces,
        escaped light, or factors of another bed.

    Notes
    -----
    Let the temperature be T + g x at the centres, the same in each sphere. The pair i, j
    exchanges :math:`A_i\varepsilon_i D_{ij}\,4\sigma T^3 g\,x_{ij}` over the distance
    :math:`x_{ij}`, so the flux through a volume V is half the sum over all i, j of heat times
    distance, over V:

    .. math:: k = 4\sigma T^3 \frac{1}{2V}\sum_i A_i\varepsilon_i \sum_j D_{ij} x_{ij}^2

    The mean over directions has :math:`d_{ij}^2/3`. With :math:`\varphi = V_s/V` and
    :math:`d_{32} = 6 V_s/\sum A_i` this is :math:`k = 4\sigma T^3 d_{32} F_E`,

    .. math:: F_E = \frac{\varphi}{\sum_i A_i} \sum_i A_i\varepsilon_i
                    \sum_j D_{ij} \frac{d_{ij}^2}{d_{32}^2},

    for equal spheres the mean over emitters of :math:`\varphi\sum_j\varepsilon D_{ij}
    (d_{ij}/d)^2`. Images of a sphere count at their own distances, the sphere itself at zero.
    In a cubic lattice the linear profile is exact. In a random bed the spheres settle a little
    off it until none gains or loses heat, which lowers k: there the value is an upper bound.
    The spheres conduct well compared with radiation, and the bed is large compared with the way
    of light. The error covers the rays, not the choice of the bed. Where straight channels run
    through a lattice (simple cubic), some light goes very far: its share falls with the inverse
    of the distance, squares of the sum have no bound, and the stated error is too small; compare
    seeds there.
    """
    if not all(packing.periodic):
        raise InputError(
            f"{packing.source}: a radiative exchange factor needs a bed that is periodic in all "
            f"directions, not {packing.periodic}; take a periodic bed."
        )
    n = len(packing)
    if len(result.areas) != n or packing.n_walls:
        raise InputError(
            f"factors of {len(result.areas)} spheres do not belong to {packing.source} with {n} "
            f"spheres and {packing.n_walls} walls; take a bed without walls and its own factors."
        )
    traced = np.flatnonzero(np.isfinite(result.buried))
    if result.buried[traced].any():
        i = int(traced[result.buried[traced].argmax()])
        raise InputError(
            f"sphere {i} has {100.0 * result.buried[i]:.2g} % of its surface inside others, so "
            "solid fraction and diameter are not those of the surface that radiates; separate "
            "the spheres."
        )
    lost = float(result.escaped[traced].max())
    if lost > 0.0:
        raise InputError(
            f"up to {lost:.2g} [-] of what a sphere sends escapes within max_distance; trace the "
            "bed without that limit."
        )
    areas = packing.areas[traced]
    diameter = 6.0 * packing.sphere_volume / float(packing.areas.sum())
    weight = areas * result.emissivity[traced] / areas.sum() * packing.solid_fraction / diameter**2
    total = weight @ result.spread[traced]
    error = np.sqrt(weight**2 @ result.spread_stderr[traced] ** 2)
    return RadiativeExchangeFactor(
        factor=float(total[3]),
        stderr=float(error[3]),
        axes=3.0 * total[:3],
        axes_stderr=3.0 * error[:3],
        diameter=diameter,
    )


def breitbach_barthels(
    void_fraction: ArrayLike, emissivity: ArrayLike, solid: ArrayLike = np.inf
) -> Array:
    r"""Radiative exchange factor of pebble beds after Breitbach and Barthels, to compare with.

    The radiation term of the Zehner-Bauer-Schluender unit cell in its modified form,

    .. math:: F_E = (1-\sqrt{1-\psi})\,\psi + \frac{\sqrt{1-\psi}}{2/\varepsilon-1}\,
              \frac{B+1}{B}\,\frac{1}{1+\frac{1}{(2/\varepsilon-1)\Lambda}},\quad
              B = 1.25\left(\frac{1-\psi}{\psi}\right)^{10/9}

    Parameters
    ----------
    void_fraction : array_like
        psi, above 0 and below 1 [-].
    emissivity : array_like
        In (0, 1] [-].
    solid : array_like
        Lambda = k_s / (4 sigma T^3 d) of the spheres, above 0 [-]; infinite for spheres of one
        temperature each, as in :func:`radiative_exchange_factor`.

    Returns
    -------
    ndarray
        F_E = k_rad / (4 sigma T^3 d) [-].

    Raises
    ------
    InputError
        For a value out of range.

    Notes
    -----
    Breitbach & Barthels, Nuclear Technology 49 (1980) 392. The paper itself was not at hand: the
    form here is the one in common use, from two places that agree. For packed beds only: towards
    an empty one it grows without bound at infinite Lambda.
    """
    void, eps, ratio = np.broadcast_arrays(
        *(np.asarray(v, dtype=np.float64) for v in (void_fraction, emissivity, solid))
    )
    if not ((void > 0.0) & (void < 1.0)).all():
        raise InputError("void_fraction must be above 0 and below 1 [-]; mend it.")
    if not ((eps > 0.0) & (eps <= 1.0)).all():
        raise InputError("emissivity must be above 0 and at most 1 [-]; mend it.")
    if not (ratio > 0.0).all():
        raise InputError("solid [-] must be above 0; give k_s / (4 sigma T^3 d).")
    root = np.sqrt(1.0 - void)
    shape = 1.25 * ((1.0 - void) / void) ** (10.0 / 9.0)
    gap = 2.0 / eps - 1.0
    across = root / gap * (shape + 1.0) / shape / (1.0 + 1.0 / (gap * ratio))
    return (1.0 - root) * void + across
