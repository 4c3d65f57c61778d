"""Published drag laws in one convention: F(solid fraction, Re), 1 for slow flow round one sphere.

The force on the particles in a unit volume is ``beta (u - v)`` (model A: besides the pressure
gradient) with ``beta = 18 mu eps phi F / d^2`` and ``Re = eps rho d |u - v| / mu``. In a fixed bed
this is a pressure gradient of ``18 mu phi F U / (eps d^2)`` with U the superficial velocity, and on
one sphere in still fluid a force of ``3 pi mu d v F``.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.core.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class DragLaw:
    """One published drag law.

    Attributes
    ----------
    name : str
        As case files write it.
    force : callable (phi, re) -> F
        Arrays of one shape, both [-]; F [-].
    source : str
        Where it was published, and where the form here was read.
    limits : str
        Range of its data, and limits that it misses.
    inertia : bool
        Whether F depends on Re.
    bed : bool
        Whether F depends on phi: a law for beds; the others are for one sphere.
    sphere : bool
        Whether it holds for one sphere too, phi = 0.
    """

    name: str
    force: Callable[[Array, Array], Array]
    source: str
    limits: str
    inertia: bool = True
    bed: bool = True
    sphere: bool = True

    def __call__(self, solid_fraction: ArrayLike, reynolds: ArrayLike) -> Array:
        """F [-] for solid fractions 0 to below 1 and Re from 0, broadcast together."""
        phi, re = np.broadcast_arrays(
            np.asarray(solid_fraction, dtype=np.float64), np.asarray(reynolds, dtype=np.float64)
        )
        return self.force(phi, re)


def _sphere(re: Array) -> Array:
    """Schiller and Naumann's F of one sphere."""
    return np.where(re < 1000.0, 1.0 + 0.15 * re**0.687, 0.44 * re / 24.0)


def _stokes(phi: Array, re: Array) -> Array:
    return np.ones_like(re)


def _schiller_naumann(phi: Array, re: Array) -> Array:
    return _sphere(re)


def _clift_gauvin(phi: Array, re: Array) -> Array:
    safe = np.maximum(re, 1e-12)
    return 1.0 + 0.15 * re**0.687 + 0.42 * re / 24.0 / (1.0 + 42500.0 * safe**-1.16)


def _haider_levenspiel(phi: Array, re: Array) -> Array:
    return 1.0 + 0.1806 * re**0.6459 + 0.4251 / 24.0 * re**2 / (re + 6880.95)


def _wen_yu(phi: Array, re: Array) -> Array:
    return (1.0 - phi) ** -3.65 * _sphere(re)


def _ergun(phi: Array, re: Array) -> Array:
    return (150.0 * phi + 1.75 * re) / (18.0 * (1.0 - phi) ** 2)


def _carman_kozeny(phi: Array, re: Array) -> Array:
    return 10.0 * phi / (1.0 - phi) ** 2


def _gidaspow(phi: Array, re: Array) -> Array:
    return np.where(phi < 0.2, _wen_yu(phi, re), _ergun(phi, re))


def _bvk(phi: Array, re: Array) -> Array:
    eps = 1.0 - phi
    safe = np.maximum(re, 1e-12)
    viscous = 10.0 * phi / eps**2 + eps**2 * (1.0 + 1.5 * np.sqrt(phi))
    inertial = (0.413 * re / (24.0 * eps**2)) * (
        (1.0 / eps + 3.0 * eps * phi + 8.4 * safe**-0.343)
        / (1.0 + 10.0 ** (3.0 * phi) * safe ** (-0.5 * (1.0 + 4.0 * phi)))
    )
    return viscous + inertial


def _koch_hill(phi: Array, re: Array) -> Array:
    eps = 1.0 - phi
    safe = np.maximum(phi, 1e-300)
    dilute = (1.0 + 3.0 * np.sqrt(0.5 * phi) + 135.0 / 64.0 * phi * np.log(safe) + 16.14 * phi) / (
        1.0 + 0.681 * phi - 8.48 * phi**2 + 8.16 * phi**3
    )
    f0 = np.where(phi < 0.4, dilute, 10.0 * phi / eps**3)
    f3 = 0.0673 + 0.212 * phi + 0.0232 / eps**5
    return eps * (f0 + 0.5 * f3 * re)


def _tenneti(phi: Array, re: Array) -> Array:
    eps = 1.0 - phi
    total = (
        _sphere(re) / eps**3
        + 5.81 * phi / eps**3
        + 0.48 * np.cbrt(phi) / eps**4
        + phi**3 * re * (0.95 + 0.61 * phi**3 / eps**2)
    )
    # the published force holds the mean pressure gradient; model A counts it apart
    return eps * total


def _di_felice(phi: Array, re: Array) -> Array:
    safe = np.maximum(re, 1e-12)
    chi = 3.7 - 0.65 * np.exp(-0.5 * (1.5 - np.log10(safe)) ** 2)
    return (0.63 * np.sqrt(safe) + 4.8) ** 2 / 24.0 * (1.0 - phi) ** -chi


