"""Compiled drag laws: F and Re dF/dRe of a code number, a solid fraction and a Reynolds number."""

import math

from greybed.core.jit import njit

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}

STOKES, SCHILLER_NAUMANN, CLIFT_GAUVIN, HAIDER_LEVENSPIEL = 0, 1, 2, 3
WEN_YU, ERGUN, CARMAN_KOZENY, GIDASPOW, GIDASPOW_BLEND = 4, 5, 6, 7, 8
BVK, KOCH_HILL, KOCH_HILL_BENYAHIA, TENNETI, TANG, DI_FELICE, RONG = 9, 10, 11, 12, 13, 14, 15

# Below it, powers of 1 / Re overflow; what they multiply is 0 there.
_LEAST = 1e-12


@njit(**_OPTIONS)
def _sphere(re):
    if re < 1000.0:
        part = 0.15 * re**0.687
        return 1.0 + part, 0.687 * part
    part = 0.44 * re / 24.0
    return part, part


@njit(**_OPTIONS)
def _clift_gauvin(re):
    low = 0.15 * re**0.687
    fade = 42500.0 * max(re, _LEAST) ** -1.16
    high = 0.42 * re / 24.0 / (1.0 + fade)
    return 1.0 + low + high, 0.687 * low + high * (1.0 + 1.16 * fade / (1.0 + fade))


@njit(**_OPTIONS)
def _haider_levenspiel(re):
    low, high = 0.1806 * re**0.6459, 0.4251 / 24.0 * re * re / (re + 6880.95)
    return 1.0 + low + high, 0.6459 * low + high * (2.0 - re / (re + 6880.95))


@njit(**_OPTIONS)
def _wen_yu(phi, re):
    f, slope = _sphere(re)
    swarm = (1.0 - phi) ** -3.65
    return swarm * f, swarm * slope


@njit(**_OPTIONS)
def _ergun(phi, re):
    eps = 1.0 - phi
    return (150.0 * phi + 1.75 * re) / (18.0 * eps * eps), 1.75 * re / (18.0 * eps * eps)


@njit(**_OPTIONS)
def _blend(phi, re):
    # MFIX's switch, which turns from Ergun to Wen & Yu over some 0.01 of the void fraction.
    dilute = math.atan(150.0 * 1.75 * (0.2 - phi)) / math.pi + 0.5
    (f, slope), (dense, dense_slope) = _wen_yu(phi, re), _ergun(phi, re)
    share = 1.0 - dilute
    return share * dense + dilute * f, share * dense_slope + dilute * slope


@njit(**_OPTIONS)
def _creep(phi):
    """BVK's and Tang's F of slow flow."""
    eps = 1.0 - phi
    return 10.0 * phi / (eps * eps) + eps * eps * (1.0 + 1.5 * math.sqrt(phi))


@njit(**_OPTIONS)
def _bvk(phi, re):
    eps, safe = 1.0 - phi, max(re, _LEAST)
    turn, power = 8.4 * safe**-0.343, 0.5 * (1.0 + 4.0 * phi)
    fade = 10.0 ** (3.0 * phi) * safe**-power
    top, bottom = 1.0 / eps + 3.0 * eps * phi + turn, 1.0 + fade
    part = 0.413 * re / (24.0 * eps * eps) * top / bottom
    return _creep(phi) + part, part * (1.0 - 0.343 * turn / top + power * fade / bottom)


@njit(**_OPTIONS)
def _tang(phi, re):
    eps = 1.0 - phi
    fourth = 1.0 / eps**4
    low = (0.169 * eps + 0.0644 * fourth) * re**0.657
    high = (0.11 * phi * (1.0 + phi) - 0.00456 * fourth) * re
    return _creep(phi) + low + high, 0.657 * low + high


@njit(**_OPTIONS)
def _array_drag(phi, linear, square, cube):
    """Fit to slow flow through arrays of spheres, (Hill, Koch & Ladd 2001)."""
    log = phi * math.log(phi) if phi > 0.0 else 0.0
    top = 1.0 + 3.0 * math.sqrt(0.5 * phi) + 135.0 / 64.0 * log + linear * phi
    return top / (1.0 + 0.681 * phi - square * phi**2 + cube * phi**3)


@njit(**_OPTIONS)
def _koch_hill(phi, re):
    eps = 1.0 - phi
    slow = _array_drag(phi, 16.14, 8.48, 8.16) if phi < 0.4 else 10.0 * phi / eps**3
    part = eps * 0.5 * (0.0673 + 0.212 * phi + 0.0232 / eps**5) * re
    return eps * slow + part, part


