"""Damping that returns the restitution asked for, law by law."""

from __future__ import annotations

import math
from functools import lru_cache

from scipy.optimize import brentq

from greybed.core.errors import InputError
from greybed.dem._impact import returned_speed

# Time step over that of the contact: the result is right to 1e-7.
_STEP = 1e-3
# Damping beyond which less than 1 % of the speed is left; viscous material is tried up to 0.1 %.
_MOST = 60.0
_MOST_VISCOUS = 160.0


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

    Raises
    ------
    InputError
        If no damping takes so much.

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
        return float(returned_speed(exponent, zeta * share, 0.0, True, _STEP)) - restitution

    if excess(_MOST) > 0.0:
        raise _too_little(restitution)
    return float(brentq(excess, 0.0, _MOST, xtol=1e-10))


@lru_cache(maxsize=1024)
def relaxation(restitution: float, slow: float, *, limit_force: bool) -> float:
    r"""Relaxation time of a viscous material, in units of the impact.

    Parameters
    ----------
    restitution : float
        Of the impact, above 0, at most ``slow`` [-].
    slow : float
        What impacts of vanishing speed return, at most 1 [-].
    limit_force : bool
        Whether attraction is cut off.

    Returns
    -------
    float
        :math:`A v / L` of the force :math:`k (\delta^{3/2} + \tfrac32 A \sqrt\delta\,\dot\delta)`
        that comes to the damping of ``slow``, :math:`L = (m^* v^2 / k)^{2/5}`, v the speed [-].

    Raises
    ------
    InputError
        If no viscosity takes so much.

    Notes
    -----
    Brilliantov, Spahn, Hertzsch & Poeschel, Phys. Rev. E 53 (1996) 5382; Kuwabara & Kono, Jpn. J.
    Appl. Phys. 26 (1987) 1230. With ``slow`` = 1 the restitution is
    :math:`1 - 1.15344\,\beta v^{1/5} + \dots`, :math:`\beta = \tfrac32 A (k/m^*)^{2/5}` (Ramirez et
    al., Phys. Rev. E 60 (1999) 4465). The equation of motion is integrated until the number is
    found.
    """
    if restitution == slow:
        return 0.0
    constant = damping(slow, "hertz", limit_force=limit_force) * math.sqrt(1.5)

    def excess(number: float) -> float:
        return float(returned_speed(1.5, constant, number, limit_force, _STEP)) - restitution

    most = 2.5
    while excess(most) > 0.0:
        most *= 2.0
        if most > _MOST_VISCOUS:
            raise _too_little(restitution)
    return float(brentq(excess, 0.0, most, xtol=1e-10)) / 1.5


def _too_little(restitution: float) -> InputError:
    return InputError(
        f"restitution = {restitution:g} [-] is less than damping without attraction can leave; "
        "take 0.01, or limit_force = false."
    )
