"""Filtered drag for solvers: the diagonal of its derivative, compiled where the form allows it."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.closures.drag.filtered import _kernels
from greybed.closures.drag.filtered import features as shape
from greybed.closures.drag.filtered.closure import (
    LOG_BOUND,
    PARCEL_RATE,
    SHARE_BOUND,
    FilteredDragClosure,
)
from greybed.closures.drag.filtered.force import (
    FADE,
    KeptDrag,
    Law,
    filtered_force,
    law_with_slope,
)
from greybed.closures.drag.filtered.markers import FRACTION, frame_of
from greybed.closures.drag.filtered.materials import Material
from greybed.closures.predictors import Network

Array = NDArray[np.float64]

_SMALL = (
    shape.DILUTE, shape.SMALL_FILTER, shape.SMALL_ACROSS, shape.SMALL_SLIP2, shape.SMALL_FRACTION,
    shape.SMALL_RATIO, shape.SLIP_BEND, shape.GRADIENT_BEND,
)  # fmt: skip
_BOUNDS = (LOG_BOUND, SHARE_BOUND, PARCEL_RATE, FADE)


class AxisDrag(NamedTuple):
    """Filtered drag of n places along x, y and z; gravity lies along one of them.

    Attributes
    ----------
    force : (n, 3) float
        [N m-3].
    secant : (n, 3) float
        Drag over slip, without what the pressure gradient gives [N s m-4].
    diagonal : (n, 3) float
        Of the derivative of the force for the slip [N s m-4].
    beta : (n,) float
        The drag law without correction [N s m-4].
    extrapolates : (n,) bool
    """

    force: Array
    secant: Array
    diagonal: Array
    beta: Array
    extrapolates: NDArray[np.bool_]


def axis_drag(
    closure: KeptDrag, material: Material, law: Law, gravity: ArrayLike, phi: Array, slip: Array,
    filter_size: float, pressure_gradient: Array | None, parcels: float = 1.0,
) -> AxisDrag:  # fmt: skip
    """What :func:`filtered_force` gives, for a gravity along an axis.

    Networks of one layer are compiled, which takes less than a tenth of the time.
    """
    if (
        isinstance(closure, FilteredDragClosure)
        and isinstance(closure.predictor, Network)
        and len(closure.predictor.weights) == 2
        and closure.predictor.bent
        and (pressure_gradient is not None or not closure.needs_gradient)
        and len(phi)
        and float(phi.min()) >= 0.0
        and float(phi.max()) <= FRACTION.high
        and math.isfinite(float(slip.sum()))
    ):
        return _compiled(
            closure, closure.predictor, material, law, gravity, phi, slip, filter_size,
            pressure_gradient, parcels,
        )  # fmt: skip
    f = filtered_force(
        closure, material, law, gravity, phi, slip, filter_size, pressure_gradient, parcels
    )
    axis = int(np.abs(np.asarray(gravity, dtype=np.float64)).argmax())
    kept = np.repeat(f.prediction.kept_across[:, None], 3, axis=1)
    kept[:, axis] = f.prediction.kept_along
    secant = (f.beta * (1.0 - f.share))[:, None] * kept
    diagonal = np.stack([f.derivative[:, a, a] for a in range(3)], axis=1)
    return AxisDrag(f.force, secant, diagonal, f.beta, f.prediction.extrapolates)


def _compiled(
    closure: FilteredDragClosure, network: Network, material: Material, law: Law,
    gravity: ArrayLike, phi: Array, slip: Array, filter_size: float,
    pressure_gradient: Array | None, parcels: float,
) -> AxisDrag:  # fmt: skip
    frame = frame_of(material, gravity, slip, pressure_gradient)
    scale = material.gas_density * material.diameter / material.gas_viscosity
    s = np.ascontiguousarray(frame.slip)
    speed = np.sqrt(s[:, 0] ** 2 + s[:, 1] ** 2 + s[:, 2] ** 2)
    phi = np.ascontiguousarray(phi, dtype=np.float64)
    f, steep = law_with_slope(law, phi, (1.0 - phi) * scale * speed)
    stokes = 18.0 * material.gas_viscosity / material.diameter**2
    numbers = (
        material.terminal_velocity, material.weight, material.terminal_drag,
        math.log(material.terminal_reynolds), stokes,
    )  # fmt: skip
    fall = np.zeros((1, 3)) if frame.fall is None else np.ascontiguousarray(frame.fall)
    gate, domain = closure.gate, closure.domain
    force, secant, diagonal = (np.empty_like(s) for _ in range(3))
    outside = np.zeros(len(phi), np.bool_)
    _kernels.network_drag(
        phi, s, fall, f, steep, filter_size / material.length, parcels, frame.up, numbers,
        (gate.filter_scale, gate.dilute_scale, gate.packing, float(gate.power)), _SMALL, _BOUNDS,
        closure.markers.marked, closure.markers.linear, network.mean, network.scale,
        *(np.ascontiguousarray(x) for pair in zip(network.weights, network.biases, strict=True)
          for x in pair),
        domain.low, domain.high, domain.centre, np.ascontiguousarray(domain.precision),
        float(domain.limit) ** 2, force, secant, diagonal, outside,
    )  # fmt: skip
    return AxisDrag(force, secant, diagonal, stokes * (1.0 - phi) * phi * f, outside)
