"""What the coupling needs of a gas, and slopes of its pressure."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from greybed.cfd.grid import Grid
from greybed.coupling import _exchange

Array = NDArray[np.float64]
Faces = tuple[Array, Array, Array]


class Fluid(Protocol):
    """Constant properties."""

    @property
    def density(self) -> float:
        """[kg/m3]."""

    @property
    def viscosity(self) -> float:
        """[Pa s]."""


class Gas(Protocol):
    """A solver of eps rho Du/Dt = -eps grad p + ... - drag (u - target) + source on a grid.

    In model B all of grad p acts on the gas.
    """

    @property
    def model(self) -> str:
        """``A`` or ``B``."""

    @property
    def grid(self) -> Grid:
        """Cells."""

    @property
    def fluid(self) -> Fluid:
        """Properties."""

    @property
    def velocity(self) -> Faces:
        """Of the faces across x, y and z, between the particles [m/s]."""

    @property
    def pressure(self) -> Array:
        """Of the cells [Pa]."""

    @property
    def gravity(self) -> Array:
        """What acts on the gas; 0 where its pressure leaves its weight out [m/s2]."""

    def step(
        self, dt: float, *, void_fraction: Array, void_rate: Array, drag: Faces, target: Faces,
        source: Faces,
    ) -> Any:  # fmt: skip
        """Go on by ``dt``; drag per volume [kg/m3/s], targets [m/s], sources [N/m3] of faces.

        The result has ``velocity``, three arrays: the means that the drag has seen [m/s].
        """


def imposed_gradient(gas: Gas) -> Array:
    """Pressure gradient that a gas has besides its field, shape (3,) [Pa/m]."""
    state = getattr(gas, "state", None)
    return np.zeros(3) if state is None else np.asarray(state.gradient, dtype=np.float64)


def begin_with(gas: Gas, void_fraction: Array) -> None:
    """Give a gas that has not moved yet the void fraction that the particles leave it."""
    state = getattr(gas, "state", None)
    if state is not None and state.time == 0.0:
        mass = state.mass / state.void_fraction * void_fraction
        gas.state = replace(state, void_fraction=void_fraction.copy(), mass=mass)  # type: ignore[attr-defined]


def cell_slopes(pressure: Array, grid: Grid) -> Array:
    """Means of the gradients on the two faces of each cell, (nz, ny, nx, 3) [Pa/m].

    On a rim, where the gas has none of its own, the one inside holds.
    """
    out = np.empty((*pressure.shape, 3))
    _exchange.cell_slopes(
        np.ascontiguousarray(pressure), np.array(grid.spacing), np.array(grid.periodic), out
    )
    return out
