"""Conduction through spheres and stagnant gas: Zehner and Schluender's unit cell."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

STEFAN_BOLTZMANN = 5.670374419e-8  # W/m2/K4, CODATA 2018
NEAR = 0.1  # below this 1 - B / kappa the closed form loses digits and the series has them
NOTHING = 1e-200
TERMS = 16  # of the series; the first one left out is below 1e-16


def _core(kappa: Array, shape: Array) -> Array:
    """Conductivity of the core of the cell over that of the gas."""
    n = 1.0 - shape / kappa
    close = np.abs(n) < NEAR
    far = np.where(close, 1.0, n)
    # no spheres, shape = 0: the logarithm's factor is 0 there
    ratio = kappa / np.maximum(shape, NOTHING)
    closed = (2.0 / far) * (
        shape * (1.0 - 1.0 / kappa) / far**2 * np.log(ratio)
        - 0.5 * (shape + 1.0)
        - (shape - 1.0) / far
    )
    if not close.any():
        return closed
    near = np.where(close, n, 0.0)
    series = np.zeros_like(n)
    for k in reversed(range(TERMS)):
        series = series * near + 2.0 * ((shape - 1.0) / (k + 3.0) + 1.0 / (k + 2.0))
    return np.where(close, series, closed)


def zehner_schluender(
    solid_conductivity: ArrayLike, gas_conductivity: ArrayLike, void_fraction: ArrayLike
) -> Array:
    """Effective conductivity of a bed of spheres without radiation and without contact areas.

    Parameters
    ----------
    solid_conductivity, gas_conductivity : array_like, broadcast together
        Of the spheres and of the gas between them [W/m/K], above 0.
    void_fraction : array_like
        Of the bed, above 0 and up to 1 [-]; tested by its authors between 0.2 and 0.6.

    Returns
    -------
    conductivity : ndarray
        [W/m/K]; equals the gas where the solid is the same, and the gas alone at void fraction 1.

    Notes
    -----
    Zehner & Schluender, Chem.-Ing.-Tech. 42 (1970) 933; in the form of VDI Heat Atlas, D6.3, with
    the shape factor ``B = 1.25 ((1 - eps) / eps)^(10/9)`` of spheres. Contact areas begin to matter
    where the solid conducts 2000 times better than the gas. Where B equals the ratio of the
    conductivities the closed form is 0 / 0; there its own power series is summed.
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
    return kg * (1.0 - root + root * _core(kappa, shape))
