"""Conjugate gradients for many right-hand sides at once, with sums in a fixed order."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_TOLERANCE = 1e-15


def conjugate_gradients(apply: Callable[[Array], Array], right: Array, pivot: Array) -> Array:
    """Solve a symmetric positive definite system for all columns of ``right`` (n, k).

    ``apply`` multiplies (n, k) with the matrix; ``pivot`` (n, 1) is about its inverse diagonal.
    """
    x = np.zeros_like(right)
    rest = right.copy()
    step = pivot * rest
    old = (rest * step).sum(axis=0)
    goal = _TOLERANCE**2 * old
    for _ in range(10_000):
        if (old <= goal).all():
            break
        moved = apply(step)
        curvature = (step * moved).sum(axis=0)
        # A column that has arrived stays where it is.
        length = np.divide(old, curvature, out=np.zeros_like(old), where=curvature > 0.0)
        x += length * step
        rest -= length * moved
        scaled = pivot * rest
        new = (rest * scaled).sum(axis=0)
        step = scaled + np.divide(new, old, out=np.zeros_like(new), where=old > 0.0) * step
        old = new
    return x
