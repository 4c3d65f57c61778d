"""Box filters of a resolved flow: what a coarse cell would see of it, and what it would miss."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

Array = NDArray[np.float64]

# Without particles there is no velocity of the solids.
LEAST_FRACTION = 1e-6


@dataclass(frozen=True, eq=False, kw_only=True)
class Resolved:
    """Fields in the cells [z, y, x] of a box that repeats; vectors (3, z, y, x).

    Attributes
    ----------
    solid_fraction : (z, y, x) float
        [-].
    gas, solids : (3, z, y, x) float
        Velocities along x, y, z [m s-1].
    gradient : (3, z, y, x) float
        Of the pressure, with its mean [Pa m-1].
    drag : (3, z, y, x) float
        On the particles in a unit of volume [N m-3].
    edge : float
        Of a cell [m].
    dimension : int
        2 (one cell along z) or 3.
    """

    solid_fraction: Array
    gas: Array
    solids: Array
    gradient: Array
    drag: Array
    edge: float
    dimension: int


def box_mean(field: Array, cells: int, dimension: int) -> Array:
    """Mean over boxes of so many cells across, of a field whose last axes repeat.

    Parameters
    ----------
    field : (..., z, y, x) float
    cells : int
        Across, at least 1; with an even number boxes are centred on corners of cells.
    dimension : int
        2 or 3.
    """
    if cells == 1:
        return field
    size = [1] * (field.ndim - dimension) + [cells] * dimension
    return np.asarray(uniform_filter(field, size=size, mode="wrap"), dtype=np.float64)


def filtered(flow: Resolved, cells: int) -> dict[str, Array]:
    """Filtered fields of one width.

    Velocities are weighted with their phase (Favre). The drift velocity is the gas velocity that
    the particles see less that of the gas, ``cov(phi, u) / (phi (1 - phi))``.

    Parameters
    ----------
    flow : Resolved
    cells : int
        Cells across the filter.

    Returns
    -------
    dict
        Columns of :class:`greybed.datasets.filtered_drag.FilteredDrag` as fields: (z, y, x), or
        (3, z, y, x).
    """

    def mean(field: Array) -> Array:
        return box_mean(field, cells, flow.dimension)

    phi, u, v = flow.solid_fraction, flow.gas, flow.solids
    eps = 1.0 - phi
    solid = mean(phi)
    share = np.maximum(solid, LEAST_FRACTION)
    void = 1.0 - solid
    gas, solids = mean(eps * u) / void, mean(phi * v) / share
    return {
        "solid_fraction": solid,
        "slip": gas - solids,
        "pressure_gradient": mean(flow.gradient),
        "drag_force": mean(flow.drag),
        "drift_velocity": mean(phi * u) / share - gas,
        "scalar_variance": np.maximum(mean(phi * phi) - solid * solid, 0.0),
        "solids_stress": mean(phi * v * v) / share - solids * solids,
        "gas_stress": mean(eps * u * u) / void - gas * gas,
    }


def sampled(
    flow: Resolved, cells: int, most: int, random: np.random.Generator
) -> dict[str, NDArray[np.float64]]:
    """Rows of one filter from a flow, at most so many.

    Boxes stand half their width apart. Of those, as many of each tenth of the solid fractions are
    taken, so that what is rare is there too.

    Returns
    -------
    dict
        Columns (n,) or (n, 3), with ``filter_size`` and ``filter_cells``.
    """
    fields = filtered(flow, cells)
    apart = max(1, cells // 2)
    along_z = apart if flow.dimension == 3 else 1
    rows = {
        name: np.moveaxis(
            field[..., ::along_z, ::apart, ::apart].reshape(*field.shape[:-3], -1), -1, 0
        )
        for name, field in fields.items()
    }
    phi = rows["solid_fraction"]
    there = np.flatnonzero(phi > LEAST_FRACTION)
    if len(there) > most:
        low, high = float(phi[there].min()), float(phi[there].max())
        tenth = np.minimum(((phi[there] - low) / max(high - low, 1e-300) * 10).astype(int), 9)
        held = np.bincount(tenth, minlength=10)
        # Weights of one over what a tenth holds, without replacement (Efraimidis and Spirakis,
        # Inf. Process. Lett. 97, 2006, 181).
        keys = np.log(random.random(len(there))) * held[tenth]
        there = np.sort(there[np.argsort(-keys, kind="stable")[:most]])
    rows = {name: np.ascontiguousarray(column[there]) for name, column in rows.items()}
    rows["filter_size"] = np.full(len(there), cells * flow.edge)
    rows["filter_cells"] = np.full(len(there), float(cells))
    return rows
