"""Rows of a data set of filtered drag as fits and scores need them, without units.

Forces are over (rho_p - rho_g) g, so that those of suspended particles are about their solid
fraction; velocities are over u_t. Vectors are (up, across, across).
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from greybed.closures.drag import drag_law
from greybed.closures.drag.filtered import Gate, Material, drag_markers, frame_of
from greybed.closures.drag.filtered.features import DragMarkerSet
from greybed.closures.drag.filtered.markers import along
from greybed.core.errors import InputError

Array = NDArray[np.float64]

# Slip along gravity below which a quotient of forces says nothing, over u_t.
LEAST_SLIP = 0.1
# Kept fractions that rows of a clean quotient show; beyond them is a slip that nearly vanishes.
MOST_KEPT = 3.0
# Values of a feature from which on it is used.
LEAST_VALUES = 20
# Rows of a fit, drawn evenly over the cases: more of them say little that is new.
MOST_ROWS = 24_000


@dataclass(frozen=True, eq=False)
class DragRows:
    """Arrays of equal length.

    Attributes
    ----------
    markers : dict of (n,) arrays
        All that can be made of a row [-].
    case : (n,) int
        Which run.
    force, unfiltered, pull : (n, 3) float
        Filtered drag, the drag law at the filtered fields, and -eps (grad p - rho_g g), over
        (rho_p - rho_g) g [-].
    slip : (n, 3) float
        Over u_t [-].
    lead : (n,) float
        beta u_t over (rho_p - rho_g) g [-].
    cells : (n,) int
        Cells of the fine grid across a filter.
    """

    markers: dict[str, Array]
    case: NDArray[np.int64]
    force: Array
    unfiltered: Array
    pull: Array
    slip: Array
    lead: Array
    cells: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.case)

    @property
    def kept(self) -> Array:
        """H along gravity [-]; any number where the slip nearly vanishes."""
        return self.force[:, 0] / self.unfiltered[:, 0]

    @property
    def clean(self) -> NDArray[np.bool_]:
        """Rows whose slip along gravity is large enough for H to say something."""
        kept = self.kept
        fast = np.abs(self.slip[:, 0]) >= LEAST_SLIP
        return fast & (self.lead > 0.0) & (kept > 0.0) & (kept < MOST_KEPT)

    def drift(self, force: Array) -> Array:
        """Drift flux phi (F / beta - slip) / u_t (n, 3) that a force stands for [-]."""
        return self.markers["solid_fraction"][:, None] * (force / self.lead[:, None] - self.slip)

    def take(self, index: NDArray[Any]) -> DragRows:
        """Some of the rows."""
        found = {f.name: getattr(self, f.name) for f in fields(self) if f.name != "markers"}
        some = {name: value[index] for name, value in self.markers.items()}
        return DragRows(markers=some, **{name: value[index] for name, value in found.items()})

    def thinned(self, most: int, seed: int) -> DragRows:
        """At most so many rows, drawn evenly over the cases."""
        if len(self) <= most:
            return self
        rng = np.random.default_rng(seed)
        names = np.unique(self.case)
        share, left = -(-most // len(names)), []
        for name in names:
            own = np.flatnonzero(self.case == name)
            left.append(own if len(own) <= share else rng.choice(own, share, replace=False))
        return self.take(np.sort(np.concatenate(left)))

    def of(self, chosen: DragMarkerSet) -> dict[str, Array]:
        """The markers of a set, as keywords for ``predict``."""
        return {name: self.markers[name] for name in chosen.names}


def heard(features: Array) -> NDArray[np.bool_]:
    """Which features (n_features,) a fit may use: those with many values.

    Re of a handful of materials says which case a row is from, and a fit that uses it fails on the
    next material: on 12 cases of 7 materials R2 of H fell from 0.85 to 0.82. Such a feature still
    bounds the domain.
    """
    return np.array([len(np.unique(column)) >= LEAST_VALUES for column in features.T])


def drag_rows(data: Any) -> DragRows:
    """Rows of a data set.

    Parameters
    ----------
    data : FilteredDrag
        What :func:`greybed.datasets.filtered_drag.read_filtered_drag` gives.

    Raises
    ------
    InputError
        If a filter is smaller than a cell, or numbers are not finite.
    """
    small = np.flatnonzero(data.filter_cells < 1)
    if len(small):
        k = int(small[0])
        raise InputError(
            f"row {k}: a filter of {data.filter_size[k]:g} [m] is smaller than a cell of its grid; "
            "filter over one cell at least, 2 or more to see anything."
        )
    parts = [_case_rows(data, k) for k in range(len(data.cases)) if (data.case == k).any()]
    if not parts:
        raise InputError("the data set has no rows; run its cases longer.")
    joined = {
        f.name: np.concatenate([getattr(p, f.name) for p in parts])
        for f in fields(DragRows)
        if f.name != "markers"
    }
    names = parts[0].markers
    markers = {name: np.concatenate([p.markers[name] for p in parts]) for name in names}
    rows = DragRows(markers=markers, **joined)
    # A filter without particles says nothing, and a number that is none must not pass.
    some = rows.lead > 1e-9
    rows = rows.take(np.flatnonzero(some))
    if not np.isfinite(rows.force).all():
        raise InputError("the data set has forces that are not finite; make it again.")
    return rows


def material_of(case: Any) -> Material:
    """Gas and particles of a case."""
    return Material(
        case.diameter, case.particle_density, case.gas_density, case.gas_viscosity, case.gravity
    )


def _case_rows(data: Any, k: int) -> DragRows:
    case, own = data.cases[k], data.case == k
    material, law = material_of(case), drag_law(case.law, f"case {case.name}: law")
    phi = data.solid_fraction[own].astype(np.float64)
    frame = frame_of(
        material, np.asarray(case.gravity_axis, dtype=np.float64),
        data.slip[own].astype(np.float64), data.pressure_gradient[own].astype(np.float64),
    )  # fmt: skip
    assert frame.fall is not None  # the gradient was given
    speed = np.sqrt((frame.slip**2).sum(axis=1))
    scale = material.gas_density * material.diameter / material.gas_viscosity
    f = law(phi, (1.0 - phi) * scale * speed)
    beta = 18.0 * material.gas_viscosity * (1.0 - phi) * phi * f / material.diameter**2
    cg = float(getattr(case, "parcels", 1)) ** (1.0 / 3.0)
    markers = drag_markers(material, frame, phi, data.filter_size[own], f, cg)
    u_t, weight = material.terminal_velocity, material.weight
    axes = _axes(frame.up)

    def turned(vectors: Array) -> Array:
        return np.stack([along(vectors, axis) for axis in axes], axis=1)

    slip = turned(frame.slip) / u_t
    lead = beta * u_t / weight
    return DragRows(
        {name: np.array(value) for name, value in markers.items()},
        np.full(len(phi), k, np.int64),
        turned(data.drag_force[own].astype(np.float64)) / weight,
        lead[:, None] * slip,
        turned((1.0 - phi)[:, None] * frame.fall) / weight,
        slip,
        lead,
        data.filter_cells[own].astype(np.int64),
    )


def _axes(up: Array) -> tuple[Array, Array, Array]:
    """Up, and two directions across it."""
    least = np.eye(3)[int(np.abs(up).argmin())]
    first = np.cross(up, least)
    first /= np.sqrt((first**2).sum())
    return up, first, np.cross(up, first)


def gate_of(data: Any) -> Gate:
    """The gate for the packing of a data set: the densest of its cases."""
    return Gate(packing=float(max(case.packing for case in data.cases)))
