"""Compiled cohesion: what a batch of contacts, or a gap, adds to the normal force."""

import math

from numba import njit

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
