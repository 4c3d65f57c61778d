"""Dimensionless markers of filtered drag, all unchanged by turns and mirrors of the whole flow.

Slips and gradients come in as vectors, gravity as a direction; what goes on are numbers along
gravity, magnitudes across it and products of two vectors. The slip is gas less solids.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from greybed.closures.drag.filtered.materials import Material
from greybed.closures.markers import Marker, checked_markers
from greybed.core.errors import InputError

Array = NDArray[np.float64]

_WIDE = 1e9  # no marker of a flow is larger
FRACTION = Marker("solid_fraction", "solid fraction", 0.0, 0.999, typical=(0.0, 0.62))
FILTER = Marker(
    "filter_size", "edge of the filter over L_c = d Fr^(1/3)", 0.0, _WIDE, typical=(0.0, 30.0)
)
REYNOLDS = Marker(
    "terminal_reynolds", "Re of one settling particle", 0.0, _WIDE, low_open=True,
    typical=(0.3, 60.0),
)  # fmt: skip
FROUDE = Marker("froude", "u_t^2 / (g d)", 0.0, _WIDE * _WIDE, low_open=True, typical=(5.0, 500.0))
UP = Marker("slip_up", "slip against gravity over u_t", -_WIDE, _WIDE, typical=(-2.0, 6.0))
ACROSS = Marker(
    "slip_across", "magnitude of the slip across gravity over u_t", 0.0, _WIDE, typical=(0.0, 3.0)
)
GRADIENT = Marker(
    "gradient_up", "fall of pressure along up, less the gas's weight, over (rho_p - rho_g) g",
    -_WIDE, _WIDE, typical=(-0.5, 1.5),
)  # fmt: skip
WORK = Marker(
    "gradient_work", "fall of pressure across times slip across, over (rho_p - rho_g) g u_t",
    -_WIDE, _WIDE, typical=(-0.5, 0.5),
)  # fmt: skip
DRAG = Marker(
    "drag_ratio", "F of the drag law over F of one settling particle", 0.0, _WIDE, low_open=True,
    typical=(0.5, 20.0),
)  # fmt: skip
PARCELS = Marker(
    "parcels", "diameter of a parcel over that of its particles", 1.0, 1e4, typical=(1.0, 1.0)
)


@dataclass(frozen=True, eq=False)
class Frame:
    """The vectors of n places, split along gravity and across it.

    Attributes
    ----------
    up : (3,) float
        Against gravity.
    slip : (n, 3) float
        Gas less solids [m s-1].
    fall : (n, 3) float or None
        -(grad p - rho_g g), what drives gas and particles alike [N m-3].
    """

    up: Array
    slip: Array
    fall: Array | None

    @property
    def slip_up(self) -> Array:
        """[m s-1]."""
        return along(self.slip, self.up)

    @property
    def slip_across(self) -> Array:
        """(n, 3) [m s-1]."""
        return across(self.slip, self.up)


def along(vectors: Array, up: Array) -> Array:
    """Component (n,) of vectors (n, 3)."""
    return vectors[:, 0] * up[0] + vectors[:, 1] * up[1] + vectors[:, 2] * up[2]


def across(vectors: Array, up: Array) -> Array:
    """What is left of vectors (n, 3) across ``up``."""
    return vectors - along(vectors, up)[:, None] * up


def frame_of(
    material: Material,
    gravity: Sequence[float] | ArrayLike,
    slip: ArrayLike,
    pressure_gradient: ArrayLike | None = None,
) -> Frame:
    """Check vectors and split them.

    Parameters
    ----------
    material : Material
        For the weight of the gas.
    gravity : (3,) array_like
        Direction of gravity; its magnitude is the material's.
    slip : (n, 3) array_like
        Gas less solids [m s-1].
    pressure_gradient : (n, 3) array_like, optional
        With its mean in a periodic box [Pa m-1].

    Raises
    ------
    InputError
        For shapes that do not fit, or a gravity without direction.
    """
    down = np.asarray(gravity, dtype=np.float64)
    length = float(np.sqrt((down**2).sum())) if down.shape == (3,) else 0.0
    if not (np.isfinite(length) and length > 0.0):
        raise InputError(
            f"filtered drag: gravity = {down.tolist()} must be three numbers that are not all 0, "
            "for drag differs along and across it; give its direction."
        )
    up = -down / length + 0.0  # no minus zeros
    s = np.asarray(slip, dtype=np.float64)
    if s.ndim != 2 or s.shape[1] != 3:
        raise InputError(f"filtered drag: slip has the shape {s.shape} and must be (n, 3).")
    fall = None
    if pressure_gradient is not None:
        p = np.asarray(pressure_gradient, dtype=np.float64)
        if p.shape != s.shape:
            raise InputError(
                f"filtered drag: pressure_gradient has the shape {p.shape} and must be {s.shape}."
            )
        fall = -p - material.gas_density * material.gravity * up
    return Frame(up, s, fall)


def drag_markers(
    material: Material,
    frame: Frame,
    solid_fraction: ArrayLike,
    filter_size: ArrayLike,
    drag: ArrayLike | None = None,
    parcels: ArrayLike = 1.0,
) -> dict[str, Array]:
    """All markers that can be made of these numbers, by name.

    Parameters
    ----------
    material : Material
        Gas and particles.
    frame : Frame
        Slip and, for the markers of the gradient, fall of pressure: see :func:`frame_of`.
    solid_fraction : array_like, shape (n,)
        Filtered [-].
    filter_size : array_like, shape () or (n,)
        Edge of the filter [m].
    drag : array_like, shape (n,), optional
        F of the drag law at the filtered fields [-], for the markers of the gradient.
    parcels : array_like, shape () or (n,)
        Diameter of a parcel over that of its particles [-].

    Returns
    -------
    markers : dict of (n,) arrays
    """
    n = len(frame.slip)
    u_t, up = material.terminal_velocity, frame.up
    lateral = frame.slip_across
    found = {
        "solid_fraction": np.asarray(solid_fraction, dtype=np.float64),
        "filter_size": np.asarray(filter_size, dtype=np.float64) / material.length,
        "terminal_reynolds": np.asarray(material.terminal_reynolds),
        "froude": np.asarray(material.froude),
        "slip_up": frame.slip_up / u_t,
        "slip_across": np.sqrt((lateral**2).sum(axis=1)) / u_t,
        "parcels": np.asarray(parcels, dtype=np.float64),
    }
    if frame.fall is not None and drag is not None:
        found["gradient_up"] = along(frame.fall, up) / material.weight
        found["gradient_work"] = (frame.fall * lateral).sum(axis=1) / (material.weight * u_t)
        found["drag_ratio"] = np.asarray(drag, dtype=np.float64) / material.terminal_drag
    return {name: np.broadcast_to(value, (n,)) for name, value in found.items()}


def flat_markers(
    known: Sequence[Marker], markers: dict[str, ArrayLike]
) -> tuple[dict[str, Array], tuple[int, ...]]:
    """Flat arrays of the markers by name, and the shape they had; ``parcels`` may be left out.

    Raises
    ------
    RangeError
        As :func:`greybed.closures.markers.checked_markers`.
    """
    parcels = any(marker.name == "parcels" for marker in known)
    found = checked_markers(known, {"parcels": 1.0, **markers} if parcels else markers)
    shape = next(iter(found.values())).shape
    return {name: np.ravel(value) for name, value in found.items()}, shape
