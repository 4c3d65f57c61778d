"""Drag on the sizes of a mixture: from the law at the mean size to the force on each size."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.core.errors import InputError

Array = NDArray[np.float64]

MIXTURES = ("none", "bvk", "yin-sundaresan")


def mixture_factor(
    kind: str, force: ArrayLike, solid_fraction: ArrayLike, size_ratio: ArrayLike
) -> Array:
    r"""F of one size of a mixture.

    Parameters
    ----------
    kind : str
        ``none``: F as it is. ``bvk``: :math:`F (y + 0.064 y^3)`, the drag without the mean
        pressure gradient of Beetstra, van der Hoef & Kuipers (AIChE J. 53 (2007) 489), as CFDEM
        has it; 6.4 % too high for spheres of one size. ``yin-sundaresan``:
        :math:`1/\varepsilon + (F - 1/\varepsilon)(a y + (1 - a) y^2)` with
        :math:`a = 1 - 2.66 \phi + 9.096 \phi^2 - 11.338 \phi^3` (Yin & Sundaresan, AIChE J. 55
        (2009) 1352, as MFIX has it, without the drag between sizes).
    force : array_like
        F of the law at the mean size: with Re of the mean diameter [-].
    solid_fraction : array_like
        Of all sizes together [-].
    size_ratio : array_like
        y, diameter over the Sauter mean [-].

    Returns
    -------
    force : ndarray
        F in the convention of :mod:`greybed.closures.drag.laws`: :math:`3 \pi \mu d \varepsilon F`
        per slip for a sphere of its own diameter d [-].

    Raises
    ------
    InputError
        For another name.
    """
    f, phi, y = np.asarray(force), np.asarray(solid_fraction), np.asarray(size_ratio)
    if kind == "none":
        return np.array(np.broadcast_to(f, np.broadcast_shapes(f.shape, phi.shape, y.shape)))
    if kind == "bvk":
        return np.asarray(f * (y + 0.064 * y**3) + 0.0 * phi)
    if kind == "yin-sundaresan":
        dilute = 1.0 / (1.0 - phi)
        a = 1.0 - 2.66 * phi + 9.096 * phi**2 - 11.338 * phi**3
        return np.asarray(dilute + (f - dilute) * (a * y + (1.0 - a) * y**2))
    raise InputError(f"mixture = {kind!r} is not known; known are {', '.join(MIXTURES)}.")


def sauter_mean(diameters: ArrayLike) -> float:
    """Sauter mean of spheres, the sum of cubes over the sum of squares [m]."""
    d = np.asarray(diameters, dtype=np.float64)
    return float((d**3).sum() / (d**2).sum())