@njit(**_OPTIONS)
def _koch_hill_benyahia(phi, re):
    eps, r = 1.0 - phi, 0.5 * re
    dense = 10.0 * phi / eps**3
    f0 = f2 = dense
    if phi < 0.4:
        w = math.exp(-10.0 * (0.4 - phi) / phi) if phi > 0.0 else 0.0
        f0 = (1.0 - w) * _array_drag(phi, 17.14, 8.48, 8.16) + w * dense
        f2 = (1.0 - w) * _array_drag(phi, 17.89, 11.03, 15.41) + w * dense
    f3 = 0.9351 * phi + 0.03667
    if phi >= 0.0953:
        f3 = 0.0673 + 0.212 * phi + 0.0232 / eps**5
    if phi <= 0.01:
        if r <= (f2 - 1.0) / (0.375 - f3):
            return eps * (1.0 + 0.375 * r), eps * 0.375 * r
    else:
        f1 = math.sqrt(2.0 / phi) / 40.0 if phi <= 0.1 else 0.11 + 5.1e-4 * math.exp(11.6 * phi)
        inside = f3 * f3 - 4.0 * f1 * (f0 - f2)
        # Where the parabola and the line do not meet MFIX's root is no number, and F is 0.
        if r <= (f3 + math.sqrt(max(inside, 0.0))) / (2.0 * f1):
            return eps * (f0 + f1 * r * r), eps * 2.0 * f1 * r * r
    return eps * (f2 + f3 * r), eps * f3 * r


@njit(**_OPTIONS)
def _tenneti(phi, re):
    f, slope = _sphere(re)
    eps = 1.0 - phi
    part = phi**3 * re * (0.95 + 0.61 * phi**3 / (eps * eps))
    still = 5.81 * phi / eps**3 + 0.48 * phi ** (1.0 / 3.0) / eps**4
    # The published force holds the mean pressure gradient; model A counts it apart.
    return eps * (f / eps**3 + still + part), eps * (slope / eps**3 + part)


@njit(**_OPTIONS)
def _by_exponent(phi, re, rong):
    """Dallavalle's sphere times eps^-chi."""
    eps, safe = 1.0 - phi, max(re, _LEAST)
    root = 0.63 * math.sqrt(safe)
    away = 1.5 - math.log10(safe)
    bell = math.exp(-0.5 * away * away)
    if rong:
        scale = (5.3 - 3.5 * eps) * eps * eps
        chi = 2.65 * (eps + 1.0) - scale * bell
    else:
        scale = 0.65
        chi = 3.7 - scale * bell
    f = (root + 4.8) ** 2 / 24.0 * eps**-chi
    turn = scale * bell * away / math.log(10.0) * math.log(eps)
    return f, f * (root / (root + 4.8) + turn)


@njit(**_OPTIONS)
def drag(code, phi, re):
    """F [-] and Re dF/dRe [-] of a law: what an implicit step needs, finite at Re = 0."""
    if code == SCHILLER_NAUMANN:
        return _sphere(re)
    if code == CLIFT_GAUVIN:
        return _clift_gauvin(re)
    if code == HAIDER_LEVENSPIEL:
        return _haider_levenspiel(re)
    if code == WEN_YU:
        return _wen_yu(phi, re)
    if code == ERGUN:
        return _ergun(phi, re)
    if code == CARMAN_KOZENY:
        return 10.0 * phi / (1.0 - phi) ** 2, 0.0
    if code == GIDASPOW:
        return _wen_yu(phi, re) if phi < 0.2 else _ergun(phi, re)
    if code == GIDASPOW_BLEND:
        return _blend(phi, re)
    if code == BVK:
        return _bvk(phi, re)
    if code == KOCH_HILL:
        return _koch_hill(phi, re)
    if code == KOCH_HILL_BENYAHIA:
        return _koch_hill_benyahia(phi, re)
    if code == TENNETI:
        return _tenneti(phi, re)
    if code == TANG:
        return _tang(phi, re)
    if code == DI_FELICE:
        return _by_exponent(phi, re, False)
    if code == RONG:
        return _by_exponent(phi, re, True)
    return 1.0, 0.0


@njit(**_OPTIONS)
def drag_into(code, phi, re, force, slope):
    """Fill ``force`` and ``slope`` (n,) for ``phi``, ``re`` (n,)."""
    for i in range(phi.size):
        force[i], slope[i] = drag(code, phi[i], re[i])
