"""Published drag laws in one convention: F(solid fraction, Re), 1 for slow flow round one sphere.

The force on the particles in a unit volume is ``beta (u - v)`` (model A: besides the pressure
gradient) with ``beta = 18 mu eps phi F / d^2`` and ``Re = eps rho d |u - v| / mu``. In a fixed bed
this is a pressure gradient of ``18 mu phi F U / (eps d^2)`` with U the superficial velocity, and on
one sphere in still fluid a force of ``3 pi mu d v F``.
"""

from __future__ import annotations

import difflib

from greybed.closures.drag import _kernels as code
from greybed.closures.drag.law import DragLaw
from greybed.core.errors import InputError

LAWS = {
    law.name: law
    for law in (
        DragLaw(
            "stokes", code.STOKES,
            "Stokes (1851)",
            "2 % low at Re = 0.1",
            (0.0, 0.0), 0.1, inertia=False, bed=False,
        ),
        DragLaw(
            "schiller-naumann", code.SCHILLER_NAUMANN,
            "Schiller & Naumann (1935); Cd = 0.44 beyond Re = 1000",
            "jumps by 0.4 % at Re = 1000",
            (0.0, 0.0), 2e5, bed=False,
        ),
        DragLaw(
            "clift-gauvin", code.CLIFT_GAUVIN,
            "Clift & Gauvin (1970) with the constants of Clift, Grace & Weber (1978); others print "
            "0.152, 0.677, 0.417, 5070 and 0.94",
            "smooth",
            (0.0, 0.0), 3e5, bed=False,
        ),
        DragLaw(
            "haider-levenspiel", code.HAIDER_LEVENSPIEL,
            "Haider & Levenspiel, Powder Technol. 58 (1989) 63, spheres",
            "smooth",
            (0.0, 0.0), 2.6e5, bed=False,
        ),
        DragLaw(
            "wen-yu", code.WEN_YU,
            "Wen & Yu (1966)",
            "no packed-bed limit; jumps by 0.4 % at Re = 1000",
            (0.0, 0.2), 2e5,
        ),
        DragLaw(
            "ergun", code.ERGUN,
            "Ergun, Chem. Eng. Prog. 48 (1952) 89",
            "no dilute limit",
            (0.5, 0.65), 1500.0, sphere=False,
        ),
        DragLaw(
            "carman-kozeny", code.CARMAN_KOZENY,
            "Carman (1937), constant 180",
            "no dilute limit",
            (0.4, 0.65), 0.5, inertia=False, sphere=False,
        ),
        DragLaw(
            "gidaspow", code.GIDASPOW,
            "Gidaspow (1994): Ergun from a solid fraction of 0.2, Wen & Yu below",
            "jumps at the seam, by 6 % at Re = 1 and 73 % at Re = 100",
            (0.0, 0.65), 1500.0,
        ),
        DragLaw(
            "gidaspow-blend", code.GIDASPOW_BLEND,
            "The same with MFIX's switch, an arc tangent (source given there: Lathouwers & Bellan, "
            "2000)",
            "0.6 % of Ergun in dilute flow, so that F = 0.994 for one slow sphere",
            (0.0, 0.65), 1500.0,
        ),
        DragLaw(
            "bvk", code.BVK,
            "Beetstra, van der Hoef & Kuipers, AIChE J. 53 (2007) 489, as MFIX and CFDEM have it",
            "smooth",
            (0.0, 0.6), 1000.0,
        ),
        DragLaw(
            "koch-hill", code.KOCH_HILL,
            "Koch & Hill, Annu. Rev. Fluid Mech. 33 (2001) 619, the short form with 16.14 (CFDEM, "
            "Lethe)",
            "jumps by 1 % at phi = 0.4; dilute inertia 0.045 Re",
            (0.0, 0.64), 100.0,
        ),
        DragLaw(
            "koch-hill-benyahia", code.KOCH_HILL_BENYAHIA,
            "Hill, Koch & Ladd, J. Fluid Mech. 448 (2001) 213 and 243, extended by Benyahia, "
            "Syamlal & O'Brien, Powder Technol. 162 (2006) 166, with 17.14, as MFIX has it",
            "jumps by 22 % at phi = 0.01 in slow flow, where its branches part",
            (0.0, 0.64), 1000.0,
        ),
        DragLaw(
            "tenneti", code.TENNETI,
            "Tenneti, Garg & Subramaniam, Int. J. Multiphase Flow 37 (2011) 1072, less the mean "
            "pressure gradient: all of it times the void fraction",
            "jumps by 0.4 % at most at Re = 1000",
            (0.1, 0.5), 300.0,
        ),
        DragLaw(
            "tang", code.TANG,
            "Tang, Peters, Kuipers, Kriebitzsch & van der Hoef, AIChE J. 61 (2015) 688",
            "smooth; for one sphere at Re = 10 19 % above Schiller & Naumann",
            (0.0, 0.6), 1000.0,
        ),
        DragLaw(
            "di-felice", code.DI_FELICE,
            "Di Felice, Int. J. Multiphase Flow 20 (1994) 153",
            "Stokes limit 0.96, not 1",
            (0.0, 0.6), 1e4,
        ),
        DragLaw(
            "rong", code.RONG,
            "Rong, Dong & Yu, Chem. Eng. Sci. 99 (2013) 44; CFDEM counts it for model A too",
            "Stokes limit 0.96, not 1",
            (0.2, 0.63), 3000.0,
        ),
    )
}  # fmt: skip
SYNONYMS = {
    "beetstra": "bvk",
    "wenyu": "wen-yu",
    "hkl": "koch-hill-benyahia",
    "hill-koch-ladd": "koch-hill-benyahia",
}


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
