"""Sets of markers that drag closures may use, and the smooth features that are made of them.

``plain`` needs the flow only. ``gradient`` adds what the pressure gradient says: of gas that is
hardly accelerated the drag on the particles in a volume is about -eps (grad p - rho_g g), so the
kept fraction is about q, that force over the drag without a correction. ``linear`` has the plain
markers, and a share of the force of the gradient itself beside the corrected drag. ``full`` has
both.

Features are smooth in the slip, also where it is 0, and bounded in it or logarithmic.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from greybed.closures.drag.filtered.markers import (
    ACROSS,
    DRAG,
    FILTER,
    FRACTION,
    GRADIENT,
    PARCELS,
    REYNOLDS,
    UP,
    WORK,
)
from greybed.closures.markers import Marker

Array = NDArray[np.float64]

# Small numbers that keep logarithms and quotients smooth where their argument is 0.
DILUTE = 0.01
SMALL_FILTER = 0.1
SMALL_ACROSS = 0.01
SMALL_SLIP2 = 0.0025
SMALL_FRACTION = 5e-3
SMALL_RATIO = 0.1
# Where slip and gradient along gravity are bent.
SLIP_BEND, GRADIENT_BEND = 4.0, 2.0

# What the derivative is taken for: slip up, the square of slip across, work, drag ratio.
SLIP_UP, SLIP_ACROSS2, WORKING, RATIO = 0, 1, 2, 3


class Slope(NamedTuple):
    """Derivative (m,) of one feature with respect to one number of the slip."""

    feature: int
    number: int
    value: Array


@dataclass(frozen=True)
class DragMarkerSet:
    """Markers of a drag closure.

    Attributes
    ----------
    name : str
        ``plain``, ``gradient``, ``linear`` or ``full``.
    markers : tuple of Marker
        The last one, ``parcels``, may be left out.
    feature_names : tuple of str
        Of what the predictor sees.
    marked : bool
        Whether the predictor sees the pressure gradient.
    linear : bool
        Whether a share of the gradient's force stands beside the drag.
    """

    name: str
    markers: tuple[Marker, ...]
    feature_names: tuple[str, ...]
    marked: bool
    linear: bool

    @property
    def pressure(self) -> bool:
        """Whether the force needs the pressure gradient."""
        return self.marked or self.linear

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the markers, as keywords of ``predict``."""
        return tuple(marker.name for marker in self.markers)

    @property
    def outputs(self) -> int:
        """Numbers of the predictor: one for each direction, the share, the spread."""
        return 4 if self.linear else 3

    def features(self, m: dict[str, Array]) -> Array:
        """Features (n, n_features) of flat markers."""
        return self.with_slopes(m)[0]

    def with_slopes(self, m: dict[str, Array]) -> tuple[Array, list[Slope]]:
        """Features, and their derivatives that are not 0."""
        phi, up = m["solid_fraction"], m["slip_up"]
        across2 = m["slip_across"] * m["slip_across"]
        bent, bent_slope = bend(up, SLIP_BEND)
        columns = [
            phi,
            np.log(phi + DILUTE),
            np.log(m["filter_size"] + SMALL_FILTER),
            np.log(m["terminal_reynolds"]),
            bent,
            np.log(across2 + SMALL_ACROSS),
        ]
        slopes = [
            Slope(4, SLIP_UP, bent_slope),
            Slope(5, SLIP_ACROSS2, 1.0 / (across2 + SMALL_ACROSS)),
        ]
        if self.marked:
            pull, work = m["gradient_up"], m["gradient_work"]
            scale = (phi + SMALL_FRACTION) * m["drag_ratio"]
            up2 = up * up + SMALL_SLIP2
            q_up = pull * up / (scale * up2)
            q_across = work / (scale * (across2 + SMALL_SLIP2))
            log_up, log_up_slope = log_positive(q_up)
            log_across, log_across_slope = log_positive(q_across)
            columns += [log_up, log_across, bend(pull, GRADIENT_BEND)[0]]
            ratio = m["drag_ratio"]
            slopes += [
                Slope(
                    6, SLIP_UP,
                    log_up_slope * pull * (SMALL_SLIP2 - up * up) / (scale * up2 * up2),
                ),
                Slope(6, RATIO, -log_up_slope * q_up / ratio),
                Slope(
                    7, SLIP_ACROSS2, -log_across_slope * q_across / (across2 + SMALL_SLIP2)
                ),
                Slope(7, WORKING, log_across_slope / (scale * (across2 + SMALL_SLIP2))),
                Slope(7, RATIO, -log_across_slope * q_across / ratio),
            ]  # fmt: skip
        return np.stack(columns, axis=-1), slopes


def bend(x: Array, bound: float) -> tuple[Array, Array]:
    """x / sqrt(1 + (x / bound)^2), which stays inside +- bound, and its slope."""
    y = x / bound
    root = np.sqrt(1.0 + y * y)
    return x / root, 1.0 / (root * root * root)


def log_positive(q: Array) -> tuple[Array, Array]:
    """Logarithm of a smooth positive part of q, (q + sqrt(q^2 + s^2)) / 2, and its slope."""
    root = np.sqrt(q * q + SMALL_RATIO * SMALL_RATIO)
    # Where q < 0 the sum would cancel; the product of both roots is s^2.
    size = root + np.abs(q)
    part = np.where(q >= 0.0, 0.5 * size, 0.5 * SMALL_RATIO * SMALL_RATIO / size)
    return np.log(part), 1.0 / root


_PLAIN = (FRACTION, FILTER, REYNOLDS, UP, ACROSS)
_PLAIN_FEATURES = (
    "solid_fraction",
    f"log(solid_fraction + {DILUTE:g})",
    f"log(filter_size + {SMALL_FILTER:g})",
    "log(terminal_reynolds)",
    "bent slip_up",
    f"log(slip_across^2 + {SMALL_ACROSS:g})",
)
_SEEN = (*_PLAIN, GRADIENT, WORK, DRAG, PARCELS)
_SEEN_FEATURES = (*_PLAIN_FEATURES, "log of q up", "log of q across", "bent gradient_up")
MARKER_SETS = {
    "plain": DragMarkerSet("plain", (*_PLAIN, PARCELS), _PLAIN_FEATURES, False, False),
    "gradient": DragMarkerSet("gradient", _SEEN, _SEEN_FEATURES, True, False),
    "linear": DragMarkerSet("linear", (*_PLAIN, PARCELS), _PLAIN_FEATURES, False, True),
    "full": DragMarkerSet("full", _SEEN, _SEEN_FEATURES, True, True),
}
