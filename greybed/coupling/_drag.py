"""Compiled drag of each particle: slips, void fractions, coefficients."""

import math

import numpy as np

from greybed.closures.drag._kernels import drag
from greybed.core.jit import njit

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}


@njit(**_OPTIONS)
def surroundings(seen, motion, first, cell, volume, field, slip, void):
    """Fill ``slip`` (n, 3), of the gas against the particle, and ``void`` (n,), its mean there."""
    for p in range(void.size):
        total, whole = 0.0, 0.0
        for m in range(first[p], first[p + 1]):
            total += volume[m] * field[cell[m]]
            whole += volume[m]
        void[p] = total / whole
        for c in range(3):
            slip[p, c] = seen[p, c] - motion[p, c]


@njit(**_OPTIONS)
def of_law(code, least_solids, most_solids, most_reynolds, slip, void, d, density, viscosity,
           reynolds, coefficient, steepness):  # fmt: skip
    """Fill Re, the drag over the slip [N s/m] and the slope of the drag over that, (n,) each.

    Returns how many lie outside the range of the law, and the first particle whose F is no number
    from 0 on, or -1.
    """
    outside, bad = 0, -1
    for p in range(void.size):
        phi = 1.0 - void[p]
        speed = math.sqrt(slip[p, 0] ** 2 + slip[p, 1] ** 2 + slip[p, 2] ** 2)
        re = void[p] * density * d[p] * speed / viscosity
        force, slope = drag(code, phi, re)
        if not (phi >= least_solids and phi <= most_solids and re <= most_reynolds):
            outside += 1
        if bad < 0 and not (force >= 0.0 and force < np.inf):
            bad = p
        reynolds[p] = re
        coefficient[p] = 3.0 * math.pi * viscosity * d[p] * void[p] * force
        steepness[p] = max(1.0 + (slope / force if force > 0.0 else 0.0), 0.5)
    return outside, bad
