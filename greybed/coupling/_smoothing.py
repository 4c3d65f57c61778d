"""Compiled implicit diffusion along one axis of a grid, line by line."""

import numpy as np

from greybed.core.jit import njit

_OPTIONS = {"cache": True, "nogil": True, "error_model": "numpy"}


@njit(**_OPTIONS)
def factors(n, share, periodic):
    """What the lines of an axis have in common: pivots (n,), and the turn of a ring (n,).

    ``share`` is the diffusivity times the time over the square of the spacing.
    """
    pivot, ring = np.empty(n), np.zeros(n)
    for i in range(n):
        diagonal = 1.0 + 2.0 * share
        if periodic:  # of the matrix without its corners (Sherman & Morrison)
            if i == 0:
                diagonal += share
            if i == n - 1:
                diagonal += share
        else:
            if i == 0:
                diagonal -= share
            if i == n - 1:
                diagonal -= share
        pivot[i] = diagonal if i == 0 else diagonal - share * share / pivot[i - 1]
    if periodic:
        ring[0], ring[n - 1] = -share, -share
        for i in range(1, n):
            ring[i] += share / pivot[i - 1] * ring[i - 1]
        ring[n - 1] /= pivot[n - 1]
        for i in range(n - 2, -1, -1):
            ring[i] = (ring[i] + share * ring[i + 1]) / pivot[i]
    return pivot, ring


@njit(**_OPTIONS)
def diffuse(field, share, pivot, ring, periodic):
    """One implicit step of ``field`` (outer, n, inner) along its middle axis, in place."""
    outer, n, inner = field.shape
    for o in range(outer):
        for i in range(1, n):
            back = share / pivot[i - 1]
            for k in range(inner):
                field[o, i, k] += back * field[o, i - 1, k]
        over = 1.0 / pivot[n - 1]
        for k in range(inner):
            field[o, n - 1, k] *= over
        for i in range(n - 2, -1, -1):
            over = 1.0 / pivot[i]
            for k in range(inner):
                field[o, i, k] = (field[o, i, k] + share * field[o, i + 1, k]) * over
        if periodic:
            turn = 1.0 / (1.0 + ring[0] + ring[n - 1])
            for k in range(inner):
                both = (field[o, 0, k] + field[o, n - 1, k]) * turn
                for i in range(n):
                    field[o, i, k] -= both * ring[i]
