"""Published algebraic models of filtered drag as fractions kept, in the interface of closures.

Igci, Milioli and Radl & Sundaresan publish the fraction that is lost; here it is 1 less that, the
same number along gravity and across it. None of them tells its error: ``stderr`` is 0.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.closures.drag.filtered.closure import (
    PARCEL_RATE,
    QUANTITY,
    DragPrediction,
    DragSlopes,
)
from greybed.closures.drag.filtered.markers import (
    ACROSS,
    FILTER,
    FRACTION,
    FROUDE,
    PARCELS,
    UP,
    flat_markers,
)
from greybed.closures.drag.filtered.milioli import milioli_lost
from greybed.closures.markers import Marker
from greybed.core.errors import InputError

Array = NDArray[np.float64]
# Fraction lost (n,) and its slope over the slip [1 / u_t], of markers by name.
Lost = Callable[[dict[str, Array]], tuple[Array, Array]]

# What is kept at least where a model as published would turn drag round.
LEAST_KEPT = 0.01

# Edge below which a row holds, origin, and coefficients of powers of the distance from it.
_H = (
    (0.03, 0.0, 0.0, 7.97, 0.0, 0.0),
    (0.08, 0.03, 0.239, 4.64, -4.41, 253.63),
    (0.12, 0.08, 0.492, 6.1, 33.63, -789.6),
    (0.18, 0.12, 0.739, 5.01, -61.1, 310.8),
    (0.34, 0.18, 0.887, 1.03, -5.17, 5.99),
    (0.48, 0.34, 0.943, -0.17, -2.29, -9.12),
    (0.55, 0.48, 0.85, -1.35, -6.13, -132.6),
    (np.inf, 0.55, 0.68, -2.34, -225.2, 0.0),
)
_A = (
    (0.016, 0.0, 21.51, 0.0, 0.0, 0.0),
    (0.1, 0.0, 1.96, 29.4, 164.91, -1923.0),
    (0.18, 0.1, 4.63, 4.68, -412.04, 2254.0),
    (0.25, 0.18, 3.52, -17.99, 128.8, -603.0),
    (0.4, 0.25, 2.68, -8.2, 2.18, 112.33),
    (np.inf, 0.0, 1.79, 0.0, 0.0, 0.0),
)


def _piecewise(rows: tuple[tuple[float, ...], ...], x: Array) -> Array:
    table = np.array(rows)
    row = table[np.searchsorted(table[:, 0], x, side="right")]
    y = x - row[:, 1]
    return row[:, 2] + y * (row[:, 3] + y * (row[:, 4] + y * row[:, 5]))


def _radl(m: dict[str, Array]) -> tuple[Array, Array]:
    phi, size = m["solid_fraction"], m["filter_size"]
    # h / (1 + a / D) without a division by a filter of size 0.
    lost = _piecewise(_H, phi) * size / (size + _piecewise(_A, phi))
    return lost, np.zeros_like(phi)


def _radl_clamped(m: dict[str, Array]) -> tuple[Array, Array]:
    lost, slope = _radl(m)
    # The last cubic falls through 0 at phi = 0.60 and would raise drag beyond it.
    return np.maximum(lost, 0.0), slope


def _over_slow(m: dict[str, Array]) -> Array:
    """Filter size over u_t^2 / g."""
    return m["filter_size"] * np.cbrt(m["froude"]) ** -2


def _igci(m: dict[str, Array]) -> tuple[Array, Array]:
    phi = m["solid_fraction"]
    x = np.maximum(phi, 1e-300)
    h = np.select(
        [phi < 0.0012, phi < 0.014, phi < 0.25, phi < 0.455, phi <= 0.59],
        [
            2.7 * x**0.234,
            0.963 - 0.019 * x**-0.455,
            0.868 * np.exp(-0.38 * phi) - 0.176 * np.exp(-119.2 * phi),
            0.852 * np.exp(-0.268 * phi) - 4.59e-5 * np.exp(19.75 * np.minimum(phi, 0.6)),
            (phi - 0.59) * (-1501.0 * phi**3 + 2203.0 * phi**2 - 1054.0 * phi + 162.0),
        ],
        0.0,
    )
    dilute = np.where(phi < 0.18, x**0.24 * (1.48 + np.exp(-18.0 * phi)), 1.0)
    power = _over_slow(m) ** 1.6
    return h * dilute * power / (power + 0.4), np.zeros_like(phi)


def _milioli(m: dict[str, Array]) -> tuple[Array, Array]:
    slip = np.hypot(m["slip_up"], m["slip_across"])
    return milioli_lost(m["solid_fraction"], _over_slow(m), slip)


def _none(m: dict[str, Array]) -> tuple[Array, Array]:
    zeros = np.zeros_like(m["solid_fraction"])
    return zeros, zeros


@dataclass(frozen=True)
class PublishedDrag:
    """An algebraic model.

    Attributes
    ----------
    name : str
        As case files write it.
    source : str
        Where it was published, and where the form here was read.
    defects : str
        Where it breaks a limit or jumps.
    markers : tuple of Marker
        What it takes.
    lost : callable
        Fraction lost and its slope.
    least : float
        Least fraction kept [-].
    """

    quantity: ClassVar[str] = QUANTITY
    name: str
    source: str
    defects: str
    markers: tuple[Marker, ...]
    lost: Lost
    least: float = LEAST_KEPT

    @property
    def marker_names(self) -> tuple[str, ...]:
        """Markers that it takes; ``parcels`` may be left out."""
        return tuple(marker.name for marker in self.markers)

    @property
    def needs_gradient(self) -> bool:
        """Whether it needs the pressure gradient: none does."""
        return False

    def predict(self, **markers: ArrayLike) -> DragPrediction:
        """Kept fractions of markers, as :meth:`FilteredDragClosure.predict`."""
        return self.with_slopes(**markers)[0]

    def with_slopes(self, **markers: ArrayLike) -> tuple[DragPrediction, DragSlopes]:
        """Kept fractions and their derivatives."""
        m, shape = flat_markers(self.markers, markers)
        lost, steep = self.lost(m)
        kept = np.maximum(1.0 - lost, self.least)
        slopes = np.zeros((3, len(kept), 4))
        if steep.any():
            free = kept > self.least
            slip = np.maximum(np.hypot(m["slip_up"], m["slip_across"]), 1e-12)
            rate = np.where(free, -steep / kept, 0.0)
            slopes[:2, :, 0] = rate * m["slip_up"] / slip
            slopes[:2, :, 1] = rate * 0.5 / slip
        kept = (kept * np.exp(-PARCEL_RATE * (m["parcels"] - 1.0))).reshape(shape)
        zeros = np.zeros(shape)
        return (
            DragPrediction(kept, kept.copy(), zeros, zeros.copy(), np.zeros(shape, bool)),
            DragSlopes(*slopes),
        )


_OF_SLIP = (FRACTION, FILTER, FROUDE, UP, ACROSS, PARCELS)
BASELINES = {
    model.name: model
    for model in (
        PublishedDrag(
            "none", "no correction: the drag law at the filtered fields", "keeps all drag",
            (FRACTION, FILTER, PARCELS), _none,
        ),
        PublishedDrag(
            "radl-sundaresan",
            "Radl & Sundaresan, Chem. Eng. Sci. 117 (2014) 416, as CFDEMcoupling-PFM has it in "
            "BeetstraDrag.C; its h is held at 0 from a solid fraction of 0.60 on",
            "a jumps from 21.5 to 2.46 at 0.016, so that the lost share of filters of a few L_c "
            "jumps up to sixfold; no effect of the slip",
            (FRACTION, FILTER, PARCELS), _radl_clamped,
        ),
        PublishedDrag(
            "radl-sundaresan-unclamped",
            "the same without that bound, as CFDEMcoupling-PFM computes it",
            "raises drag above a solid fraction of 0.60, to 2.4 times at 0.64; no effect of the "
            "slip",
            (FRACTION, FILTER, PARCELS), _radl, 0.0,
        ),
        PublishedDrag(
            "igci",
            "Igci & Sundaresan, Ind. Eng. Chem. Res. 50 (2011) 13190 and Igci, Pannala, Benyahia & "
            "Sundaresan, 51 (2012) 2094, as MFIX has it in drag_gs.f",
            "fitted to one kind of particles; jumps by less than 0.01; no effect of the slip",
            (FRACTION, FILTER, FROUDE, PARCELS), _igci,
        ),
        PublishedDrag(
            "milioli",
            "Milioli, Milioli, Holloway, Agrawal & Sundaresan, AIChE J. 59 (2013) 3265, as MFIX "
            "has it in drag_gs.f, kept fraction at least 0.01",
            "bins of the filter size with jumps between, filters below u_t^2 / g have no effect at "
            "all; kinks where its branches meet; drag below 0 as published; an exponent of 0.03 in "
            "one bin where its neighbours have 0.3",
            _OF_SLIP, _milioli,
        ),
    )
}  # fmt: skip


def baseline(name: str) -> PublishedDrag:
    """The published model of that name.

    Raises
    ------
    InputError
        If there is none.
    """
    key = name.strip().lower().replace("_", "-").replace(" ", "-")
    if key not in BASELINES:
        raise InputError(
            f"filtered drag: {name!r} is not a known model; known are {', '.join(BASELINES)}, "
            "a .closure file, and shipped:NAME."
        )
    return BASELINES[key]
