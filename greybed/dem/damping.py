"""Damping that returns the restitution asked for, law by law."""

from __future__ import annotations

import math
from functools import lru_cache

from scipy.optimize import brentq

from greybed.dem._impact import returned_speed

# Time step over that of the contact: the result is right to 1e-7.
_STEP = 1e-3
# Damping beyond which less than 1 % of the speed is left.
_MOST = 60.0


@lru_cache(maxsize=1024)
def damping(restitution: float, normal: str, *, limit_force: bool) -> float:
    r"""Damping number of a law.

    Parameters
    ----------
    restitution : float
        Above 0, at most 1 [-].
    normal : {"hertz", "linear"}
        The law.
    limit_force : bool
        Whether attraction is cut off.

    Returns
    -------
    float
        :math:`\zeta` of the damping force :math:`2\zeta\sqrt{m^* k}\,v`, where k is the stiffness
        of the linear law and :math:`S = 2E^*\sqrt{R^*\delta}` for Hertz [-].

    Notes
    -----
    Without the cut the linear contact is an oscillator and
    :math:`\zeta = -\ln e / \sqrt{\pi^2 + \ln^2 e}`; Hertz's has the same number times
    :math:`\sqrt{5/6}` (Tsuji et al. 1992, doi 10.1016/0032-5910(92)88030-L; closed form by
    Antypov & Elliott 2011, doi 10.1209/0295-5075/94/50004). With the cut the contact ends where the
    force vanishes, and the equation of motion is integrated until the number is found (Schwager &
    Poeschel 2007, doi 10.1007/s10035-007-0065-z, have the linear case in closed form).
    """
    if restitution == 1.0:
        return 0.0
    log = math.log(restitution)
    free = -log / math.hypot(math.pi, log)
    hertz = normal == "hertz"
    if not limit_force:
        return free * math.sqrt(5.0 / 6.0) if hertz else free
    exponent = 1.5 if hertz else 1.0
    # Of the force x^(3/2) the stiffness S is 3/2 x^(1/2).
    share = math.sqrt(1.5) if hertz else 1.0

    def excess(zeta: float) -> float:
        return float(returned_speed(exponent, zeta * share, _STEP)) - restitution

    return float(brentq(excess, 0.0, _MOST, xtol=1e-10))