def _rong(phi: Array, re: Array) -> Array:
    eps = 1.0 - phi
    safe = np.maximum(re, 1e-12)
    bell = np.exp(-0.5 * (1.5 - np.log10(safe)) ** 2)
    chi = 2.65 * (eps + 1.0) - (5.3 - 3.5 * eps) * eps**2 * bell
    return (0.63 * np.sqrt(safe) + 4.8) ** 2 / 24.0 * eps**-chi


LAWS = {
    law.name: law
    for law in (
        DragLaw(
            "stokes",
            _stokes,
            "Stokes (1851)",
            "Re well below 0.1; 2 % low at Re = 0.1",
            inertia=False,
            bed=False,
        ),
        DragLaw(
            "schiller-naumann",
            _schiller_naumann,
            "Schiller & Naumann (1935); Cd = 0.44 beyond Re = 1000",
            "Re up to 2e5; jumps by 0.4 % at Re = 1000",
            bed=False,
        ),
        DragLaw(
            "clift-gauvin",
            _clift_gauvin,
            "Clift & Gauvin (1970) with the constants of Clift, Grace & Weber (1978); others print "
            "0.152, 0.677, 0.417, 5070 and 0.94",
            "Re up to 3e5",
            bed=False,
        ),
        DragLaw(
            "haider-levenspiel",
            _haider_levenspiel,
            "Haider & Levenspiel, Powder Technol. 58 (1989) 63, spheres",
            "Re up to 2e5",
            bed=False,
        ),
        DragLaw(
            "wen-yu",
            _wen_yu,
            "Wen & Yu (1966)",
            "void fraction above 0.8; no packed-bed limit; jumps by 0.4 % at Re = 1000",
        ),
        DragLaw(
            "ergun",
            _ergun,
            "Ergun (1952)",
            "packed beds, void fraction below 0.5, Re / phi 1 to 2500; no dilute limit",
            sphere=False,
        ),
        DragLaw(
            "carman-kozeny",
            _carman_kozeny,
            "Carman (1937), constant 180",
            "packed beds, Re / phi below 1; no dilute limit",
            inertia=False,
            sphere=False,
        ),
        DragLaw(
            "gidaspow",
            _gidaspow,
            "Gidaspow (1994): Ergun up to a solid fraction of 0.2, Wen & Yu below",
            "jumps at the seam, by 6 % at Re = 1 and 73 % at Re = 100",
        ),
        DragLaw(
            "bvk",
            _bvk,
            "Beetstra, van der Hoef & Kuipers, AIChE J. 53 (2007) 489, as MFIX and CFDEM have it",
            "phi 0.1 to 0.6, Re up to 1000",
        ),
        DragLaw(
            "koch-hill",
            _koch_hill,
            "Koch & Hill (2001) in the short form with 16.14 (CFDEM, Lethe); MFIX has 17.14",
            "phi up to 0.6, Re up to 100; jumps by 1 % at phi = 0.4; dilute inertia 0.045 Re",
        ),
        DragLaw(
            "tenneti",
            _tenneti,
            "Tenneti, Garg & Subramaniam, Int. J. Multiphase Flow 37 (2011) 1072, less the mean "
            "pressure gradient: all of it times the void fraction",
            "phi 0.1 to 0.5, Re up to 300; jumps by 0.4 % at most at Re = 1000",
        ),
        DragLaw(
            "di-felice",
            _di_felice,
            "Di Felice, Int. J. Multiphase Flow 20 (1994) 153",
            "Stokes limit 0.96, not 1",
        ),
        DragLaw(
            "rong",
            _rong,
            "Rong, Dong & Yu, Chem. Eng. Sci. 99 (2013) 44",
            "void fraction 0.37 to 0.8, Re up to 3000; Stokes limit 0.96, not 1",
        ),
    )
}
SYNONYMS = {"beetstra": "bvk", "schiller_naumann": "schiller-naumann", "wenyu": "wen-yu"}


def drag_law(name: str, where: str = "drag") -> DragLaw:
    """The law of that name.

    Parameters
    ----------
    name : str
        A key of ``LAWS``; ``beetstra`` is ``bvk``. Capitals, blanks and underscores do not matter.
    where : str
        Place named in an error.

    Raises
    ------
    InputError
        If there is none.
    """
    key = str(name).strip().lower().replace("_", "-").replace(" ", "-")
    key = SYNONYMS.get(key, key)
    if key not in LAWS:
        near = difflib.get_close_matches(key, LAWS, n=1, cutoff=0.5)
        hint = f"did you mean {near[0]!r}?" if near else f"known are {', '.join(LAWS)}."
        raise InputError(f"{where} = {name!r} is not a known law; {hint}")
    return LAWS[key]
