"""Conduction through spheres and stagnant gas: Zehner and Schluender's unit cell."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

STEFAN_BOLTZMANN = 5.670374419e-8  # W/m2/K4, CODATA 2018
NEAR = 1e-3  # distance of B/kappa from 1 at which the formula loses its digits


def _core(kappa: Array, shape: Array) -> Array:
    """Conductivity of the core of the cell over that of the gas."""
    n = 1.0 - shape / kappa
    return (2.0 / n) * (
        shape * (1.0 - 1.0 / kappa) / n**2 * np.log(kappa / shape)
        - 0.5 * (shape + 1.0)
        - (shape - 1.0) / n
    )


def zehner_schluender(
    solid_conductivity: ArrayLike, gas_conductivity: ArrayLike, void_fraction: ArrayLike
) -> Array:
    """Effective conductivity of a bed of spheres without radiation and without contact areas.

    Parameters
    ----------
    solid_conductivity, gas_conductivity : array_like, broadcast together
        Of the spheres and of the gas between them [W/m/K], above 0.
    void_fraction : array_like
        Of the bed, 0 to 1 exclusive [-].

    Returns
    -------
    conductivity : ndarray
        [W/m/K]; equals the gas where the solid is the same, and the gas alone at void fraction 1.

    Notes
    -----
    Zehner & Schluender, Chem.-Ing.-Tech. 42 (1970) 933; in the form of VDI Heat Atlas, D6.3, with
    the shape factor ``B = 1.25 ((1 - eps) / eps)^(10/9)`` of spheres.
    """
    ks, kg, eps = np.broadcast_arrays(
        *(
            np.asarray(v, dtype=np.float64)
            for v in (solid_conductivity, gas_conductivity, void_fraction)
        )
    )
    kappa = ks / kg
    shape = 1.25 * ((1.0 - eps) / eps) ** (10.0 / 9.0)
    root = np.sqrt(1.0 - eps)
    close = np.abs(1.0 - shape / kappa) < NEAR
    # the singularity is removable: between points on both sides the course is straight enough
    low = _core(np.where(close, shape / (1.0 + 2.0 * NEAR), kappa), shape)
    high = _core(np.where(close, shape / (1.0 - 2.0 * NEAR), kappa), shape)
    share = np.where(close, (1.0 - shape / kappa + 2.0 * NEAR) / (4.0 * NEAR), 0.5)
    core = low + share * (high - low)
    return kg * (1.0 - root + root * core)
