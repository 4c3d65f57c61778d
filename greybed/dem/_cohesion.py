"""Compiled cohesion: what a batch of contacts, or a gap, adds to the normal force."""

import math

from greybed.core.jit import njit
from greybed.dem import _columns as col

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}


@njit(**_OPTIONS)
def energy_density(work, n):
    """SJKR: attraction in proportion to the disc of contact."""
    force, cohesion, area = work[col.FORCE], work[col.LAW_COHESION], work[col.AREA]
    for c in range(n):
        force[c] -= cohesion[c] * area[c]


@njit(**_OPTIONS)
def pull_off(work, n):
    """DMT: a constant attraction of 4 pi gamma R* in contact."""
    force, cohesion, r_eff = work[col.FORCE], work[col.LAW_COHESION], work[col.R_EFF]
    for c in range(n):
        force[c] -= 4.0 * math.pi * cohesion[c] * r_eff[c]


@njit(**_OPTIONS)
def van_der_waals(work, n):
    """Hamaker's attraction at the nearest gap; across gaps see :func:`attraction`."""
    force, cohesion, r_eff, nearest = (
        work[col.FORCE],
        work[col.LAW_COHESION],
        work[col.R_EFF],
        work[col.LAW_NEAREST],
    )
    for c in range(n):
        force[c] -= cohesion[c] * r_eff[c] / (6.0 * nearest[c] * nearest[c])


@njit(**_OPTIONS)
def attraction(gap, r_eff, table, p):
    """Hamaker's attraction across a gap [N], at least 0."""
    if gap >= table[p, col.REACH]:
        return 0.0
    h = max(gap, table[p, col.NEAREST])
    return table[p, col.COHESION] * r_eff / (6.0 * h * h)


@njit(**_OPTIONS)
def jkr(work, n, limit):
    """Johnson, Kendall & Roberts: elastic force of a neck of radius a, with Hertz's damping.

    Overlap a^2 / R - 2 sqrt(pi gamma a / E) (on the stable branch, a above its minimum) and force
    4 E a^3 / (3 R) - 4 sqrt(pi gamma E a^3); largest attraction 3 pi gamma R.
    """
    r_eff, overlap, modulus, gamma, held = (
        work[col.R_EFF],
        work[col.OVERLAP],
        work[col.LAW_MODULUS],
        work[col.LAW_COHESION],
        work[col.HELD],
    )
    k_n, k_t, shear, force, viscous = (
        work[col.K_N],
        work[col.K_T],
        work[col.LAW_SHEAR],
        work[col.FORCE],
        work[col.DASHPOT],
    )
    damping, m_eff, un, sideways = (
        work[col.LAW_DAMPING],
        work[col.M_EFF],
        work[col.UN],
        work[col.LAW_TANGENTIAL],
    )
    for c in range(n):
        pull = math.sqrt(math.pi * gamma[c] / modulus[c])
        # Newton from beyond the root: the function is convex there, so each step stays beyond.
        least = (0.5 * r_eff[c] * pull) ** (1.0 / 3.0)
        s = math.sqrt(math.sqrt(r_eff[c] * abs(overlap[c]))) + (2.0 * pull * r_eff[c]) ** (
            1.0 / 3.0
        )
        s += least
        for _ in range(12):
            cube = s * s * s
            value = cube * s / r_eff[c] - 2.0 * pull * s - overlap[c]
            slope = 4.0 * cube / r_eff[c] - 2.0 * pull
            s = max(s - value / max(slope, 1e-300), least)
        a = s * s
        elastic = 4.0 * modulus[c] * a * (a * a / (3.0 * r_eff[c]) - pull * s)
        stiff = 2.0 * modulus[c] * a
        k_n[c] = stiff * (2.0 / 3.0)
        k_t[c] = 8.0 * shear[c] * a
        root = 2.0 * math.sqrt(stiff * m_eff[c])
        force[c] = elastic - damping[c] * root * un[c]
        if limit:
            force[c] = max(force[c], min(elastic, 0.0))
        viscous[c] = sideways[c] * root
        # Thornton: friction is that of the force plus twice the pull-off force.
        held[c] = 6.0 * math.pi * gamma[c] * r_eff[c]


@njit(**_OPTIONS)
def neck(r_eff, table, p):
    """Gap across which a neck of JKR still holds [m]."""
    if table[p, col.COHESION] == 0.0:
        return 0.0
    pull = math.sqrt(math.pi * table[p, col.COHESION] / table[p, col.MODULUS])
    least = (0.5 * r_eff * pull) ** (1.0 / 3.0)
    return 3.0 * least**4 / r_eff


@njit(**_OPTIONS)
def bridges(work, n):
    """A liquid bridge between surfaces that touch; across gaps see :func:`bridge`."""
    force, tension, r_eff = work[col.FORCE], work[col.LAW_COHESION], work[col.R_EFF]
    for c in range(n):
        force[c] -= 4.0 * math.pi * tension[c] * r_eff[c]


@njit(**_OPTIONS)
def bridge(gap, r_eff, table, p):
    """Attraction of a liquid bridge across a gap [N] (Willett et al. 2000)."""
    radius = 2.0 * r_eff
    s = gap * math.sqrt(radius / table[p, col.NEAREST])
    return 2.0 * math.pi * radius * table[p, col.COHESION] / (1.0 + 1.05 * s + 2.5 * s * s)
