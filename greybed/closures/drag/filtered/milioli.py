"""The fraction of drag that Milioli's model loses: bins of the filter size, as in MFIX.

MFIX has eight bins, but lets filters below 1.028 u_t^2 / g lose nothing, so that the first one
never counts; it is left out.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Edges of the bins: filter size over u_t^2 / g. Below the first nothing is lost.
EDGES = (1.028, 2.056, 4.112, 8.224, 12.336, 16.448, 20.56)

# Line in the solid fraction, its coefficients functions of the slip over u_t: (slope, offset).
# They are rational, so a complex slip gives their derivative to the last digit.
_LINES: tuple[Callable[[NDArray[np.complex128]], tuple[NDArray, NDArray]], ...] = (
    lambda v: (1.268 - 0.2 * v + 0.14 / (v + 0.01), 0.385 + 0.09 * v - 0.05 / (0.2 * v + 0.01)),
    lambda v: ((0.018 * v + 0.1) / (0.14 * v + 0.01), 0.9454 - 0.09 / (0.2 * v + 0.01)),
    lambda v: ((0.05 * v + 0.3) / (0.4 * v + 0.06), 0.9466 - 0.05 / (0.11 * v + 0.01)),
    lambda v: ((1.3 * v + 2.2) / (5.2 * v + 0.07), 0.9363 - 0.11 / (0.3 * v + 0.01)),
    lambda v: ((2.6 * v + 4.0) / (10.0 * v + 0.08), 0.926 - 0.17 / (0.5 * v + 0.01)),
    lambda v: ((2.5 * v + 4.0) / (10.0 * v + 0.08), 0.9261 - 0.17 / (0.5 * v + 0.01)),
    lambda v: ((1.6 * v + 4.0) / (7.9 * v + 0.08), 0.9394 - 0.22 / (0.6 * v + 0.01)),
)
# Envelope: (edge, end), below the edge (a, b, c, d, e) for a (1 + x) x^b / (c x^d + e), from there
# to the end (a, b, p) for a (end - x)^b / (1 - x^p).
_ENVELOPES = (
    (0.53, 0.65, (8.6, 0.2, 10.0, 1.0, 6.3), (0.423, 0.3, 0.4)),
    (0.5, 0.63, (7.9, 0.2, 10.0, 0.9, 5.0), (0.705, 0.3, 0.7)),
    (0.45, 0.57, (7.9, 0.2, 10.0, 0.6, 3.6), (0.78, 0.2, 0.9)),
    (0.35, 0.55, (7.6, 0.2, 10.0, 0.6, 3.3), (0.81, 0.3, 0.7)),
    (0.25, 0.52, (8.4, 0.2, 10.0, 0.5, 3.3), (1.01, 0.03, 0.9)),
    (0.25, 0.52, (8.4, 0.2, 10.0, 0.5, 3.3), (1.065, 0.3, 1.0)),
    (0.25, 0.52, (9.0, 0.15, 10.0, 0.45, 4.2), (0.91, 0.4, 0.6)),
)


def _envelope(k: int, phi: Array) -> Array:
    edge, end, (a, b, c, d, e), (high, power, p) = _ENVELOPES[k]
    low = a * (1.0 + phi) * phi**b / (c * phi**d + e)
    inside = np.clip(phi, edge, end)
    dense = high * (end - inside) ** power / (1.0 - inside**p)
    return np.where(phi <= edge, low, np.where(phi <= end, dense, 0.0))


def milioli_lost(phi: Array, size: Array, slip: Array) -> tuple[Array, Array]:
    """Fraction lost [-] and its derivative with respect to the slip over u_t.

    Parameters
    ----------
    phi : (n,) array
        Solid fraction [-].
    size : (n,) array
        Filter size over u_t^2 / g [-]; below 1.028 nothing is lost, as in MFIX.
    slip : (n,) array
        Magnitude over u_t [-].
    """
    step = 1e-30
    moved = slip + 1j * step
    bins = np.searchsorted(np.array(EDGES), size, side="left")
    lost, slope = np.zeros_like(phi), np.zeros_like(phi)
    for k in range(len(_LINES)):
        some = bins == k + 1
        if not some.any():
            continue
        steep, offset = _LINES[k](moved[some])
        line = steep * phi[some] + offset
        most = _envelope(k, phi[some])
        chosen = (line.real > 0.0) & (line.real < most)
        lost[some] = np.where(chosen, line.real, np.where(line.real > 0.0, most, 0.0))
        slope[some] = np.where(chosen, line.imag / step, 0.0)
    return lost, slope
