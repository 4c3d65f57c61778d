"""Resolved flows for filtered drag: two fluids in a box that repeats."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from greybed.cfd.grid import Grid
from greybed.cfd.kinetic import Granular
from greybed.cfd.twofluid import Correction, TwoFluid
from greybed.closures.drag import drag_law
from greybed.closures.drag.filtered import Material
from greybed.datasets.drag_design import FlowDesign
from greybed.datasets.drag_filters import Resolved

Array = NDArray[np.float64]

GRAVITY = 9.81  # [m s-2], along -y
# The start is uniform but for this; clusters grow from it.
PERTURBATION = 0.1
# Longest step over the time in which a particle falls to its terminal velocity.
_OF_RELAXATION = 0.01


def clock(design: FlowDesign) -> float:
    """Terminal velocity over gravity, the unit of time of a design [s]."""
    material = Material(
        design.diameter, design.particle_density, design.gas_density, design.gas_viscosity
    )
    return material.terminal_velocity / GRAVITY


def grid_of(design: FlowDesign) -> Grid:
    """Cubic cells; one along z, which does not repeat, in two dimensions."""
    edge = design.cell * design.diameter
    x, y, z = (n * edge for n in design.cells)
    return Grid(cells=design.cells, upper=(x, y, z), periodic=(True, True, design.dimension == 3))


class TwoFluidFlow:
    """Two fluids in a box that repeats; the mean pressure gradient carries the weight.

    Parameters
    ----------
    design : FlowDesign
    correction : callable, optional
        Of the drag, where the grid does not resolve clusters.
    """

    def __init__(self, design: FlowDesign, correction: Correction | None = None) -> None:
        self.design, self.grid = design, grid_of(design)
        random = np.random.default_rng(design.seed).uniform(-1.0, 1.0, self.grid.shape)
        start = np.minimum(
            design.solid_fraction * (1.0 + PERTURBATION * random), 0.99 * design.packing
        )
        self.solver = TwoFluid(
            self.grid, start, particle_density=design.particle_density, diameter=design.diameter,
            gas_density=design.gas_density, gas_viscosity=design.gas_viscosity,
            drag=drag_law(design.law), gravity=(0.0, -GRAVITY, 0.0),
            granular=Granular(restitution=design.restitution, packing=design.packing),
            longest_step=_OF_RELAXATION * clock(design), correction=correction,
        )  # fmt: skip

    @property
    def time(self) -> float:
        """Since the start [s]."""
        return self.solver.time

    @property
    def steps(self) -> int:
        """Since the start."""
        return self.solver.steps

    def step(self, until: float) -> None:
        """One step, not beyond a time [s]."""
        self.solver.step(until - self.time)

    def look(self) -> Resolved:
        """The fields of now, velocities in the middle of the cells."""
        solver, design = self.solver, self.design
        phi = solver.solid_fraction
        gas, solids = centred(solver.gas_velocity), centred(solver.solids_velocity)
        return Resolved(
            solid_fraction=phi, gas=gas, solids=solids,
            gradient=gradient_of(solver.pressure, solver.pressure_gradient, self.grid),
            drag=drag_of(design, phi, gas - solids), edge=self.grid.spacing[0],
            dimension=design.dimension,
        )  # fmt: skip

    def save(self) -> dict[str, Array]:
        """The state."""
        return self.solver.save()

    def restore(self, saved: Mapping[str, Any]) -> None:
        """Take a state."""
        self.solver.restore(saved)


def centred(faces: tuple[Array, Array, Array]) -> Array:
    """Means of the two faces of each cell, (3, z, y, x)."""
    found = []
    for axis, u in enumerate(faces):
        along = np.moveaxis(u, 2 - axis, 0)
        found.append(np.moveaxis(0.5 * (along[1:] + along[:-1]), 0, 2 - axis))
    return np.stack(found)


def gradient_of(pressure: Array, mean: tuple[float, float, float], grid: Grid) -> Array:
    """Central differences of a pressure that repeats, and its mean gradient [Pa m-1]."""
    found = []
    for axis in range(3):
        k = 2 - axis
        slope = np.zeros_like(pressure)
        if grid.periodic[axis]:
            slope = (np.roll(pressure, -1, k) - np.roll(pressure, 1, k)) / (2 * grid.spacing[axis])
        found.append(slope + mean[axis])
    return np.stack(found)


def drag_of(design: FlowDesign, phi: Array, slip: Array) -> Array:
    """Drag on the particles in a unit of volume by the law of the design [N m-3]."""
    eps, mu = 1.0 - phi, design.gas_viscosity
    speed = np.sqrt((slip * slip).sum(axis=0))
    re = eps * design.gas_density * design.diameter * speed / mu
    factor = np.asarray(drag_law(design.law)(phi, re))
    return np.asarray(18.0 * mu * eps * phi * factor / design.diameter**2 * slip)
