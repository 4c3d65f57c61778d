"""Heat transfer between gas and spheres: Nusselt numbers of a void fraction, Re and Pr."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from greybed.core.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class NusseltLaw:
    """One published law, with Re = eps rho d |u - v| / mu as in the drag laws.

    Attributes
    ----------
    name : str
    number : callable (void fraction, re, pr) -> Nu
    source, limits : str
    void : (float, float)
        Void fractions of its data [-].
    reynolds : float
        Largest Re of its data [-].
    """

    name: str
    number: Callable[[Array, Array, float], Array]
    source: str
    limits: str
    void: tuple[float, float]
    reynolds: float

    def __call__(self, void: Array, re: Array, pr: float) -> Array:
        """Nu [-]."""
        return self.number(np.asarray(void), np.asarray(re), pr)


def _gunn(e: Array, re: Array, pr: float) -> Array:
    third = pr ** (1.0 / 3.0)
    slow = (7.0 - 10.0 * e + 5.0 * e**2) * (1.0 + 0.7 * re**0.2 * third)
    return slow + (1.33 - 2.4 * e + 1.2 * e**2) * re**0.7 * third


def _ranz_marshall(e: Array, re: Array, pr: float) -> Array:
    # On the interstitial slip: the law knows no neighbours.
    return 2.0 + 0.6 * np.sqrt(re / e) * pr ** (1.0 / 3.0)


def _whitaker(e: Array, re: Array, pr: float) -> Array:
    own = re / e
    return 2.0 + (0.4 * np.sqrt(own) + 0.06 * own ** (2.0 / 3.0)) * pr**0.4


def _wakao(e: Array, re: Array, pr: float) -> Array:
    return 2.0 + 1.1 * re**0.6 * pr ** (1.0 / 3.0) + 0.0 * e


def _sun(e: Array, re: Array, pr: float) -> Array:
    still = (-0.46 + 1.77 * e + 0.69 * e**2) / e**3
    return still + (1.37 - 2.4 * e + 1.2 * e**2) * re**0.7 * pr ** (1.0 / 3.0)


NUSSELT = {
    law.name: law
    for law in (
        NusseltLaw(
            "gunn", _gunn,
            "Gunn, Int. J. Heat Mass Transfer 21 (1978) 467",
            "2 for one sphere in slow flow",
            (0.35, 1.0), 1e5,
        ),
        NusseltLaw(
            "ranz-marshall", _ranz_marshall,
            "Ranz & Marshall, Chem. Eng. Prog. 48 (1952) 141",
            "one sphere; neighbours by the interstitial velocity only",
            (0.9, 1.0), 200.0,
        ),
        NusseltLaw(
            "whitaker", _whitaker,
            "Whitaker, AIChE J. 18 (1972) 361, one sphere, without the viscosity ratio",
            "one sphere; neighbours by the interstitial velocity only",
            (0.9, 1.0), 7.6e4,
        ),
        NusseltLaw(
            "wakao", _wakao,
            "Wakao, Kaguei & Funazkri, Chem. Eng. Sci. 34 (1979) 325",
            "packed beds",
            (0.35, 0.5), 8500.0,
        ),
        NusseltLaw(
            "sun", _sun,
            "Sun, Tenneti & Subramaniam, Int. J. Heat Mass Transfer 86 (2015) 898",
            "fit to direct simulations at Pr = 0.7",
            (0.5, 0.9), 100.0,
        ),
    )
}  # fmt: skip


def nusselt_law(name: str) -> NusseltLaw:
    """The law of that name.

    Raises
    ------
    InputError
        If there is none.
    """
    key = str(name).strip().lower().replace("_", "-").replace(" ", "-")
    if key not in NUSSELT:
        raise InputError(f"nusselt = {name!r} is not known; known are {', '.join(NUSSELT)}.")
    return NUSSELT[key]
